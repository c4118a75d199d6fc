/**
 * Over-sketching (DESIGN 12): a line drawn over the selected stroke, begun close to it, takes the place of the part that it
 * passes. It lies on the stroke's own plane, so the frame of its anchors stays; all but the tool is pure.
 */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import type { Camera } from "../../core/camera/camera.ts";
import { along, rayPlane, segmentDistance, simplifyTo } from "../../core/geometry.ts";
import { distance, dot, normalize } from "../../core/math.ts";
import type { Ray, Vec3 } from "../../core/types.ts";
import { type CurvePoint, worldPoints } from "../../doc/strokes.ts";
import type { SyncDoc } from "../../doc/sync.ts";
import { type Stroke, TICK_MS } from "../../generated/contract.ts";
import type { ToolId } from "../keys/action.ts";
import type { Say } from "../say.ts";
import { crestIndex } from "../tools/handles.ts";
import type { InkVisual } from "../tools/stroketool.ts";
import { type Sample, SIMPLIFY_PX, smoothedRay, smoothPixels } from "./sketch.ts";
import { curveOps, frameCurve, roundCurve } from "./strokeops.ts";

/** A place on a stroke's line: between its points `floor(s)` and the next. */
interface Place {
  readonly s: number;
  /** Device pixels from the pen. */
  readonly away: number;
}

/** The pen begins on the line, not at its ends: there new lines begin. CSS pixels. */
const END_PX = 26;
/** A line that ends within so many CSS pixels of the stroke is back on it. */
const BACK_PX = 26;
/** A plane that is seen more edge-on than this (sine) cannot be drawn on. */
const EDGE_ON = 0.2;
/** Points farther than this many times the beginning are not believed. */
const FAR = 8;
/** Share of the new part over which it leaves the old line, and comes back. */
const EASE = 0.25;
const MOST_POINTS = 400;

/** Says whether a tool draws strokes like this one: mountains are redrawn by the mountain's tool. */
export function redraws(tool: ToolId, stroke: Stroke): boolean {
  if (stroke.locked || stroke.hidden || stroke.curve.length < 2) return false;
  if (stroke.kind === "level") return tool === "plateau";
  if (stroke.kind !== "profile") return false;
  return tool === ((stroke.curve[crestIndex(stroke)]?.[1] ?? 0) < 0 ? "crevice" : "mountain");
}

/** One line that is drawn over a stroke. */
export class Oversketch {
  readonly #stroke: Stroke;
  readonly #camera: Camera;
  readonly #point: Vec3;
  readonly #normal: Vec3;
  readonly #range: number;
  readonly #samples: Sample[];
  /** The line as it was when the pen came down. */
  readonly #world: Float64Array;
  readonly #from: number;
  readonly #ratio: number;

  private constructor(stroke: Stroke, camera: Camera, sample: Sample, from: number, range: number, ratio: number) {
    this.#stroke = stroke;
    this.#camera = camera;
    this.#samples = [sample];
    this.#world = worldPoints(stroke);
    this.#from = from;
    this.#ratio = ratio;
    this.#point = stroke.first;
    this.#normal = normalOf(stroke);
    this.#range = range;
  }

  /** Null where the pen is not on the line, at an end of it, or where its plane is seen edge-on. `nearPx`, `ratio`: CSS pixels. */
  static begin(stroke: Stroke, camera: Camera, sample: Sample, nearPx: number, ratio: number): Oversketch | null {
    const world = worldPoints(stroke);
    const place = nearestPlace(world, camera, sample);
    if (place === null || place.away > nearPx * ratio) return null;
    const closed = stroke.kind === "level" && isClosed(world);
    for (const end of closed ? [] : [at(world, 0), at(world, world.length / 3 - 1)]) {
      const p = camera.project(end);
      if (Math.hypot(p.x - sample.x, p.y - sample.y) < END_PX * ratio) return null;
    }
    const normal = normalOf(stroke);
    if (Math.abs(dot(normalize(sample.ray.dir), normal)) < EDGE_ON) return null;
    const t = rayPlane(sample.ray, stroke.first, normal);
    if (t === null) return null;
    const range = distance(sample.ray.origin, along(sample.ray, t));
    return new Oversketch(stroke, camera, sample, place.s, range, ratio);
  }

  get samples(): readonly Sample[] {
    return this.#samples;
  }

  add(sample: Sample): void {
    this.#samples.push(sample);
  }

  /** The whole curve with its new part, rounded for the wire; null while there is nothing of it. */
  curve(): CurvePoint[] | null {
    const drawn = this.#drawn();
    const end = nearestPlace(this.#world, this.#camera, this.#samples.at(-1)!);
    if (drawn.length < 2 || end === null) return null;
    const old = this.#stroke.curve as readonly CurvePoint[];
    const back = end.away <= BACK_PX * this.#ratio;
    const eased = ease(drawn, curveAt(old, this.#from), back ? curveAt(old, end.s) : null);
    const closed = this.#stroke.kind === "level" && isClosed(this.#world);
    return roundCurve(this.#stroke.kind, spliced(old, eased, this.#from, end.s, closed));
  }

  /** The pen's line on the stroke's plane, in the frame of its anchors. */
  #drawn(): CurvePoint[] {
    const pixels = smoothPixels(this.#samples);
    const points: number[] = [];
    for (const i of simplifyTo(pixels, SIMPLIFY_PX, MOST_POINTS)) {
      const ray = smoothedRay(this.#camera, this.#samples[i]!, pixels[2 * i]!, pixels[2 * i + 1]!);
      const p = this.#onPlane(ray);
      if (p !== null) points.push(...p);
    }
    const { kind, first, last, curve } = this.#stroke;
    const drawn = frameCurve(kind, points, first, last);
    if (kind !== "profile") return drawn;
    // A stroke that never lay under its anchors does not sink below them by a slip of the pen, nor the other way round.
    const up = curve.every(([, w]) => w > -1e-3);
    const down = curve.every(([, w]) => w < 1e-3);
    return drawn.map(([u, w]) => [u, up ? Math.max(0, w) : down ? Math.min(0, w) : w]);
  }

  #onPlane(ray: Ray): Vec3 | null {
    const t = rayPlane(ray, this.#point, this.#normal);
    if (t === null) return null;
    const p = along(ray, t);
    return distance(ray.origin, p) > FAR * this.#range ? null : p;
  }
}

/** `drawn` in the place of what lies between two places of the old curve; a closed one loses the shorter way round. */
export function spliced(
  old: readonly CurvePoint[],
  drawn: readonly CurvePoint[],
  from: number,
  to: number,
  closed: boolean,
): CurvePoint[] {
  const [low, high] = from <= to ? [from, to] : [to, from];
  const line = from <= to ? drawn : drawn.toReversed();
  const kept = old.slice(Math.floor(low) + 1, Math.floor(high) + 1);
  const round = closed && high - low > (old.length - 1) / 2;
  if (round) return [...line.toReversed(), ...kept, line.at(-1)!];
  return [...old.slice(0, Math.floor(low) + 1), ...line, ...old.slice(Math.floor(high) + 1)];
}

/** The line leaves `start` and ends at `end` without a step: what lies between is shifted less and less. */
function ease(line: readonly CurvePoint[], start: CurvePoint, end: CurvePoint | null): CurvePoint[] {
  const n = line.length - 1;
  const [a, b] = [line[0]!, line[n]!];
  return line.map(([u, v], i) => {
    const near = Math.max(0, 1 - i / n / EASE) ** 2;
    const last = end === null ? 0 : Math.max(0, 1 - (n - i) / n / EASE) ** 2;
    const shift = (k: 0 | 1): number => near * (start[k] - a[k]) + last * ((end?.[k] ?? 0) - b[k]);
    return [u + shift(0), v + shift(1)];
  });
}

function curveAt(curve: readonly CurvePoint[], s: number): CurvePoint {
  const i = Math.min(curve.length - 2, Math.floor(s));
  const t = s - i;
  const [a, b] = [curve[i]!, curve[i + 1]!];
  return [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
}

/** The place of the line (xyz triples) that is seen nearest to the sample; null when nothing of it is before the eye. */
function nearestPlace(world: Float64Array, camera: Camera, { x, y }: Sample): Place | null {
  const map = camera.state.peek().mode === "map";
  let best: Place | null = null;
  let a = camera.project(at(world, 0));
  for (let i = 0; i + 1 < world.length / 3; i++) {
    const b = camera.project(at(world, i + 1));
    const found = segmentDistance(x, y, a.x, a.y, b.x, b.y);
    const seen = map || (a.depth > 0 && b.depth > 0);
    if (seen && (best === null || found.distance < best.away)) best = { s: i + found.t, away: found.distance };
    a = b;
  }
  return best;
}

function at(points: Float64Array, i: number): Vec3 {
  return [points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!];
}

function normalOf({ kind, first, last }: Stroke): Vec3 {
  return kind === "level" ? [0, 0, 1] : normalize([first[1] - last[1], last[0] - first[0], 0]);
}

/** An outline that comes back to where it began. */
function isClosed(world: Float64Array): boolean {
  const n = world.length / 3;
  let length = 0;
  for (let i = 0; i + 1 < n; i++) length += distance(at(world, i), at(world, i + 1));
  return n > 3 && distance(at(world, 0), at(world, n - 1)) < 0.25 * length;
}

export interface OversketchContext {
  readonly camera: Camera;
  readonly doc: SyncDoc;
  readonly onMessage: Say;
  readonly now: () => number;
}

/** The line under way: live, at most every 33 ms, one gesture, so one step of undo. */
export class OversketchTool {
  readonly #c: OversketchContext;
  readonly #ink = signal<InkVisual | null>(null);
  #line: { readonly sketch: Oversketch; readonly stroke: Stroke; readonly gesture: string; sentAt: number } | null =
    null;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(context: OversketchContext) {
    this.#c = context;
  }

  get ink(): ReadonlySignal<InkVisual | null> {
    return this.#ink;
  }

  /** Says whether a pen that comes down here draws over the line. */
  would(stroke: Stroke, sample: Sample, nearPx: number, ratio: number): boolean {
    return Oversketch.begin(stroke, this.#c.camera, sample, nearPx, ratio) !== null;
  }

  /** True when the pen came down on the line of this stroke and draws over it. */
  start(stroke: Stroke, sample: Sample, nearPx: number, ratio: number): boolean {
    const sketch = Oversketch.begin(stroke, this.#c.camera, sample, nearPx, ratio);
    if (sketch === null) return false;
    this.#line = { sketch, stroke, gesture: `redraw-${stroke.id}-${Math.floor(this.#c.now())}`, sentAt: -Infinity };
    return true;
  }

  move(samples: readonly Sample[], predicted: readonly Sample[]): void {
    const line = this.#line;
    if (line === null) return;
    for (const sample of samples) line.sketch.add(sample);
    this.#ink.value = { points: line.sketch.samples, predicted };
    if (this.#timer !== undefined) return;
    const wait = line.sentAt + TICK_MS - this.#c.now();
    if (wait <= 0) this.#submit();
    else
      this.#timer = setTimeout(() => {
        this.#timer = undefined;
        this.#submit();
      }, wait);
  }

  /** The last place always arrives. */
  finish(): void {
    this.#submit();
    this.#clear();
  }

  /** Takes back what the line has changed. */
  cancel(): void {
    const changed = this.#line !== null && this.#line.sentAt > -Infinity;
    this.#clear();
    if (changed) this.#c.doc.undo();
  }

  #submit(): void {
    const line = this.#line;
    const curve = line?.sketch.curve() ?? null;
    if (line === null || curve === null) return;
    line.sentAt = this.#c.now();
    for (const op of curveOps(line.stroke, curve)) {
      const refusal = this.#c.doc.submit(op, line.gesture);
      if (refusal === null) continue;
      this.#c.onMessage(refusal.message, { code: refusal.code, op });
      this.#clear();
      return;
    }
  }

  #clear(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#line = null;
    this.#ink.value = null;
  }
}
