// The view makes room for handles that lie under the inspector (SPEC U35).
import { describe, expect, it } from "vitest";
import { Camera } from "../../src/core/camera.ts";
import type { Vec3 } from "../../src/core/types.ts";
import { makeRoom, roomNeeded } from "../../src/ui/make-room.ts";
import { FLAT } from "../input/scene.ts";

const PANEL = { left: 900, top: 70, bottom: 700 };

describe("room for handles", () => {
  it("is needed only under the panel, and never pushes the others out at the left", () => {
    expect(roomNeeded([{ x: 500, y: 300 }], PANEL)).toBe(0);
    expect(roomNeeded([{ x: 1000, y: 750 }], PANEL)).toBe(0);
    const hidden = { x: 1000, y: 300 };
    expect(roomNeeded([{ x: 500, y: 300 }, hidden], PANEL)).toBe(128);
    expect(roomNeeded([{ x: 150, y: 750 }, hidden], PANEL)).toBe(66);
    expect(roomNeeded([{ x: 40, y: 300 }, hidden], PANEL)).toBe(0);
    expect(roomNeeded([], PANEL)).toBe(0);
  });

  it.each(["orbit", "map"] as const)("is made by gliding: handles lie beside the panel then (%s)", (mode) => {
    const camera = new Camera(4096);
    camera.resize(2000, 1600);
    camera.setMode(mode);
    const handles: { position: Vec3 }[] = [{ position: [3300, 2000, 50] }, { position: [3600, 2100, 0] }];
    const toWindow = (p: Vec3) => {
      const { x, y, visible } = camera.project(p);
      return { x: x / 2, y: y / 2, visible };
    };
    const left = Math.min(...handles.map((h) => toWindow(h.position).x)) - 10;
    const panel = { left, top: 0, bottom: 800 };
    const { eye, target } = camera.state.value;
    makeRoom(camera, handles, toWindow, panel, 2);
    for (let i = 0; i < 40; i++) camera.update(0.05, FLAT);
    for (const h of handles) expect(toWindow(h.position).x).toBeLessThan(left - 10);
    const after = camera.state.value;
    for (const k of [0, 1, 2] as const) expect(after.eye[k] - eye[k]).toBeCloseTo(after.target[k] - target[k], 6);
    const still = camera.state.value;
    makeRoom(camera, handles, toWindow, { ...panel, left: 1000 }, 2);
    expect(camera.state.value).toBe(still);
  });
});
