/** Grounds with known heights, and a camera before them, for the input tests. */

import { Camera } from "../../src/core/camera/camera.ts";
import type { Ground, Ray, Vec3 } from "../../src/core/types.ts";
import type { Sample } from "../../src/input/sketch/sketch.ts";

export const SIZE = 4096;

/** Any height function as a ground; rays are marched in steps of 1 m and refined by bisection. */
export function groundOf(heightAt: (x: number, y: number) => number): Ground {
  const clampXY = (v: number): number => Math.max(0, Math.min(SIZE, v));
  const h = (x: number, y: number): number => heightAt(clampXY(x), clampXY(y));
  const over = (ray: Ray, t: number): number =>
    ray.origin[2] + t * ray.dir[2] - h(ray.origin[0] + t * ray.dir[0], ray.origin[1] + t * ray.dir[1]);
  return {
    sizeM: SIZE,
    heightAt: h,
    raycast(ray: Ray): Vec3 | null {
      for (let t = 0; t < 30_000; t += 4) {
        if (over(ray, t + 4) > 0) continue;
        let [low, high] = [t, t + 4];
        for (let i = 0; i < 40; i++) {
          const mid = (low + high) / 2;
          if (over(ray, mid) > 0) low = mid;
          else high = mid;
        }
        const [x, y] = [ray.origin[0] + high * ray.dir[0], ray.origin[1] + high * ray.dir[1]];
        return x < 0 || y < 0 || x > SIZE || y > SIZE ? null : [x, y, h(x, y)];
      }
      return null;
    },
  };
}

export const FLAT = groundOf(() => 0);
/** Rises to the north, so that the far ground hides nothing and the sky begins lower. */
export const SLOPE = groundOf((_x, y) => 0.1 * y);

/** A camera 1000 x 800 that looks north from the south at the middle of the terrain. */
export function camera(mode: "orbit" | "map" = "orbit"): Camera {
  const c = new Camera(SIZE);
  c.resize(1000, 800);
  c.setMode(mode);
  if (mode === "orbit") c.goTo([2048, -800, 900], [2048, 1800, 0], 0);
  return c;
}

export function sampleAt(c: Camera, x: number, y: number, pressure = 0.5): Sample {
  return { x, y, ray: c.ray(x, y), pressure };
}

/** The sample at the pixel where a world point is seen. */
export function sampleOf(c: Camera, p: Vec3): Sample {
  const { x, y } = c.project(p);
  return sampleAt(c, x, y);
}
