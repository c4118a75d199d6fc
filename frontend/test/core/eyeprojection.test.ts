/** Places relative to the eye (SPEC R24). */

import { describe, expect, it } from "vitest";
import { eyeProjection, reversedDepth } from "../../src/core/camera/projection.ts";
import { cameraState, type Pose } from "../../src/core/camera/state.ts";
import type { CameraState, Vec3 } from "../../src/core/types.ts";

const SIZE = 65536;
const pose: Pose = {
  mode: "orbit",
  pivot: [61234.567, 60001.234, 812.345],
  distanceM: 3,
  heading: 0.7,
  pitch: -0.4,
  fovDeg: 45,
};

function apply(m: ArrayLike<number>, p: Vec3): number[] {
  return [0, 1, 2, 3].map((r) => m[r]! * p[0] + m[4 + r]! * p[1] + m[8 + r]! * p[2] + m[12 + r]!);
}

const relative = (s: CameraState, p: Vec3): Vec3 => [p[0] - s.eye[0], p[1] - s.eye[1], p[2] - s.eye[2]];

describe("eyeProjection", () => {
  it.each(["orbit", "map"] as const)("R24: is the camera's own projection, seen from the eye (%s)", (mode) => {
    const near: Pose = { ...pose, mode, pivot: [900, 700, 40], distanceM: 400 };
    const state = cameraState(near, 800, 600, 4096);
    const p: Vec3 = [930, 690, 20];
    const whole = apply(state.viewProj, p);
    const seen = apply(eyeProjection(state), relative(state, p));
    for (const [i, v] of seen.entries()) expect(v).toBeCloseTo(whole[i]!, 2);
  });

  it("R24: a step of a millimetre at the far corner of the largest terrain moves the picture by what it should", () => {
    const state = cameraState(pose, 1280, 720, SIZE);
    const m = Float32Array.from(eyeProjection(state));
    const pixel = (p: Vec3): number => {
      const [x, , , w] = apply(m, relative(state, p).map(Math.fround) as unknown as Vec3) as [
        number,
        number,
        number,
        number,
      ];
      return (x / w) * 640;
    };
    const right: Vec3 = [Math.cos(pose.heading), -Math.sin(pose.heading), 0];
    const at = (k: number): Vec3 => [pose.pivot[0] + k * right[0], pose.pivot[1] + k * right[1], pose.pivot[2]];
    const step = pixel(at(0.001)) - pixel(at(0));
    const expected = (0.001 / 3 / Math.tan(Math.PI / 8) / (1280 / 720)) * 640;
    expect(step).toBeGreaterThan(0.97 * expected);
    expect(step).toBeLessThan(1.03 * expected);
    // The same by way of world coordinates in float32 is lost in noise.
    const far = (p: Vec3): number => {
      const [x, , , w] = apply(state.viewProj, p.map(Math.fround) as unknown as Vec3) as [
        number,
        number,
        number,
        number,
      ];
      return (x / w) * 640;
    };
    expect(Math.abs(far(at(0.001)) - far(at(0)) - expected)).toBeGreaterThan(0.1 * expected);
  });

  it("R24: reversed depth is 1 at the near plane and 0 at the far one", () => {
    const state = cameraState(pose, 800, 600, SIZE);
    const m = reversedDepth(eyeProjection(state));
    const forward = relative({ ...state, eye: state.eye }, state.target).map((v) => v / 3);
    const depth = (d: number): number => {
      const [, , z, w] = apply(m, forward.map((v) => v * d) as unknown as Vec3) as [number, number, number, number];
      return z / w;
    };
    expect(depth(state.near)).toBeCloseTo(1, 6);
    expect(depth(state.far)).toBeCloseTo(0, 6);
    expect(depth(10)).toBeGreaterThan(depth(11));
  });
});
