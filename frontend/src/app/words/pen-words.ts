/** Measures of a stroke under way, in words for beside the pen. Pure. */

import { msg, str } from "@lit/localize";
import { fixed, midSentence } from "../../core/language.ts";
import { worldPoints } from "../../doc/strokes.ts";
import type { Stroke } from "../../generated/contract.ts";
import { reliefOf } from "../view/scene.ts";
import { courseFacts } from "./course-words.ts";
import { paintName } from "./paints.ts";
import { height, metres } from "./words.ts";

/** "420 m high, 1.9 km long"; null before there is a line. */
export function penWords(stroke: Stroke): string | null {
  if (stroke.curve.length < 2) return null;
  const line = worldPoints(stroke);
  if (stroke.paint !== null)
    return msg(
      str`${paintName(stroke.paint)}, ${metres(2 * stroke.paint.radius_m)} wide, ${metres(alongOf(line))} long`,
    );
  if (stroke.course !== null) {
    const facts = courseFacts(stroke).map(({ name, text }) => `${midSentence(name)} ${text}`);
    return facts.length === 0 ? null : facts.join(", ");
  }
  if (stroke.kind === "level") return msg(str`at ${height(stroke.first[2])}, ${metres(alongOf(line))} round`);
  const relief = reliefOf(stroke);
  return relief < 0
    ? msg(str`${fixed(-relief)} m deep, ${metres(spanOf(line))} long`)
    : msg(str`${fixed(relief)} m high, ${metres(spanOf(line))} long`);
}

/** Length of a line on the map, metres. */
function alongOf(line: Float64Array): number {
  let sum = 0;
  for (let i = 3; i < line.length; i += 3) sum += Math.hypot(line[i]! - line[i - 3]!, line[i + 1]! - line[i - 2]!);
  return sum;
}

/** How far apart on the map the ends of a profile are, the way back of an overhanging line not counted, metres. */
function spanOf(line: Float64Array): number {
  let most = 0;
  for (let i = 3; i < line.length; i += 3)
    most = Math.max(most, Math.hypot(line[i]! - line[0]!, line[i + 1]! - line[1]!));
  return most;
}
