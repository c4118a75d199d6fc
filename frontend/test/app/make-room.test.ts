// The view makes room for handles that lie under the inspector (SPEC U35).
import { describe, expect, it } from "vitest";
import { Room, roomNeeded } from "../../src/app/view/make-room.ts";
import { Camera } from "../../src/core/camera/camera.ts";
import type { Vec3 } from "../../src/core/types.ts";
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
    const room = new Room(camera);
    room.make(handles, toWindow, panel, 2);
    for (let i = 0; i < 40; i++) camera.update(0.05, FLAT);
    for (const h of handles) expect(toWindow(h.position).x).toBeLessThan(left - 10);
    const after = camera.state.value;
    for (const k of [0, 1, 2] as const) expect(after.eye[k] - eye[k]).toBeCloseTo(after.target[k] - target[k], 6);
    const still = camera.state.value;
    room.make(handles, toWindow, { ...panel, left: 1000 }, 2);
    expect(camera.state.value).toBe(still);
    // A second selection needs more room; all of it is given back (SPEC U310).
    room.make(handles, toWindow, { ...panel, left: left - 100 }, 2);
    room.giveBack();
    for (let i = 0; i < 40; i++) camera.update(0.05, FLAT);
    for (const k of [0, 1, 2] as const) {
      expect(camera.state.value.eye[k]).toBeCloseTo(eye[k], 6);
      expect(camera.state.value.target[k]).toBeCloseTo(target[k], 6);
    }
  });

  it("is not given back to somebody who has moved the view since (SPEC U310)", () => {
    const camera = new Camera(4096);
    camera.resize(2000, 1600);
    const handles: { position: Vec3 }[] = [{ position: [3300, 2000, 50] }];
    const room = new Room(camera);
    const toWindow = (p: Vec3) => ({ ...camera.project(p) });
    room.make(handles, toWindow, { left: toWindow(handles[0]!.position).x - 10, top: 0, bottom: 1600 }, 1);
    for (let i = 0; i < 40; i++) camera.update(0.05, FLAT);
    camera.orbit(40, 0);
    const mine = camera.state.value;
    room.giveBack();
    for (let i = 0; i < 40; i++) camera.update(0.05, FLAT);
    expect(camera.state.value.eye).toEqual(mine.eye);
  });
});
