/** What a page tells the server of itself as it goes along: where it looks, where it points, and what it holds. */

import { askedOf } from "../core/camera/asked.ts";
import type { ClientMessage } from "../generated/contract.ts";
import { DEFAULT_TAU_PX, MAX_PRESENCE_PER_SECOND, PRESENCE_HZ } from "../generated/contract.ts";
import { Throttle } from "./throttle.ts";
import type { Stage } from "./view/stage.ts";
import { WATER } from "./view/water/others.ts";

const VIEWS_PER_SECOND = 10;
const MAX_SIDE_PX = 16_384;

export interface OutgoingOptions {
  readonly stage: () => Stage | null;
  /** Sends to whichever room is shown, that of now or of the history. */
  readonly sendView: (message: ClientMessage) => void;
  /** Sends to the people who are here; null while nobody can see this page. */
  readonly sendPresence: () => ((message: ClientMessage) => void) | null;
}

export class Outgoing {
  readonly #views: Throttle;
  readonly #presence: Throttle;

  constructor(options: OutgoingOptions) {
    this.#views = new Throttle(VIEWS_PER_SECOND, () => sendView(options));
    this.#presence = new Throttle(Math.min(PRESENCE_HZ, MAX_PRESENCE_PER_SECOND), () => sendPresence(options));
  }

  /** Asks for a presence message; many requests become few messages. */
  presenceChanged(): void {
    this.#presence.request();
  }

  /** Asks for a message that says where this page looks. */
  viewChanged(): void {
    this.#views.request();
  }

  stop(): void {
    this.#views.stop();
    this.#presence.stop();
  }
}

function sendView({ stage, sendView: send }: OutgoingOptions): void {
  const camera = stage()?.camera.state.value;
  if (!camera) return;
  send({
    type: "view",
    eye: [...camera.eye],
    target: [...camera.target],
    ...askedOf(camera, DEFAULT_TAU_PX),
    width: Math.max(1, Math.min(MAX_SIDE_PX, camera.width)),
    height: Math.max(1, Math.min(MAX_SIDE_PX, camera.height)),
  });
}

function sendPresence({ stage: shown, sendPresence: to }: OutgoingOptions): void {
  const stage = shown();
  const send = to();
  if (!stage || send === null) return;
  const { eye, target } = stage.camera.state.value;
  // Who follows water is seen at the place that they ask about.
  const drop = stage.water.place.value;
  const cursor = drop ?? stage.cursor.value;
  send({
    type: "presence",
    cursor: cursor ? [...cursor] : null,
    tool: drop === null ? stage.input.tool.value : WATER,
    stroke: stage.input.drawing.value ?? stage.input.held.value,
    eye: [...eye],
    target: [...target],
  });
}
