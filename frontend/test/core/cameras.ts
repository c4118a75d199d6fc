/** What tests of the camera share: grounds, a camera on a canvas, an animation run to its end. */

import { Camera } from "../../src/core/camera/camera.ts";
import type { Ground } from "../../src/core/types.ts";

export const SIZE = 4096;
export const flat = (z = 0): Ground => ({ sizeM: SIZE, heightAt: () => z, raycast: () => null });
export const hill: Ground = {
  sizeM: SIZE,
  heightAt: (x, y) => 1500 * Math.exp(-((x - 2048) ** 2 + (y - 2048) ** 2) / 400 ** 2),
  raycast: () => null,
};

/** On 1200 × 800 pixels, at home. */
export function camera(mode: "orbit" | "fly" | "map" = "orbit"): Camera {
  const c = new Camera(SIZE);
  c.resize(1200, 800);
  c.setMode(mode);
  return c;
}

/** Runs an animation to its end, 60 steps a second. */
export function settle(c: Camera, ground: Ground = flat()): void {
  for (let i = 0; i < 600 && c.update(1 / 60, ground); i++);
}
