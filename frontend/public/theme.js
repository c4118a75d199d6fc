// Sets the colour theme before the first paint; the page itself keeps it in step (src/app/device/theme.ts).
(() => {
  let choice = null;
  try {
    choice = localStorage.getItem("esker.theme");
  } catch {
    // Storage may be blocked: then the theme follows the system.
  }
  const dark = choice === "dark" || (choice !== "light" && matchMedia("(prefers-color-scheme: dark)").matches);
  document.documentElement.classList.add(dark ? "wa-dark" : "wa-light");
})();
