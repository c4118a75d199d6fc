/** Labels on index contours (R60). */

import { describe, expect, test } from "vitest";
import { LETTERS, letterInstances } from "../../src/gpu/passes/labels.ts";
import { contourLabels, heightText } from "../../src/tiles/contourlabels.ts";
import { FieldView, lookAt, mapCamera } from "./world.ts";

const dome = new FieldView(4096, 3, (x, y) => 900 - Math.hypot(x - 2000, y - 2100) * 0.4);
const options = { everyM: 100, sizePx: 19 };

describe("labels on index contours", () => {
  const camera = lookAt([2000, -1800, 2600], [2000, 2100, 400], 1280, 720);
  const labels = contourLabels(dome, camera, options);

  test("R60: each lies on its line and runs along it", () => {
    expect(labels.length).toBeGreaterThan(6);
    for (const { x, y, z, dx, dy, text } of labels) {
      expect(Math.abs(z % 100)).toBe(0);
      expect(text).toBe(`${z} m`.replace("-", "−"));
      const ground = 900 - Math.hypot(x - 2000, y - 2100) * 0.4;
      expect(Math.abs(ground - z)).toBeLessThan(0.5);
      // Across the slope, not down it.
      const down = [(x - 2000) / Math.hypot(x - 2000, y - 2100), (y - 2100) / Math.hypot(x - 2000, y - 2100)];
      expect(Math.abs(down[0]! * dx + down[1]! * dy)).toBeLessThan(0.1);
      expect(Math.hypot(dx, dy)).toBeCloseTo(1, 5);
    }
  });

  test("R60: none is near another, and the same view gives the same ones", () => {
    const pixel = ({ x, y, z }: (typeof labels)[number]): [number, number] => {
      const m = camera.viewProj;
      const w = m[3]! * x + m[7]! * y + m[11]! * z + m[15]!;
      return [
        ((m[0]! * x + m[4]! * y + m[8]! * z + m[12]!) / w) * 640,
        ((m[1]! * x + m[5]! * y + m[9]! * z + m[13]!) / w) * 360,
      ];
    };
    labels.forEach((a, i) => {
      for (const b of labels.slice(0, i)) {
        const [[ax, ay], [bx, by]] = [pixel(a), pixel(b)];
        expect(Math.hypot(ax - bx, ay - by)).toBeGreaterThan(19 * 5);
      }
    });
    expect(contourLabels(dome, camera, options)).toEqual(labels);
  });

  test("R60: flat ground and lines too close together get none", () => {
    const flat = new FieldView(4096, 2, () => 100);
    expect(contourLabels(flat, camera, options)).toEqual([]);
    expect(contourLabels(dome, camera, { everyM: 4, sizePx: 19 })).toEqual([]);
  });

  test("R60: the map is labelled too", () => {
    expect(contourLabels(dome, mapCamera([2048, 2048, 0], 4400, 900, 700), options).length).toBeGreaterThan(5);
  });

  test("R60: heights are whole metres unless the interval is finer", () => {
    expect(heightText(1250, 250)).toBe("1250 m");
    expect(heightText(-50, 50)).toBe("−50 m");
    expect(heightText(0.75, 0.25)).toBe("0.75 m");
    expect(heightText(-0, 10)).toBe("0 m");
  });

  test("R60: letters are centred on the label and among the glyphs", () => {
    const [label] = labels;
    const data = letterInstances([label!], camera, 20);
    const letters = [...label!.text].filter((c) => c !== " ");
    expect(data.length).toBe(8 * letters.length);
    letters.forEach((letter, i) => {
      expect(data[8 * i + 6]).toBe(LETTERS.indexOf(letter));
    });
    expect(Math.abs(data[3]! + data[data.length - 5]!)).toBeLessThan(3);
  });
});
