/**
 * The type of an action, and the parts that actions are made from. Makers of actions know this file, not each other.
 */

import type { Signal } from "@preact/signals-core";
import type { Camera, CameraMode } from "../../core/camera/camera.ts";
import type { Ground } from "../../core/types.ts";
import type { SyncDoc } from "../../doc/sync.ts";
import type { PenToolId, ToolDefaults } from "../defaults.ts";
import type { Say } from "../say.ts";
import type { Placing } from "../tools/placement.ts";
import type { Ruler } from "../tools/ruler.ts";

export type ToolId = "select" | PenToolId;

export type ActionId =
  | ToolId
  | "undo"
  | "redo"
  | "delete"
  | "duplicate"
  | "mirror"
  | "lock"
  | "hide"
  | "raise"
  | "lower"
  | "brush-smaller"
  | "brush-larger"
  | "brush-weaker"
  | "brush-stronger"
  | "brush-channel"
  | "brush-opposite"
  | "set-point"
  | "water"
  | "measure-line"
  | "measure-area"
  | "turn-grid-left"
  | "turn-grid-right"
  | "next-stroke"
  | "previous-stroke"
  | "cancel"
  | `nudge-${Direction}`
  | "frame-selection"
  | "home"
  | "north"
  | `camera-${CameraMode}`
  | "zoom-in"
  | "zoom-out"
  | "turn-left"
  | "turn-right"
  | "finger-draws"
  | `view-${1 | 2 | 3}`
  | `save-view-${1 | 2 | 3}`;

type Direction = "up" | "down" | "left" | "right";

export interface Action {
  readonly title: string;
  /** Combinations such as `Ctrl+Shift+z`, as `combination` (keyboard.ts) writes them. The first one is shown. */
  readonly keys: readonly string[];
  run(): void;
  enabled(): boolean;
}

export interface ActionContext {
  readonly ruler: Ruler;
  readonly camera: Camera;
  readonly doc: SyncDoc;
  readonly ground: () => Ground;
  /** Returns the ground, held fast for one stroke or drag. */
  readonly freeze: () => Ground;
  readonly canEdit: () => boolean;
  readonly tool: Signal<ToolId>;
  readonly selection: Signal<string | null>;
  /** The elevation grid that is being placed. */
  readonly placing: Signal<Placing | null>;
  readonly fingerDraws: Signal<boolean>;
  readonly defaults: ToolDefaults;
  readonly newId: () => string;
  readonly onMessage: Say;
  /** Gives up what is being drawn or dragged; true when there was something. */
  readonly cancel: () => boolean;
  /** The pen that the arrow keys move. */
  readonly keyPen: ArrowPen;
  readonly now: () => number;
}

/** The pen that the arrow keys move, as far as actions need it. */
export interface ArrowPen {
  readonly usable: () => boolean;
  show(): void;
}

export type Put = (id: ActionId, title: string, keys: string[], run: () => void, enabled?: () => boolean) => void;

/** Key repeats within this time belong to one gesture, so that a held key is one step of undo. */
export const GESTURE_MS = 800;
