/**
 * Decides whether two scenes show the same picture. The app builds scenes anew each frame, so values count, not
 * identity.
 */

import type { CameraState, CursorVisual, FootprintVisual, GhostVisual, Scene, StrokeVisual } from "../core/types.ts";

function sameNumbers(a: ArrayLike<number>, b: ArrayLike<number>): boolean {
  if (a === b) return true;
  if (a.length !== b.length) return false;
  for (let i = 0; i < a.length; i += 1) if (a[i] !== b[i]) return false;
  return true;
}

function sameList<T>(a: readonly T[], b: readonly T[], same: (x: T, y: T) => boolean): boolean {
  return a === b || (a.length === b.length && a.every((x, i) => x === b[i] || same(x, b[i]!)));
}

function sameCamera(a: CameraState, b: CameraState): boolean {
  if (a === b) return true;
  // Far from the origin small steps of the eye leave the float32 matrix as it was.
  return (
    a.width === b.width && a.height === b.height && sameNumbers(a.viewProj, b.viewProj) && sameNumbers(a.eye, b.eye)
  );
}

function sameStroke(a: StrokeVisual, b: StrokeVisual): boolean {
  return (
    a.id === b.id &&
    a.selected === b.selected &&
    a.hovered === b.hovered &&
    a.live === b.live &&
    a.calm === b.calm &&
    sameNumbers(a.colour, b.colour) &&
    sameNumbers(a.points, b.points)
  );
}

function sameCursor(a: CursorVisual, b: CursorVisual): boolean {
  return a.radiusPx === b.radiusPx && sameNumbers(a.position, b.position) && sameNumbers(a.colour, b.colour);
}

function sameFootprint(a: FootprintVisual, b: FootprintVisual): boolean {
  return (
    a.strong === b.strong &&
    a.halfWidthPx === b.halfWidthPx &&
    sameNumbers(a.colour, b.colour) &&
    sameNumbers(a.points, b.points)
  );
}

function sameGhost(a: GhostVisual | null, b: GhostVisual | null): boolean {
  if (a === null || b === null) return a === b;
  return (
    a === b ||
    (sameNumbers(a.shadow, b.shadow) &&
      sameNumbers(a.colour, b.colour) &&
      a.corners.every((corner, i) => sameNumbers(corner, b.corners[i]!)))
  );
}

function sameSurface(a: Scene["surface"], b: Scene["surface"]): boolean {
  return a === b || (a?.materials === b?.materials && a?.shade === b?.shade && a?.instances === b?.instances);
}

function sameSettings(a: Scene["settings"], b: Scene["settings"]): boolean {
  return (
    a === b ||
    (a.look === b.look &&
      a.sea_level_m === b.sea_level_m &&
      a.lakes_m === b.lakes_m &&
      a.seed === b.seed &&
      a.detail === b.detail &&
      a.rule === b.rule &&
      a.erosion === b.erosion &&
      a.erosion_scale === b.erosion_scale &&
      a.hold === b.hold &&
      a.sun_azimuth_deg === b.sun_azimuth_deg &&
      a.sun_elevation_deg === b.sun_elevation_deg)
  );
}

/** True when `b`, with its store at `stampB`, shows what `a` showed at `stampA`; time is left out. */
export function samePicture(a: Scene, stampA: number, b: Scene, stampB: number): boolean {
  return (
    a.tiles === b.tiles &&
    stampA === stampB &&
    a.channels === b.channels &&
    a.tauPx === b.tauPx &&
    a.overlay === b.overlay &&
    ((a.overlay !== "influence" && a.overlay !== "watershed") || a.influence === b.influence) &&
    (a.drops ?? null)?.stamp === (b.drops ?? null)?.stamp &&
    (a.flood ?? null) === (b.flood ?? null) &&
    (a.rivers ?? null) === (b.rivers ?? null) &&
    a.showStrokes === b.showStrokes &&
    a.contourM === b.contourM &&
    a.lineScale === b.lineScale &&
    sameSurface(a.surface, b.surface) &&
    sameCamera(a.camera, b.camera) &&
    sameSettings(a.settings, b.settings) &&
    sameGhost(a.ghost, b.ghost) &&
    (a.placing ?? null) === (b.placing ?? null) &&
    sameList(a.footprints ?? [], b.footprints ?? [], sameFootprint) &&
    sameList(a.cursors, b.cursors, sameCursor) &&
    sameList(a.strokes, b.strokes, sameStroke)
  );
}
