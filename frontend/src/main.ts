/** The page's start: theme, language, then the page that the address means. The landing page never loads the 3D view. */

import "./ui/styles/theme.css";
import { startLanguage } from "./app/device/language.ts";
import { startTheme } from "./app/device/theme.ts";
import { route } from "./app/server/router.ts";

async function show(): Promise<void> {
  const target = route(new URL(window.location.href));
  const app = document.getElementById("app");
  if (!app) throw new Error("index.html has no #app");
  if (target.page === "terrain") {
    const { openTerrain } = await import("./ui/pages/terrain-page.ts");
    app.replaceChildren(openTerrain(target.id, target.secret));
  } else if (target.page === "landing") {
    await import("./ui/pages/landing.ts");
    app.replaceChildren(document.createElement("esk-landing"));
  } else if (target.page === "server") {
    const { serverPage } = await import("./ui/pages/server-page.ts");
    app.replaceChildren(serverPage(target.key));
  } else if (target.page === "privacy") {
    const { privacyPage } = await import("./ui/pages/privacy.ts");
    app.replaceChildren(privacyPage());
  } else if (target.page === "lesson") {
    const { lessonPage } = await import("./ui/pages/lesson-page.ts");
    app.replaceChildren(lessonPage(target.id));
  } else if (target.page === "room") {
    const { roomPage } = await import("./ui/room/room-page.ts");
    app.replaceChildren(roomPage(target.code));
  } else if (target.page === "help") {
    const { helpPage } = await import("./ui/room/help-pages.ts");
    app.replaceChildren(helpPage(target.topic, window.location.host));
  } else if (target.page === "join") {
    const { joinPage } = await import("./ui/pages/join-page.ts");
    app.replaceChildren(joinPage(target.code));
  } else if (target.page === "wall") {
    const { wallPage } = await import("./ui/pages/wall-page.ts");
    app.replaceChildren(wallPage(target.id, target.lesson, target.secret));
  } else {
    const { missingPage } = await import("./ui/pages/missing.ts");
    app.replaceChildren(missingPage(target.path));
  }
}

startTheme();
// A link pasted over an open terrain changes only the fragment, which loads nothing by itself.
window.addEventListener("hashchange", () => window.location.reload());
window.addEventListener("popstate", () => void show());
void startLanguage().then(show);
