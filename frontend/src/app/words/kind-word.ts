import { msg } from "@lit/localize";
import type { Stroke } from "../../generated/contract.ts";
import { shapeOf } from "../view/scene.ts";
import { paintName } from "./paints.ts";

export const COURSE_WORDS = { river: msg("River"), road: msg("Road"), ridge: msg("Ridge") } as const;

/** Returns the kind of a stroke in a word. */
export function kindWord(stroke: Stroke): string {
  if (stroke.paint !== null) return paintName(stroke.paint);
  if (stroke.course !== null) return COURSE_WORDS[stroke.course.use];
  if (stroke.kind === "level") return msg("Plateau");
  return shapeOf(stroke).sinks ? msg("Crevice") : msg("Mountain");
}
