/** An open terrain as the stage and the page's components know it: all but how it is seen (stage.ts). */

import type { ReadonlySignal, Signal } from "@preact/signals-core";
import type { RiverSet } from "../core/types.ts";
import type { SyncDoc } from "../doc/sync.ts";
import type {
  Member,
  MemberPresence,
  Op,
  Progress,
  Role,
  Score,
  StrokeFields,
  TerrainFields,
} from "../generated/contract.ts";
import type { Connection } from "../net/connection.ts";
import type { Identity, Store } from "./device/storage.ts";
import type { History } from "./history/history.ts";
import type { HistoryView } from "./history/history-view.ts";
import type { TimeLapse } from "./history/timelapse.ts";
import type { LessonView } from "./lesson/lesson-view.ts";
import type { Deletion } from "./server/deletion.ts";
import type { Status } from "./status.ts";
import type { ToastList } from "./toasts.ts";
import type { People } from "./view/scene.ts";

/** Facts that the server gave about itself. */
export interface ServerInfo {
  readonly version: string;
  readonly device: string;
  readonly levels: number;
}

export interface OpenTerrain {
  readonly id: string;
  readonly secret: string;
  readonly client: string;
  readonly store: Store;
  readonly toasts: ToastList;
  readonly doc: SyncDoc;
  readonly connection: Connection;
  readonly historyView: HistoryView;
  readonly timeLapse: TimeLapse;
  readonly history: History;
  readonly deletion: Deletion;
  readonly lesson: LessonView;
  /** Clock of the present, also while the past is shown. */
  readonly newest: ReadonlySignal<number>;
  readonly role: ReadonlySignal<Role | null>;
  readonly members: ReadonlySignal<readonly Member[]>;
  readonly presences: ReadonlySignal<ReadonlyMap<string, MemberPresence>>;
  readonly progress: Signal<Progress | null>;
  /** The server makes the ground of the elevation layers, and it takes long. */
  readonly baseBuilding: ReadonlySignal<boolean>;
  /** The server's last sentence about its solver, until somebody has read it. */
  readonly notice: ReadonlySignal<string | null>;
  readonly server: ReadonlySignal<ServerInfo | null>;
  /** How far the terrain is with its task, as the server last said. */
  readonly score: ReadonlySignal<Score | null>;
  readonly me: ReadonlySignal<Identity>;
  /** The rivers that the server found last; null before. */
  readonly rivers: ReadonlySignal<RiverSet | null>;
  /** Whether the link allows changes. */
  readonly mayEdit: ReadonlySignal<boolean>;
  /** Whether the terrain can be changed now: an earlier clock cannot. */
  readonly canEdit: ReadonlySignal<boolean>;
  readonly status: ReadonlySignal<Status>;
  readonly people: ReadonlySignal<People>;

  /** Applies an op at once and sends it; a refusal becomes a toast. True when it was applied. */
  submit(op: Op, gesture?: string): boolean;
  /** Says why an op was refused; where its stroke was deleted, by whom, with the way back. */
  refused(refusal: { readonly code: string; readonly message: string }, op: Op | undefined): void;
  /** Changes fields of a stroke; one gesture is one step of undo. */
  setStroke(stroke: string, fields: StrokeFields, gesture?: string): boolean;
  /** Changes settings of the terrain. */
  setTerrain(fields: TerrainFields, gesture?: string): boolean;
  /** A name for a gesture that no other has. */
  newGesture(): string;
  /** Goes on with a new secret for the same link. */
  adoptSecret(secret: string): void;
  rename(who: Identity): void;
  /** Asks for a presence message; many requests become few messages. */
  presenceChanged(): void;
  viewChanged(): void;
  dismissNotice(): void;
}
