/** The lesson of an open terrain as this page knows it: how it stands, what a conductor says, and whose view mine follows. */

import { msg } from "@lit/localize";
import { computed, effect, type ReadonlySignal, signal } from "@preact/signals-core";
import type { SyncDoc } from "../../doc/sync.ts";
import type { ClientMessage, Conduct, Lesson, Member, Op, People } from "../../generated/contract.ts";
import { memberName } from "../device/names.ts";
import type { Store } from "../device/storage.ts";
import { Drafts } from "./drafts.ts";
import { Groups } from "./groups.ts";

/** How a lesson stands where nobody leads. */
export const NOBODY_LEADS: Lesson = {
  type: "lesson",
  hands_off: false,
  protect: false,
  hide: false,
  animals: "",
  look: null,
  held: false,
  draws: true,
  conducts: false,
  removed: [],
  waiting: [],
  groups: [],
};

const UNCHANGED: Conduct = {
  type: "conduct",
  hands_off: null,
  protect: null,
  hide: null,
  animals: null,
  look: null,
  held: null,
};

export const HANDS_OFF = msg("Hands off: drawing is paused for now.");

/** The terrain of which it is the lesson. */
export interface LessonHost {
  readonly id: string;
  readonly client: string;
  readonly store: Store;
  readonly doc: SyncDoc;
  readonly members: ReadonlySignal<readonly Member[]>;
  readonly connection: { send(message: ClientMessage): unknown };
  submit(op: Op, gesture?: string): boolean;
}

export class LessonView {
  readonly state = signal<Lesson>(NOBODY_LEADS);
  readonly drafts: Drafts;
  /** People whose pens are given together, where this page leads. */
  readonly groups: Groups;
  /** I look away from what is shown, where that is allowed. */
  readonly away = signal(false);
  /** The client whose view mine follows, because a conductor shows. */
  readonly leader: ReadonlySignal<string | null>;
  /** Name of who shows, also while I look away; null: nobody, or I. */
  readonly shower: ReadonlySignal<string | null>;
  readonly #o: LessonHost;
  readonly #lift: () => void;
  readonly #key: string;
  readonly #stop: () => void;

  /** `lift` lifts the pen, so that what it draws ends as it is. */
  constructor(host: LessonHost, lift: () => void) {
    this.#o = host;
    this.#lift = lift;
    this.#key = `esker.ticket.${host.id}`;
    this.drafts = new Drafts(host.store, host.id);
    this.groups = new Groups(this.state, (order) => host.connection.send(order));
    this.leader = computed(() => {
      const { look, held } = this.state.value;
      return look === null || look === host.client || (this.away.value && !held) ? null : look;
    });
    this.shower = computed(() => {
      const { look } = this.state.value;
      if (look === null || look === host.client) return null;
      const member = host.members.value.find((m) => m.client === look);
      return member ? memberName(member) : msg("Somebody");
    });
    this.#stop = effect(() => {
      const doc = host.doc.doc.value;
      if (doc && this.state.value.draws && host.doc.pending.value === 0) this.drafts.settle(doc);
    });
  }

  /** By which this device is the same person again in this terrain. */
  get ticket(): string | null {
    return this.#o.store.getItem(this.#key);
  }

  keepTicket(ticket: string): void {
    if (ticket !== "") this.#o.store.setItem(this.#key, ticket);
  }

  receive(lesson: Lesson): void {
    const before = this.state.peek();
    if (before.draws && !lesson.draws) {
      this.#lift();
      this.drafts.keep(this.#o.doc.unconfirmed());
    }
    if (before.look !== lesson.look) this.away.value = false;
    this.state.value = lesson;
  }

  conduct(change: Partial<Omit<Conduct, "type">>): void {
    this.#o.connection.send({ ...UNCHANGED, ...change });
  }

  about(action: People["action"], people: readonly string[]): void {
    this.#o.connection.send({ type: "people", action, people: [...people] });
  }

  /** Gives pens to everybody who is here, or takes them: the groups with them. */
  pensForAll(pen: boolean, people: readonly string[]): void {
    this.about(pen ? "pen" : "no_pen", people);
    this.groups.allHave(pen);
  }

  lookAway(away: boolean): void {
    if (!this.state.peek().held) this.away.value = away;
  }

  /** Brings the lines back that were in hand when drawing was paused. */
  putBack(): void {
    const doc = this.#o.doc.doc.peek();
    if (!doc) return;
    const now = Date.now();
    for (const [i, ops] of this.drafts.take(doc, this.#o.client, now).entries())
      for (const op of ops) if (!this.#o.submit(op, `back-${now}-${i}`)) break;
  }

  dispose(): void {
    this.#stop();
  }
}
