/** Two ops in a row that can travel as one. Pure. */

import { MAX_POINTS_PER_APPEND, type Op } from "../generated/contract.ts";

/** One op with the effect of `a` followed by `b`, or null when there is none within the limits. */
export function mergeOps(a: Op, b: Op): Op | null {
  if (a.type === "stroke.append" && b.type === "stroke.append" && a.stroke === b.stroke) {
    if (b.start > a.start + a.points.length) return null;
    const start = Math.min(a.start, b.start);
    const points = [...a.points.slice(0, Math.max(0, b.start - a.start)), ...b.points];
    return points.length > MAX_POINTS_PER_APPEND ? null : { ...b, start, points };
  }
  if (a.type === "stroke.set" && b.type === "stroke.set" && a.stroke === b.stroke) {
    // A lock in between has an order of its own: a locked stroke takes nothing but its unlocking.
    if (a.fields.locked !== undefined || b.fields.locked !== undefined) return null;
    return { ...b, fields: { ...a.fields, ...b.fields } };
  }
  if (a.type === "stroke.anchor" && b.type === "stroke.anchor" && a.stroke === b.stroke && a.which === b.which)
    return b;
  if (a.type === "layer.set" && b.type === "layer.set" && a.layer === b.layer)
    return { ...b, fields: { ...a.fields, ...b.fields } };
  if (a.type === "terrain.set" && b.type === "terrain.set") return { ...b, fields: { ...a.fields, ...b.fields } };
  return null;
}
