/**
 * Drawing one stroke: pen samples in, ops out (DESIGN 12). At most every 33 ms the whole curve is submitted anew, since
 * a turning plane re-projects it; one gesture, so that the stroke is one step of undo.
 */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import type { Camera } from "../../core/camera/camera.ts";
import type { GhostVisual, Ground, Rgba } from "../../core/types.ts";
import type { SyncDoc } from "../../doc/sync.ts";
import { MAX_POINTS_PER_STROKE, type Op, type Stroke, TICK_MS } from "../../generated/contract.ts";
import { type PenToolId, pressed, type ToolDefaults } from "../defaults.ts";
import type { Say } from "../say.ts";
import { beginOnLand } from "../sketch/border.ts";
import { courseFields, courseOf, courseSection } from "../sketch/courseline.ts";
import { CourseSketch } from "../sketch/coursesketch.ts";
import { LevelSketch, RidgeSketch } from "../sketch/levelsketch.ts";
import { ProfileSketch } from "../sketch/profilesketch.ts";
import { meanPressure, type Sample, type Sketch, type SketchShape, type SketchStart } from "../sketch/sketch.ts";
import { anchorOn, appendOps, frameCurve, metres, solvedHeight, type Triple } from "../sketch/strokeops.ts";
import { BrushSketch, dabShape, NO_SECTION, pressedPaint } from "./painttool.ts";

/** Samples of the line under the pen in device pixels, for an ink overlay; `predicted` is never part of the stroke. */
export interface InkVisual {
  readonly points: readonly { readonly x: number; readonly y: number; readonly pressure: number }[];
  readonly predicted: readonly { readonly x: number; readonly y: number }[];
}

export interface StrokeToolOptions {
  readonly camera: Camera;
  readonly doc: SyncDoc;
  readonly defaults: ToolDefaults;
  readonly clientId: string;
  /** The name that the stroke carries. */
  readonly author: () => string;
  readonly freeze: () => Ground;
  readonly onMessage: Say;
  /** Milliseconds. */
  readonly now: () => number;
}

/** While drawing, so few that one append holds them; at the end, what the screen can show. */
const LIVE_POINTS = 240;
const FINAL_POINTS = Math.min(2048, MAX_POINTS_PER_STROKE);
/** Looking down more steeply than this, a vertical plane is seen edge-on. */
const STEEP = Math.sin((78 * Math.PI) / 180);

const COLOURS: Readonly<Record<PenToolId, Rgba>> = {
  mountain: [0.25, 0.5, 0.95, 1],
  crevice: [0.2, 0.65, 0.8, 1],
  plateau: [0.95, 0.4, 0.3, 1],
  paint: [0.95, 0.95, 0.98, 1],
  course: [0.2, 0.65, 0.8, 1],
};

/** A stroke that has just been drawn. */
export interface FinishedStroke {
  readonly id: string;
  /** A stroke that lies on the ground all along, so that nothing is seen of it. */
  readonly flush: boolean;
}

interface Session {
  readonly tool: PenToolId;
  readonly start: SketchStart;
  /** The brush does the opposite of what it is set to. */
  readonly opposite: boolean;
  readonly ground: Ground;
  sketch: Sketch & { readonly samples: readonly Sample[] };
  readonly id: string;
  readonly gesture: string;
  readonly pen: boolean;
  begun: boolean;
  sentAt: number;
}

/**
 * An id after those of all strokes before: strokes count in the order of their ids, and what the solver keeps while one
 * is drawn is what the strokes before it say. `count` tells apart what one client begins at the same time.
 */
export function strokeId(nowMs: number, count: number, clientId: string): string {
  return `z${Math.floor(nowMs).toString(36)}${count.toString(36)}-${clientId.slice(0, 16)}`;
}

export class StrokeTool {
  readonly #o: StrokeToolOptions;
  readonly #ghost = signal<GhostVisual | null>(null);
  readonly #drawing = signal<string | null>(null);
  readonly #ink = signal<InkVisual | null>(null);
  #session: Session | null = null;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #count = 0;

  constructor(options: StrokeToolOptions) {
    this.#o = options;
  }

  get ghost(): ReadonlySignal<GhostVisual | null> {
    return this.#ghost;
  }

  /** Id of the stroke under way. */
  get drawing(): ReadonlySignal<string | null> {
    return this.#drawing;
  }

  get ink(): ReadonlySignal<InkVisual | null> {
    return this.#ink;
  }

  get active(): boolean {
    return this.#session !== null;
  }

  /**
   * Puts the pen down; `opposite`: a brush takes away what it would add. False when there is no ground to draw on under the
   * pen, nor a border within `besidePx` device pixels of it, where the line then begins.
   */
  start(tool: PenToolId, at: Sample, pen: boolean, opposite = false, besidePx = 0): boolean {
    const ground = this.#o.freeze();
    const sample = beginOnLand(this.#o.camera, ground, at, besidePx);
    const hit = sample && ground.raycast(sample.ray);
    if (!sample || !hit) return false;
    this.#o.camera.halt();
    const nowMs = this.#o.now();
    const start: SketchStart = { camera: this.#o.camera, ground, hit, sample, nowMs };
    const id = this.newId();
    const sketch = this.#sketchFor(tool, start);
    const gesture = `draw-${id}`;
    this.#session = { tool, start, opposite, ground, sketch, id, gesture, pen, begun: false, sentAt: -Infinity };
    return true;
  }

  /** An id that no stroke has had. */
  newId(): string {
    this.#count += 1;
    return strokeId(this.#o.now(), this.#count, this.#o.clientId);
  }

  /** Takes the samples of one event; `predicted` ones are shown as ink only. */
  move(samples: readonly Sample[], predicted: readonly Sample[] = []): void {
    const session = this.#session;
    if (session === null || samples.length === 0) return;
    for (const sample of samples) session.sketch.add(sample);
    this.#show(session, predicted);
  }

  /** Replaces all samples but the first: the line of a pen that takes points back. */
  redraw(samples: readonly Sample[]): void {
    const session = this.#session;
    if (session === null || samples.length === 0) return;
    session.sketch = this.#sketchFor(session.tool, session.start);
    for (const sample of samples) session.sketch.add(sample);
    this.#show(session, []);
  }

  #sketchFor(tool: PenToolId, start: SketchStart): Sketch & { readonly samples: readonly Sample[] } {
    return tool === "course" ? new CourseSketch(start, this.#o.defaults.course.value) : sketchFor(tool, start);
  }

  #show(session: Session, predicted: readonly Sample[]): void {
    if (!session.begun) this.#begin(session);
    if (this.#session === null) return;
    this.#drawing.value = session.id;
    this.#ink.value = { points: session.sketch.samples, predicted };
    this.#schedule(session);
  }

  /** Lifts the pen: the exact stroke is submitted and finished. Returns what was made, or null when there was nothing. */
  finish(): FinishedStroke | null {
    const session = this.#session;
    if (session === null) return null;
    const { points } = session.sketch.shape(this.#o.now(), true, FINAL_POINTS);
    if (session.begun && points.length < 6) {
      this.cancel(); // nothing of the line could be projected
      return null;
    }
    const drapes = session.tool === "paint" || session.tool === "course";
    const flush = !drapes && liesOnGround(points, session.ground, flatness(session.tool, points));
    if (session.begun) {
      this.#submitShape(session, true);
      if (this.#session !== null) this.#submit(session, { type: "stroke.finish", stroke: session.id });
    }
    const done = this.#session !== null && session.begun;
    this.#clear();
    return done ? { id: session.id, flush } : null;
  }

  /** A touch without a line: a brush leaves a dab, other tools nothing. Returns what was made. */
  touch(): FinishedStroke | null {
    const session = this.#session;
    if (session?.tool !== "paint") {
      this.cancel();
      return null;
    }
    const shape = dabShape(session.start, this.#o.defaults.paint.value.radius_m);
    this.#begin(session, shape);
    if (this.#session === null || !this.#submitCurve(session, shape)) return null;
    if (!this.#submit(session, { type: "stroke.finish", stroke: session.id })) return null;
    this.#clear();
    return { id: session.id, flush: false };
  }

  /** Gives the stroke up: whatever of it was submitted is deleted again. */
  cancel(): void {
    const session = this.#session;
    this.#clear();
    if (session?.begun && this.#o.doc.doc.value?.strokes.has(session.id))
      this.#o.doc.submit({ type: "stroke.delete", stroke: session.id }, session.gesture);
  }

  #begin(session: Session, shape = session.sketch.shape(this.#o.now(), false, LIVE_POINTS)): void {
    session.begun = true;
    const [first, last] = anchors(session, shape);
    const stroke: Stroke = {
      id: session.id,
      author: this.#o.author(),
      kind: KINDS[session.tool],
      first,
      last,
      curve: [],
      ...this.#style(session),
      yields: 0,
      locked: false,
      hidden: false,
      label: "",
      finished: false,
    };
    this.#submit(session, { type: "stroke.begin", stroke });
  }

  /** Returns the style that the tool's defaults give the stroke, changed by the pen's pressure. */
  #style(session: Session): Style {
    const { defaults } = this.#o;
    const pressure = session.pen && defaults.pressure.value !== "none" ? meanPressure(session.sketch.samples) : null;
    if (session.tool === "course") {
      const style = defaults.course.value;
      return { ...courseSection(style), paint: null, course: { ...courseOf(style), rises: [] } };
    }
    if (session.tool !== "paint") {
      const base = defaults[session.tool].value;
      return { ...(pressure === null ? base : pressed(base, pressure)), paint: null, course: null };
    }
    const base = defaults.paint.value;
    const paint = pressure === null ? base : pressedPaint(base, pressure);
    return { ...NO_SECTION, paint: session.opposite ? { ...paint, value: -paint.value } : paint, course: null };
  }

  /** Submits now if the last time is long enough ago, else when it is; goes on while the plane still turns. */
  #schedule(session: Session): void {
    if (this.#timer !== undefined) return;
    const wait = session.sentAt + TICK_MS - this.#o.now();
    if (wait <= 0) this.#tick(session);
    else this.#timer = setTimeout(() => this.#tick(session), wait);
  }

  #tick(session: Session): void {
    this.#timer = undefined;
    if (this.#session !== session) return;
    this.#submitShape(session, false);
    if (this.#session === session && session.sketch.settling) this.#schedule(session);
  }

  #submitShape(session: Session, exact: boolean): void {
    const shape = session.sketch.shape(this.#o.now(), exact, exact ? FINAL_POINTS : LIVE_POINTS);
    if (!this.#submitCurve(session, shape)) return;
    if (exact && session.tool !== "course" && session.pen && this.#o.defaults.pressure.value !== "none") {
      const { left, right, paint } = this.#style(session);
      const fields = paint === null ? { left, right } : { paint };
      this.#submit(session, { type: "stroke.set", stroke: session.id, fields });
    }
    this.#ghost.value = exact ? null : this.#ghostOf(session, shape);
  }

  /** The curve is that of the line as drawn; its frame stands on the solved ground. */
  #submitCurve(session: Session, shape: SketchShape): boolean {
    session.sentAt = this.#o.now();
    if (session.tool === "course") {
      const fields = courseFields(shape.points, courseOf(this.#o.defaults.course.value));
      return this.#submit(session, { type: "stroke.set", stroke: session.id, fields });
    }
    const curve = frameCurve(KINDS[session.tool], shape.points, metres(shape.first), metres(shape.last));
    return appendOps(session.id, curve, anchors(session, shape)[1]).every((op) => this.#submit(session, op));
  }

  /** False when the op was refused: then the stroke is gone and the person knows why. */
  #submit(session: Session, op: Op): boolean {
    const refusal = this.#o.doc.submit(op, session.gesture);
    if (refusal === null) return true;
    this.#o.onMessage(refusal.message, { code: refusal.code, op });
    this.cancel();
    return false;
  }

  #ghostOf(session: Session, shape: SketchShape): GhostVisual | null {
    const corners = session.sketch.corners(shape);
    if (corners === null) return null;
    return {
      corners,
      shadow: shadowOf(shape.points, session.ground),
      colour: COLOURS[session.tool],
    };
  }

  #clear(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#session = null;
    this.#ghost.value = null;
    this.#ink.value = null;
    this.#drawing.value = null;
  }
}

type Style = Pick<Stroke, "left" | "right" | "plateau_radius_m" | "amplitude_m" | "roughness" | "paint" | "course">;

const KINDS: Readonly<Record<PenToolId, Stroke["kind"]>> = {
  mountain: "profile",
  crevice: "profile",
  plateau: "level",
  paint: "paint",
  course: "course",
};

/** First and last anchor of a shape. The ground was drawn with its detail, which comes on top of what a stroke makes. */
function anchors({ tool, ground }: Session, shape: SketchShape): [Triple, Triple] {
  if (tool === "course") return [metres(shape.first), metres(shape.last)];
  const first = anchorOn(ground, shape.first);
  const last = anchorOn(ground, shape.last);
  if (tool === "plateau") last[2] = first[2];
  return [first, last];
}

function sketchFor(tool: PenToolId, start: SketchStart): Sketch & { readonly samples: readonly Sample[] } {
  if (tool === "plateau") return new LevelSketch(start);
  if (tool === "paint") return new BrushSketch(start);
  const sense = tool === "mountain" ? "up" : "down";
  const edgeOn = start.camera.state.value.mode === "map" || Math.abs(start.sample.ray.dir[2]) > STEEP;
  return edgeOn ? new RidgeSketch(start, sense) : new ProfileSketch(start, sense);
}

/** Closer to the ground than this all along, metres, a plateau changes nothing that one sees. */
const FLUSH_M = 2;

/** As a share of its length: a line across the ground trembles by so much, where a silhouette was meant. */
const FLAT_PROFILE = 0.01;

/** How far from the ground a line (xyz triples) still lies on it, metres. */
function flatness(tool: PenToolId, points: Float64Array): number {
  if (tool === "plateau") return FLUSH_M;
  const n = points.length;
  return Math.max(FLUSH_M, FLAT_PROFILE * Math.hypot(points[n - 3]! - points[0]!, points[n - 2]! - points[1]!));
}

/** Says whether every point (xyz triples) lies within `most` metres of the ground. */
function liesOnGround(points: Float64Array, ground: Ground, most: number): boolean {
  for (let i = 0; i + 2 < points.length; i += 3)
    if (Math.abs(points[i + 2]! - ground.heightAt(points[i]!, points[i + 1]!)) > most) return false;
  return true;
}

/** The path dropped on the ground, dense enough to follow it (at least 48 steps along its length). */
export function shadowOf(points: Float64Array, ground: Ground): Float32Array {
  const n = points.length / 3;
  const out: number[] = [];
  const drop = (x: number, y: number): void => void out.push(x, y, solvedHeight(ground, x, y));
  const parts = Math.max(1, Math.ceil(48 / Math.max(1, n - 1)));
  for (let i = 0; i + 1 < n; i++)
    for (let k = 0; k < parts; k++) {
      const t = k / parts;
      drop(mixAt(points, i, 0, t), mixAt(points, i, 1, t));
    }
  if (n > 0) drop(points[3 * n - 3]!, points[3 * n - 2]!);
  return new Float32Array(out);
}

function mixAt(points: Float64Array, i: number, axis: number, t: number): number {
  const a = points[3 * i + axis]!;
  return a + (points[3 * i + 3 + axis]! - a) * t;
}
