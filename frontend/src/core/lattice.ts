/**
 * Where an elevation grid lies on the terrain (DESIGN 11, paper 2 section 3.1). Pure; float64.
 *
 * Lattice coordinates (u, v) are (col, row) in samples; sample [0, 0] lies at the anchor, rows go north at rotation 0. Names
 * are those of `contract.Layer`, so that a layer is a place. What a grid bends beyond this affine map belongs to its content
 * and is not known here.
 */

import { MAX_GRID_SPACING_M, MAX_VERTICAL_SCALE, MIN_GRID_SPACING_M } from "../generated/contract.ts";
import { clamp, DEG } from "./math.ts";

export type Point = readonly [number, number];

/** The part of a layer that says where it lies: metres and degrees counter-clockwise. */
export interface GridPlace {
  readonly anchor: Point;
  readonly rotation_deg: number;
  /** Metres between samples, along the columns and along the rows. */
  readonly spacing_m: Point;
  readonly scale: number;
  readonly lift_m: number;
}

export interface GridShape {
  readonly rows: number;
  readonly cols: number;
}

/** World position of a lattice point. */
export function latticePoint(place: GridPlace, u: number, v: number): Point {
  const [x, y] = [u * place.spacing_m[0], v * place.spacing_m[1]];
  const [c, s] = turn(place.rotation_deg);
  return [place.anchor[0] + c * x - s * y, place.anchor[1] + s * x + c * y];
}

/** Lattice coordinates of a world position. */
export function latticeOf(place: GridPlace, x: number, y: number): Point {
  const [dx, dy] = [x - place.anchor[0], y - place.anchor[1]];
  const [c, s] = turn(place.rotation_deg);
  return [(c * dx + s * dy) / place.spacing_m[0], (-s * dx + c * dy) / place.spacing_m[1]];
}

/** Lattice coordinates of the corners, counter-clockwise from sample [0, 0]. */
export function latticeCorners({ rows, cols }: GridShape): readonly [Point, Point, Point, Point] {
  return [
    [0, 0],
    [cols - 1, 0],
    [cols - 1, rows - 1],
    [0, rows - 1],
  ];
}

/** World positions of the corner samples, counter-clockwise from sample [0, 0]. */
export function cornersOf(shape: GridShape, place: GridPlace): Point[] {
  return latticeCorners(shape).map(([u, v]) => latticePoint(place, u, v));
}

export function centreOf({ rows, cols }: GridShape, place: GridPlace): Point {
  return latticePoint(place, (cols - 1) / 2, (rows - 1) / 2);
}

/** Width and height on the ground between the outer samples, metres. */
export function extentOf({ rows, cols }: GridShape, place: GridPlace): Point {
  return [(cols - 1) * place.spacing_m[0], (rows - 1) * place.spacing_m[1]];
}

/** Says whether a world position lies on the grid. */
export function covers(shape: GridShape, place: GridPlace, x: number, y: number): boolean {
  const [u, v] = latticeOf(place, x, y);
  return u >= 0 && v >= 0 && u <= shape.cols - 1 && v <= shape.rows - 1;
}

export function moved(place: GridPlace, dx: number, dy: number): GridPlace {
  return { ...place, anchor: [place.anchor[0] + dx, place.anchor[1] + dy] };
}

/** Returns the place laid so that its lattice point (u, v) is at a world position. */
export function pinned(place: GridPlace, u: number, v: number, [x, y]: Point): GridPlace {
  const at = latticePoint(place, u, v);
  return moved(place, x - at[0], y - at[1]);
}

/** Returns the place turned about its middle to a rotation in degrees counter-clockwise. */
export function turned(shape: GridShape, place: GridPlace, rotationDeg: number): GridPlace {
  const middle = centreOf(shape, place);
  const next = { ...place, rotation_deg: wrapDegrees(rotationDeg) };
  return pinned(next, (shape.cols - 1) / 2, (shape.rows - 1) / 2, middle);
}

/**
 * Returns the place with another spacing; its lattice point (u, v) stays where it is. Spacings are kept within the
 * contract's bounds.
 */
export function respaced(place: GridPlace, spacing: Point, u: number, v: number): GridPlace {
  const fixed = latticePoint(place, u, v);
  const within = (step: number): number => clamp(step, MIN_GRID_SPACING_M, MAX_GRID_SPACING_M);
  return pinned({ ...place, spacing_m: [within(spacing[0]), within(spacing[1])] }, u, v, fixed);
}

/**
 * Returns the place as large as the terrain holds, in its present direction and proportions, in the middle of the
 * terrain.
 */
export function fitted(shape: GridShape, place: GridPlace, sizeM: number, share = 1): GridPlace {
  const [wide, tall] = extentOf(shape, place);
  const [c, s] = turn(place.rotation_deg).map(Math.abs) as [number, number];
  const k = (share * sizeM) / Math.max(c * wide + s * tall, s * wide + c * tall);
  const [u, v] = [(shape.cols - 1) / 2, (shape.rows - 1) / 2];
  const scaled = respaced(place, [k * place.spacing_m[0], k * place.spacing_m[1]], u, v);
  return pinned(scaled, u, v, [sizeM / 2, sizeM / 2]);
}

/**
 * Where a grid lies before anybody has laid it: in the middle of the terrain, with its own spacing if it has one that fits,
 * else on a share of the terrain.
 */
export function firstPlace(
  shape: GridShape,
  sizeM: number,
  spacing: Point | null,
  rotationDeg = 0,
  share = 1,
): GridPlace {
  const place: GridPlace = {
    anchor: [0, 0],
    rotation_deg: wrapDegrees(rotationDeg),
    spacing_m: spacing ?? [1, 1],
    scale: 1,
    lift_m: 0,
  };
  const [wide, tall] = extentOf(shape, place);
  if (spacing === null || Math.max(wide, tall) > 4 * sizeM) return fitted(shape, place, sizeM, share);
  return pinned(place, (shape.cols - 1) / 2, (shape.rows - 1) / 2, [sizeM / 2, sizeM / 2]);
}

/** Short numbers for the wire: a millimetre, a thousandth of a degree, seven digits of a spacing. */
export function rounded(place: GridPlace): GridPlace {
  const mm = (v: number): number => Math.round(v * 1000) / 1000;
  const fine = (v: number): number => Number(v.toPrecision(9));
  return {
    anchor: [mm(place.anchor[0]), mm(place.anchor[1])],
    rotation_deg: mm(wrapDegrees(place.rotation_deg)),
    spacing_m: [fine(place.spacing_m[0]), fine(place.spacing_m[1])],
    scale: clamp(fine(place.scale), -MAX_VERTICAL_SCALE, MAX_VERTICAL_SCALE),
    lift_m: mm(place.lift_m),
  };
}

export function samePlace(a: GridPlace, b: GridPlace): boolean {
  return (
    a.anchor[0] === b.anchor[0] &&
    a.anchor[1] === b.anchor[1] &&
    a.rotation_deg === b.rotation_deg &&
    a.spacing_m[0] === b.spacing_m[0] &&
    a.spacing_m[1] === b.spacing_m[1] &&
    a.scale === b.scale &&
    a.lift_m === b.lift_m
  );
}

/** An angle in degrees, brought into (-180, 180]. */
export function wrapDegrees(angle: number): number {
  const wrapped = ((((angle + 180) % 360) + 360) % 360) - 180;
  return wrapped === -180 ? 180 : wrapped;
}

/** Cosine and sine, exact at right angles, so that a grid that is not turned keeps straight coordinates. */
function turn(deg: number): Point {
  if (deg % 90 === 0) {
    const quarter = (((deg / 90) % 4) + 4) % 4;
    return [[1, 0, -1, 0][quarter]!, [0, 1, 0, -1][quarter]!];
  }
  return [Math.cos(deg * DEG), Math.sin(deg * DEG)];
}
