// Projections from the pen to strokes (SPEC I10-I17; paper 0, III-B).
import { describe, expect, it } from "vitest";
import type { Camera } from "../../src/core/camera/camera.ts";
import { simplify, simplifyTo } from "../../src/core/geometry.ts";
import { distance, distanceXY } from "../../src/core/math.ts";
import type { Ground, Vec3 } from "../../src/core/types.ts";
import { profileCurve, worldPoints } from "../../src/doc/strokes.ts";
import { LevelSketch, RidgeSketch } from "../../src/input/sketch/levelsketch.ts";
import { ProfileSketch } from "../../src/input/sketch/profilesketch.ts";
import type { SketchShape, SketchStart } from "../../src/input/sketch/sketch.ts";
import { shadowOf, strokeId } from "../../src/input/tools/stroketool.ts";
import { camera, FLAT, groundOf, SLOPE, sampleAt, sampleOf } from "./scene.ts";

function startAt(c: Camera, ground: Ground, p: Vec3): SketchStart {
  const sample = sampleOf(c, p);
  return { camera: c, ground, hit: ground.raycast(sample.ray)!, sample, nowMs: 0 };
}

/** Points of the shape, as triples. */
function triples(shape: SketchShape): Vec3[] {
  return Array.from({ length: shape.points.length / 3 }, (_, i) => [
    shape.points[3 * i]!,
    shape.points[3 * i + 1]!,
    shape.points[3 * i + 2]!,
  ]);
}

/** Draws the silhouette of a world polyline with dense pixels in between. */
function draw(sketch: ProfileSketch | LevelSketch, c: Camera, path: readonly Vec3[]): void {
  for (let i = 1; i < path.length; i++) {
    const a = c.project(path[i - 1]!);
    const b = c.project(path[i]!);
    const n = Math.max(1, Math.ceil(Math.hypot(b.x - a.x, b.y - a.y) / 5));
    for (let k = 1; k <= n; k++) sketch.add(sampleAt(c, a.x + ((b.x - a.x) * k) / n, a.y + ((b.y - a.y) * k) / n));
  }
}

describe("mountains (SPEC I10)", () => {
  for (const [name, ground] of [
    ["flat ground", FLAT],
    ["sloping ground", SLOPE],
  ] as const)
    it(`a silhouette over a known plane comes back, on ${name}`, () => {
      const c = camera();
      const first: Vec3 = [1400, 1500, ground.heightAt(1400, 1500)];
      const last: Vec3 = [2600, 1900, ground.heightAt(2600, 1900)];
      const at = (u: number, h: number): Vec3 => {
        const [x, y] = [first[0] + u * 1200, first[1] + u * 400];
        return [x, y, ground.heightAt(x, y) + h];
      };
      const peaks = [at(0, 0), at(0.25, 180), at(0.5, 420), at(0.75, 150), at(1, 0)];
      const sketch = new ProfileSketch(startAt(c, ground, first), "up");
      draw(sketch, c, peaks);
      const shape = sketch.shape(1000, true, 2000);
      expect(distance(shape.first, first)).toBeLessThan(0.01);
      expect(distance(shape.last, last)).toBeLessThan(5);
      const summit = triples(shape).reduce((a, b) =>
        b[2] - ground.heightAt(b[0], b[1]) > a[2] - ground.heightAt(a[0], a[1]) ? b : a,
      );
      expect(distance(summit, peaks[2]!)).toBeLessThan(15);
      for (const p of triples(shape)) {
        const off = ((p[0] - first[0]) * -400 + (p[1] - first[1]) * 1200) / Math.hypot(1200, 400);
        expect(Math.abs(off)).toBeLessThan(5);
        expect(p[2]).toBeGreaterThanOrEqual(ground.heightAt(p[0], p[1]) - 1e-9);
      }
    });

  it("every point projects to where the pen was (SPEC I11)", () => {
    const c = camera();
    const sketch = new ProfileSketch(startAt(c, FLAT, [1500, 1700, 0]), "up");
    draw(sketch, c, [
      [1500, 1700, 0],
      [2048, 1900, 300],
      [2500, 1600, 0],
    ]);
    const shape = sketch.shape(1000, true, 2000);
    const pixels = sketch.samples;
    for (const p of triples(shape)) {
      const q = c.project(p);
      const nearest = Math.min(...pixels.map((s) => Math.hypot(s.x - q.x, s.y - q.y)));
      expect(nearest).toBeLessThan(1.5);
    }
  });

  it("the first point is on the ground, and the curve round-trips through the frame", () => {
    const c = camera();
    const sketch = new ProfileSketch(startAt(c, SLOPE, [1500, 1700, 170]), "up");
    draw(sketch, c, [
      [1500, 1700, 170],
      [2048, 1900, 500],
      [2500, 1600, 160],
    ]);
    const { first, last, points } = sketch.shape(1000, true, 2000);
    expect(points[2]).toBeCloseTo(SLOPE.heightAt(points[0]!, points[1]!), 9);
    const back = worldPoints({
      kind: "profile",
      first: [...first],
      last: [...last],
      curve: profileCurve(points, first, last),
    });
    for (let i = 0; i < points.length; i++) expect(back[i]).toBeCloseTo(points[i]!, 2);
  });

  it("over the horizon the end is the drop on the camera-facing plane (SPEC I12)", () => {
    const c = camera();
    const sketch = new ProfileSketch(startAt(c, FLAT, [1700, 1500, 0]), "up");
    const start = c.project([1700, 1500, 0]);
    for (let k = 1; k <= 40; k++) sketch.add(sampleAt(c, start.x + 6 * k, start.y - 10 * k));
    expect(FLAT.raycast(c.ray(start.x + 240, start.y - 400))).toBeNull();
    const shape = sketch.shape(1000, true, 2000);
    const end = triples(shape).at(-1)!;
    expect(end[2]).toBeGreaterThan(200);
    expect(shape.last[2]).toBe(0);
    expect(distanceXY(shape.last, end)).toBeLessThan(1e-6);
    // The plane faces the camera: the end is about as far away as the start.
    const depth = (p: Vec3): number => c.project([p[0], p[1], 0]).depth;
    expect(Math.abs(depth(end) - depth(shape.first)) / depth(shape.first)).toBeLessThan(0.15);
  });

  it("a silhouette before far ground rises while it is drawn, and ends exactly (SPEC I18)", () => {
    const c = camera();
    const tall: readonly Vec3[] = [
      [1400, 1500, 0],
      [1700, 1600, 300],
      [2000, 1700, 420],
      [2300, 1800, 250],
      [2600, 1900, 0],
    ];
    const peak = c.project(tall[2]!);
    expect(FLAT.raycast(c.ray(peak.x, peak.y))).not.toBeNull(); // the pen is over ground all the time
    const sketch = new ProfileSketch(startAt(c, FLAT, tall[0]!), "up");
    draw(sketch, c, tall.slice(0, 3));
    const highest = (s: SketchShape): number => Math.max(...triples(s).map((p) => p[2]));
    expect(highest(sketch.shape(500, false, 500))).toBeGreaterThan(300);
    draw(sketch, c, tall.slice(2));
    const done = sketch.shape(1500, true, 500);
    expect(distance(done.last, tall[4]!)).toBeLessThan(5);
    expect(highest(done)).toBeCloseTo(420, -1);
  });

  it("a ridge may end on farther ground, higher on the screen", () => {
    const c = camera();
    const deep: readonly Vec3[] = [
      [1700, 1200, 0],
      [1900, 1700, 800],
      [2300, 2700, 0],
    ];
    const sketch = new ProfileSketch(startAt(c, FLAT, deep[0]!), "up");
    draw(sketch, c, deep);
    expect(c.project(deep[2]!).y).toBeLessThan(c.project(deep[0]!).y);
    expect(distance(sketch.shape(1500, true, 500).last, deep[2]!)).toBeLessThan(5);
  });

  it("the plane stays 20° off the line of sight (SPEC I13)", () => {
    const c = camera();
    for (const dx of [-30, 30]) {
      const sketch = new ProfileSketch(startAt(c, FLAT, [2048, 2200, 0]), "up");
      draw(sketch, c, [
        [2048, 2200, 0],
        [2048 + dx, 900, 0],
      ]);
      const shape = sketch.shape(1000, true, 2000);
      const sight = [2048 - c.state.value.eye[0], 2200 - c.state.value.eye[1]];
      const d = [shape.last[0] - shape.first[0], shape.last[1] - shape.first[1]];
      const cross = Math.abs(sight[0]! * d[1]! - sight[1]! * d[0]!) / Math.hypot(...sight) / Math.hypot(...d);
      expect(Math.asin(Math.min(1, cross)) * (180 / Math.PI)).toBeGreaterThan(19);
    }
  });

  it("turns smoothly while drawing and exactly at the end (SPEC I14)", () => {
    const c = camera();
    const sketch = new ProfileSketch(startAt(c, FLAT, [1500, 1500, 0]), "up");
    draw(sketch, c, [
      [1500, 1500, 0],
      [2100, 1500, 0],
    ]);
    sketch.shape(0, true, 500);
    sketch.add(sampleOf(c, [2100, 900, 0]));
    const heading = (s: SketchShape): number => Math.atan2(s.first[1] - s.last[1], s.last[0] - s.first[0]);
    const steps = Array.from({ length: 12 }, (_, i) => heading(sketch.shape(33 * (i + 1), false, 500)));
    const target = heading(sketch.shape(500, true, 500));
    expect(target).toBeCloseTo(Math.PI / 4, 1);
    for (let i = 1; i < steps.length; i++) {
      expect(steps[i]!).toBeGreaterThan(steps[i - 1]!);
      expect(steps[i]! - steps[i - 1]!).toBeLessThan(0.5 * target);
    }
    expect(steps[0]!).toBeLessThan(0.6 * target);
    expect(sketch.settling).toBe(false);
  });

  it("does not depend on ground that changes afterwards", () => {
    const c = camera();
    let rise = 0;
    const live = groundOf((x, y) => rise * Math.exp(-((x - 2048) ** 2 + (y - 1700) ** 2) / 300 ** 2));
    const frozen = groundOf(() => 0);
    const [a, b] = [frozen, frozen].map((g) => new ProfileSketch(startAt(c, g, [1500, 1700, 0]), "up"));
    draw(a!, c, [
      [1500, 1700, 0],
      [2048, 1800, 300],
    ]);
    rise = 800;
    expect(live.heightAt(2048, 1700)).toBe(800);
    draw(b!, c, [
      [1500, 1700, 0],
      [2048, 1800, 300],
    ]);
    expect(a!.shape(500, true, 500)).toEqual(b!.shape(500, true, 500));
  });

  it("a line straight up and down again still has a usable frame", () => {
    const c = camera();
    const sketch = new ProfileSketch(startAt(c, FLAT, [2048, 1700, 0]), "up");
    draw(sketch, c, [
      [2048, 1700, 0],
      [2048, 1700, 500],
      [2049, 1700, 0],
    ]);
    const shape = sketch.shape(500, true, 500);
    expect(distanceXY(shape.first, shape.last)).toBeGreaterThan(1);
    for (const [u, w] of profileCurve(shape.points, shape.first, shape.last)) {
      expect(Math.abs(u)).toBeLessThan(1e3);
      expect(Math.abs(w)).toBeLessThan(600);
    }
  });
});

describe("crevices", () => {
  it("dig below the ground and never rise above it (SPEC I15)", () => {
    const c = camera();
    const sketch = new ProfileSketch(startAt(c, FLAT, [1500, 1700, 0]), "down");
    draw(sketch, c, [
      [1500, 1700, 0],
      [1800, 1700, -150],
      [2200, 1700, 80],
      [2500, 1700, 0],
    ]);
    const shape = sketch.shape(500, true, 2000);
    const depth = Math.min(...triples(shape).map((p) => p[2]));
    expect(depth).toBeLessThan(-120);
    expect(depth).toBeGreaterThan(-180);
    for (const p of triples(shape)) expect(p[2]).toBeLessThanOrEqual(1e-9);
  });
});

describe("plateaux (SPEC I16)", () => {
  it("lie on the horizontal plane of the first hit", () => {
    const c = camera();
    const sketch = new LevelSketch(startAt(c, SLOPE, [1500, 1500, 150]));
    draw(sketch, c, [
      [1500, 1500, 150],
      [2300, 1600, 150],
      [2500, 1200, 150],
    ]);
    const shape = sketch.shape(0, true, 2000);
    for (const p of triples(shape)) expect(p[2]).toBeCloseTo(150, 3);
    expect(distance(shape.last, [2500, 1200, 150])).toBeLessThan(1);
  });

  it("an outline is framed by its farthest point", () => {
    const c = camera();
    const sketch = new LevelSketch(startAt(c, FLAT, [1600, 1300, 0]));
    draw(sketch, c, [
      [1600, 1300, 0],
      [2000, 1900, 0],
      [2500, 1700, 0],
      [2300, 1200, 0],
      [1620, 1280, 0],
    ]);
    const shape = sketch.shape(0, true, 2000);
    expect(distance(shape.last, [2500, 1700, 0])).toBeLessThan(15);
    expect(distance(triples(shape).at(-1)!, [1620, 1280, 0])).toBeLessThan(1);
  });

  it("pen samples over the horizon are left out", () => {
    const c = camera();
    const sketch = new LevelSketch(startAt(c, FLAT, [1600, 1300, 0]));
    draw(sketch, c, [
      [1600, 1300, 0],
      [2000, 1900, 0],
    ]);
    const before = sketch.shape(0, true, 2000);
    sketch.add(sampleAt(c, 500, 2));
    expect(sketch.shape(0, true, 2000)).toEqual(before);
  });
});

describe("ridges on the map (SPEC I17)", () => {
  it.each(["up", "down"] as const)("%s: straight, smooth, a quarter of the length high", (sense) => {
    const c = camera("map");
    const sketch = new RidgeSketch(startAt(c, SLOPE, [1000, 1000, 100]), sense);
    sketch.add(sampleOf(c, [1700, 1900, 0]));
    sketch.add(sampleOf(c, [1800, 1600, 160]));
    const { first, last, points } = sketch.shape();
    expect(distance(first, [1000, 1000, 100])).toBeLessThan(0.01);
    expect(distance(last, [1800, 1600, 160])).toBeLessThan(0.01);
    const curve = profileCurve(points, first, last);
    const sign = sense === "up" ? 1 : -1;
    expect(Math.max(...curve.map(([, w]) => sign * w))).toBeCloseTo(250, 1);
    expect(curve[0]).toEqual([0, 0]);
    expect(curve.at(-1)![1]).toBeCloseTo(0, 9);
  });
});

describe("simplification", () => {
  it("keeps the ends and every point within the tolerance", () => {
    const xy: number[] = [];
    for (let i = 0; i <= 400; i++) xy.push(i, 40 * Math.sin(i / 30));
    const kept = simplify(xy, 1);
    expect(kept[0]).toBe(0);
    expect(kept.at(-1)).toBe(400);
    expect(kept.length).toBeLessThan(60);
    for (let k = 1; k < kept.length; k++)
      for (let i = kept[k - 1]! + 1; i < kept[k]!; i++) {
        const [ax, ay, bx, by] = [
          xy[2 * kept[k - 1]!]!,
          xy[2 * kept[k - 1]! + 1]!,
          xy[2 * kept[k]!]!,
          xy[2 * kept[k]! + 1]!,
        ];
        const far =
          Math.abs((bx - ax) * (ay - xy[2 * i + 1]!) - (ax - xy[2 * i]!) * (by - ay)) / Math.hypot(bx - ax, by - ay);
        expect(far).toBeLessThanOrEqual(1 + 1e-9);
      }
  });

  it("a straight line is its two ends, and a limit is kept", () => {
    expect(simplify([0, 0, 1, 0, 2, 0, 3, 0], 0.1)).toEqual([0, 3]);
    expect(simplify([], 1)).toEqual([]);
    const zigzag = Array.from({ length: 2000 }, (_, i) => (i % 2 === 0 ? i / 2 : 50 * ((i >> 1) % 2)));
    expect(simplifyTo(zigzag, 1, 100).length).toBeLessThanOrEqual(100);
  });
});

describe("the shadow", () => {
  it("lies on the ground under the line and is dense", () => {
    const shadow = shadowOf(new Float64Array([100, 100, 500, 900, 1700, 800]), SLOPE);
    expect(shadow.length / 3).toBeGreaterThanOrEqual(48);
    for (let i = 0; i < shadow.length; i += 3) expect(shadow[i + 2]).toBeCloseTo(0.1 * shadow[i + 1]!, 2);
    expect([...shadow.slice(-3)]).toEqual([900, 1700, 170]);
  });
});

describe("the id of a stroke", () => {
  it("comes after those of all strokes before it, whoever drew them (SPEC S443)", () => {
    const client = "f".repeat(32);
    const drawn = [
      ["alpine-ridge-001", "s049", "0".repeat(32), "yeti"],
      [strokeId(1.79e12, 1, client), strokeId(1.79e12 + 1, 2, "0"), strokeId(1.79e12 + 2.5, 3, client)],
    ].flat();
    expect([...drawn].sort().slice(-3)).toEqual(drawn.slice(-3));
    expect(strokeId(4e12, 99_999, client)).toMatch(/^[A-Za-z0-9_-]{1,32}$/);
  });
});
