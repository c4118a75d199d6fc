/** Changes of a river, a road or a ridge that was drawn: a point is moved or lifted, its measures change. Pure. */

import type { Ground, Vec3 } from "../../core/types.ts";
import { worldPoints } from "../../doc/strokes.ts";
import type { Course, Op, Stroke, StrokeFields } from "../../generated/contract.ts";
import { bank, type CourseStyle, courseFields, obeying } from "../sketch/courseline.ts";
import { solvedHeight } from "../sketch/strokeops.ts";

/**
 * Ops that bring one point of a course to `to`: a place, where it lies as deep as its style says, or a number of metres by which it
 * is lifted. The other points follow as its use asks: a river goes on falling, a road keeps its grade. None for null.
 */
export function vertexOps(stroke: Stroke, index: number, to: Vec3 | number | null, ground: Ground): Op[] {
  const { course } = stroke;
  const points = worldPoints(stroke);
  if (course === null || to === null || 3 * index >= points.length) return [];
  if (typeof to === "number") points[3 * index + 2]! += to;
  else {
    // The ground beside the line is what the line made of it: there the point keeps its height.
    const away = Math.hypot(to[0] - points[3 * index]!, to[1] - points[3 * index + 1]!);
    const own = stroke.plateau_radius_m + Math.max(stroke.left?.extent_m ?? 0, stroke.right?.extent_m ?? 0);
    const z = away < own ? points[3 * index + 2]! : solvedHeight(ground, to[0], to[1]) + signed(course);
    points.set([to[0], to[1], z], 3 * index);
  }
  return [{ type: "stroke.set", stroke: stroke.id, fields: fieldsOf(points, course) }];
}

/** The fields of a stroke that give it other measures. */
export function restyled(stroke: Stroke, style: CourseStyle): StrokeFields {
  const before = stroke.course!;
  const course = { use: style.use, grade: style.grade, depth_m: style.depthM };
  const side = bank(style.bankM);
  const fields: StrokeFields = {
    left: side,
    right: side === null ? null : { ...side },
    plateau_radius_m: style.widthM / 2,
  };
  const same = before.use === course.use && before.grade === course.grade && before.depth_m === course.depth_m;
  if (same) return fields;
  const points = worldPoints(stroke);
  const deeper = signed(course) - signed(before);
  for (let i = 2; i < points.length; i += 3) points[i]! += deeper;
  return { ...fields, ...fieldsOf(points, course) };
}

/** The depth of a course, which a road has none of. */
function sunk({ use, depth_m }: Pick<Course, "use" | "depth_m">): number {
  return use === "road" ? 0 : depth_m;
}

/** Metres above the ground, by its style. */
function signed(course: Pick<Course, "use" | "depth_m">): number {
  return course.use === "ridge" ? course.depth_m : -sunk(course);
}

function fieldsOf(points: Float64Array, { use, grade, depth_m }: Omit<Course, "rises">): StrokeFields {
  return courseFields(obeying(points, { use, grade }), { use, grade, depth_m });
}
