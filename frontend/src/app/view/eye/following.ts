/** The view of somebody else, which this page follows: a person who was chosen, or the one a whole lesson looks at. */

import { effect, signal } from "@preact/signals-core";
import type { Camera } from "../../../core/camera/camera.ts";
import type { MemberPresence } from "../../../generated/contract.ts";
import type { OpenTerrain } from "../../open-terrain.ts";

/** How long a view takes to where the other is, and along with each of their moves. */
const GO_MS = 700;
const ALONG_MS = 180;

export interface FollowingOptions {
  readonly session: OpenTerrain;
  readonly camera: Camera;
  /** Whether nothing may move by itself. */
  readonly calm: () => boolean;
  readonly redraw: () => void;
}

export class Following {
  /** Who is followed; null: nobody. */
  readonly client = signal<string | null>(null);
  readonly #with: FollowingOptions;

  constructor(options: FollowingOptions) {
    this.#with = options;
  }

  /** Follows a person's view until I move the camera myself; the same person again stops it. */
  toggle(client: string | null): void {
    const { session } = this.#with;
    if (session.lesson.leader.peek() !== null) return;
    this.client.value = this.client.value === client ? null : client;
    if (this.client.value) this.#go(session.presences.value.get(this.client.value), GO_MS);
  }

  /** New presences have come: the view goes along with the person that is followed. */
  moved(changed: readonly MemberPresence[]): void {
    const leader = changed.find((p) => p.client === this.client.value);
    if (leader) this.#go(leader, ALONG_MS);
  }

  /** Follows whom the lesson looks at, and lets go where a hand moves the camera. Returns what stops it. */
  watch(viewport: HTMLElement): (() => void)[] {
    const { session } = this.#with;
    const letGo = (): void => {
      session.lesson.lookAway(true);
      if (session.lesson.leader.peek() === null) this.client.value = null;
    };
    // Where nobody may look away, a view that a hand has moved springs back.
    const springBack = (): void => {
      const leader = session.lesson.leader.peek();
      if (leader !== null && session.lesson.state.peek().held) this.#go(session.presences.peek().get(leader), ALONG_MS);
    };
    const stops: (() => void)[] = [];
    for (const type of ["pointerdown", "wheel"] as const) {
      viewport.addEventListener(type, letGo, { passive: true });
      stops.push(() => viewport.removeEventListener(type, letGo));
    }
    for (const type of ["pointerup", "wheel", "keyup"] as const) {
      window.addEventListener(type, springBack, { passive: true });
      stops.push(() => window.removeEventListener(type, springBack));
    }
    stops.push(
      effect(() => {
        const leader = session.lesson.leader.value;
        if (leader !== null) {
          this.client.value = leader;
          this.#go(session.presences.peek().get(leader), GO_MS);
        } else if (this.client.peek() !== null) this.client.value = null;
      }),
    );
    return stops;
  }

  #go(presence: MemberPresence | undefined, durationMs: number): void {
    if (!presence?.eye || !presence.target) return;
    this.#with.camera.goTo(presence.eye, presence.target, this.#with.calm() ? 0 : durationMs);
    this.#with.redraw();
  }
}
