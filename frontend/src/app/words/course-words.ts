/** What is to be known of a river, a road or a ridge, in words. Pure. */

import { msg } from "@lit/localize";
import { fixed } from "../../core/language.ts";
import { earthwork } from "../../core/measure/earthwork.ts";
import type { Ground } from "../../core/types.ts";
import { worldPoints } from "../../doc/strokes.ts";
import type { Stroke } from "../../generated/contract.ts";
import { arcs, steepest } from "../../input/sketch/courseline.ts";
import { volumeWords } from "../view/instruments/words.ts";
import { metres } from "./words.ts";

export interface CourseFact {
  readonly name: string;
  readonly text: string;
  /** It is more than was asked for. */
  readonly over: boolean;
}

/** A road is called too steep beyond this many times its grade: heights are kept in millimetres. */
const SLACK = 1.02;

/** `ground`: as it is with the course, for what was cut and filled; left out while it has not come. */
export function courseFacts(stroke: Stroke, ground: Ground | null = null): CourseFact[] {
  const { course } = stroke;
  if (course === null || stroke.curve.length < 2) return [];
  const line = worldPoints(stroke);
  const change = line.at(-1)! - line[2]!;
  const grade = steepest(line);
  return [
    { name: msg("Length"), text: metres(arcs(line).at(-1)!), over: false },
    { name: change > 0 ? msg("Rises by") : msg("Falls by"), text: metres(Math.abs(change)), over: false },
    {
      name: msg("Steepest grade"),
      text: `${fixed(100 * grade, 1)} %`,
      over: course.use === "road" && grade > SLACK * course.grade,
    },
    ...(ground === null ? [] : earthworkFacts(stroke, line, ground)),
  ];
}

/** How far beyond its banks a course is still felt, in parts of its width: sections end there. */
const BESIDE = 0.5;
const SECTION_M = 8;

function earthworkFacts(stroke: Stroke, line: ArrayLike<number>, ground: Ground): CourseFact[] {
  const width = 2 * stroke.plateau_radius_m;
  const bank = Math.max(stroke.left?.extent_m ?? 0, stroke.right?.extent_m ?? 0);
  const reach = width / 2 + Math.max(bank, BESIDE * width);
  const { cutM3, fillM3 } = earthwork(line, reach, Math.max(SECTION_M, width / 2), (x, y) => ground.heightAt(x, y));
  const balance = cutM3 - fillM3;
  return [
    { name: msg("Cut"), text: volumeWords(cutM3), over: false },
    { name: msg("Fill"), text: volumeWords(fillM3), over: false },
    {
      name: balance >= 0 ? msg("Left over") : msg("To be brought"),
      text: volumeWords(Math.abs(balance)),
      over: false,
    },
  ];
}
