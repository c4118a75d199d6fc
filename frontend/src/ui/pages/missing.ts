import { html, render } from "lit";

/** The page for an address that means nothing here. */
export function missingPage(path: string): HTMLElement {
  const main = document.createElement("main");
  main.className = "missing";
  document.title = "Not found · Esker";
  render(
    html`
      <img src="/favicon.svg" alt="" width="52" height="52" />
      <h1>There is nothing here.</h1>
      <p>Esker has no page at <code>${path}</code>. A link to a terrain looks like /t/name#secret.</p>
      <p><a href="/">Go to the start page</a></p>
    `,
    main,
  );
  return main;
}
