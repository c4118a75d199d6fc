/** What a goal asks for, in words. */

import { MAX_GRADE, type Task } from "../../../generated/contract.ts";

export type Goal = NonNullable<Task["goal"]>;

export type GoalType = Goal["type"] | "none";

export const GOALS: readonly { readonly value: GoalType; readonly label: string; readonly about: string }[] = [
  { value: "none", label: "No goal", about: "A text alone: nothing is scored." },
  { value: "terrain", label: "A target terrain", about: "The ground is to become as this terrain is now." },
  { value: "contours", label: "A contour map", about: "The same, but pupils see its contours only." },
  { value: "profile", label: "A profile", about: "Along a line the ground is to have given heights." },
  { value: "volume", label: "Water held", about: "A basin is to hold so much water." },
  { value: "slope", label: "A path", about: "A path is nowhere to be too steep." },
  { value: "area", label: "Land above a level", about: "So much land is to stay above water." },
  { value: "watershed", label: "A watershed", about: "Rain from so much land is to run through a point." },
];

const number = (v: number, digits = 3): string => Number(v.toPrecision(digits)).toLocaleString("en");
export const metreWords = (v: number): string => `${number(v, 4)} m`;
export const areaWords = (m2: number): string => (m2 >= 1e5 ? `${number(m2 / 1e6)} km²` : `${number(m2 / 1e4)} ha`);
export const volumeWords = (m3: number): string =>
  m3 >= 1e6 ? `${number(m3 / 1e6)} million m³` : `${Math.round(m3).toLocaleString("en")} m³`;

/** The goal as a sentence for who draws. */
export function goalWords(goal: Goal): string {
  switch (goal.type) {
    case "terrain":
      return `Make the ground like the target. What is within ${metreWords(goal.tolerance_m)} of it counts whole.`;
    case "contours":
      return `Make the ground that has these contours, ${metreWords(goal.interval_m)} apart. What is within ${metreWords(goal.tolerance_m)} counts whole.`;
    case "profile":
      return `Along the yellow line, make the ground as the profile says. What is within ${metreWords(goal.tolerance_m)} counts whole.`;
    case "volume":
      return `Around the yellow ring, hold ${volumeWords(goal.at_least_m3)} of water, no higher than ${metreWords(goal.level_m)}.`;
    case "slope":
      return `Along the yellow path, nothing steeper than ${number(100 * Math.min(goal.at_most, MAX_GRADE))} %.`;
    case "area":
      return goal.dry
        ? `Keep ${areaWords(goal.at_least_m2)} dry when the sea stands at ${metreWords(goal.level_m)}. Behind a dyke counts.`
        : `Have ${areaWords(goal.at_least_m2)} of land above ${metreWords(goal.level_m)}.`;
    case "watershed":
      return `Let rain from ${areaWords(goal.at_least_m2)} run through the yellow ring.`;
  }
}
