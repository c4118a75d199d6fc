/** The values that a new stroke starts with, per tool: signals that the inspector writes and the stroke tool reads. */

import { type Signal, signal } from "@preact/signals-core";
import type { Course, Flank, Paint, Stroke } from "../generated/contract.ts";
import { DEFAULT_COURSE_GRADE, DEFAULT_EXTENT_FRACTION, DEFAULT_SLOPE_DEG } from "../generated/contract.ts";
import type { CourseStyle } from "./sketch/courseline.ts";
import { brushRadius } from "./tools/painttool.ts";

export type DrawToolId = "mountain" | "crevice" | "plateau";
/** Tools that put strokes on the ground. */
export type PenToolId = DrawToolId | "paint" | "course";

/** Cross-section and noise of the next stroke of a tool. */
export type ToolStyle = Pick<Stroke, "left" | "right" | "plateau_radius_m" | "amplitude_m" | "roughness">;

export interface ToolDefaults {
  readonly mountain: Signal<ToolStyle>;
  readonly crevice: Signal<ToolStyle>;
  readonly plateau: Signal<ToolStyle>;
  /** The brush. */
  readonly paint: Signal<Paint>;
  /** The river, road or ridge that is drawn next. */
  readonly course: Signal<CourseStyle>;
  /** The property that the pressure of a pen changes: the extent of flanks, the radius of the brush. */
  readonly pressure: Signal<"none" | "extent">;
}

const CREVICE_SLOPE_DEG = 50;
const CREVICE_EXTENT_FRACTION = 1 / 4;
const PLATEAU_SLOPE_DEG = 30;
/** Strength of a new brush, and its radius as a share of the terrain. */
const BRUSH_VALUE = 0.8;
const BRUSH_RADIUS = 1 / 40;
/** Share of the extent that is left at no pressure at all. */
const PRESSURE_FLOOR = 0.05;

function style(slopeDeg: number, extentM: number, plateauRadiusM: number): ToolStyle {
  const flank: Flank = { slope_deg: slopeDeg, extent_m: extentM, shape: "concave" };
  return { left: flank, right: { ...flank }, plateau_radius_m: plateauRadiusM, amplitude_m: 0, roughness: 0.5 };
}

/** What a course of a use begins with on a terrain of `sizeM` metres. */
export function courseStyle(use: Course["use"], sizeM: number): CourseStyle {
  const grade = DEFAULT_COURSE_GRADE;
  if (use === "road") return { use, widthM: sizeM / 320, bankM: sizeM / 100, depthM: 0, grade };
  if (use === "ridge") return { use, widthM: 0, bankM: sizeM / 20, depthM: sizeM / 50, grade };
  return { use, widthM: sizeM / 320, bankM: sizeM / 50, depthM: sizeM / 512, grade };
}

/** The defaults for a terrain of `sizeM` metres. */
export function toolDefaults(sizeM: number): ToolDefaults {
  return {
    mountain: signal(style(DEFAULT_SLOPE_DEG, sizeM * DEFAULT_EXTENT_FRACTION, 0)),
    crevice: signal(style(CREVICE_SLOPE_DEG, sizeM * CREVICE_EXTENT_FRACTION, 0)),
    plateau: signal(style(PLATEAU_SLOPE_DEG, sizeM * DEFAULT_EXTENT_FRACTION, sizeM / 40)),
    paint: signal({ channel: "snow", value: BRUSH_VALUE, radius_m: brushRadius(sizeM * BRUSH_RADIUS, sizeM) }),
    course: signal(courseStyle("river", sizeM)),
    pressure: signal("extent"),
  };
}

/**
 * The style with its extents scaled by pen pressure 0..1: full pressure gives them whole, a light touch a slender ridge.
 * The square spreads the light touches, where extents are short enough to end a flank before its slope does.
 */
export function pressed(base: ToolStyle, pressure: number): ToolStyle {
  const k = Math.min(1, PRESSURE_FLOOR + pressure ** 2);
  const scaled = (f: Flank | null): Flank | null =>
    f === null ? null : { ...f, extent_m: Math.round(f.extent_m * k * 10) / 10 };
  return { ...base, left: scaled(base.left), right: scaled(base.right) };
}
