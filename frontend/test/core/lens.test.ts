// Vertical exaggeration: the picture is one linear map away from the true one (SPEC N25, N26, N27).
import { describe, expect, it } from "vitest";
import { askedOf } from "../../src/core/camera/asked.ts";
import { Camera } from "../../src/core/camera/camera.ts";
import { loweredRay, MOST_EXAGGERATION } from "../../src/core/camera/lens.ts";
import { eyeProjection } from "../../src/core/camera/projection.ts";
import { along } from "../../src/core/geometry.ts";
import type { CameraState, Ground, Vec3 } from "../../src/core/types.ts";

const SIZE = 4096;
const flat: Ground = { sizeM: SIZE, heightAt: () => 120, raycast: () => null };
const PLACES: readonly Vec3[] = [
  [1000, 1200, 0],
  [2048, 2048, 400],
  [2600, 900, -80],
];

function opened(k: number, mode: "orbit" | "fly" | "map" = "orbit"): Camera {
  const camera = new Camera(SIZE);
  camera.resize(1000, 800);
  camera.stand({ groundM: 60, lowM: -20, peaks: [[2048, 2048, 400]] });
  camera.setMode(mode);
  camera.exaggerate(k);
  return camera;
}

function byMatrix(state: CameraState, p: Vec3): readonly [number, number] {
  const m = state.viewProj;
  const of = (r: number): number => m[r]! * p[0] + m[4 + r]! * p[1] + m[8 + r]! * p[2] + m[12 + r]!;
  return [((of(0) / of(3) + 1) / 2) * state.width, ((1 - of(1) / of(3)) / 2) * state.height];
}

describe("exaggeration", () => {
  it("has rays, projection and matrices of the true world agree, in every mode (SPEC N25)", () => {
    for (const mode of ["orbit", "fly", "map"] as const)
      for (const k of [1, 1.5, 3, 5]) {
        const camera = opened(k, mode);
        const state = camera.state.value;
        expect(state.exaggeration).toBe(k);
        for (const p of PLACES) {
          const at = camera.project(p);
          const [x, y] = byMatrix(state, p);
          expect(at.x).toBeCloseTo(x, 1);
          expect(at.y).toBeCloseTo(y, 1);
          const ray = camera.ray(at.x, at.y);
          expect(Math.hypot(...ray.dir)).toBeCloseTo(1, 9);
          const d = ray.dir;
          const t = (p[0] - ray.origin[0]) * d[0] + (p[1] - ray.origin[1]) * d[1] + (p[2] - ray.origin[2]) * d[2];
          const met = along(ray, t);
          for (const i of [0, 1, 2] as const) expect(met[i]).toBeCloseTo(p[i], 5);
          // The matrix from the eye's own place is the same but for its origin.
          const e = eyeProjection(state);
          const rel = p.map((v, i) => v - state.eye[i as 0]!);
          const row = (r: number): number => e[r]! * rel[0]! + e[4 + r]! * rel[1]! + e[8 + r]! * rel[2]! + e[12 + r]!;
          expect(((row(0) / row(3) + 1) / 2) * state.width).toBeCloseTo(at.x, 4);
          expect(((1 - row(1) / row(3)) / 2) * state.height).toBeCloseTo(at.y, 4);
        }
      }
  });

  it("draws heights larger: a metre up is k times as many pixels as before at the same place (SPEC N25)", () => {
    const span = (k: number): number => {
      const camera = new Camera(SIZE);
      camera.resize(1000, 800);
      camera.exaggerate(k);
      // The same seen eye: far away and level with the place.
      camera.goTo([2048, -9000, 0], [2048, 2048, 0], 0);
      return camera.project([2048, 2048, 0]).y - camera.project([2048, 2048, 10]).y;
    };
    for (const k of [2, 3, 5]) expect(span(k) / span(1)).toBeCloseTo(k, 2);
  });

  it("keeps in the middle what is looked at, is bounded, and home stays home (SPEC N26)", () => {
    const camera = opened(1);
    const home = camera.state.value.target;
    camera.exaggerate(3);
    camera.exaggerate(1);
    for (const i of [0, 1, 2] as const) expect(camera.state.value.target[i]).toBeCloseTo(home[i], 6);
    camera.goTo([1000, 1000, 500], [2000, 2000, 300], 0);
    camera.exaggerate(4);
    const at = camera.project([2000, 2000, 300]);
    expect([Math.round(at.x), Math.round(at.y)]).toEqual([500, 400]);
    camera.exaggerate(99);
    expect(camera.state.value.exaggeration).toBe(MOST_EXAGGERATION);
    camera.exaggerate(Number.NaN);
    expect(camera.state.value.exaggeration).toBe(1);
  });

  it("remembers views as true places (SPEC N26)", () => {
    const camera = opened(2);
    camera.goTo([1000, 1000, 500], [2000, 2000, 300], 0);
    const view = camera.saveView("1");
    expect(view.eye.map(Math.round)).toEqual([1000, 1000, 500]);
    camera.exaggerate(1);
    camera.restoreView("1", 0);
    expect(camera.state.value.eye.map(Math.round)).toEqual([1000, 1000, 500]);
  });

  it("keeps the eye over the ground as it is seen (SPEC N26)", () => {
    const camera = opened(5, "fly");
    camera.goTo([2000, 2000, 10], [2000, 2100, 10], 0);
    camera.update(0.016, flat);
    expect(camera.state.value.eye[2]).toBeGreaterThan(120);
  });

  it("turns north on a click; the place stays (SPEC N31)", () => {
    const camera = opened(1);
    camera.twist(77);
    const before = camera.state.value.target;
    camera.north(0);
    const { eye, target } = camera.state.value;
    expect(target).toEqual(before);
    expect(target[0] - eye[0]).toBeCloseTo(0, 6);
    expect(target[1]).toBeGreaterThan(eye[1]);
  });

  it("asks the server for a cone that holds all that is seen (SPEC N27)", () => {
    for (const k of [1, 2, 5])
      for (const pitch of [-0.1, -0.6, -1.3]) {
        const camera = opened(1);
        camera.exaggerate(k);
        camera.goTo([2048, 2048 - 3000 * Math.cos(pitch), (-3000 * Math.sin(pitch)) / k], [2048, 2048, 0], 0);
        const state = camera.state.value;
        const asked = askedOf(state, 1.5);
        const tan = Math.tan((asked.fov_deg * Math.PI) / 360);
        const [f0, f1, f2] = [0, 1, 2].map((i) => state.target[i as 0]! - state.eye[i as 0]!) as [
          number,
          number,
          number,
        ];
        const length = Math.hypot(f0, f1, f2);
        const forward: Vec3 = [f0 / length, f1 / length, f2 / length];
        const right: Vec3 = [1, 0, 0];
        const up: Vec3 = [0, -forward[2], forward[1]];
        for (const x of [0, 1000])
          for (const y of [0, 800]) {
            const { dir } = camera.ray(x, y);
            const dot = (v: Vec3): number => dir[0] * v[0] + dir[1] * v[1] + dir[2] * v[2];
            if (asked.fov_deg > 149) continue;
            expect(Math.abs(dot(up)) / dot(forward)).toBeLessThanOrEqual(tan * (1 + 1e-6));
            expect(Math.abs(dot(right)) / dot(forward)).toBeLessThanOrEqual(tan * 1.25 * (1 + 1e-6));
          }
        if (k === 1) expect(asked).toEqual({ fov_deg: 45 });
        else expect(asked.tau_px!).toBeGreaterThanOrEqual(0.25);
      }
  });

  it("changes nothing at 1, to the bit", () => {
    const ray = { origin: [1, 2, 3], dir: [0.6, 0, -0.8], spread: [0, 1] } as const;
    expect(loweredRay(ray, 1)).toEqual(ray);
    const one = opened(1).state.value;
    const plain = new Camera(SIZE);
    plain.resize(1000, 800);
    plain.stand({ groundM: 60, lowM: -20, peaks: [[2048, 2048, 400]] });
    expect([...one.viewProj]).toEqual([...plain.state.value.viewProj]);
  });
});
