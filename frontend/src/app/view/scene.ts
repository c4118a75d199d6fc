/** From the document and the people to what one frame shows. Pure apart from a cache keyed by immutable strokes. */

import type { CursorVisual, Ground, StrokeVisual, Vec3 } from "../../core/types.ts";
import type { Doc } from "../../doc/document.ts";
import { worldPoints } from "../../doc/strokes.ts";
import type { Member, MemberPresence, Stroke } from "../../generated/contract.ts";
import { drapedOf } from "../../input/picking.ts";
import { hexColour, lighten, paintColour, strokeColour, withAlpha } from "./colours.ts";

interface Shape {
  readonly points: Float32Array;
  readonly sinks: boolean;
}

const shapes = new WeakMap<Stroke, Shape>();

/** World points of a stroke's crest and whether it lies below the line between its anchors. */
export function shapeOf(stroke: Stroke): Shape {
  const known = shapes.get(stroke);
  if (known) return known;
  const shape: Shape = { points: new Float32Array(worldPoints(stroke)), sinks: meanHeight(stroke) < 0 };
  shapes.set(stroke, shape);
  return shape;
}

function meanHeight(stroke: Stroke): number {
  if (stroke.kind !== "profile" || stroke.curve.length === 0) return 0;
  return stroke.curve.reduce((sum, point) => sum + point[1], 0) / stroke.curve.length;
}

/** Greatest height of the crest over (or, negative, under) the line between the anchors, metres. */
export function reliefOf(stroke: Stroke): number {
  if (stroke.kind !== "profile") return 0;
  return stroke.curve.reduce((peak, point) => (Math.abs(point[1]) > Math.abs(peak) ? point[1] : peak), 0);
}

export interface People {
  readonly members: readonly Member[];
  readonly presences: ReadonlyMap<string, MemberPresence>;
  /** Me: my own cursor is not drawn. */
  readonly me: string;
  readonly myColour: string;
}

/** Lines of paint on the ground, for as long as neither stroke nor ground changes: renderers know lines by their array. */
const painted = new WeakMap<
  Stroke,
  { readonly ground: Ground; readonly near: boolean; readonly points: Float32Array }
>();

/** The line of a paint stroke: on the ground with its detail where one looks at it, else on the solved one, which is cheap. */
function paintedLine(stroke: Stroke, ground: Ground, near: boolean): Float32Array {
  const known = painted.get(stroke);
  if (known?.ground === ground && known.near === near) return known.points;
  const line = drapedOf(stroke, ground).points;
  const points = new Float32Array(line);
  if (near) for (let i = 0; i < points.length; i += 3) points[i + 2] = ground.heightAt(line[i]!, line[i + 1]!);
  painted.set(stroke, { ground, near, points });
  return points;
}

/** How strongly finished strokes show that nobody points at: the land comes first. */
const CALM_ALPHA = { select: 0.2, draw: 0.12 } as const;
/** How strongly they show for people who chose lines that are easily seen. */
const CLEAR_ALPHA = { select: 0.5, draw: 0.3 } as const;
/** Share of the domain's size by which a line may leave it and still be seen. */
const OUTSIDE = 0.02;

export interface Marks {
  /** In the select tool one looks for strokes, so they show more; lines of paint show with the brush only. */
  readonly tool: "select" | "paint" | "draw";
  readonly selection: string | null;
  readonly hovered: string | null;
  /** The stroke that I am drawing. */
  readonly drawing: string | null;
  /** Nobody has asked for strokes yet: only those show that are selected, pointed at or under way. */
  readonly quiet?: boolean;
  /** Finished strokes are easily seen too: a choice of the device. */
  readonly clear?: boolean;
}

/** Returns the person who draws each stroke at this moment, as colours by stroke id. */
function liveColours(people: People, drawing: string | null): Map<string, string> {
  const colours = new Map<string, string>();
  for (const member of people.members) {
    const stroke = people.presences.get(member.client)?.stroke;
    if (stroke) colours.set(stroke, member.colour);
  }
  if (drawing) colours.set(drawing, people.myColour);
  return colours;
}

/** Returns the person, of the others, who draws or drags each stroke. */
export function holders(people: People): { readonly member: Member; readonly stroke: string }[] {
  return people.members.flatMap((member) => {
    const stroke = people.presences.get(member.client)?.stroke;
    return stroke && member.client !== people.me ? [{ member, stroke }] : [];
  });
}

const inside = new WeakMap<Float32Array, Float32Array>();

/** The points of a line that lie in the domain, give or take 2 % of its size; the line itself when all do. */
export function insidePoints(points: Float32Array, sizeM: number): Float32Array {
  const known = inside.get(points);
  if (known) return known;
  const [low, high] = [-OUTSIDE * sizeM, (1 + OUTSIDE) * sizeM];
  const within = (i: number): boolean =>
    points[i]! >= low && points[i]! <= high && points[i + 1]! >= low && points[i + 1]! <= high;
  const kept: number[] = [];
  for (let i = 0; i + 2 < points.length; i += 3) if (within(i)) kept.push(points[i]!, points[i + 1]!, points[i + 2]!);
  const result = kept.length === points.length ? points : new Float32Array(kept);
  inside.set(points, result);
  return result;
}

/**
 * The strokes to draw. Hidden ones show only while selected; the one under way wears its author's colour; finished ones
 * that are neither selected nor pointed at step back behind the land.
 */
export function strokeVisuals(doc: Doc, marks: Marks, people: People, ground: Ground): StrokeVisual[] {
  const live = liveColours(people, marks.drawing);
  const out: StrokeVisual[] = [];
  for (const stroke of doc.strokes.values()) {
    const selected = stroke.id === marks.selection;
    if (stroke.curve.length < 2 || (stroke.hidden && !selected)) continue;
    const author = live.get(stroke.id);
    const hovered = stroke.id === marks.hovered;
    const calm = stroke.finished && !selected && !hovered && !author;
    if (calm && (marks.quiet || (stroke.paint !== null && marks.tool !== "paint"))) continue;
    const { points: straight, sinks } = shapeOf(stroke);
    const all = stroke.paint === null ? straight : paintedLine(stroke, ground, !calm);
    const points = insidePoints(all, doc.settings.size_m);
    if (points.length < 6) continue;
    const base = author
      ? hexColour(author)
      : stroke.paint
        ? paintColour(stroke.paint)
        : strokeColour(stroke.kind, sinks, stroke.course?.use);
    const alpha = calm ? calmAlpha(marks, stroke) : 1;
    out.push({
      id: stroke.id,
      kind: stroke.kind,
      points,
      colour: withAlpha(hovered && !selected ? lighten(base, 0.3) : base, alpha),
      selected,
      hovered,
      live: author !== undefined,
      calm: calm && marks.clear !== true,
    });
  }
  return out;
}

function calmAlpha({ tool, clear }: Marks, stroke: Stroke): number {
  const looked = tool === "paint" ? stroke.paint !== null : tool === "select";
  return (clear ? CLEAR_ALPHA : CALM_ALPHA)[looked ? "select" : "draw"];
}

/** Rings on the ground where the others point. */
export function cursorVisuals(people: People): CursorVisual[] {
  const out: CursorVisual[] = [];
  for (const member of people.members) {
    const position = cursorOf(people, member.client);
    if (position) out.push({ position, colour: hexColour(member.colour), radiusPx: 9 });
  }
  return out;
}

/** Where another member points, or null: not at the ground, gone, or it is me. */
export function cursorOf(people: People, client: string): Vec3 | null {
  if (client === people.me) return null;
  return people.presences.get(client)?.cursor ?? null;
}

/** Whether the document has lines of paint. */
export function hasPaint(doc: Doc | null): boolean {
  for (const stroke of doc?.strokes.values() ?? []) if (stroke.paint !== null) return true;
  return false;
}
