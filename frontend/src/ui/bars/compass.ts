/** A needle that points north in the picture; pressed, it turns the view until north is up. */

import { msg, str } from "@lit/localize";
import { html, svg, type TemplateResult } from "lit";
import { compass as pointOf } from "../../app/words/words.ts";
import type { CameraState } from "../../core/types.ts";

/** Direction in which the view looks, degrees clockwise from north. */
export function headingDeg({ eye, target, up, mode }: CameraState): number {
  const [x, y] = mode === "map" ? [up[0], up[1]] : [target[0] - eye[0], target[1] - eye[1]];
  return ((Math.atan2(x, y) * 180) / Math.PI + 360) % 360;
}

export function compassButton(camera: CameraState, title: string, press: () => void): TemplateResult {
  const heading = headingDeg(camera);
  const north = heading < 0.5 || heading > 359.5;
  return html`<button
    class="icon-btn small compass"
    aria-label=${north ? msg("North is up") : msg(str`Looking ${pointOf(heading)}. Turn the view north`)}
    title=${title}
    @click=${press}
  >
    <svg class="icon" viewBox="-12 -12 24 24" aria-hidden="true">
      ${svg`<g transform="rotate(${(-heading).toFixed(1)})">
        <path d="M0-9.500 3.600 0H-3.600z" fill="var(--esk-accent)"></path>
        <path d="M0 9.500 3.600 0H-3.600z" fill="currentColor" opacity="0.45"></path>
      </g>`}
    </svg>
  </button>`;
}
