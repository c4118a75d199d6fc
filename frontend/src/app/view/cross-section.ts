/**
 * The cross-section of a stroke as a picture that can be dragged (DESIGN 5.2, 12). Pure geometry, no DOM.
 *
 * The picture has equal scales, so angles are true. It shows what the stroke prescribes on flat ground: the crest, the
 * flat top of the plateau radius, each flank down to where it meets the base or its extent, whichever is nearer. The
 * scale is that of the profile; an extent that ends outside the picture has its knob at the picture's edge.
 */

import { msg } from "@lit/localize";
import { type Flank, MAX_SLOPE_DEG } from "../../generated/contract.ts";

export interface Section {
  readonly left: Flank | null;
  readonly right: Flank | null;
  readonly plateauRadiusM: number;
  /** Height of the crest over the base, metres; negative for a crevice. */
  readonly reliefM: number;
}

export type Side = "left" | "right";
export type KnobId = `${Side}-slope` | `${Side}-extent` | "plateau";

/** Where the section stands on the picture: pixels, y down. Kept still while a knob is dragged. */
export interface Frame {
  readonly width: number;
  readonly height: number;
  readonly pxPerM: number;
  readonly centreX: number;
  readonly baseY: number;
  readonly crestY: number;
}

export interface Knob {
  readonly id: KnobId;
  readonly x: number;
  readonly y: number;
  readonly value: number;
  readonly unit: "°" | "m";
  readonly label: string;
  /** The value lies outside the picture; the knob stands at its edge. */
  readonly beyond: boolean;
}

export interface SectionLimits {
  readonly maxExtentM: number;
  readonly maxPlateauM: number;
}

const DEG = Math.PI / 180;
const PAD_X = 14;
const PAD_Y = 16;
const SIDES: readonly Side[] = ["left", "right"];

/** The widest horizontal distance that the stroke prescribes anything at, metres. */
function prescribedHalf(section: Section): number {
  const extent = Math.max(section.left?.extent_m ?? 0, section.right?.extent_m ?? 0);
  return Math.max(section.plateauRadiusM + extent, 1);
}

/** How far out a flank is shown, in runs of its slope down to the base: a round shoulder or foot ends at one and a half. */
const ROOM = 1.6;

/** How far out from the crest the profile is worth a look at a relief: past each foot, but not past its extent, metres. */
function profileHalf(section: Section, reliefM: number): number {
  const ends = SIDES.map((side) => {
    const flank = section[side];
    if (flank === null) return 0;
    const tangent = Math.tan((flank.slope_deg ?? 0) * DEG);
    return tangent > 0 ? Math.min(flank.extent_m, (ROOM * Math.abs(reliefM)) / tangent) : flank.extent_m;
  });
  return Math.max(section.plateauRadiusM + Math.max(...ends), 1);
}

/** The relief of the picture: a flat section is drawn with a height that can be dragged. */
function drawnRelief(section: Section): number {
  const extents = SIDES.map((side) => section[side]?.extent_m ?? 0);
  const least = Math.max(Math.abs(section.reliefM), 0.22 * section.plateauRadiusM, 0.02 * Math.max(...extents), 1);
  return Math.max(least, 0.1 * profileHalf(section, least));
}

/** The widest horizontal distance of the picture from the crest line, metres. */
function halfWidth(section: Section): number {
  const relief = drawnRelief(section);
  const ends = SIDES.map((side) => {
    const flank = section[side];
    if (flank !== null && flank.slope_deg === null) return section.plateauRadiusM + flank.extent_m;
    const foot = flank === null ? 0 : footM(flank, relief);
    return section.plateauRadiusM + foot + freeRun(section, side);
  });
  return Math.max(profileHalf(section, relief), ...ends);
}

/** Fits the section into a picture of the given size in pixels. */
export function fitFrame(section: Section, width: number, height: number): Frame {
  const relief = drawnRelief(section);
  const pxPerM = Math.min((width / 2 - PAD_X) / halfWidth(section), (height - 2 * PAD_Y) / relief);
  const sign = section.reliefM < 0 ? -1 : 1;
  const reliefPx = relief * pxPerM;
  const baseY = height / 2 + (sign * reliefPx) / 2;
  return { width, height, pxPerM, centreX: width / 2, baseY, crestY: baseY - sign * reliefPx };
}

/** Shares of the crest height that a round shoulder and a round foot take, as the solver has them (SOFT_PART). */
function rounding(flank: Flank): { readonly shoulder: number; readonly foot: number } {
  return { shoulder: flank.shape === "convex" ? 0.5 : 0, foot: flank.shape === "concave" ? 0.5 : 0 };
}

/** Horizontal distance from the edge of the plateau to where the band of a flank ends, metres. */
export function footM(flank: Flank, reliefM: number): number {
  if (flank.slope_deg === null) return flank.extent_m;
  const { shoulder, foot } = rounding(flank);
  const tangent = Math.tan(flank.slope_deg * DEG);
  return tangent > 0 ? Math.min(flank.extent_m, ((1 + shoulder + foot) * Math.abs(reliefM)) / tangent) : flank.extent_m;
}

/**
 * Height of a flank over the base as a share of the relief, `t` metres out from the plateau's edge: a parabolic
 * shoulder, a straight part of the prescribed slope, a parabolic foot (backend/esker/solve/constraints/raster_reference.py).
 */
export function flankShare(flank: Flank, reliefM: number, t: number): number {
  if (flank.slope_deg === null) {
    const u = flank.extent_m > 0 ? Math.min(Math.max(t / flank.extent_m, 0), 1) : 1;
    return 1 - u * u * (3 - 2 * u);
  }
  const { shoulder: k, foot: f } = rounding(flank);
  // In units of the relief: x is the distance in which the straight slope would fall by the whole relief.
  const x = (Math.max(t, 0) * Math.tan(flank.slope_deg * DEG)) / Math.max(Math.abs(reliefM), 1e-9);
  const rest = Math.max(1 + k + f - x, 0);
  if (x < 2 * k) return 1 - (x * x) / (4 * k);
  if (rest < 2 * f) return (rest * rest) / (4 * f);
  return Math.max(1 + k - x, 0);
}

/** The slope, degrees, whose flank stands at a share 0..1 of the relief `t` metres out: the inverse of `flankShare`. */
export function slopeThrough(flank: Flank, reliefM: number, t: number, share: number): number {
  const { shoulder: k, foot: f } = rounding(flank);
  const z = Math.min(Math.max(share, 0), 1);
  const x = z > 1 - k ? 2 * Math.sqrt(k * (1 - z)) : z < f ? 1 + k + f - 2 * Math.sqrt(f * z) : 1 + k - z;
  return Math.atan2(x * Math.abs(reliefM), Math.max(t, 1e-6)) / DEG;
}

/** Where the slope knob sits: the middle of the straight part, within the band. */
function slopeKnobM(flank: Flank, slopeDeg: number, reliefM: number): number {
  const { shoulder: k, foot: f } = rounding(flank);
  const tangent = Math.max(Math.tan(slopeDeg * DEG), 1e-9);
  return Math.min((((1 + 3 * k - f) / 2) * Math.abs(reliefM)) / tangent, 0.9 * flank.extent_m);
}

function reliefOf(frame: Frame): number {
  return (frame.baseY - frame.crestY) / frame.pxPerM;
}

type Points = [number, number][];

interface Half {
  /** Returns the profile that the stroke prescribes, from the crest outwards. */
  readonly firm: Points;
  /** From there to the base: what the diffusion decides, drawn as a soft fall. */
  readonly free: Points;
}

const CURVE_STEPS = 16;

function half(section: Section, frame: Frame, side: Side): Half {
  const dir = side === "left" ? -1 : 1;
  const relief = reliefOf(frame);
  const edge = section.plateauRadiusM;
  const flank = section[side];
  const at = (m: number, share: number): [number, number] => [
    frame.centreX + dir * m * frame.pxPerM,
    frame.baseY - share * relief * frame.pxPerM,
  ];
  const firm = [at(0, 1), at(edge, 1)];
  let end = edge;
  let share = 1;
  if (flank !== null && flank.slope_deg !== null) {
    const foot = footM(flank, relief);
    for (let i = 1; i <= CURVE_STEPS; i++) {
      const t = (foot * i) / CURVE_STEPS;
      firm.push(at(edge + t, flankShare(flank, relief, t)));
    }
    end = edge + foot;
    share = flankShare(flank, relief, foot);
  }
  const run = flank !== null && flank.slope_deg === null ? flank.extent_m : freeRun(section, side);
  const free: Points = [];
  for (let i = 0; i <= CURVE_STEPS; i++) {
    const u = i / CURVE_STEPS;
    free.push(at(end + run * u, share * (1 - u * u * (3 - 2 * u))));
  }
  return { firm, free };
}

/** How far the soft fall beyond a side runs in the picture, metres: about as far as it falls, within bounds. */
function freeRun(section: Section, side: Side): number {
  const flank = section[side];
  const relief = drawnRelief(section);
  const share = flank === null ? 1 : flankShare(flank, relief, footM(flank, relief));
  return share * Math.min(relief, 0.6 * (prescribedHalf(section) + relief));
}

export interface Outline {
  /** The land, closed, to be filled. */
  readonly land: string;
  /** The prescribed surface. */
  readonly firm: string;
  /** The surface that the diffusion decides. */
  readonly free: string;
}

/** The paths of the section. */
export function outline(section: Section, frame: Frame): Outline {
  const left = half(section, frame, "left");
  const right = half(section, frame, "right");
  const text = (points: Points): string => points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join(" L");
  const reversed = (points: Points): Points => [...points].reverse();
  return {
    land: `M${text([...reversed(left.free), ...reversed(left.firm), ...right.firm, ...right.free])} Z`,
    firm: `M${text([...reversed(left.firm), ...right.firm])}`,
    free: `M${text(left.free)} M${text(right.free)}`,
  };
}

/** The knobs of the section. A side without a flank has none; a side whose slope is free has no slope knob. */
export function knobs(section: Section, frame: Frame): Knob[] {
  const relief = reliefOf(frame);
  const out: Knob[] = [];
  for (const side of SIDES) {
    const flank = section[side];
    if (flank === null) continue;
    const dir = side === "left" ? -1 : 1;
    const edge = section.plateauRadiusM;
    if (flank.slope_deg !== null) {
      const t = slopeKnobM(flank, flank.slope_deg, relief);
      out.push({
        id: `${side}-slope`,
        x: frame.centreX + dir * (edge + t) * frame.pxPerM,
        y: frame.baseY - flankShare(flank, relief, t) * relief * frame.pxPerM,
        value: flank.slope_deg,
        unit: "°",
        label: side === "left" ? msg("Slope left") : msg("Slope right"),
        beyond: false,
      });
    }
    out.push({
      id: `${side}-extent`,
      x: frame.centreX + dir * Math.min((edge + flank.extent_m) * frame.pxPerM, edgePx(frame)),
      y: frame.baseY,
      value: flank.extent_m,
      unit: "m",
      label: side === "left" ? msg("Extent left") : msg("Extent right"),
      beyond: (edge + flank.extent_m) * frame.pxPerM > edgePx(frame) + 0.5,
    });
  }
  out.push({
    id: "plateau",
    x: frame.centreX + section.plateauRadiusM * frame.pxPerM,
    y: frame.crestY,
    value: section.plateauRadiusM,
    unit: "m",
    label: msg("Plateau radius"),
    beyond: false,
  });
  return out;
}

/** Where the picture ends: pixels from its middle. */
function edgePx(frame: Frame): number {
  return frame.width / 2 - PAD_X;
}

/** Pixels past the picture's edge in which an extent doubles. */
const DOUBLING_PX = 16;

/**
 * The extent for a pointer `outPx` from the middle of the picture: to scale within it, faster and faster past its edge.
 * One that ends outside already stays until the pointer comes inside.
 */
function draggedExtent(flank: Flank, plateauM: number, frame: Frame, outPx: number): number {
  const past = outPx - edgePx(frame);
  const t = Math.max(Math.min(outPx, edgePx(frame)) / frame.pxPerM - plateauM, 0);
  if (past < -0.5) return t;
  return Math.max(flank.extent_m, t * 2 ** Math.min(Math.max(past, 0) / DOUBLING_PX, 20));
}

function clamp(x: number, low: number, high: number): number {
  return Math.min(Math.max(x, low), high);
}

function withFlank(section: Section, side: Side, change: Partial<Flank>, linked: boolean): Section {
  const sides = linked ? SIDES : [side];
  let next = section;
  for (const s of sides) {
    const flank = next[s];
    if (flank !== null) next = { ...next, [s]: { ...flank, ...change } };
  }
  return next;
}

/**
 * The section after a knob was moved to (x, y) pixels of a still frame. Linked sides change together. Slopes are whole
 * degrees; lengths are rounded to about a pixel, so that dragging gives numbers one would type.
 */
export function drag(
  section: Section,
  frame: Frame,
  knob: KnobId,
  at: { readonly x: number; readonly y: number },
  linked: boolean,
  limits: SectionLimits,
): Section {
  const relief = Math.abs(reliefOf(frame));
  const out = Math.abs(at.x - frame.centreX) / frame.pxPerM;
  if (knob === "plateau") {
    return {
      ...section,
      plateauRadiusM: clamp(nice((at.x - frame.centreX) / frame.pxPerM, frame), 0, limits.maxPlateauM),
    };
  }
  const [side, what] = knob.split("-") as [Side, "slope" | "extent"];
  const t = Math.max(out - section.plateauRadiusM, 0);
  const flank = section[side];
  if (flank === null) return section;
  if (what === "extent") {
    const extent = draggedExtent(flank, section.plateauRadiusM, frame, out * frame.pxPerM);
    return withFlank(
      section,
      side,
      { extent_m: clamp(nice(extent, frame), nice(2 / frame.pxPerM, frame), limits.maxExtentM) },
      linked,
    );
  }
  const share = 1 - Math.abs(at.y - frame.crestY) / Math.max(Math.abs(frame.baseY - frame.crestY), 1e-9);
  const above = (at.y - frame.crestY) * (frame.baseY - frame.crestY) < 0;
  const slope = slopeThrough(flank, relief, t, above ? 1 : share);
  return withFlank(section, side, { slope_deg: clamp(Math.round(slope), 1, MAX_SLOPE_DEG) }, linked);
}

/** The section after an arrow key on a knob: one degree, or about a hundredth of the picture. */
export function nudge(
  section: Section,
  frame: Frame,
  knob: KnobId,
  steps: number,
  linked: boolean,
  limits: SectionLimits,
): Section {
  const stepM = nice(frame.width / frame.pxPerM / 100, frame);
  if (knob === "plateau") {
    return { ...section, plateauRadiusM: clamp(section.plateauRadiusM + steps * stepM, 0, limits.maxPlateauM) };
  }
  const [side, what] = knob.split("-") as [Side, "slope" | "extent"];
  const flank = section[side];
  if (flank === null) return section;
  if (what === "extent") {
    const step = Math.max(stepM, nice(flank.extent_m / 50, frame)); // one outside the picture moves at its own scale
    return withFlank(
      section,
      side,
      { extent_m: clamp(flank.extent_m + steps * step, stepM, limits.maxExtentM) },
      linked,
    );
  }
  if (flank.slope_deg === null) return section;
  return withFlank(section, side, { slope_deg: clamp(flank.slope_deg + steps, 0, MAX_SLOPE_DEG) }, linked);
}

/** Rounds a length to the power of ten below one pixel, at least a tenth of a metre. */
function nice(m: number, frame: Frame): number {
  const step = Math.max(10 ** Math.floor(Math.log10(1 / frame.pxPerM)), 0.1);
  return Math.round(Math.round(m / step) * step * 10) / 10;
}

/** Says whether both flanks are alike, so that the inspector may show one for both. */
export function symmetric(section: Pick<Section, "left" | "right">): boolean {
  const { left, right } = section;
  if (left === null || right === null) return left === right;
  return left.slope_deg === right.slope_deg && left.extent_m === right.extent_m && left.shape === right.shape;
}
