import type { Stroke } from "../../generated/contract.ts";
import { shapeOf } from "../view/scene.ts";
import { paintName } from "./paints.ts";

export const COURSE_WORDS = { river: "River", road: "Road", ridge: "Ridge" } as const;

/** Returns the kind of a stroke in a word. */
export function kindWord(stroke: Stroke): string {
  if (stroke.paint !== null) return paintName(stroke.paint);
  if (stroke.course !== null) return COURSE_WORDS[stroke.course.use];
  if (stroke.kind === "level") return "Plateau";
  return shapeOf(stroke).sinks ? "Crevice" : "Mountain";
}
