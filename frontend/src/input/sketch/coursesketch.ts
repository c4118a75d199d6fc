/** Rivers, roads and ridges: a line drawn over the ground, laid by its use (DESIGN 21). */

import type { Ground } from "../../core/types.ts";
import { drape } from "../picking.ts";
import { BrushSketch } from "../tools/painttool.ts";
import { type CourseStyle, laid, thinned } from "./courseline.ts";
import { type Sample, SIMPLIFY_PX, type Sketch, type SketchShape, type SketchStart } from "./sketch.ts";
import { solvedHeight } from "./strokeops.ts";

/** The line follows the ground in steps of this share of the domain. */
const STEP = 1 / 512;

export class CourseSketch implements Sketch {
  readonly settling = false;
  readonly #line: BrushSketch;
  readonly #ground: Ground;
  readonly #style: CourseStyle;
  readonly #tolerance: number;

  constructor(start: SketchStart, style: CourseStyle) {
    this.#line = new BrushSketch(start);
    this.#ground = start.ground;
    this.#style = style;
    this.#tolerance = Math.max(2 * SIMPLIFY_PX * start.camera.metresPerPixelAt(start.hit), start.ground.sizeM / 2048);
  }

  get samples(): readonly Sample[] {
    return this.#line.samples;
  }

  add(sample: Sample): void {
    this.#line.add(sample);
  }

  shape(nowMs: number, exact: boolean, most: number): SketchShape {
    const ground = this.#ground;
    const { points } = this.#line.shape(nowMs, exact, most);
    const along = drape(points, ground.sizeM * STEP, (x, y) => solvedHeight(ground, x, y));
    const line = thinned(laid(along, this.#style), this.#tolerance, this.#style.depthM, most);
    const n = line.length;
    return { first: [line[0]!, line[1]!, line[2]!], last: [line[n - 3]!, line[n - 2]!, line[n - 1]!], points: line };
  }

  /** It lies on the ground: there is no plane to show. */
  corners(): null {
    return null;
  }
}
