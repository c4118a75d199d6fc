/** What it costs to point at the shown ground and to stand on it: `npm run bench:ground`. Best of several runs, as JSON. */

import { performance } from "node:perf_hooks";
import { DetailField } from "../../src/tiles/detail/detail.ts";
import { heightsOfTiles } from "../../src/tiles/patches/guide.ts";
import type { RuleSettings } from "../../src/tiles/rules/rule.ts";
import { ShownGround } from "../../src/tiles/shown.ts";
import { TileStore } from "../../src/tiles/store.ts";
import { camera, SIZE } from "../input/scene.ts";
import { frame, tileOf } from "./frames.ts";
import { channelsOf } from "./synthesis.ts";

const RUNS = 12;
const SOLVED = 4;
const SETTINGS: RuleSettings = {
  size_m: SIZE,
  seed: 7,
  sea_level_m: null,
  look: "natural",
  detail: 1,
  rule: "landscape",
};

const height = (x: number, y: number): number =>
  700 * Math.exp(-((x - 1900) ** 2 + (y - 2200) ** 2) / 600_000) + 40 * Math.sin(x / 183) * Math.cos(y / 171);

const store = new TileStore(SIZE, SOLVED, SOLVED);
for (let level = 0; level <= SOLVED; level++) {
  const n = 2 ** level;
  const tiles = Array.from({ length: n * n }, (_, k) => tileOf(level, k % n, Math.floor(k / n), 1, height, SIZE));
  store.apply(frame("LEVEL", level, tiles));
}
const heightOf = heightsOfTiles((level, x, y) => store.tile(level, x, y));
const fresh = (): ShownGround =>
  new ShownGround(store.freeze(), SOLVED, new DetailField(SETTINGS, channelsOf(), heightOf, SOLVED));

const view = camera();
const best: Record<string, number> = {};

/** Milliseconds of one of `count` calls; the least of all runs is kept. */
function timed(name: string, count: number, run: (k: number) => void): void {
  const began = performance.now();
  for (let k = 0; k < count; k++) run(k);
  best[name] = Math.min(best[name] ?? Infinity, (performance.now() - began) / count);
}

for (let round = 0; round < RUNS; round++) {
  timed("point_cold_ms", 40, (k) => void fresh().heightAt(1000 + 17 * k, 1500 + 9 * k, 0.02));
  const ground = fresh();
  timed("point_walking_ms", 1000, (k) => void ground.heightAt(1500 + 0.02 * k, 1800, 0.02));
  timed("ray_cold_ms", 20, (k) => void fresh().raycast(view.ray(200 + 20 * k, 300 + 8 * k)));
  timed("ray_warm_ms", 300, (k) => void ground.raycast(view.ray(300 + k, 420)));
  timed("ray_solved_only_ms", 300, (k) => void store.ground.raycast(view.ray(300 + k, 420)));
}
process.stdout.write(`${JSON.stringify({ runs: RUNS, size_m: SIZE, finest_level: 13, ...best }, null, 2)}\n`);
