/** What is to be known of a river, a road or a ridge, in words. Pure. */

import { worldPoints } from "../../doc/strokes.ts";
import type { Stroke } from "../../generated/contract.ts";
import { arcs, steepest } from "../../input/sketch/courseline.ts";
import { metres } from "./words.ts";

export interface CourseFact {
  readonly name: string;
  readonly text: string;
  /** It is more than was asked for. */
  readonly over: boolean;
}

/** A road is called too steep beyond this many times its grade: heights are kept in millimetres. */
const SLACK = 1.02;

export function courseFacts(stroke: Stroke): CourseFact[] {
  const { course } = stroke;
  if (course === null || stroke.curve.length < 2) return [];
  const line = worldPoints(stroke);
  const change = line.at(-1)! - line[2]!;
  const grade = steepest(line);
  return [
    { name: "Length", text: metres(arcs(line).at(-1)!), over: false },
    { name: change > 0 ? "Rises by" : "Falls by", text: metres(Math.abs(change)), over: false },
    {
      name: "Steepest grade",
      text: `${(100 * grade).toFixed(1)} %`,
      over: course.use === "road" && grade > SLACK * course.grade,
    },
  ];
}
