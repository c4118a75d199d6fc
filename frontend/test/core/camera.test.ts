// The camera's moves, modes and flights (SPEC I2-I5, I340).

import { describe, expect, it } from "vitest";
import { Camera } from "../../src/core/camera/camera.ts";
import { addScaled, distance, distanceXY, dot, sub } from "../../src/core/math.ts";
import type { Ground, Vec3 } from "../../src/core/types.ts";
import { random } from "../gpu/world.ts";
import { camera, flat, hill, SIZE, settle } from "./cameras.ts";

/** 9 x 9 places of the near plane, to the picture's corners. */
function nearPlane(c: Camera): Vec3[] {
  const { near, eye, width, height } = c.state.value;
  const forward = c.ray(width / 2, height / 2).dir;
  const steps = Array.from({ length: 9 }, (_, k) => k / 8);
  return steps.flatMap((u) =>
    steps.map((v) => {
      const { dir } = c.ray(u * width, v * height);
      return addScaled(eye, dir, near / dot(dir, forward));
    }),
  );
}

describe("moves", () => {
  it("zoom keeps the anchor under the pointer (SPEC I2)", () => {
    for (const mode of ["orbit", "fly", "map"] as const) {
      const c = camera(mode);
      const anchor: Vec3 = [1200, 2600, 80];
      const before = c.project(anchor);
      c.zoom(1.7, anchor);
      expect(c.project(anchor).x).toBeCloseTo(before.x, 6);
      expect(c.project(anchor).y).toBeCloseTo(before.y, 6);
      expect(c.metresPerPixelAt(anchor)).toBeLessThan(camera(mode).metresPerPixelAt(anchor) / 1.69);
    }
  });

  it("a smooth zoom ends where a plain one does", () => {
    const a = camera();
    const b = camera();
    const anchor: Vec3 = [1200, 2600, 80];
    a.zoom(1.5, anchor);
    b.zoom(1.5, anchor, true);
    expect(b.moving).toBe(true);
    settle(b);
    expect(b.moving).toBe(false);
    expect(distance(a.state.value.eye, b.state.value.eye)).toBeLessThan(1e-6);
  });

  it("orbit keeps the pivot and its distance; the eye goes against the pointer", () => {
    const c = camera();
    const before = c.state.value;
    c.orbit(100, 0);
    const after = c.state.value;
    expect(after.target).toEqual(before.target);
    expect(distance(after.eye, after.target)).toBeCloseTo(distance(before.eye, before.target), 6);
    const right: Vec3 = [Math.cos(20 * (Math.PI / 180)), -Math.sin(20 * (Math.PI / 180)), 0];
    expect(dot(sub(after.eye, before.eye), right)).toBeLessThan(0);
  });

  it("look keeps the eye and turns toward the pointer", () => {
    const c = camera("fly");
    const eye = c.state.value.eye;
    const right = c.project(addScaled(c.state.value.target, [1, 0, 0], 300));
    c.look(50, 0);
    expect(distance(c.state.value.eye, eye)).toBeLessThan(1e-6);
    expect(c.project(addScaled(c.state.value.target, [1, 0, 0], 300)).x).not.toBeCloseTo(right.x + 1000, 0);
  });

  it("pan drags the ground: the point under the pointer follows it", () => {
    for (const mode of ["orbit", "map"] as const) {
      const c = camera(mode);
      c.goTo([2048, -3000, 2500], [2048, 2048, 0], 0);
      const p = c.state.value.target;
      const before = c.project(p);
      c.pan(40, 25, flat());
      const after = c.project(p);
      expect(after.x - before.x).toBeGreaterThan(38);
      expect(after.x - before.x).toBeLessThan(43);
      expect(after.y - before.y).toBeGreaterThan(23);
      expect(after.y - before.y).toBeLessThan(28);
    }
  });

  it("pan follows the height of the ground, and never leaves the neighbourhood of the terrain", () => {
    const c = camera();
    c.goTo([2048, -3000, 2500], [2048, 2048, 0], 0);
    c.pan(0, 200, hill);
    const { target } = c.state.value;
    expect(target[2]).toBeCloseTo(hill.heightAt(target[0], target[1]) - 1500, 6);
    for (let i = 0; i < 300; i++) c.pan(500, 500, flat());
    expect(c.state.value.target[0]).toBeGreaterThanOrEqual(-0.76 * SIZE);
    expect(c.state.value.target[1]).toBeLessThanOrEqual(1.76 * SIZE);
  });

  it("fly moves along the view, faster higher up", () => {
    const c = camera("fly");
    const high = c.state.value.eye;
    c.update(0, flat());
    c.fly(1, 0, 0, 0.1);
    const fast = distance(high, c.state.value.eye);
    c.goTo([2048, 100, 20], [2048, 600, 20], 0);
    c.update(0, flat());
    const low = c.state.value.eye;
    c.fly(1, 0, 0, 0.1);
    expect(distance(low, c.state.value.eye)).toBeLessThan(fast / 5);
    expect(c.state.value.eye[1]).toBeGreaterThan(low[1]);
  });

  it("pivotAt changes neither eye nor direction", () => {
    const c = camera();
    const before = c.state.value;
    c.pivotAt([1500, 1500, 0]);
    const after = c.state.value;
    expect(distance(after.eye, before.eye)).toBeLessThan(1e-6);
    expect(c.project(before.target).x).toBeCloseTo(600, 4);
    expect(distance(after.eye, after.target)).not.toBeCloseTo(distance(before.eye, before.target), 0);
  });
});

describe("modes and flights", () => {
  it("the map keeps place and scale, and going back restores the view (SPEC I3)", () => {
    const c = camera();
    c.goTo([100, 200, 900], [2000, 2500, 100], 0);
    c.update(0.1, flat());
    const before = c.state.value;
    const scale = c.metresPerPixelAt(before.target);
    c.setMode("map");
    expect(c.state.value.target).toEqual(before.target);
    expect(c.metresPerPixelAt(before.target)).toBeCloseTo(scale, 6);
    c.setMode("orbit");
    expect(distance(c.state.value.eye, before.eye)).toBeLessThan(1e-6);
  });

  it("the first map shows the whole land beside the bars, and going back is home again (SPEC I340)", () => {
    const c = camera();
    c.inset({ left: 70, top: 80, right: 20, bottom: 60 }, true);
    const home = c.state.value;
    c.setMode("map");
    for (const x of [0, SIZE])
      for (const y of [0, SIZE]) {
        const p = c.project([x, y, 0]);
        expect(p.x).toBeGreaterThan(70);
        expect(p.x).toBeLessThan(1180);
        expect(p.y).toBeGreaterThan(80);
        expect(p.y).toBeLessThan(740);
      }
    c.setMode("orbit");
    expect(distance(c.state.value.eye, home.eye)).toBeLessThan(1e-6);
  });

  it("goTo arrives exactly, and a user's move ends the flight", () => {
    const c = camera();
    c.goTo([100, 200, 900], [2000, 2500, 100], 300);
    expect(c.update(0.1, flat())).toBe(true);
    settle(c);
    expect(distance(c.state.value.eye, [100, 200, 900])).toBeLessThan(1e-6);
    expect(distance(c.state.value.target, [2000, 2500, 100])).toBeLessThan(1e-6);
    expect(c.moving).toBe(false);
    c.home();
    c.update(0.1, flat());
    c.orbit(1, 0);
    expect(c.moving).toBe(false);
  });

  it("frame brings all points into view", () => {
    for (const mode of ["orbit", "map"] as const) {
      const c = camera(mode);
      const points: Vec3[] = [
        [300, 300, 0],
        [900, 700, 400],
        [500, 1200, -50],
      ];
      c.frame(points, 0);
      for (const p of points) expect(c.project(p).visible).toBe(true);
      c.frame({ x0: 1000, y0: 1000, x1: 1400, y1: 1300 }, 0);
      expect(c.project([1000, 1000, 0]).visible && c.project([1400, 1300, 0]).visible).toBe(true);
      expect(distanceXY(c.state.value.target, [1200, 1150, 0])).toBeLessThan(1e-6);
    }
  });

  it("update keeps the eye above the ground (SPEC I4)", () => {
    for (const mode of ["orbit", "fly"] as const) {
      const c = camera(mode);
      c.goTo([2048, 1900, 300], [2048, 2600, 200], 0);
      settle(c, hill);
      const { eye } = c.state.value;
      expect(eye[2]).toBeGreaterThanOrEqual(hill.heightAt(eye[0], eye[1]) + 1.6);
    }
  });

  it("comes as near to the ground of the largest terrain as to that of a small one", () => {
    const c = new Camera(65536);
    c.resize(1000, 800);
    c.goTo([30000, 30000, 1], [30000, 30003, 0], 0);
    settle(c);
    const { eye, target, near } = c.state.value;
    expect(distance(eye, target)).toBeLessThan(4);
    expect(eye[2]).toBeLessThan(2);
    expect(near).toBe(0.1);
    const small = new Camera(64);
    small.resize(1000, 800);
    small.zoom(1e6);
    expect(distance(small.state.value.eye, small.state.value.target)).toBeLessThan(0.2);
    expect(small.state.value.near).toBeLessThan(0.05);
  });

  it("no corner of the near plane reaches into the ground, on slopes and at the foot of walls (SPEC I4)", () => {
    const grounds: Record<string, (x: number, y: number) => number> = {
      steep: (x) => 6 * (x - 2000),
      wall: (x) => (x < 2048 ? 100 : 160),
      spikes: (x, y) => 12 * Math.abs(Math.sin(2 * x) * Math.cos(1.7 * y)),
    };
    const next = random(5);
    for (const [name, heightAt] of Object.entries(grounds))
      for (const mode of ["orbit", "fly"] as const)
        for (let k = 0; k < 25; k += 1) {
          const c = new Camera(4096);
          c.resize(2400, 1000);
          if (mode === "fly") c.setMode("fly");
          const [x, y] = [2047 + next(), 2048 + next()];
          const eye: Vec3 = [x, y, heightAt(x, y) + 40 * next() ** 3 - 2];
          const away = 3 + 900 * next();
          const turn = 2 * Math.PI * next();
          c.goTo(eye, [eye[0] + away * Math.cos(turn), eye[1] + away * Math.sin(turn), eye[2] - away * next()], 0);
          settle(c, { sizeM: 4096, heightAt, raycast: () => null });
          const room = Math.min(...nearPlane(c).map((p) => p[2] - heightAt(p[0], p[1])));
          expect(room, `${name} ${mode} ${k}`).toBeGreaterThan(0);
        }
  });

  it("comes to rest where the ground lifted it", () => {
    const c = camera();
    const wall: Ground = { sizeM: 4096, heightAt: (x) => (x < 2048 ? 0.1 : 300.3), raycast: () => null };
    c.goTo([2047.9, 1234.567, 1], [2300, 1300, 320], 0);
    settle(c, wall);
    expect(c.update(0.016, wall)).toBe(false);
  });

  it("views are remembered by slot (SPEC I5)", () => {
    const c = camera();
    c.orbit(200, 100);
    const saved = c.saveView("1");
    const { eye } = c.state.value;
    c.home(0);
    const other = camera("map");
    other.loadViews([["1", saved]]);
    expect(other.restoreView("1", 0)).toBe(true);
    expect(other.state.value.mode).toBe("orbit");
    expect(distance(other.state.value.eye, eye)).toBeLessThan(1e-6);
    expect(other.restoreView("2")).toBe(false);
  });
});
