import { html, type TemplateResult } from "lit";
import sprite from "./icons.svg?url";

/** Names of the symbols in `icons.svg` that the page's own code uses. */
export type IconName = string;

/** The address of one icon inside the sprite, which is served from this origin like every other asset. */
export function iconUrl(name: IconName): string {
  return `${sprite}#${name}`;
}

/** An icon of the sprite, decorative: the control around it carries the accessible name. */
export function icon(name: IconName): TemplateResult {
  return html`<svg class="icon" viewBox="0 0 24 24" aria-hidden="true" focusable="false">
    <use href=${iconUrl(name)}></use>
  </svg>`;
}
