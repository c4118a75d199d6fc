import { msg } from "@lit/localize";
import { html, render } from "lit";

/** The page for an address that means nothing here. */
export function missingPage(path: string): HTMLElement {
  const main = document.createElement("main");
  main.className = "missing";
  document.title = msg("Not found · Esker");
  render(
    html`
      <img src="/favicon.svg" alt="" width="52" height="52" />
      <h1>${msg("There is nothing here.")}</h1>
      <p>${msg(html`Esker has no page at <code>${path}</code>. A link to a terrain looks like /t/name#secret.`)}</p>
      <p><a href="/">${msg("Go to the start page")}</a></p>
    `,
    main,
  );
  return main;
}
