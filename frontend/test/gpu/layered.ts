/**
 * The crack test on ground of elevation layers with strokes on it: the frames of a server, through the page's own decoder and
 * store, where offsets are added to the base. The counter is that of `cracks.ts`.
 */

import type { Point } from "../../src/core/lattice.ts";
import type { CameraState, TileView, Vec3 } from "../../src/core/types.ts";
import { FrameDecoder } from "../../src/net/decode.ts";
import { TileStore } from "../../src/tiles/store.ts";
import { makeWorld, picture, sceneOf, sharedRig, spoilRecords } from "./crackrig.ts";
import { type CrackReport, HEIGHT, KINDS, type Kind, Tally, WIDTH } from "./cracktally.ts";
import { lookAt, mapCamera, random } from "./world.ts";

/** Views lie within this share of the domain of the places asked for. */
const AROUND = 0.06;

/** What a server sent: frames (base64) up to each moment at which somebody looks, and places worth a look, metres. */
export interface Sent {
  readonly size_m: number;
  readonly levels: number;
  readonly moments: readonly (readonly string[])[];
  readonly places: readonly Point[];
}

function heightAt(view: TileView, x: number, y: number): number {
  const root = view.tile(0, 0, 0)!;
  const index = (v: number): number => Math.round((v / view.sizeM) * 64);
  return root.heights[index(y) * 65 + index(x)]!;
}

function camera(kind: Kind, next: () => number, view: TileView, [x, y]: Point): CameraState {
  const ground = heightAt(view, x, y);
  const angle = next() * 2 * Math.PI;
  const along: Vec3 = [Math.cos(angle), Math.sin(angle), 0];
  const size = view.sizeM;
  if (kind === "map") return mapCamera([x, y, 0], (0.08 + 0.25 * next()) * size, WIDTH, HEIGHT);
  if (kind === "above") {
    const up = (0.1 + 0.15 * next()) * size;
    return lookAt([x, y, ground + up], [x + along[0] * up * 0.4, y + along[1] * up * 0.4, ground], WIDTH, HEIGHT, 40);
  }
  if (kind === "below") {
    const down = (0.5 + 0.3 * next()) * size;
    return lookAt([x, y, ground - down], [x + along[0] * 50, y + along[1] * 50, ground], WIDTH, HEIGHT, 20);
  }
  const far = 0.12 * size;
  const eye: Vec3 = [x, y, ground + (0.02 + 0.05 * next()) * size];
  return lookAt(eye, [x + along[0] * far, y + along[1] * far, ground - 0.02 * size * next()], WIDTH, HEIGHT, 45, 1);
}

/** Draws `views` views at every moment. `spoil` clears the edge bits, to see the test fail. */
export async function layeredCrackTest(seed: number, views: number, sent: Sent, spoil = false): Promise<CrackReport> {
  const rig = await sharedRig();
  const next = random(seed);
  const looks = ["natural", "alpine", "desert", "paper"] as const;
  const tally = new Tally();
  const decoder = new FrameDecoder();
  const store = new TileStore(sent.size_m, sent.levels);
  const world = makeWorld(rig, store);
  if (spoil) spoilRecords(world.selection);
  for (const [moment, frames] of sent.moments.entries()) {
    for (const frame of frames)
      store.apply(decoder.decode(Uint8Array.from(atob(frame), (c) => c.charCodeAt(0)).buffer));
    for (let k = 0; k < views; k += 1) {
      const kind = KINDS[k % 4]!;
      const place = sent.places[k % sent.places.length]!;
      const near = place.map((v) => v + (2 * next() - 1) * AROUND * sent.size_m) as unknown as Point;
      const tau = 0.6 + 4 * next() ** 2;
      const scene = sceneOf(store, camera(kind, next, store, near), looks[Math.floor(k / 4) % 4]!);
      const drawn = await picture(rig, world, scene, tau, { full: Math.floor(k / 4) % 2 === moment % 2 });
      tally.add(drawn, kind, `seed ${seed} moment ${moment} view ${k} ${kind} tau ${tau.toFixed(2)}`);
    }
  }
  world.atlas.destroy();
  return tally.report(views * sent.moments.length);
}
