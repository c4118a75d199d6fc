import { msg } from "@lit/localize";
import { html, type TemplateResult } from "lit";
import { chooseLanguage, LANGUAGES } from "../../app/device/language.ts";
import { type Language, language } from "../../core/language.ts";

/** A field to choose the language of the page on this device. */
export function languageChoice(): TemplateResult {
  return html`<select
    class="field language"
    aria-label=${msg("Language of the page")}
    @change=${(e: Event) => chooseLanguage((e.target as HTMLSelectElement).value as Language)}
  >
    ${LANGUAGES.map(({ code, name }) => html`<option value=${code} lang=${code} ?selected=${code === language()}>${name}</option>`)}
  </select>`;
}
