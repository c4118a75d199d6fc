// The camera's projections, and home (SPEC I1, U32, U33, I313).

import { describe, expect, it } from "vitest";
import { Camera } from "../../src/core/camera/camera.ts";
import type { Insets } from "../../src/core/camera/home.ts";
import { addScaled, normalize, sub } from "../../src/core/math.ts";
import type { Vec3 } from "../../src/core/types.ts";
import { camera, flat, SIZE } from "./cameras.ts";

/** Eye and pivot of home on 390 × 844 pixels; the same numbers stand in tests/render/test_camera.py. */
const HOME_TALL = [-2235, -7137, 4725.8, 2048, 2048, 1432.9];

/** Clip coordinates of a point through the published matrix. */
function clip(c: Camera, p: Vec3): { x: number; y: number; z: number } {
  const m = c.state.value.viewProj;
  const r = [0, 1, 2, 3].map((i) => m[i]! * p[0] + m[4 + i]! * p[1] + m[8 + i]! * p[2] + m[12 + i]!);
  return { x: r[0]! / r[3]!, y: r[1]! / r[3]!, z: r[2]! / r[3]! };
}

describe("projection (SPEC I1)", () => {
  it.each(["orbit", "fly", "map"] as const)("%s: project inverts ray, and agrees with viewProj", (mode) => {
    const c = camera(mode);
    c.orbit(123, 45);
    for (const [x, y] of [
      [1, 1],
      [600, 400],
      [1199, 13],
      [77, 780],
    ] as const) {
      const ray = c.ray(x, y);
      const p = addScaled(ray.origin, ray.dir, mode === "map" ? ray.origin[2] : 3000);
      const q = c.project(p);
      expect(q.x).toBeCloseTo(x, 6);
      expect(q.y).toBeCloseTo(y, 6);
      expect(q.visible).toBe(true);
      const ndc = clip(c, p);
      expect(((ndc.x + 1) / 2) * 1200).toBeCloseTo(x, 1);
      expect(((1 - ndc.y) / 2) * 800).toBeCloseTo(y, 1);
      expect(ndc.z).toBeGreaterThan(0);
      expect(ndc.z).toBeLessThan(1);
    }
  });

  it("points behind the eye are not visible", () => {
    const c = camera("fly");
    const { eye, target } = c.state.value;
    const behind = addScaled(eye, normalize(sub(target, eye)), -100);
    expect(c.project(behind).visible).toBe(false);
    expect(c.project(target).visible).toBe(true);
  });

  it("the whole domain is visible from home on a wide canvas; a tall one cuts off two corners and is filled", () => {
    for (const [w, h, hidden] of [
      [1600, 900, 0],
      [800, 800, 0],
      [390, 844, 2],
    ] as const) {
      const c = new Camera(SIZE);
      c.resize(w, h);
      c.home(0);
      const corners = [0, SIZE].flatMap((x) => [0, SIZE].map((y) => c.project([x, y, 0])));
      expect(corners.filter((p) => !p.visible).length).toBe(hidden);
      for (const p of corners) expect(Math.abs(p.x / w - 0.5)).toBeLessThan(0.5 + 0.21);
    }
  });

  it("on a tall canvas home is that of the reference (tests/render/test_camera.py)", () => {
    const c = new Camera(SIZE);
    c.resize(390, 844);
    c.home(0);
    const { eye, target } = c.state.value;
    expect([...eye, ...target].map((v) => Math.round(v * 10) / 10)).toEqual(HOME_TALL);
  });

  it("home shows the sky above a horizon in the upper third and the land large below it", () => {
    for (const [w, h, least] of [
      [1440, 900, 0.66],
      [720, 540, 0.72],
      [360, 740, 1.25],
    ] as const) {
      const c = new Camera(SIZE);
      c.resize(w, h);
      c.home(0);
      const { eye, target } = c.state.value;
      const away = sub(target, eye);
      const horizon = c.project(addScaled(eye, normalize([away[0], away[1], 0]), 1e7)).y / h;
      expect(horizon).toBeGreaterThan(0.1);
      expect(horizon).toBeLessThan(0.33);
      const corners = [0, SIZE].flatMap((x) => [0, SIZE].map((y) => c.project([x, y, 0])));
      const xs = corners.map((p) => p.x / w);
      expect(Math.max(...xs) - Math.min(...xs)).toBeGreaterThan(least);
      expect(Math.min(...corners.map((p) => p.y / h))).toBeGreaterThan(horizon + 0.15);
      expect(eye[0]).toBeLessThan(SIZE / 2);
      expect(eye[1]).toBeLessThan(0);
    }
  });

  it("the map has north up and east right, and covers orthoHeight metres", () => {
    const c = camera("map");
    const a = c.project([2048, 2048, 0]);
    expect(c.project([2048, 2148, 0]).y).toBeLessThan(a.y);
    expect(c.project([2148, 2048, 0]).x).toBeGreaterThan(a.x);
    const { orthoHeight } = c.state.value;
    expect(c.project([2048, 2048 + orthoHeight / 2, 0]).y).toBeCloseTo(0, 6);
    expect(c.metresPerPixelAt([0, 0, 0])).toBeCloseTo(orthoHeight / 800, 9);
  });
});

describe("home beside what covers the picture (SPEC I313)", () => {
  const BARS = { left: 76, top: 66, right: 12, bottom: 60 };
  const WINDOWS: readonly (readonly [string, number, number, Insets])[] = [
    ["a desktop", 1280, 800, BARS],
    ["a small window", 900, 600, BARS],
    ["a wide strip", 1600, 420, BARS],
    ["a square", 700, 700, BARS],
    ["with the inspector open", 1280, 800, { ...BARS, right: 348 }],
    ["a small one with the inspector", 1000, 600, { ...BARS, right: 348 }],
    ["an upright phone", 390, 760, { left: 8, top: 60, right: 8, bottom: 124 }],
    ["a phone with its drawer open", 390, 410, { left: 8, top: 60, right: 8, bottom: 72 }],
    ["a phone on its side", 844, 390, { left: 8, top: 60, right: 8, bottom: 124 }],
    ["almost no room", 300, 200, { left: 100, top: 90, right: 120, bottom: 100 }],
  ];

  for (const [name, width, height, insets] of WINDOWS)
    for (const land of [
      { groundM: 0, lowM: 0 },
      { groundM: 900, lowM: 300 },
    ])
      it.each(["orbit", "map"] as const)(
        `the whole land is in the free part: ${name}, ground ${land.groundM} m (%s)`,
        (mode) => {
          const c = new Camera(SIZE);
          c.resize(width, height);
          c.setMode(mode);
          c.stand(land);
          c.inset(insets, true);
          c.home(0);
          const corners = [0, SIZE].flatMap((x) =>
            [0, SIZE].flatMap((y) => [c.project([x, y, land.groundM]), c.project([x, y, land.lowM])]),
          );
          const crowded = width < 320;
          const free = crowded ? { left: 0, top: 0, right: 0, bottom: 0 } : insets;
          for (const p of corners) {
            expect(p.x).toBeGreaterThan(free.left);
            expect(p.x).toBeLessThan(width - free.right);
            expect(p.y).toBeGreaterThan(free.top);
            expect(p.y).toBeLessThan(height - free.bottom);
          }
          if (crowded || land.groundM > 0) return;
          // As large as fits, and under a finger in the middle of the free part.
          const xs = corners.map((p) => p.x);
          const ys = corners.map((p) => p.y);
          const wide = (Math.max(...xs) - Math.min(...xs)) / (width - insets.left - insets.right);
          const tall = (Math.max(...ys) - Math.min(...ys)) / (height - insets.top - insets.bottom);
          expect(Math.max(wide, tall)).toBeGreaterThan(0.94);
          const at = c.ray((insets.left + width - insets.right) / 2, (insets.top + height - insets.bottom) / 2);
          const t = (land.groundM - at.origin[2]) / at.dir[2];
          for (const k of [0, 1] as const) {
            expect(at.origin[k] + t * at.dir[k]).toBeGreaterThan(0);
            expect(at.origin[k] + t * at.dir[k]).toBeLessThan(SIZE);
          }
        },
      );

  it("a camera at home goes along when the inspector opens and back when it shuts, if it is asked to", () => {
    const c = new Camera(SIZE);
    c.resize(1280, 800);
    c.inset(BARS, true);
    const home = c.state.value.eye;
    c.inset({ ...BARS, right: 348 }, true, 200);
    expect(c.moving).toBe(true);
    for (let i = 0; i < 10; i++) c.update(0.05, flat());
    expect(c.state.value.eye).not.toEqual(home);
    c.inset(BARS, true);
    expect(c.state.value.eye).toEqual(home);
    c.inset({ ...BARS, right: 348 }, false);
    expect(c.state.value.eye).toEqual(home);
    c.inset(BARS, true);
    c.orbit(30, 0);
    const mine = c.state.value.eye;
    c.inset({ ...BARS, right: 348 }, true);
    expect(c.state.value.eye).toEqual(mine);
  });
});

describe("home over land that lies high (SPEC U32)", () => {
  const land = { groundM: 2150, lowM: 1780 };

  it("looks at the land where it lies, down to its foot", () => {
    const c = new Camera(4096);
    c.resize(1200, 800);
    c.stand(land);
    c.home(0);
    for (const x of [0, 4096])
      for (const y of [0, 4096])
        for (const z of [land.groundM, land.lowM]) expect(c.project([x, y, z]).visible).toBe(true);
    expect(c.state.value.eye[2]).toBeGreaterThan(land.groundM);
  });

  it("goes along while nobody has moved the view, and only then", () => {
    const c = new Camera(4096);
    c.resize(1200, 800);
    c.home(0);
    const before = c.state.value.eye;
    c.stand(land);
    expect(c.state.value.eye[2] - before[2]).toBeGreaterThan(1500);
    c.orbit(40, 0);
    const moved = c.state.value.eye;
    c.stand({ groundM: 0, lowM: 0 });
    expect(c.state.value.eye).toEqual(moved);
  });

  it("goes along when the picture changes its shape, and only then (U33)", () => {
    const [turned, upright] = [new Camera(4096), new Camera(4096)];
    upright.resize(390, 844);
    upright.home(0);
    turned.resize(844, 390);
    turned.home(0);
    turned.resize(390, 844);
    expect(turned.state.value.eye).toEqual(upright.state.value.eye);
    turned.orbit(40, 0);
    const moved = turned.state.value.eye;
    turned.resize(844, 390);
    expect(turned.state.value.eye).toEqual(moved);
  });

  it("is what it was on flat land", () => {
    const [a, b] = [new Camera(4096), new Camera(4096)];
    b.stand({ groundM: 0, lowM: 0 });
    expect(b.state.value.eye).toEqual(a.state.value.eye);
  });
});

describe("what is looked at stands beside what covers the picture (SPEC I410)", () => {
  const covered: Insets = { left: 60, top: 66, right: 340, bottom: 70 };
  const points: Vec3[] = [0, 1].flatMap((x) =>
    [0, 1].flatMap((y) => [0, 1].map((z): Vec3 => [800 + 2400 * x, 700 + 2600 * y, 1000 * z])),
  );
  it.each(["orbit", "fly", "map"] as const)("%s", (mode) => {
    const c = camera(mode);
    c.resize(1100, 700);
    c.inset(covered, false);
    c.frame(points, 0);
    const seen = points.map((p) => c.project(p));
    const [xs, ys] = [seen.map((p) => p.x), seen.map((p) => p.y)];
    expect(Math.min(...xs)).toBeGreaterThan(60 + 40);
    expect(Math.max(...xs)).toBeLessThan(1100 - 340 - 40);
    expect(Math.min(...ys)).toBeGreaterThan(66 + 30);
    expect(Math.max(...ys)).toBeLessThan(700 - 70 - 30);
    // As large as fits: along one side it fills what is left of the free part.
    const fills = Math.max((Math.max(...xs) - Math.min(...xs)) / 700, (Math.max(...ys) - Math.min(...ys)) / 564);
    expect(fills).toBeGreaterThan(0.7);
  });
});
