/** The handles of a stroke: where they are and what dragging one does (DESIGN 12). Pure. */

import { msg, str } from "@lit/localize";
import type { Ground, Vec3 } from "../../core/types.ts";
import type { Flank, Paint, Stroke } from "../../generated/contract.ts";
import { MAX_SLOPE_DEG } from "../../generated/contract.ts";
import { shapeOf } from "../picking.ts";
import { solvedHeight } from "../sketch/strokeops.ts";

export type HandleKind = "first" | "last" | "crest" | "left" | "right" | "move" | "radius" | `vertex-${number}`;

export interface HandleVisual {
  readonly id: string;
  readonly kind: HandleKind;
  readonly position: Vec3;
  readonly label: string;
  readonly active: boolean;
}

/** A point of the crest and the horizontal unit vector to the left of the direction of travel there. */
export interface Section {
  readonly crest: Vec3;
  readonly left: readonly [number, number];
}

/** Relief below this gives a flank no slope to be dragged. */
const FLAT_M = 1;
/** Where the ground beside a flank is read, as a share of the run of its slope: a soft foot ends at one and a half. */
const PAST_FOOT = 1.6;
const FOOT_STEPS = 4;
/** A line of paint shorter than this many radii has no ends to take hold of. */
const SHORT = 0.25;

/** Index of the curve point whose height differs most from the line between the anchors; the middle of a flat one. */
export function crestIndex(stroke: Stroke): number {
  const { curve } = stroke;
  const middle = curve.length >> 1;
  if (stroke.kind !== "profile") return middle;
  let best = -1;
  let most = 1e-6;
  for (const [i, [, w]] of curve.entries())
    if (Math.abs(w) > most) {
      most = Math.abs(w);
      best = i;
    }
  return best >= 0 ? best : middle;
}

/** Where the cross-section is shown and dragged. */
export function sectionOf(stroke: Stroke): Section {
  const { points } = shapeOf(stroke);
  if (stroke.kind === "paint") return middleOf(points);
  const i = crestIndex(stroke);
  const crest: Vec3 = [points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!];
  let dx = stroke.last[0] - stroke.first[0];
  let dy = stroke.last[1] - stroke.first[1];
  if (stroke.kind !== "profile") {
    const [a, b] = [Math.max(0, i - 1), Math.min(stroke.curve.length - 1, i + 1)];
    const tx = points[3 * b]! - points[3 * a]!;
    const ty = points[3 * b + 1]! - points[3 * a + 1]!;
    if (Math.hypot(tx, ty) > 1e-6) [dx, dy] = [tx, ty];
  }
  const n = Math.hypot(dx, dy) || 1;
  return { crest, left: [-dy / n, dx / n] };
}

/** Half-way along a line (xyz triples), as one walks it on the map. */
function middleOf(points: Float64Array): Section {
  const leg = (i: number): number => Math.hypot(points[i + 3]! - points[i]!, points[i + 4]! - points[i + 1]!);
  const ends = points.length - 3;
  let left = 0;
  for (let i = 0; i < ends; i += 3) left += leg(i) / 2;
  let i = 0;
  while (i + 3 < ends && leg(i) < left) {
    left -= leg(i);
    i += 3;
  }
  const n = leg(i) || 1;
  const [dx, dy] = [(points[i + 3]! - points[i]!) / n, (points[i + 4]! - points[i + 1]!) / n];
  const z = points[i + 2]! + (left / n) * ((points[i + 5] ?? points[i + 2]!) - points[i + 2]!);
  return { crest: [points[i]! + left * dx, points[i + 1]! + left * dy, z], left: [-dy, dx] };
}

/** The point at a distance across the stroke from the crest; negative is right of the direction of travel. */
export function across(section: Section, distanceM: number): readonly [number, number] {
  return [section.crest[0] + distanceM * section.left[0], section.crest[1] + distanceM * section.left[1]];
}

/**
 * Relief of the crest over the ground just beyond the foot of a flank, metres; negative for a crevice. The foot depends on
 * the ground there, so it is found in a few steps from the end of the extent inwards.
 */
export function reliefBeside(stroke: Stroke, section: Section, flank: Flank, side: 1 | -1, ground: Ground): number {
  let reach = flank.extent_m;
  let relief = 0;
  for (let step = 0; step < FOOT_STEPS; step++) {
    const [x, y] = across(section, side * (stroke.plateau_radius_m + reach));
    relief = section.crest[2] - solvedHeight(ground, x, y);
    reach = Math.min(flank.extent_m, PAST_FOOT * footDistance(flank, relief));
  }
  return relief;
}

/** How far from the plateau's edge a flank reaches: its extent, or where its slope meets the ground. */
export function footDistance(flank: Flank, relief: number): number {
  if (flank.slope_deg === null || Math.abs(relief) < FLAT_M || flank.slope_deg <= 0) return flank.extent_m;
  return Math.min(flank.extent_m, Math.abs(relief) / Math.tan((flank.slope_deg * Math.PI) / 180));
}

/** The flank whose foot lies `foot` metres from the plateau's edge: a new slope where that decides, else a new extent. */
export function flankWithFoot(flank: Flank, relief: number, foot: number): Flank {
  const tenth = (v: number): number => Math.round(v * 10) / 10;
  const sloped = flank.slope_deg !== null && Math.abs(relief) >= FLAT_M;
  const natural = sloped ? footDistance({ ...flank, extent_m: Infinity }, relief) : Infinity;
  if (!sloped || (foot < natural && flank.extent_m < natural)) return { ...flank, extent_m: tenth(foot) };
  const slope = (Math.atan2(Math.abs(relief), foot) * 180) / Math.PI;
  return {
    ...flank,
    slope_deg: tenth(Math.max(0.5, Math.min(MAX_SLOPE_DEG, slope))),
    extent_m: tenth(Math.max(flank.extent_m, foot * 1.1)),
  };
}

/** All handles of a stroke; none for one that has no shape yet. */
export function handlesOf(stroke: Stroke, ground: Ground, active: HandleKind | null): HandleVisual[] {
  if (stroke.curve.length < 2) return [];
  if (stroke.paint !== null) return paintHandles(stroke, stroke.paint, ground, active);
  if (stroke.course !== null) return courseHandles(stroke, active);
  const section = sectionOf(stroke);
  const out: HandleVisual[] = [];
  const put = (kind: HandleKind, position: Vec3, label: string): void => {
    out.push({ id: `${stroke.id}/${kind}`, kind, position, label, active: kind === active });
  };
  put("move", movePoint(stroke, ground), msg("Move"));
  for (const [kind, side] of [
    ["left", 1],
    ["right", -1],
  ] as const) {
    const flank = stroke[kind];
    if (flank === null) continue;
    const relief = reliefBeside(stroke, section, flank, side, ground);
    if (flank.slope_deg !== null && Math.abs(relief) < FLAT_M) continue; // no slope to be dragged, and no foot
    const foot = footDistance(flank, relief);
    const [x, y] = across(section, side * (stroke.plateau_radius_m + foot));
    const slope = flank.slope_deg === null ? "" : `${Math.round(flank.slope_deg)}° · `;
    const width = `${Math.round(foot)} m`;
    put(
      kind,
      [x, y, ground.heightAt(x, y)],
      kind === "left" ? msg(str`Left flank · ${slope}${width}`) : msg(str`Right flank · ${slope}${width}`),
    );
  }
  put("first", stroke.first, msg("Start"));
  put("last", stroke.kind === "level" ? [stroke.last[0], stroke.last[1], stroke.first[2]] : stroke.last, msg("End"));
  put("crest", section.crest, msg(str`Height ${Math.round(crestHeight(stroke))} m`));
  return out;
}

/** Handles of paint lie on the ground: both ends, the middle that moves it, and the rim of the brush beside that. */
function paintHandles(stroke: Stroke, paint: Paint, ground: Ground, active: HandleKind | null): HandleVisual[] {
  const section = sectionOf(stroke);
  const onGround = (p: readonly [number, number]): Vec3 => [p[0], p[1], ground.heightAt(p[0], p[1])];
  const handle = (kind: HandleKind, p: readonly [number, number], label: string): HandleVisual => ({
    id: `${stroke.id}/${kind}`,
    kind,
    position: onGround(p),
    label,
    active: kind === active,
  });
  const { first, last } = stroke;
  const dab = Math.hypot(last[0] - first[0], last[1] - first[1]) < SHORT * paint.radius_m;
  return [
    handle("move", across(section, 0), msg("Move")),
    handle("radius", across(section, paint.radius_m), msg(str`Radius ${Math.round(paint.radius_m)} m`)),
    ...(dab
      ? []
      : [handle("first", [first[0], first[1]], msg("Start")), handle("last", [last[0], last[1]], msg("End"))]),
  ];
}

/** A course of more points than this has handles at some of them, both ends among them. */
const MOST_VERTICES = 24;

/** Handles of a course: its points, the middle that moves it all, and the end of a bank. */
function courseHandles(stroke: Stroke, active: HandleKind | null): HandleVisual[] {
  const { points } = shapeOf(stroke);
  const section = sectionOf(stroke);
  const n = stroke.curve.length;
  const handle = (kind: HandleKind, position: Vec3, label: string): HandleVisual => {
    return { id: `${stroke.id}/${kind}`, kind, position, label, active: kind === active };
  };
  const at = (i: number): Vec3 => [points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!];
  const count = Math.min(n, MOST_VERTICES);
  const shown = new Set(Array.from({ length: count }, (_, k) => Math.round((k * (n - 1)) / Math.max(1, count - 1))));
  const bankM = stroke.left?.extent_m ?? 0;
  const [ex, ey] = across(section, stroke.plateau_radius_m + bankM);
  return [
    handle("move", middleOf(points).crest, msg("Move")),
    ...(bankM > 0 ? [handle("radius", [ex, ey, section.crest[2]], msg(str`Banks ${Math.round(bankM)} m`))] : []),
    ...[...shown].map((i) => handle(`vertex-${i}`, at(i), msg(str`${Math.round(at(i)[2])} m · Alt: height`))),
  ];
}

/** Returns the words of the crest handle: height over the line between the anchors, or of the plateau above zero. */
function crestHeight(stroke: Stroke): number {
  return stroke.kind === "level" ? stroke.first[2] : (stroke.curve[crestIndex(stroke)]?.[1] ?? 0);
}

/** The middle of the stroke on the ground, kept apart from the crest handle. */
function movePoint(stroke: Stroke, ground: Ground): Vec3 {
  if (stroke.kind === "level") {
    const { centre } = shapeOf(stroke);
    return [centre[0], centre[1], stroke.first[2]];
  }
  const u = (stroke.curve[crestIndex(stroke)]?.[0] ?? 0.5) < 0.5 ? 0.7 : 0.3;
  const x = stroke.first[0] + u * (stroke.last[0] - stroke.first[0]);
  const y = stroke.first[1] + u * (stroke.last[1] - stroke.first[1]);
  return [x, y, ground.heightAt(x, y)];
}
