/**
 * The crack tests: the ground alone, random trees and cameras. Nothing of the background may show where ground must be.
 * A world's tree is cut anew every other view, and each view is drawn from what the views before it left in the atlas.
 */

import { tileKey } from "../../src/core/tilekey.ts";
import type { CameraState, Scene, Tile, TileView, Vec3 } from "../../src/core/types.ts";
import type { PatchTree } from "../../src/tiles/patches/patchtree.ts";
import { makeWorld, picture, sceneOf, settle, sharedRig, spoilRecords } from "./crackrig.ts";
import { type CrackReport, HEIGHT, KINDS, type Kind, Tally, WIDTH } from "./cracktally.ts";
import { craggyField, FieldView, filteredField, lookAt, mapCamera, random, SparseView } from "./world.ts";

type Look = Scene["settings"]["look"];

const SIZE = 4096;
const LARGE = 65536;
const LOOKS: readonly Look[] = ["natural", "alpine", "desert", "paper"];
/** Views of one ground. */
const WORLD_VIEWS = 40;
/** Cameras on one state of the ground, of those on foot. */
const CAMERAS = 4;
/** Views of one tree, of random trees. */
const CAMERAS_A_TREE = 2;
/** Share of the tiles that are missing. */
const MISSING = 0.06;

export interface How {
  /** Every how many views one has its look and light. */
  readonly full?: number;
  /** Heights are seen so many times larger than they are. */
  readonly exaggeration?: number;
  /** Without edge bits and corner weights, to see the test fail. */
  readonly spoil?: boolean;
}

/** The look of a seed's views: the shape of the detail follows it, so one world has one. */
function lookOf(seed: number): Look {
  return LOOKS[seed % LOOKS.length]!;
}

/** Whether a view is one of those drawn in full, by its number; which of them varies with the seed. */
function isFull(seed: number, view: number, { full }: How): boolean {
  return (seed + view) % (full ?? 10) === 0;
}

/** A whole pyramid of which a random part is missing, and all below it. */
class HoledView implements TileView {
  stamp = 1;
  readonly sizeM: number;
  readonly levels: number;
  readonly solved: number;
  private readonly missing = new Set<number>();

  constructor(private readonly whole: FieldView) {
    ({ sizeM: this.sizeM, levels: this.levels, solved: this.solved } = whole);
  }

  tile(level: number, x: number, y: number): Tile | undefined {
    return this.missing.has(tileKey(level, x, y)) ? undefined : this.whole.tile(level, x, y);
  }

  *tiles(): Iterable<Tile> {
    for (const tile of this.whole.tiles()) if (!this.missing.has(tileKey(tile.level, tile.x, tile.y))) yield tile;
  }

  /** Another part is missing. */
  cut(next: () => number): void {
    this.stamp += 1;
    this.missing.clear();
    // Coarse levels come first: a tile without its parent is never held.
    for (const { level, x, y } of this.whole.tiles()) {
      if (level === 0) continue;
      const orphan = this.missing.has(tileKey(level - 1, x >> 1, y >> 1));
      if (orphan || next() < MISSING) this.missing.add(tileKey(level, x, y));
    }
  }
}

function camera(kind: Kind, next: () => number, view: TileView): CameraState {
  // So far from the border of the domain that no sight passes over it.
  const inland = kind === "above" ? 1300 : 1000;
  const x = inland + next() * (SIZE - 2 * inland);
  const y = inland + next() * (SIZE - 2 * inland);
  const ground = kind === "below" ? heightOf(view, x, y) : ceilingOf(view, x, y);
  const angle = next() * 2 * Math.PI;
  const along: Vec3 = [Math.cos(angle), Math.sin(angle), 0];
  if (kind === "map") return mapCamera([x, y, 0], 300 + next() * 1100, WIDTH, HEIGHT);
  if (kind === "above") {
    const up = 150 + next() * 500;
    return lookAt([x, y, ground + up], [x + along[0] * up * 0.4, y + along[1] * up * 0.4, ground], WIDTH, HEIGHT, 40);
  }
  if (kind === "below") {
    const down = 500 + next() * 500;
    return lookAt([x, y, ground - down], [x + along[0] * 90, y + along[1] * 90, ground], WIDTH, HEIGHT, 35);
  }
  return lookAt(
    [x, y, ground + 30 + next() * 120],
    [x + along[0] * 500, y + along[1] * 500, ground + 10 - next() * 120],
    WIDTH,
    HEIGHT,
    45,
    1,
  );
}

/** The camera as far from the ground as before where heights are seen larger: no sight passes over the border then either. */
function seenFrom(state: CameraState, view: TileView, exaggeration: number): CameraState {
  if (exaggeration === 1) return state;
  const ground = heightOf(view, state.eye[0], state.eye[1]);
  const nearer = ([x, y, z]: Vec3): Vec3 => [x, y, ground + (z - ground) / exaggeration];
  return { ...state, exaggeration, eye: nearer(state.eye), target: nearer(state.target) };
}

function heightOf(view: TileView, x: number, y: number): number {
  const root = view.tile(0, 0, 0)!;
  return root.heights[Math.round((y / SIZE) * 64) * 65 + Math.round((x / SIZE) * 64)]!;
}

/** No level that is held has higher ground at a place: an eye inside of the ground sees its sky from below. */
function ceilingOf(view: TileView, x: number, y: number): number {
  let highest = Number.NEGATIVE_INFINITY;
  for (let level = 0; level <= view.levels; level += 1) {
    const cell = SIZE / (64 << level);
    const [col, row] = [Math.floor(x / cell), Math.floor(y / cell)];
    const tile = view.tile(level, col >> 6, row >> 6);
    if (tile === undefined) break;
    const at = (row & 63) * 65 + (col & 63);
    for (const k of [at, at + 1, at + 65, at + 66]) highest = Math.max(highest, tile.heights[k]!);
  }
  return highest;
}

/** Draws `views` random views of random trees. */
export async function crackTest(seed: number, views: number, how: How = {}): Promise<CrackReport> {
  const rig = await sharedRig();
  const next = random(seed);
  const look = lookOf(seed);
  const tally = new Tally();
  for (let done = 0; done < views; ) {
    const view = new HoledView(new FieldView(SIZE, 4, filteredField(Math.floor(next() * 1e6), 60 + next() * 160)));
    const world = makeWorld(rig, view);
    if (how.spoil === true) spoilRecords(world.selection);
    for (let k = 0; k < WORLD_VIEWS && done < views; k += 1, done += 1) {
      const kind = KINDS[k % 4]!;
      if (k % CAMERAS_A_TREE === 0) view.cut(next);
      const tau = 0.6 + 5 * next() ** 2;
      const state = seenFrom(camera(kind, next, view), view, how.exaggeration ?? 1);
      const drawn = await picture(rig, world, sceneOf(view, state, look), tau, { full: isFull(seed, done, how) });
      tally.add(drawn, kind, `view ${done} ${kind} tau ${tau.toFixed(2)}`);
    }
    world.atlas.destroy();
  }
  return tally.report(views);
}

/** Lowest and highest ground around a place, by the finest tile that is drawn there, metres. */
function groundAt(tree: PatchTree, sizeM: number, x: number, y: number): { low: number; high: number } {
  let [low, high] = [0, 0];
  for (let level = 0; level <= tree.levels; level += 1) {
    const w = sizeM / 2 ** level;
    const page = tree.find(level, Math.floor(x / w), Math.floor(y / w));
    if (page < 0 || tree.usable[page] === 0) break;
    const node = page * 16 + Math.floor((4 * (y % w)) / w) * 4 + Math.floor((4 * (x % w)) / w);
    [low, high] = [tree.min[node]!, tree.max[node]!];
  }
  return { low, high };
}

/** Looking down from `up` metres above a place. */
function above(up: number, [x, y, z]: Vec3, view: TileView, look: Look): Scene {
  return sceneOf(view, lookAt([x, y - 0.2 * up, z + up], [x, y, z], WIDTH, HEIGHT, 40, 0.1, 4e5), look);
}

/** A camera a few metres from the ground, with the near and far planes that the page has there. */
function closeCamera(kind: Kind, next: () => number, at: Vec3): CameraState {
  const angle = next() * 2 * Math.PI;
  const along: Vec3 = [Math.cos(angle), Math.sin(angle), 0];
  const [x, y, z] = at;
  const look = (eye: Vec3, target: Vec3, fov: number): CameraState =>
    lookAt(eye, target, WIDTH, HEIGHT, fov, 0.1, 400_000);
  if (kind === "map") return mapCamera([x, y, 0], 40 + next() * 300, WIDTH, HEIGHT);
  if (kind === "below") {
    const down = 150 + next() * 300;
    return look([x, y, z - down], [x + along[0] * 20, y + along[1] * 20, z], 35);
  }
  const up = 6 + next() * 30;
  if (kind === "above") return look([x, y, z + up], [x + along[0] * up * 0.4, y + along[1] * up * 0.4, z], 40);
  return look([x, y, z + up], [x + along[0] * 60, y + along[1] * 60, z + up - 5 - 20 * next()], 45);
}

/**
 * The crack test near the ground of the largest terrain: levels 4 to 10 held around a place only, with holes, some tiles
 * still on their way in. Every fourth view stands somewhere else.
 */
export async function deepCrackTest(seed: number, views: number, how: How = {}): Promise<CrackReport> {
  const rig = await sharedRig();
  const next = random(seed);
  const look = lookOf(seed);
  const tally = new Tally();
  for (let done = 0; done < views; ) {
    const view = new SparseView(LARGE, 10, 3, craggyField(Math.floor(next() * 1e6), LARGE));
    const world = makeWorld(rig, view, true);
    if (how.spoil === true) spoilRecords(world.selection);
    let [x, y] = [0, 0];
    for (let k = 0; k < WORLD_VIEWS && done < views; k += 1, done += 1) {
      const kind = KINDS[k % 4]!;
      if (kind === "above") [x, y] = [LARGE * (0.2 + 0.6 * next()), LARGE * (0.2 + 0.6 * next())];
      if (kind === "above" || kind === "below") {
        view.forgetRefined();
        view.refineAround(x, y, () => 1 + Math.round(next()));
        view.lose(() => next() < 0.08);
      }
      const held = view.shownHeightAt(x, y);
      // People come from above: an eye inside of the coarse ground sees nothing that it could refine.
      if (kind === "above")
        for (const up of [4000, 600, 100]) await settle(rig, world, above(up, [x, y, held], view, look), 2);
      // Where a branch ends early the ground drawn is another than the one held.
      const z = Math.max(held, groundAt(world.selection.tree, LARGE, x, y).high);
      const tau = 0.6 + 6 * next() ** 2;
      const scene = sceneOf(view, closeCamera(kind, next, [x, y, z]), look);
      const entrance = (): number => 0.15 + 0.7 * next();
      const steps = kind === "above" || kind === "grazing" ? 21 : 2 + Math.floor(14 * next());
      const drawn = await picture(rig, world, scene, tau, { full: isFull(seed, done, how), entrance, steps });
      tally.add(drawn, kind, `view ${done} ${kind} tau ${tau.toFixed(2)}`);
    }
    world.atlas.destroy();
  }
  return tally.report(views);
}

/** Room that the page's camera keeps to all sides (core/camera/floor.ts), metres. */
const ROOM = 0.45;
/** Where ground is asked for that may rise beside an eye. */
const AROUND = [
  [0, 0],
  ...Array.from({ length: 8 }, (_, k) => [Math.cos((k * Math.PI) / 4), Math.sin((k * Math.PI) / 4)]),
];

/**
 * A camera that somebody on foot has, at least `least` metres up: ground that is on its way must not reach the eye.
 * `highest`: of the ground drawn around a place; on a slope the eye stands above what rises beside it, as the page's does.
 */
function footCamera(
  kind: Kind,
  next: () => number,
  [x, y, z]: Vec3,
  least: number,
  highest: (x: number, y: number) => number,
): CameraState {
  if (kind === "map") return mapCamera([x, y, 0], 0.4 + 3 * next(), WIDTH, HEIGHT);
  const up = least + 2 * next();
  const angle = 2 * Math.PI * next();
  const [ex, ey] = [x + 0.3 * up * Math.cos(angle), y + 0.3 * up * Math.sin(angle)];
  const beside = Math.max(...AROUND.map(([east, north]) => highest(ex + ROOM * east!, ey + ROOM * north!)));
  return lookAt([ex, ey, Math.max(z + up, beside + ROOM)], [x, y, z], WIDTH, HEIGHT, 40, 0.05, 4e5);
}

/**
 * The crack test a metre from the ground, after an approach from above as people come, then on foot: synthetic levels to the
 * finest, beside refined ones and places where those have just come or gone, the ground half way from the one to the other.
 */
export async function walkCrackTest(seed: number, views: number, how: How = {}): Promise<CrackReport> {
  const rig = await sharedRig();
  const next = random(seed);
  const look = lookOf(seed);
  const tally = new Tally();
  for (let done = 0; done < views; ) {
    const view = new SparseView(LARGE, 10, 2, craggyField(Math.floor(next() * 1e6), LARGE));
    let [x, y] = [LARGE * (0.2 + 0.6 * next()), LARGE * (0.2 + 0.6 * next())];
    const world = makeWorld(rig, view);
    if (how.spoil === true) spoilRecords(world.selection);
    const ground = (): number => {
      const { low, high } = groundAt(world.selection.tree, LARGE, x, y);
      return 0.5 * (low + high);
    };
    const from = (up: number): Scene => above(up, [x, y, ground()], view, look);
    for (const up of [20_000, 1500, 120, 10]) await settle(rig, world, from(up), 2, { rounds: 9 });
    for (let k = 0; k < WORLD_VIEWS && done < views; k += 1, done += 1) {
      const part = Math.floor(k / CAMERAS) % 4;
      const still = k % CAMERAS > 0;
      const kind = k % 2 === 0 ? "above" : "map";
      if (!still) {
        // A few steps on; refined tiles come, and later some go.
        if (part === 0 && k > 0) {
          [x, y] = [x + 16 * (next() - 0.5), y + 16 * (next() - 0.5)];
          await settle(rig, world, from(10), 2, { rounds: 5 });
        }
        if (part === 1) view.refineAround(x, y, () => Math.round(next()));
        if (part === 3) view.lose(() => next() < 0.3);
      }
      const tau = 0.6 + 2 * next();
      const highest = (px: number, py: number): number => groundAt(world.selection.tree, LARGE, px, py).high;
      const state = footCamera(kind, next, [x, y, ground()], part === 0 ? 1 : 9, highest);
      const drawn = await picture(rig, world, sceneOf(view, state, look), tau, {
        full: isFull(seed, done, how),
        rounds: part === 0 ? 3 : 1,
        share: part === 0 ? 1 : 0.3,
        still,
      });
      tally.add(drawn, kind, `view ${done} ${kind} tau ${tau.toFixed(2)}`);
    }
    world.atlas.destroy();
  }
  return tally.report(views);
}
