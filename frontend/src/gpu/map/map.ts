/** The map: a relief as if printed on a 2D canvas, for browsers without WebGPU (DESIGN 9). Same scenes, same tiles. */

import { fixed } from "../../core/language.ts";
import type {
  CameraState,
  ChannelGrid,
  FrameStats,
  Rgba,
  Scene,
  SceneRenderer,
  Tile,
  TileView,
} from "../../core/types.ts";
import { SUBPATCHES } from "../../generated/contract.ts";
import { sharesOf } from "../../tiles/flat.ts";
import { levelsOn } from "../../tiles/lakes/lakes.ts";
import { LakeWatch } from "../../tiles/lakes/lakewatch.ts";
import { assembleBordered, SLOT_TEXELS } from "../atlas/apron.ts";
import { overlayGrid } from "../atlas/channeltexture.ts";
import { contourInterval } from "../looks.ts";
import { DetailPicture, InfluencePicture, PaintedPicture, ShedPicture } from "./detail.ts";
import { DifferencePicture } from "./difference.ts";
import { drawDrops } from "./drops.ts";
import { drawFootprints, MapPlacing } from "./grids.ts";
import { type MapStyle, shadeTile } from "./shade.ts";

/** Shading stops for this frame after so many milliseconds; what is left follows in the next frames. */
const BUDGET_MS = 14;
/** A tile is drawn at the level where it covers about this many pixels. */
const TILE_PX = 128;
const MAX_PICTURES = 512;
/** Pixels between the neat line and the kilometres beside it, and between those and the picture's edge. */
const LABEL_GAP_PX = 11;
const LABEL_EDGE_PX = 3;

interface Picture {
  readonly canvas: HTMLCanvasElement;
  key: string;
  used: number;
}

/** Where world metres lie on the map. */
interface Frame {
  readonly width: number;
  readonly height: number;
  /** Pixels per metre. */
  readonly scale: number;
  readonly x0: number;
  readonly y1: number;
}

export class MapRenderer implements SceneRenderer {
  readonly kind = "map";
  readonly description = "2D map";
  readonly software = false;
  readonly lost: Promise<string> = new Promise(() => {});
  readonly #context: CanvasRenderingContext2D;
  readonly #pictures = new Map<string, Picture>();
  readonly #detail = new DetailPicture();
  readonly #felt = new InfluencePicture();
  readonly #difference = new DifferencePicture();
  readonly #painted = new PaintedPicture();
  readonly #shed = new ShedPicture();
  readonly #placing = new MapPlacing();
  readonly #lakes = new LakeWatch();
  readonly #slot = new Float32Array(SLOT_TEXELS * SLOT_TEXELS);
  #frame = 0;

  readonly #canvas: HTMLCanvasElement;

  constructor(canvas: HTMLCanvasElement) {
    this.#canvas = canvas;
    const context = canvas.getContext("2d", { alpha: false });
    if (context === null) throw new Error("This browser has no 2D canvas.");
    this.#context = context;
  }

  render(scene: Scene): FrameStats {
    const began = performance.now();
    this.#frame += 1;
    const { camera } = scene;
    this.#lakes.update(scene.tiles, scene.settings, began, false, scene.flood);
    if (this.#canvas.width !== camera.width) this.#canvas.width = camera.width;
    if (this.#canvas.height !== camera.height) this.#canvas.height = camera.height;
    const frame = frameOf(camera);
    drawFrame(this.#context, frame, scene.tiles.sizeM);
    const { drawn, uploads, busy } = this.#drawTiles(scene, frame, began);
    if (scene.overlay === "detail") this.#drawOver(this.#detail.of(scene.channels), scene, frame);
    const shares = overlayGrid(scene);
    if (shares !== null) {
      this.#drawOver(this.#pictureOf(scene.overlay, shares), scene, frame);
    }
    drawGrid(this.#context, frame, scene.tiles.sizeM);
    const to = (x: number, y: number): [number, number] => toMap(frame, x, y);
    if (scene.placing) this.#placing.draw(this.#context, scene.placing, to);
    drawFootprints(this.#context, scene.footprints ?? [], to, globalThis.devicePixelRatio || 1);
    if (scene.showStrokes) drawStrokes(this.#context, frame, scene);
    if (scene.drops) drawDrops(this.#context, scene.drops, to, globalThis.devicePixelRatio || 1);
    drawCursors(this.#context, frame, scene);
    this.#forget();
    return {
      patches: drawn,
      triangles: 0,
      selectMs: 0,
      cpuMs: performance.now() - began,
      uploads,
      contourM: scene.contourM || contourInterval(relief(scene.tiles)),
      busy: busy || this.#lakes.busy,
    };
  }

  destroy(): void {
    this.#pictures.clear();
  }

  #drawTiles(scene: Scene, frame: Frame, began: number): { drawn: number; uploads: number; busy: boolean } {
    const { tiles, settings } = scene;
    const root = tiles.tile(0, 0, 0);
    const contourM = scene.contourM || contourInterval(relief(tiles));
    const style: MapStyle = {
      look: settings.look,
      sizeM: tiles.sizeM,
      seaM: settings.sea_level_m,
      lakes: this.#lakes.lakes,
      contourM,
      contourShares: sharesOf(tiles, contourM),
      lineScale: scene.lineScale ?? 1,
      contours: scene.overlay === "contours" || root !== undefined,
      slope: scene.overlay === "slope",
    };
    const wanted = visibleTiles(tiles, frame);
    let uploads = 0;
    let busy = false;
    for (const tile of wanted) {
      const side = pictureSide((frame.scale * tiles.sizeM) / (1 << tile.level));
      const key = pictureKey(tiles, tile, side, style);
      let picture = this.#pictures.get(nameOf(tile));
      if (picture?.key !== key) {
        if (performance.now() - began < BUDGET_MS || uploads === 0) {
          picture = this.#shade(tiles, tile, side, style, key, picture);
          uploads += 1;
        } else busy = true;
      }
      if (picture === undefined) continue;
      picture.used = this.#frame;
      this.#place(picture.canvas, tile, tiles.sizeM, frame);
    }
    return { drawn: wanted.length, uploads, busy };
  }

  #shade(view: TileView, tile: Tile, side: number, style: MapStyle, key: string, old: Picture | undefined): Picture {
    const canvas = old?.canvas ?? document.createElement("canvas");
    canvas.width = side;
    canvas.height = side;
    const context = canvas.getContext("2d", { alpha: false })!;
    const image = context.createImageData(side, side);
    assembleBordered(tile.heights, (dx, dy) => neighbour(view, tile, dx, dy)?.heights, this.#slot);
    shadeTile(this.#slot, tile, side, style, image.data);
    context.putImageData(image, 0, 0);
    const picture = { canvas, key, used: this.#frame };
    this.#pictures.set(nameOf(tile), picture);
    return picture;
  }

  #place(picture: HTMLCanvasElement, tile: Tile, sizeM: number, frame: Frame): void {
    const w = sizeM / (1 << tile.level);
    // Whole pixels, so that neighbours meet without a seam.
    const left = Math.round((tile.x * w - frame.x0) * frame.scale);
    const right = Math.round(((tile.x + 1) * w - frame.x0) * frame.scale);
    const top = Math.round((frame.y1 - (tile.y + 1) * w) * frame.scale);
    const bottom = Math.round((frame.y1 - tile.y * w) * frame.scale);
    this.#context.imageSmoothingQuality = "high";
    this.#context.drawImage(picture, left, top, right - left, bottom - top);
  }

  #pictureOf(overlay: Scene["overlay"], shares: ChannelGrid): HTMLCanvasElement {
    if (overlay === "watershed") return this.#shed.of(shares);
    if (overlay === "difference") return this.#difference.of(shares);
    return overlay === "influence" ? this.#felt.of(shares) : this.#painted.of(shares);
  }

  /** Stretches a picture of the whole domain over the map. */
  #drawOver(picture: HTMLCanvasElement, scene: Scene, frame: Frame): void {
    const [left, top] = toMap(frame, 0, scene.tiles.sizeM);
    const wide = scene.tiles.sizeM * frame.scale;
    this.#context.save();
    this.#context.globalAlpha = 0.6;
    this.#context.drawImage(picture, left, top, wide, wide);
    this.#context.restore();
  }

  #forget(): void {
    if (this.#pictures.size <= MAX_PICTURES) return;
    const byAge = [...this.#pictures].sort((a, b) => a[1].used - b[1].used);
    for (const [name] of byAge.slice(0, this.#pictures.size - MAX_PICTURES)) this.#pictures.delete(name);
  }
}

/** The 2D map on this canvas. */
export function createMapRenderer(canvas: HTMLCanvasElement): SceneRenderer {
  return new MapRenderer(canvas);
}

function frameOf(camera: CameraState): Frame {
  const away = Math.hypot(
    camera.eye[0] - camera.target[0],
    camera.eye[1] - camera.target[1],
    camera.eye[2] - camera.target[2],
  );
  const tall = camera.orthoHeight > 0 ? camera.orthoHeight : 2 * away * Math.tan((camera.fovDeg * Math.PI) / 360);
  const scale = camera.height / tall;
  return {
    width: camera.width,
    height: camera.height,
    scale,
    x0: camera.target[0] - camera.width / (2 * scale),
    y1: camera.target[1] + camera.height / (2 * scale),
  };
}

function toMap(frame: Frame, x: number, y: number): [number, number] {
  return [(x - frame.x0) * frame.scale, (frame.y1 - y) * frame.scale];
}

function nameOf(tile: Tile): string {
  return `${tile.level}/${tile.x}/${tile.y}`;
}

function neighbour(view: TileView, tile: Tile, dx: number, dy: number): Tile | undefined {
  const x = tile.x + dx;
  const y = tile.y + dy;
  const side = 1 << tile.level;
  return x < 0 || y < 0 || x >= side || y >= side ? undefined : view.tile(tile.level, x, y);
}

function pictureKey(view: TileView, tile: Tile, side: number, style: MapStyle): string {
  let stamps = "";
  for (let dy = -1; dy <= 1; dy += 1) {
    for (let dx = -1; dx <= 1; dx += 1) stamps += `${neighbour(view, tile, dx, dy)?.stamp ?? ""},`;
  }
  const { level, x, y } = tile;
  const lakes =
    style.lakes === null ? "" : levelsOn(style.lakes, level, x * SUBPATCHES, y * SUBPATCHES, SUBPATCHES).join(" ");
  return `${side} ${style.look} ${lakes} ${style.seaM} ${style.contourM} ${style.lineScale} ${style.contours} ${style.slope} ${stamps}`;
}

function relief(view: TileView): number {
  let low = Number.POSITIVE_INFINITY;
  let high = Number.NEGATIVE_INFINITY;
  const root = view.tile(0, 0, 0);
  if (root === undefined) return 0;
  for (const h of root.heights) {
    low = Math.min(low, h);
    high = Math.max(high, h);
  }
  return high - low;
}

/** Pixels along one side of a tile's picture: the power of two that suits its size on the map. */
function pictureSide(onMapPx: number): number {
  return 2 ** Math.min(9, Math.max(6, Math.round(Math.log2(onMapPx))));
}

/** Finest suitable held tiles over the visible ground, coarse first. */
function visibleTiles(view: TileView, frame: Frame): Tile[] {
  const ideal = Math.round(Math.log2((view.sizeM * frame.scale) / TILE_PX));
  const level = Math.min(view.levels, Math.max(0, ideal));
  const n = 1 << level;
  const w = view.sizeM / n;
  const clamp = (v: number): number => Math.min(n - 1, Math.max(0, v));
  const x0 = clamp(Math.floor(frame.x0 / w));
  const x1 = clamp(Math.floor((frame.x0 + frame.width / frame.scale) / w));
  const y0 = clamp(Math.floor((frame.y1 - frame.height / frame.scale) / w));
  const y1 = clamp(Math.floor(frame.y1 / w));
  const found = new Map<string, Tile>();
  for (let y = y0; y <= y1; y += 1) {
    for (let x = x0; x <= x1; x += 1) {
      for (let up = 0; up <= level; up += 1) {
        const tile = view.tile(level - up, x >> up, y >> up);
        if (tile === undefined) continue;
        found.set(nameOf(tile), tile);
        break;
      }
    }
  }
  return [...found.values()].sort((a, b) => a.level - b.level);
}

function css([r, g, b, a]: Rgba, opacity = 1): string {
  return `rgba(${Math.round(r * 255)},${Math.round(g * 255)},${Math.round(b * 255)},${a * opacity})`;
}

/** The paper, and the shadow of the map on it. */
function drawFrame(context: CanvasRenderingContext2D, frame: Frame, sizeM: number): void {
  context.fillStyle = "#e9e4d8";
  context.fillRect(0, 0, frame.width, frame.height);
  const [left, top] = toMap(frame, 0, sizeM);
  const side = sizeM * frame.scale;
  context.save();
  context.shadowColor = "rgba(60,48,30,0.35)";
  context.shadowBlur = 24;
  context.shadowOffsetY = 5;
  context.fillStyle = "#dfe3cf";
  context.fillRect(left, top, side, side);
  context.restore();
}

/** Neat line, ticks with kilometres, and the faint grid of a sixteenth of the domain. */
function drawGrid(context: CanvasRenderingContext2D, frame: Frame, sizeM: number): void {
  const [left, top] = toMap(frame, 0, sizeM);
  const side = sizeM * frame.scale;
  context.lineWidth = 1;
  context.strokeStyle = "rgba(50,46,38,0.10)";
  context.beginPath();
  for (let k = 1; k < 16; k += 1) {
    const x = Math.round(left + (side * k) / 16) + 0.5;
    const y = Math.round(top + (side * k) / 16) + 0.5;
    context.moveTo(x, top);
    context.lineTo(x, top + side);
    context.moveTo(left, y);
    context.lineTo(left + side, y);
  }
  context.stroke();
  context.strokeStyle = "rgba(46,40,30,0.85)";
  context.strokeRect(left - 0.5, top - 0.5, side + 1, side + 1);
  context.lineWidth = 2;
  context.strokeRect(left - 6, top - 6, side + 12, side + 12);
  context.fillStyle = "rgba(46,40,30,0.8)";
  context.font = "11px system-ui, sans-serif";
  for (let k = 0; k <= 4; k += 1) {
    const m = (sizeM * k) / 4;
    const text = sizeM >= 2000 ? `${fixed(m / 1000, 1)} km` : `${Math.round(m)} m`;
    context.textAlign = "center";
    context.textBaseline = "top";
    const wide = context.measureText(text).width;
    const { across, beside } = labelPlaces(left + (side * k) / 4, left, wide, frame.width);
    context.fillText(text, across, top + side + 10);
    if (beside === null) continue;
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.fillText(text, beside, top + side - (side * k) / 4);
  }
}

/**
 * Where the kilometres of a tick stand: centred below it, or so far aside that nothing of them is cut, and at the left of the
 * neat line, or nowhere where there is no room for them.
 */
export function labelPlaces(
  tick: number,
  left: number,
  wide: number,
  width: number,
): { readonly across: number; readonly beside: number | null } {
  const half = wide / 2 + LABEL_EDGE_PX;
  const seen = tick >= 0 && tick <= width;
  const across = seen ? Math.max(half, Math.min(width - half, tick)) : tick;
  return { across, beside: left - LABEL_GAP_PX - wide < LABEL_EDGE_PX ? null : left - LABEL_GAP_PX };
}

function path(context: CanvasRenderingContext2D, frame: Frame, xyz: Float32Array): void {
  context.beginPath();
  for (let i = 0; i + 2 < xyz.length; i += 3) {
    const [x, y] = toMap(frame, xyz[i]!, xyz[i + 1]!);
    if (i === 0) context.moveTo(x, y);
    else context.lineTo(x, y);
  }
}

function drawStrokes(context: CanvasRenderingContext2D, frame: Frame, scene: Scene): void {
  const unit = globalThis.devicePixelRatio || 1;
  context.lineJoin = "round";
  context.lineCap = "round";
  if (scene.ghost !== null) {
    context.setLineDash([6 * unit, 5 * unit]);
    context.lineWidth = 1.5 * unit;
    context.strokeStyle = "rgba(30,34,44,0.7)";
    path(context, frame, scene.ghost.shadow);
    context.stroke();
    context.setLineDash([]);
  }
  const ranked = [...scene.strokes].sort((a, b) => Number(a.selected) - Number(b.selected));
  for (const stroke of ranked) {
    const width = (stroke.selected || stroke.live ? 3.4 : stroke.hovered ? 3 : 2.2) * unit;
    path(context, frame, stroke.points);
    if (stroke.selected || stroke.hovered) {
      context.strokeStyle = css(stroke.colour, 0.3);
      context.lineWidth = width + 8 * unit;
      context.stroke();
    }
    context.strokeStyle = `rgba(255,253,247,${0.85 * stroke.colour[3]})`;
    context.lineWidth = width + 2 * unit;
    context.stroke();
    context.strokeStyle = css(stroke.colour);
    context.lineWidth = width;
    context.stroke();
  }
}

function drawCursors(context: CanvasRenderingContext2D, frame: Frame, scene: Scene): void {
  const unit = globalThis.devicePixelRatio || 1;
  for (const cursor of scene.cursors) {
    const [x, y] = toMap(frame, cursor.position[0], cursor.position[1]);
    context.beginPath();
    context.arc(x, y, cursor.radiusPx, 0, 2 * Math.PI);
    context.fillStyle = css(cursor.colour, 0.18);
    context.fill();
    context.strokeStyle = "rgba(255,253,247,0.9)";
    context.lineWidth = 4 * unit;
    context.stroke();
    context.strokeStyle = css(cursor.colour);
    context.lineWidth = 2 * unit;
    context.stroke();
  }
}
