/**
 * One open terrain: the connection, the document, the people and, once the server has said how large the terrain is,
 * the stage on which it is seen (stage.ts). The page's components read its signals and call its methods.
 */

import { msg } from "@lit/localize";
import { computed, effect, type ReadonlySignal, signal } from "@preact/signals-core";
import type { DecodedFrame, RiverSet } from "../core/types.ts";
import { type Doc, Refusal } from "../doc/document.ts";
import { SyncDoc } from "../doc/sync.ts";
import type {
  ClientMessage,
  ErrorMessage,
  Hello,
  InClass,
  Member,
  MemberPresence,
  Op,
  Progress,
  Role,
  Score,
  ServerMessage,
  StrokeFields,
  TerrainFields,
  Welcome,
} from "../generated/contract.ts";
import { PROTOCOL_VERSION, TICK_MS } from "../generated/contract.ts";
import { Connection } from "../net/connection.ts";
import { KeptTerrain } from "./device/kept-terrain.ts";
import { friendlyName } from "./device/names.ts";
import { deviceStore, type Identity, identity, rememberIdentity, type Store } from "./device/storage.ts";
import { GoneStrokes, strokeOf } from "./history/gone.ts";
import { History } from "./history/history.ts";
import { HistoryView } from "./history/history-view.ts";
import { TimeLapse } from "./history/timelapse.ts";
import { HANDS_OFF, LessonView } from "./lesson/lesson-view.ts";
import type { OpenTerrain, ServerInfo } from "./open-terrain.ts";
import { Outgoing } from "./outgoing.ts";
import { api } from "./server/api.ts";
import { Deletion } from "./server/deletion.ts";
import { type Status, status } from "./status.ts";
import { ToastList } from "./toasts.ts";
import type { People } from "./view/scene.ts";
import { Stage } from "./view/stage.ts";
import { noticeWords } from "./words/notices.ts";
import { refusalWords } from "./words/refusals.ts";

export class TerrainSession implements OpenTerrain {
  readonly id: string;
  readonly client: string;
  /** The server's token, by which it knows later that the client id is this page's; null before the first welcome. */
  #token: string | null = null;
  readonly store: Store = deviceStore();
  readonly toasts = new ToastList();
  readonly doc: SyncDoc;
  readonly connection: Connection;
  readonly historyView: HistoryView;
  readonly timeLapse = new TimeLapse(this);
  readonly history: History;
  readonly deletion: Deletion;
  readonly lesson: LessonView;
  /** Clock of the present, also while the past is shown. */
  readonly newest = signal(0);
  readonly role = signal<Role | null>(null);
  readonly members = signal<readonly Member[]>([]);
  readonly presences = signal<ReadonlyMap<string, MemberPresence>>(new Map());
  readonly progress = signal<Progress | null>(null);
  /** The rivers that the server found last; null before. */
  readonly rivers = signal<RiverSet | null>(null);
  /** The server makes the ground of the elevation layers, and it takes long. */
  readonly baseBuilding = signal(false);
  /** The server's last sentence about its solver, until somebody has read it. */
  readonly notice = signal<string | null>(null);
  readonly server = signal<ServerInfo | null>(null);
  /** The class whose copy this terrain is, as the server last said; null where it is none. */
  readonly inClass = signal<InClass | null>(null);
  /** How far the terrain is with its task, as the server last said; null before. */
  readonly score = signal<Score | null>(null);
  readonly me = signal<Identity>({ name: "", colour: "#888888" });
  readonly stage = signal<Stage | null>(null);
  /** Whether the link allows changes. */
  readonly mayEdit = computed(
    () => this.role.value === "owner" || (this.role.value === "edit" && this.inClass.value?.frozen !== true),
  );
  /** Whether the terrain can be changed now: an earlier clock cannot. */
  readonly canEdit: ReadonlySignal<boolean>;
  readonly status: ReadonlySignal<Status>;
  readonly people: ReadonlySignal<People>;
  readonly #viewport: HTMLElement;
  readonly #kept: KeptTerrain;
  readonly #outgoing: Outgoing;
  readonly #stops: (() => void)[] = [];
  readonly #read = new Set<string>();
  readonly #gone = new GoneStrokes();
  #gesture = 0;
  #again: ReturnType<typeof setTimeout> | undefined;

  constructor(id: string, secret: string, viewport: HTMLElement) {
    this.id = id;
    this.#kept = new KeptTerrain(this.store, id, secret);
    this.client = crypto.randomUUID().replaceAll("-", "");
    this.#viewport = viewport;
    this.me.value = identity(this.store, Math.random, this.client);
    this.doc = new SyncDoc(this.client);
    this.doc.onRefused(({ code, message, op }) => this.refused({ code, message: refusalWords(code, message) }, op));
    this.doc.onDiverged(() => this.connection.reconnect());
    const scheme = window.location.protocol === "https:" ? "wss" : "ws";
    const url = `${scheme}://${window.location.host}/ws?terrain=${id}`; // a balancer brings a terrain to one server by it
    this.historyView = this.#makeHistoryView(url);
    this.history = new History((before) => api.history(this.id, this.secret, before));
    this.deletion = new Deletion(this.id, () => this.secret);
    this.connection = new Connection({
      url,
      hello: () => this.#hello(),
      onMessage: (message) => this.#receive(message),
      onFrame: (frame) => this.#frame(frame),
    });
    this.lesson = new LessonView(this, () => this.stage.peek()?.input.lift());
    this.canEdit = computed(
      () => this.mayEdit.value && !this.historyView.active.value && this.lesson.state.value.draws,
    );
    this.status = computed(() =>
      status({
        connection: this.connection.state.value,
        reason: this.connection.reason.value,
        pending: this.doc.pending.value,
        canEdit: this.mayEdit.value,
      }),
    );
    this.people = computed(() => ({
      members: this.members.value,
      presences: this.historyView.active.value ? new Map() : this.presences.value,
      me: this.client,
      myColour: this.members.value.find((m) => m.client === this.client)?.colour ?? this.me.value.colour,
    }));
    const inPresent = (): boolean => !this.historyView.active.peek();
    const send = (message: ClientMessage): void => void this.connection.send(message);
    this.#outgoing = new Outgoing({
      stage: () => this.stage.value,
      sendView: (view) => void (inPresent() ? this.connection : this.historyView).send(view),
      sendPresence: () => (inPresent() && this.connection.state.value === "online" ? send : null),
    });
    this.#watch();
  }

  get secret(): string {
    return this.#kept.secret;
  }

  /** Applies an op at once and sends it; a refusal becomes a toast. True when it was applied. */
  submit(op: Op, gesture?: string): boolean {
    if (this.historyView.active.peek()) {
      this.toasts.show(msg("This is how the terrain was. Go back to now to change it."), "warn");
      return false;
    }
    if (!this.canEdit.value) {
      if (this.mayEdit.value) this.toasts.show(HANDS_OFF, "warn");
      else
        this.toasts.show(msg("This link lets you look, not draw. Ask for an edit link to change the terrain."), "warn");
      return false;
    }
    const refusal = this.doc.submit(op, gesture);
    if (refusal instanceof Refusal) this.refused(refusal, op);
    return refusal === null;
  }

  /** Says why, in the page's language already; where the stroke was deleted, by whom, with the way back. */
  refused(refusal: { readonly code: string; readonly message: string }, op: Op | undefined): void {
    if (refusal.code === "hands_off" && !this.lesson.state.peek().draws) return; // the bar says so, and keeps the line
    const stroke = strokeOf(op);
    if (refusal.code !== "deleted_stroke" || stroke === null) {
      this.toasts.show(refusal.message, "warn");
      return;
    }
    const run = (): void => void this.submit({ type: "stroke.restore", stroke });
    this.toasts.show(this.#gone.words(stroke), "warn", { label: msg("Restore"), run });
  }

  /** Changes fields of a stroke; one gesture is one step of undo. */
  setStroke(stroke: string, fields: StrokeFields, gesture?: string): boolean {
    return this.submit({ type: "stroke.set", stroke, fields }, gesture);
  }

  /** Changes settings of the terrain. */
  setTerrain(fields: TerrainFields, gesture?: string): boolean {
    return this.submit({ type: "terrain.set", fields }, gesture);
  }

  /** A name for a gesture that no other has. */
  newGesture(): string {
    this.#gesture += 1;
    return `panel-${this.#gesture}`;
  }

  /** Goes on with a new secret for the same link, in the address bar and in this device's memory too. */
  adoptSecret(secret: string): void {
    this.#kept.adopt(secret);
    const doc = this.doc.doc.peek();
    const role = this.role.peek();
    if (doc && role) this.#kept.remember(doc.settings.title, role);
  }

  rename(who: Identity): void {
    const name = who.name.trim().slice(0, 80) || friendlyName(this.client);
    this.me.value = { name, colour: who.colour };
    rememberIdentity(this.store, this.me.value);
    this.connection.send({ type: "rename", name, colour: who.colour });
  }

  /** Asks for a presence message; many requests become few messages. */
  presenceChanged(): void {
    this.#outgoing.presenceChanged();
  }

  viewChanged(): void {
    this.#outgoing.viewChanged();
  }

  leavePresent(): void {
    const input = this.stage.peek()?.input;
    input?.actions.get("cancel")?.run();
    input?.placing.peek()?.cancel();
    if (input) input.selection.value = null;
  }

  dispose(): void {
    for (const stop of this.#stops) stop();
    clearTimeout(this.#again);
    this.#outgoing.stop();
    this.toasts.dispose();
    this.timeLapse.pause();
    this.historyView.dispose();
    this.lesson.dispose();
    this.history.stop();
    this.connection.close();
    this.stage.value?.dispose();
    this.stage.value = null;
  }

  /** The browser asks before it closes a page that still holds work of mine. */
  readonly #warn = (event: Event): void => {
    if (this.doc.pending.peek() > 0) event.preventDefault();
  };

  #makeHistoryView(url: string): HistoryView {
    return new HistoryView({
      connect: (handlers) => new Connection({ url, ...handlers }),
      hello: () => this.#hello(),
      show: (doc) => this.doc.lookAt(doc),
      restart: () => {
        this.stage.peek()?.restart();
        this.viewChanged();
      },
      frame: (frame) => this.stage.peek()?.apply(frame),
      progress: (progress) => {
        this.progress.value = progress;
      },
      ended: (why) => this.toasts.show(why, "warn"),
      // The server counts the tiles of now as held: only a new connection sends them all again.
      back: () => this.connection.reconnect(msg("Back to now.")),
    });
  }

  #hello(): Hello {
    return {
      type: "hello",
      protocol: PROTOCOL_VERSION,
      terrain: this.id,
      secret: this.secret,
      client: this.client,
      token: this.#token,
      ticket: this.lesson.ticket,
      name: this.me.value.name,
      colour: this.me.value.colour,
      clock: this.doc.clock,
    };
  }

  /** Sends what waits whenever something waits, and keeps the title and this device's memory up to date. */
  #watch(): void {
    window.addEventListener("beforeunload", this.#warn);
    this.#stops.push(
      () => window.removeEventListener("beforeunload", this.#warn),
      effect(() => {
        this.doc.doc.value;
        if (this.doc.pending.value > 0) queueMicrotask(() => this.#flush());
      }),
      effect(() => {
        const state = this.connection.state.value;
        if (state === "reconnecting") this.doc.disconnected();
        // Without a connection nobody knows where the others point.
        if (state !== "online") this.presences.value = new Map();
      }),
      effect(() => {
        const doc = this.doc.doc.value;
        const role = this.role.value;
        if (!doc || !role || this.historyView.active.value) return;
        document.title = `${doc.settings.title || msg("Untitled terrain")} · Esker`;
      }),
      effect(() => {
        const title = this.doc.doc.value?.settings.title;
        const role = this.role.value;
        if (title === undefined || !role || this.historyView.active.value) return;
        this.#kept.remember(title, role);
      }),
    );
  }

  /** Sends what may be sent now, and comes back for the rest until the server has acknowledged all. */
  #flush(): void {
    clearTimeout(this.#again);
    this.#again = undefined;
    if (this.connection.state.peek() !== "online" || this.role.peek() === null) return;
    const ops = this.doc.outgoing();
    if (ops.length > 0) this.connection.send({ type: "ops", ops });
    if (this.doc.pending.peek() > 0) this.#again = setTimeout(() => this.#flush(), TICK_MS);
  }

  #receive(message: ServerMessage): void {
    switch (message.type) {
      case "welcome":
        this.#welcome(message);
        break;
      case "ack":
        this.doc.ack(message);
        break;
      case "reject":
        this.doc.reject(message);
        break;
      case "ordered":
        this.#gone.note(message, this.members.peek(), this.client);
        this.doc.ordered(message);
        break;
      case "members":
        this.#setMembers(message.members);
        break;
      case "presences":
        this.#setPresences(message.members);
        break;
      case "progress":
        if (!this.historyView.active.peek()) this.progress.value = message;
        if (message.note) this.#setNotice(message.note);
        // The new base is on its way until what is solved on it has settled.
        if (message.laying) this.baseBuilding.value = true;
        else if (message.settled) this.baseBuilding.value = false;
        break;
      case "importing":
        this.stage.value?.groundwork.receive(message);
        break;
      case "error":
        this.#error(message);
        break;
      case "class":
        this.inClass.value = message;
        break;
      case "lesson":
        this.lesson.receive(message);
        break;
      case "score":
        this.score.value = (message.points ?? null) === null ? null : message;
        break;
      case "notice":
        this.toasts.show(noticeWords(message));
        break;
      case "pong":
        break;
    }
    this.newest.value = this.doc.clock ?? this.newest.peek();
  }

  /** The notice has been read: the same sentence does not come again on this page. */
  dismissNotice(): void {
    if (this.notice.value !== null) this.#read.add(this.notice.value);
    this.notice.value = null;
  }

  #setNotice(note: string): void {
    if (!this.#read.has(note)) this.notice.value = note;
  }

  #error(message: ErrorMessage): void {
    this.lesson.keepTicket(message.ticket);
    if (!message.fatal) this.toasts.show(refusalWords(message.code, message.message), "warn");
    else if (message.code === "bad_secret" || message.code === "revoked") this.#kept.ended(message.code);
    else if (message.code === "no_terrain")
      void this.deletion.ask().then((restorable) => {
        if (!restorable) this.#kept.forget();
      });
  }

  #welcome(message: Welcome): void {
    this.doc.welcome(message);
    this.#token = message.token;
    this.lesson.keepTicket(message.ticket);
    if (message.lesson) this.lesson.receive(message.lesson);
    this.role.value = message.role;
    this.server.value = { version: message.server, device: message.device, levels: message.levels };
    this.#setMembers(message.members);
    const doc = this.doc.doc.value;
    if (doc && this.stage.value === null) this.#openStage(doc, message);
    else if (!this.historyView.active.peek()) this.stage.value?.restart();
    this.viewChanged();
    this.#flush();
  }

  #openStage(doc: Doc, { levels, finest }: Welcome): void {
    const sizeM = doc.settings.size_m;
    const stage = new Stage({ session: this, sizeM, levels, finest, viewport: this.#viewport });
    this.stage.value = stage;
    void stage.start();
  }

  #frame(frame: DecodedFrame): void {
    if (this.historyView.active.peek()) return;
    if (frame.rivers !== undefined) {
      this.rivers.value = frame.rivers;
      return;
    }
    if (this.stage.value?.apply(frame) === false) this.connection.reconnect();
  }

  #setMembers(members: readonly Member[]): void {
    this.members.value = members;
    const here = new Set(members.map((m) => m.client));
    const kept = [...this.presences.value].filter(([client]) => here.has(client));
    if (kept.length !== this.presences.value.size) this.presences.value = new Map(kept);
  }

  #setPresences(changed: readonly MemberPresence[]): void {
    const next = new Map(this.presences.value);
    for (const presence of changed) next.set(presence.client, presence);
    this.presences.value = next;
    if (!this.historyView.active.peek()) this.stage.value?.followed(changed);
  }
}
