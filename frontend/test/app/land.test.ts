// How high the land lies, for the view of the whole of it (SPEC U430).
import { describe, expect, it } from "vitest";
import { landOf } from "../../src/app/view/eye/land.ts";
import { Camera } from "../../src/core/camera/camera.ts";
import type { Insets } from "../../src/core/camera/home.ts";

const SIZE = 4096;
const SAMPLES = 33;

/** Flat land with one sample of its own, row 0 in the south. */
function withSummit(col: number, row: number, height: number): Float32Array {
  const heights = new Float32Array(SAMPLES * SAMPLES);
  heights[row * SAMPLES + col] = height;
  return heights;
}

describe("how the land lies (SPEC U430)", () => {
  it("is flat without summits", () => {
    expect(landOf(new Float32Array(SAMPLES * SAMPLES), SAMPLES, SIZE)).toEqual({ groundM: 0, lowM: 0, peaks: [] });
  });

  it("has the highest place of each block as a summit, where it is, no lower than it is", () => {
    const { peaks } = landOf(withSummit(20, 9, 900), SAMPLES, SIZE);
    expect(peaks).toEqual([[2560, 1152, 928]]);
    const pit = landOf(withSummit(32, 32, -40), SAMPLES, SIZE);
    expect([pit.lowM, pit.peaks]).toEqual([-32, []]);
  });

  it("lies below the bar in a wide, low window with its summits (640 x 400)", () => {
    const bars: Insets = { left: 66, top: 66, right: 6, bottom: 52 };
    const camera = new Camera(SIZE);
    camera.resize(640, 400);
    camera.inset(bars, true);
    const summit = [2560, 3200, 1500] as const;
    camera.home(0);
    expect(camera.project(summit).y).toBeLessThan(bars.top);
    camera.stand(landOf(withSummit(20, 25, 1500), SAMPLES, SIZE));
    expect(camera.project(summit).y).toBeGreaterThan(bars.top);
    for (const x of [0, SIZE])
      for (const y of [0, SIZE]) {
        const at = camera.project([x, y, 0]);
        expect(at.x).toBeGreaterThan(bars.left);
        expect(at.x).toBeLessThan(640 - bars.right);
        expect(at.y).toBeLessThan(400 - bars.bottom);
      }
  });

  it("is asked for anew when home is asked for, and not before", () => {
    const camera = new Camera(SIZE);
    camera.resize(640, 400);
    camera.inset({ left: 66, top: 66, right: 6, bottom: 52 }, true);
    camera.home(0);
    const before = camera.state.value.eye;
    camera.landNow = () => landOf(withSummit(20, 25, 1500), SAMPLES, SIZE);
    camera.update(0.1, { heightAt: () => 0 } as never);
    expect(camera.state.value.eye).toEqual(before);
    camera.home(0);
    expect(camera.state.value.eye).not.toEqual(before);
  });
});
