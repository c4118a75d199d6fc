/**
 * The values that pass between the rooms of the page (DESIGN 2). No DOM, no GPU, no logic.
 *
 * Metres; x east, y north, z up; `[row, col]` with row 0 south.
 */

import type { Stroke, StrokeKind, TerrainSettings } from "../generated/contract.ts";

export type Vec3 = readonly [number, number, number];
export type Rgba = readonly [number, number, number, number];

/** A camera at one moment. `Camera.state` (core/camera/camera.ts) makes these; nobody else does. */
export interface CameraState {
  readonly mode: "orbit" | "fly" | "map";
  readonly eye: Vec3;
  readonly target: Vec3;
  readonly up: Vec3;
  /** Vertical field of view, degrees. In map mode the camera is orthographic. */
  readonly fovDeg: number;
  /** Height of the view in metres in map mode, else 0. */
  readonly orthoHeight: number;
  readonly near: number;
  readonly far: number;
  /** Canvas size in device pixels. */
  readonly width: number;
  readonly height: number;
  /** How many times heights are seen larger than they are (core/camera/lens.ts); 1 where it is left out. Places here are true. */
  readonly exaggeration?: number;
  /** Column-major 4x4 of true places, WebGPU clip space (z 0..1). */
  readonly viewProj: Float32Array;
}

export interface Ray {
  readonly origin: Vec3;
  readonly dir: Vec3;
  /** Metres that a pixel covers at the origin, and by how much more for each metre of way. */
  readonly spread?: readonly [number, number];
}

/** A heightfield that answers for its whole domain [0, size]^2; outside, heights are those of the nearest border. */
export interface Ground {
  readonly sizeM: number;
  /** Metres. `cellM`: detail finer than cells of this size may be left out. */
  heightAt(x: number, y: number, cellM?: number): number;
  /** Metres without synthesised detail, which no stroke constrains; `heightAt` where there is none. */
  solvedAt?(x: number, y: number): number;
  /** First hit of the ray with the ground inside the domain, or null. */
  raycast(ray: Ray): Vec3 | null;
}

/** One tile as it is drawn now. Immutable: a change makes a new object with a greater `stamp`. */
export interface Tile {
  readonly level: number;
  readonly x: number;
  readonly y: number;
  /** Version on the server of the exact samples; display may run ahead while `exact` is false. */
  readonly version: number;
  /** False while the heights are the last exact ones moved along with a newer parent (a preview). */
  readonly exact: boolean;
  /** Rises with every change of any tile of the store; renderers upload what is newer than what they hold. */
  readonly stamp: number;
  /** 65 x 65 display heights in metres. */
  readonly heights: Float32Array;
  /** Per 16-cell sub-patch [row*4 + col], metres. `subError`: distance to what the parent would draw there. */
  readonly subMin: Float32Array;
  readonly subMax: Float32Array;
  readonly subError: Float32Array;
}

/** The part of the tile store that selection, renderers and picking read. */
export interface TileView {
  readonly sizeM: number;
  /** Finest level that can exist. */
  readonly levels: number;
  /** Finest level that is solved everywhere; above it tiles come and go where somebody looks. */
  readonly solved: number;
  /** Rises when any tile changes. */
  readonly stamp: number;
  tile(level: number, x: number, y: number): Tile | undefined;
  tiles(): Iterable<Tile>;
}

/** A square grid of values over the domain, `[row * side + col]`, row 0 south, corners on the domain's corners. */
export interface ChannelGrid {
  readonly side: number;
  readonly values: Float32Array;
}

/** Channels by which strokes change the detail that is synthesised on the ground (DESIGN 5.4). */
export interface ChannelView {
  /** Rises with every change. */
  readonly stamp: number;
  /** Noise amplitude, metres. */
  readonly amplitude: ChannelGrid;
  /** Roughness, 0..1. */
  readonly roughness: ChannelGrid;
  /** Paint, which is added to the rule's own snow, grass, forest and wetness, -1..1. */
  readonly snow: ChannelGrid;
  readonly grass: ChannelGrid;
  readonly forest: ChannelGrid;
  readonly wetness: ChannelGrid;
  /** Level whose spacing is that of the finest elevation data, BASE_SURVEY where there are none. */
  readonly survey: ChannelGrid;
  /** What paint adds to gullies or takes from them, -1..1. */
  readonly erosion: ChannelGrid;
  /** Distance from what strokes fix, 0..1 of a share of the domain; 1 beyond. */
  readonly far: ChannelGrid;
}

/** A binary frame after decoding (net/decode.ts), applied atomically by tiles/store.ts. */
export interface DecodedTile {
  readonly x: number;
  readonly y: number;
  readonly version: number;
  /** 65 x 65 exact samples in quanta of the level. */
  readonly samples: Int32Array;
  readonly subMin: Int32Array;
  readonly subMax: Int32Array;
  readonly subError: Uint32Array;
}

/** A river from its head, or a confluence, down to the next. */
export interface RiverLine {
  /** xy pairs, cells of the set's level. */
  readonly cells: Float32Array;
  /** What drains through its head and its end, square metres. */
  readonly areasM2: readonly [number, number];
  /** The index of the river that it runs into; null at the border or the sea. */
  readonly into: number | null;
}

/** All rivers of a terrain at one clock, found on the samples of `level`. */
export interface RiverSet {
  readonly clock: number;
  readonly level: number;
  readonly settled: boolean;
  /** Each comes before the one that it runs into. */
  readonly rivers: readonly RiverLine[];
}

export interface DecodedFrame {
  readonly kind: number;
  readonly level: number;
  readonly channel: number;
  readonly clock: number;
  readonly settled: boolean;
  readonly drops: readonly { readonly x: number; readonly y: number }[];
  readonly tiles: readonly DecodedTile[];
  /** Bytes on the wire: returned to the server as credit once applied. */
  readonly bytes: number;
  /** All rivers, in place of those of before. A frame that has them has no tiles. */
  readonly rivers?: RiverSet;
}

/** A stroke as the renderers draw it: world points of its crest. */
export interface StrokeVisual {
  readonly id: string;
  readonly kind: StrokeKind;
  /** xyz triples, metres. */
  readonly points: Float32Array;
  readonly colour: Rgba;
  readonly selected: boolean;
  readonly hovered: boolean;
  /** Under way: drawn by somebody at this moment. */
  readonly live: boolean;
  /** Nobody draws it, points at it or has it selected: a thin, faint line. */
  readonly calm?: boolean;
}

/** The plane that is being drawn on, and the shadow of the stroke on the frozen ground. */
export interface GhostVisual {
  readonly corners: readonly [Vec3, Vec3, Vec3, Vec3];
  /** xyz triples on the ground under the stroke. */
  readonly shadow: Float32Array;
  readonly colour: Rgba;
}

/** A line on the ground: the outline of an elevation grid, what is measured, or a river. */
export interface FootprintVisual {
  readonly id: string;
  /** xyz triples, metres; the last point is the first again. */
  readonly points: Float32Array;
  readonly colour: Rgba;
  /** Selected, or being placed. */
  readonly strong: boolean;
  /** Half the width of a river on the 2D map, where alone rivers are lines; a river has no rim. */
  readonly halfWidthPx?: number;
}

/** A coarse picture of a grid that has no place yet: a lattice of points over the ground. Immutable. */
export interface PlacingVisual {
  /** Points along one side. */
  readonly side: number;
  /** xyz triples [row, col], metres; z is NaN where the grid has no data. */
  readonly points: Float32Array;
  readonly colour: Rgba;
}

/** A ring on the ground: somebody's cursor, or mine. */
export interface CursorVisual {
  readonly position: Vec3;
  readonly colour: Rgba;
  readonly radiusPx: number;
}

/** Rivers as shaders read them (tiles/water/rivermap.ts): four floats a texel. */
export interface RiverMap {
  readonly texels: Float32Array<ArrayBuffer>;
  readonly rows: number;
}

/** Drops of rain on the ground: x y z in metres, and how far each is shown (0..1, with 2 added while it falls). */
export interface DropsVisual {
  readonly data: Float32Array;
  readonly count: number;
  /** Another one with every movement. */
  readonly stamp: number;
}

/** Water that was poured out: lakes on the samples of one level, in place of those that their hollows hold otherwise. */
export interface FloodVisual {
  /** The ground of that level with its detail, metres. */
  readonly heights: Float32Array;
  readonly lakes: readonly { readonly levelM: number; readonly samples: Int32Array }[];
}

/** Quality settings of a picture: `automatic` holds the frame rate, the others hold their screen-error bound. */
export type QualityMode = "automatic" | "fast" | "balanced" | "fine";

/** What of the ground's surface is drawn: choices of the device. Null: what suits the adapter. */
export interface SurfaceChoice {
  /** Stones, blades and joints where the eye is near; without them the ground is as it is from afar. */
  readonly materials: boolean | null;
  /** Hollows and joints go dark. */
  readonly shade: boolean;
  /** Trees, rocks and tufts. */
  readonly instances: boolean | null;
}

/** Overlays of what paint adds to a channel, or takes from it. */
export type PaintedOverlay = "snow" | "forest" | "grass" | "wetness" | "erosion";

/** All that one frame shows. Built anew by the app each frame; renderers only read it. */
export interface Scene {
  readonly camera: CameraState;
  readonly tiles: TileView;
  readonly channels: ChannelView;
  readonly settings: TerrainSettings;
  /** Lowest and highest sample of the elevation layers that are shown, metres: climate of ground without a place. */
  readonly ground?: readonly [number, number] | null;
  readonly strokes: readonly StrokeVisual[];
  readonly ghost: GhostVisual | null;
  readonly cursors: readonly CursorVisual[];
  /** Outlines of elevation grids; they show whether strokes do or not. */
  readonly footprints?: readonly FootprintVisual[];
  readonly placing?: PlacingVisual | null;
  /** Screen-error bound in pixels. */
  readonly tauPx: number;
  /** `automatic` where it is left out. */
  readonly quality?: QualityMode;
  /** All that suits the adapter where it is left out. */
  readonly surface?: SurfaceChoice;
  /** Seconds, for water and the like. */
  readonly time: number;
  readonly overlay:
    | "none"
    | "contours"
    | "slope"
    | "detail"
    | PaintedOverlay
    | "patches"
    | "influence"
    | "watershed"
    | "difference";
  /**
   * Where the selected stroke is felt, 0..1, a watershed, or how far the ground is from a target (`core/difference.ts`),
   * for the overlays of these names; null: none is selected.
   */
  readonly influence?: ChannelGrid | null;
  /** Rivers of the 3D view; the 2D map draws them among the footprints. */
  readonly rivers?: RiverMap | null;
  readonly drops?: DropsVisual | null;
  readonly flood?: FloodVisual | null;
  readonly showStrokes: boolean;
  /** Height between contours, metres; 0, or left out: what suits the relief. */
  readonly contourM?: number;
  /** Lines of the contours are this many times as wide: for projectors. 1 where it is left out. */
  readonly lineScale?: number;
}

export interface FrameStats {
  readonly patches: number;
  readonly triangles: number;
  readonly selectMs: number;
  readonly cpuMs: number;
  readonly uploads: number;
  /** Screen-error bound that the device's memory has room for where that is coarser than the one asked for, else null. */
  readonly coarsenedPx?: number | null;
  /** Height between the contours of the picture, metres. */
  readonly contourM?: number;
  /** True when another frame is needed even if nothing changes (uploads pending, something moving). */
  readonly busy: boolean;
}

/** The 3D renderer and the 2D map both are one of these. */
export interface SceneRenderer {
  readonly kind: "webgpu" | "map";
  /** Short words for the status line: adapter or "2D map". */
  readonly description: string;
  /** True where the picture is drawn by a processor, not by a graphics device. */
  readonly software: boolean;
  /** Draws one frame; cheap when nothing changed. */
  render(scene: Scene): FrameStats;
  /** Resolves to a reason when the device is lost. */
  readonly lost: Promise<string>;
  destroy(): void;
}

export interface TemplateInfo {
  readonly id: string;
  readonly title: string;
  readonly description: string;
}

export type { Stroke, TerrainSettings };
