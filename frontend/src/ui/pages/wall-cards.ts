/** The cards of the wall: one for each copy, its ground drawn as relief from its coarsest tiles. */

import { msg, str } from "@lit/localize";
import { html, nothing, type TemplateResult } from "lit";
import { repeat } from "lit/directives/repeat.js";
import { copyName } from "../../app/server/classes/copies.ts";
import type { WallConnection } from "../../app/server/classes/wall.ts";
import { ago } from "../../app/words/words.ts";
import type { WallCopy } from "../../generated/contract.ts";
import { drawCard } from "../../gpu/map/card.ts";
import { icon } from "../controls/icons.ts";

const CARD_PX = 256;

/** Draws one card a frame: the page goes on answering, however many copies have changed. */
export class CardPainter {
  readonly #root: ParentNode;
  readonly #wall: WallConnection;
  readonly #stale = new Set<number>();
  #frame = 0;

  constructor(root: ParentNode, wall: WallConnection) {
    this.#root = root;
    this.#wall = wall;
  }

  /** These copies have changed. */
  changed(numbers: Iterable<number>): void {
    for (const number of numbers) this.#stale.add(number);
    if (this.#stale.size > 0) this.#frame ||= requestAnimationFrame(() => this.#draw());
  }

  /** The page has been rendered: a card that has just come into it has an empty canvas. */
  rendered(): void {
    const empty = this.#root.querySelectorAll<HTMLCanvasElement>("canvas[data-copy]:not(.drawn)");
    this.changed([...empty].map((canvas) => Number(canvas.dataset.copy)));
  }

  stop(): void {
    cancelAnimationFrame(this.#frame);
  }

  #draw(): void {
    this.#frame = 0;
    const number = this.#stale.values().next().value;
    if (number === undefined) return;
    this.#stale.delete(number);
    const ground = this.#wall.ground(number);
    const copy = this.#wall.copies.peek().get(number);
    const canvas = this.#root.querySelector<HTMLCanvasElement>(`canvas[data-copy="${number}"]`);
    if (ground && copy && canvas && drawCard(ground, copy.settings, canvas, CARD_PX)) canvas.classList.add("drawn");
    this.changed([]);
  }
}

/** Few copies are shown large. */
export function cardWidth(count: number): number {
  return count <= 6 ? 360 : count <= 15 ? 270 : 210;
}

export interface CardState {
  readonly isChosen: boolean;
  /** Whether the whole class is shown this copy. */
  readonly isShown: boolean;
  readonly onPress: () => void;
}

/** Cards in their order. Each keeps its canvas when the order changes: what was drawn on it goes along. */
export function wallCards(
  copies: readonly WallCopy[],
  width: number,
  stateOf: (copy: WallCopy) => CardState,
): TemplateResult {
  return html`<ul style=${`--card: ${width}px`}>${repeat(
    copies,
    (copy) => copy.number,
    (copy) => wallCard(copy, stateOf(copy)),
  )}</ul>`;
}

function wallCard(copy: WallCopy, { isChosen, isShown, onPress }: CardState): TemplateResult {
  const name = copyName(copy);
  const last = copy.last === null ? msg("nothing drawn yet") : ago(Date.now() - 1000 * copy.last);
  const points = copy.score?.points ?? null;
  const scored = points === null ? "" : `, ${msg(str`${points} of 100 points`)}`;
  const lines = copy.strokes === 1 ? msg("1 line") : msg(str`${copy.strokes} lines`);
  return html`<li>
      <button
        class="copy"
        aria-pressed=${isChosen ? "true" : "false"}
        aria-label=${`${name}, ${copy.online > 0 ? msg("here") : msg("away")}, ${last}, ${lines}${scored}`}
        @click=${onPress}
      >
        <span class="picture"><canvas data-copy=${copy.number} aria-hidden="true"></canvas></span>
        <span class="badges">
          ${isShown ? html`<span class="badge shown">${icon("eye")} ${msg("Shown to all")}</span>` : nothing}
          ${copy.frozen ? html`<span class="badge">${icon("lock")} ${msg("Frozen")}</span>` : nothing}
        </span>
        ${points === null ? nothing : html`<span class="points" title=${copy.score?.text ?? ""} style="--done:${points}%">${points}</span>`}
        <span class="words">
          <span class="name"><i class=${copy.online > 0 ? "dot here" : "dot"}></i><span title=${name}>${name}</span></span>
          <span class="facts">${last} · ${lines}</span>
        </span>
      </button>
    </li>`;
}
