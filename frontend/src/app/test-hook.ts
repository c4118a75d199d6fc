/**
 * `window.esker`: what the page shows, readable from outside. Read-only; for end-to-end tests, for measuring and for the
 * curious in the console. docs/user-guide.md lists it.
 */

import type { GridPlace } from "../core/lattice.ts";
import type { AreaFigures } from "../core/measure/area.ts";
import { isImpossible, lengthM } from "../core/measure/places.ts";
import type { CameraState, FrameStats } from "../core/types.ts";
import { type Layer, type PaintChannel, type Stroke, TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";
import type { Attributes } from "../tiles/detail/detail.ts";
import { orderedLayers } from "./layers/layers.ts";
import { importingWords } from "./layers/others.ts";
import { placeOf } from "./layers/placing.ts";
import type { TerrainSession } from "./session.ts";

export interface PageView {
  /** Connected, the ground has come and a frame was drawn. */
  ready(): boolean;
  /** Height in metres of the solved ground as shown, without detail, or null before it has come. */
  heightAt(x: number, y: number): number | null;
  /** Height in metres of the ground as drawn, with synthesised detail down to cells of `cellM` metres. */
  shownAt(x: number, y: number, cellM?: number): number | null;
  /** Attributes of a place, shares 0..1: what grows and lies there; null before the ground has come. */
  attributesAt(x: number, y: number): Attributes | null;
  /** The value that strokes ask of a channel at a place: metres of amplitude, roughness 0..1, biases -1..1. */
  channelAt(channel: PaintChannel, x: number, y: number): number | null;
  /** Level of the finest tile held at a place, -1 before the ground has come. */
  levelAt(x: number, y: number): number;
  /** Noise amplitude in metres and roughness 0..1 that the strokes ask for at a place, or null before they have come. */
  amplitudeAt(x: number, y: number): number | null;
  roughnessAt(x: number, y: number): number | null;
  /** Finest level that is solved everywhere, finest to which tiles are refined. */
  levels(): { solved: number; finest: number } | null;
  /** Tiles that the server is still refining for somebody. */
  refining(): number;
  /** The server's last sentence about its solver, if nobody has read it away. */
  notice(): string | null;
  /** Document clock as confirmed here. */
  clock(): number | null;
  /** The solver has finished for the present clock and nothing of mine is on its way. */
  settled(): boolean;
  /** The clock that is shown instead of now, once its document is here. */
  historyClock(): number | null;
  /** Entries of the activity log, newest first, as far as it was read. */
  history(): string[];
  /** My operations that are not yet in the server's journal. */
  pending(): number;
  strokes(): Stroke[];
  /** Elevation layers, the most believed first. */
  layers(): Layer[];
  /** Elevation files that I bring in. */
  imports(): { file: string; phase: string; share: number; problem: string }[];
  /** Imports of other people, as the server tells of them. */
  importing(): string[];
  /** Where handles are in the window, CSS pixels. */
  handles(): { kind: string; x: number; y: number }[];
  /** The elevation grid that is being placed by hand. */
  placing(): (GridPlace & { id: string }) | null;
  /** What is measured, and its figures in metres; null: nothing, or it cannot be. */
  profile(): { lengthM: number; min: number; max: number; gain: number; points: number } | null;
  area(): AreaFigures | null;
  /** The rivers that the server found last, metres; null before. */
  rivers(): { clock: number; settled: boolean; lines: number[][][] } | null;
  /** What the water tool found at its place; null while it is put away, or has not looked yet. */
  water(): WaterFigures | null;
  /** How far the terrain is with its task; null: nothing is scored. */
  score(): { points: number; text: string } | null;
  title(): string;
  role(): string | null;
  members(): string[];
  connection(): string;
  status(): string;
  selection(): string | null;
  tool(): string | null;
  renderer(): string | null;
  camera(): Pick<CameraState, "mode" | "eye" | "target" | "fovDeg" | "orthoHeight" | "width" | "height"> | null;
  /** CSS pixels of the window for a point of the world. */
  project(x: number, y: number, z: number): { x: number; y: number; visible: boolean } | null;
  /** Greatest step between neighbouring held tiles of a level along the edges that they share, metres: 0 means no crack. */
  seams(): number;
  /** Tiles held, how many of them are exact, and how many there are of each level. */
  tiles(): { held: number; exact: number; levels: number[] };
  stats(): FrameStats | null;
  /** Frames drawn so far. */
  readonly frames: number;
}

/** Metres, square metres, cubic metres; null where there is no place, or where the view shows something else. */
export interface WaterFigures {
  readonly view: string;
  readonly way: { readonly lengthM: number; readonly ends: string; readonly lakes: number } | null;
  readonly shedM2: number | null;
  readonly peak: number | null;
  readonly flood: { readonly levelM: number | null; readonly volumeM3: number; readonly runsOffM3: number } | null;
  readonly seaM2: number | null;
  readonly drops: number;
  /** How deep water stands at the place. */
  readonly depthM: number | null;
}

declare global {
  interface Window {
    esker?: PageView;
  }
}

/** Puts the view of a session on the window; the result takes it away again. */
export function installTestHook(session: TerrainSession): () => void {
  const stage = () => session.stage.peek();
  const doc = () => session.doc.doc.peek();
  const view: PageView = {
    ready: () => session.connection.state.peek() === "online" && (stage()?.tiles.size ?? 0) > 0 && view.frames > 0,
    heightAt: (x, y) => ((stage()?.tiles.size ?? 0) > 0 ? (stage()?.tiles.ground.heightAt(x, y) ?? null) : null),
    shownAt: (x, y, cellM) =>
      (stage()?.tiles.size ?? 0) > 0 ? (stage()?.shown.ground.heightAt(x, y, cellM) ?? null) : null,
    attributesAt: (x, y) => stage()?.shown.attributesAt(x, y) ?? null,
    channelAt: (channel, x, y) => stage()?.channels.valueAt(channel, x, y) ?? null,
    levelAt: (x, y) => finestLevel(session, x, y),
    amplitudeAt: (x, y) => stage()?.channels.amplitudeAt(x, y) ?? null,
    roughnessAt: (x, y) => stage()?.channels.roughnessAt(x, y) ?? null,
    levels: () => {
      const tiles = stage()?.tiles;
      return tiles ? { solved: tiles.solved, finest: tiles.levels } : null;
    },
    refining: () => session.progress.peek()?.refining ?? 0,
    notice: () => session.notice.peek(),
    clock: () => session.doc.clock,
    settled: () => {
      const progress = session.progress.peek();
      const clock = session.historyView.active.peek() ? session.historyView.shown.peek() : session.doc.clock;
      return (
        session.doc.pending.peek() === 0 && progress?.settled === true && progress.clock === clock && allExact(session)
      );
    },
    historyClock: () => session.historyView.shown.peek(),
    history: () => session.history.entries.peek().map((e) => `${session.history.nameOf(e.author)} ${e.text}`),
    pending: () => session.doc.pending.peek(),
    strokes: () => [...(doc()?.strokes.values() ?? [])],
    layers: () => orderedLayers(doc()?.layers.values() ?? []),
    imports: () =>
      (stage()?.groundwork.imports.jobs.peek() ?? []).map(({ file, phase, share, problem }) => ({
        file,
        phase,
        share,
        problem,
      })),
    importing: () => (stage()?.groundwork.others.list.peek() ?? []).map(importingWords),
    handles: () =>
      (stage()?.input.handles.peek() ?? []).map(({ kind, position }) => ({ kind, ...stage()!.box.toWindow(position) })),
    placing: () => {
      const placing = stage()?.input.placing.peek();
      return placing ? { id: placing.id, ...placeOf(placing.place.peek()) } : null;
    },
    profile: () => {
      const found = stage()?.instruments.profile.peek() ?? null;
      if (found === null || isImpossible(found)) return null;
      const { lengthM, min, max, gainM, corners } = found;
      return { lengthM, min: min.m, max: max.m, gain: gainM, points: corners.length };
    },
    area: () => {
      const found = stage()?.instruments.area.peek() ?? null;
      return found === null || isImpossible(found) ? null : found;
    },
    rivers: () => {
      const [found, settings] = [session.rivers.peek(), doc()?.settings];
      if (found === null || settings === undefined) return null;
      const cellM = settings.size_m / (TILE_CELLS << found.level);
      const lines = found.rivers.map(({ cells }) => pairs(Array.from(cells, (v) => v * cellM)));
      return { clock: found.clock, settled: found.settled, lines };
    },
    water: () => waterFigures(session),
    score: () => {
      const found = session.score.peek();
      return found === null ? null : { points: found.points ?? 0, text: found.text ?? "" };
    },
    title: () => doc()?.settings.title ?? "",
    role: () => session.role.peek(),
    members: () => session.members.peek().map((m) => m.name),
    connection: () => session.connection.state.peek(),
    status: () => session.status.peek().text,
    selection: () => stage()?.input.selection.peek() ?? null,
    tool: () => stage()?.input.tool.peek() ?? null,
    renderer: () => stage()?.graphics.info.peek()?.kind ?? null,
    camera: () => {
      const state = stage()?.camera.state.peek();
      if (!state) return null;
      const { mode, eye, target, fovDeg, orthoHeight, width, height } = state;
      return { mode, eye, target, fovDeg, orthoHeight, width, height };
    },
    project: (x, y, z) => stage()?.box.toWindow([x, y, z]) ?? null,
    seams: () => greatestStep(session),
    tiles: () => ({ held: stage()?.tiles.size ?? 0, exact: count(session), levels: byLevel(session) }),
    stats: () => stage()?.stats.peek() ?? null,
    get frames() {
      return stage()?.loop.frames ?? 0;
    },
  };
  window.esker = view;
  return () => {
    if (window.esker === view) delete window.esker;
  };
}

function pairs(flat: readonly number[]): number[][] {
  return flat.flatMap((v, k) => (k % 2 === 0 ? [[v, flat[k + 1]!]] : []));
}

function waterFigures(session: TerrainSession): WaterFigures | null {
  const water = session.stage.peek()?.water;
  if (!water?.isOpen.peek() || water.found.peek() === null) return null;
  const [way, flood] = [water.way.peek(), water.flood.peek()];
  return {
    view: water.view.peek(),
    way: way && { lengthM: lengthM(way.points), ends: way.ends, lakes: way.lakes },
    shedM2: water.shed.peek()?.areaM2 ?? null,
    peak: water.gauge.peek()?.peak.flow ?? null,
    flood: flood && {
      levelM: flood.lakes[0]?.levelM ?? null,
      volumeM3: flood.lakes.reduce((sum, lake) => sum + lake.volumeM3, 0),
      runsOffM3: flood.runsOffM3,
    },
    seaM2: water.sea.peek()?.areaM2 ?? null,
    drops: water.shower.drops,
    depthM: water.depthM.peek(),
  };
}

function greatestStep(session: TerrainSession): number {
  const tiles = session.stage.peek()?.tiles;
  let most = 0;
  for (const { level, x, y, heights } of tiles?.tiles() ?? []) {
    const [east, north] = [tiles?.tile(level, x + 1, y)?.heights, tiles?.tile(level, x, y + 1)?.heights];
    for (let k = 0; k < TILE_SAMPLES; k++) {
      const [right, top] = [k * TILE_SAMPLES + TILE_SAMPLES - 1, TILE_SAMPLES * (TILE_SAMPLES - 1) + k];
      if (east) most = Math.max(most, Math.abs(heights[right]! - east[k * TILE_SAMPLES]!));
      if (north) most = Math.max(most, Math.abs(heights[top]! - north[k]!));
    }
  }
  return most;
}

function count(session: TerrainSession): number {
  let exact = 0;
  for (const tile of session.stage.peek()?.tiles.tiles() ?? []) if (tile.exact) exact++;
  return exact;
}

function byLevel(session: TerrainSession): number[] {
  const counts: number[] = [];
  for (const { level } of session.stage.peek()?.tiles.tiles() ?? []) {
    while (counts.length <= level) counts.push(0);
    counts[level]! += 1;
  }
  return counts;
}

function allExact(session: TerrainSession): boolean {
  const tiles = session.stage.peek()?.tiles;
  return tiles === undefined || (tiles.settled && count(session) === tiles.size);
}

function finestLevel(session: TerrainSession, x: number, y: number): number {
  const tiles = session.stage.peek()?.tiles;
  if (!tiles) return -1;
  for (let level = tiles.levels; level >= 0; level--) {
    const n = 2 ** level;
    const at = (v: number) => Math.min(n - 1, Math.max(0, Math.floor((v / tiles.sizeM) * n)));
    if (tiles.tile(level, at(x), at(y))) return level;
  }
  return -1;
}
