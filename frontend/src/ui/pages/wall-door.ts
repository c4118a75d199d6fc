/** The way into a class as the wall shows it: the address, the code in large letters, and its picture. */

import { msg, str } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/qr-code/qr-code.js";
import { html, nothing, type TemplateResult } from "lit";
import { codeWords } from "../../app/server/classes/copies.ts";
import { joinLink, roomPath } from "../../app/server/links.ts";
import { icon } from "../controls/icons.ts";

/** Before anybody is here the way in fills the page. */
export function emptyWall(code: string | null): TemplateResult {
  if (code === null) return html`<div class="empty"><p>${msg("The door is closed, and nobody is in.")}</p></div>`;
  return html`<div class="empty">
      <p class="where">${msg(html`Open <strong>${window.location.origin}</strong> and type`)}</p>
      <p class="letters">${codeWords(code)}</p>
      <div class="qr"><wa-qr-code .value=${joinLink(window.location.origin, code)} label=${msg("QR code to join")} size="220"></wa-qr-code></div>
      <p>${msg("Nobody is here yet.")}</p>
      <p><a class="btn outline" href=${roomPath(code)} target="_blank">${icon("monitor")} ${msg("On the projector")}</a></p>
      <p class="quiet">${msg("Each device that types the code gets its own copy, and it appears here.")}</p>
    </div>`;
}

interface DoorState {
  readonly code: string;
  readonly busy: boolean;
  /** Whether there is room for the picture of the code. */
  readonly hasPicture: boolean;
  readonly onClose: () => void;
}

/** The open door beside the title, once somebody is in. */
export function openDoor({ code, busy, hasPicture, onClose }: DoorState): TemplateResult {
  return html`<div class="door">
              <div>
                <small>${msg(html`Open <strong>${window.location.origin}</strong> and type`)}</small>
                <span class="letters" aria-label=${msg(str`Code ${code}`)}>${codeWords(code)}</span>
              </div>
              ${hasPicture ? html`<div class="qr"><wa-qr-code .value=${joinLink(window.location.origin, code)} label=${msg("QR code to join")} size="104"></wa-qr-code></div>` : nothing}
              <a class="icon-btn" href=${roomPath(code)} target="_blank" title=${msg("On the projector, without the wall")} aria-label=${msg("On the projector")}>
                ${icon("monitor")}
              </a>
              <button class="icon-btn" title=${msg("Close the door: who is in stays in")} aria-label=${msg("Close the door")} ?disabled=${busy} @click=${onClose}>
                ${icon("xmark")}
              </button>
            </div>`;
}
