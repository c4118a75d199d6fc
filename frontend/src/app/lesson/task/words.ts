/** What a goal asks for, in words. */

import { msg, str } from "@lit/localize";
import { counted } from "../../../core/language.ts";
import { MAX_GRADE, type Task } from "../../../generated/contract.ts";

export type Goal = NonNullable<Task["goal"]>;

export type GoalType = Goal["type"] | "none";

export const GOALS: readonly { readonly value: GoalType; readonly label: string; readonly about: string }[] = [
  { value: "none", label: msg("No goal"), about: msg("A text alone: nothing is scored.") },
  { value: "terrain", label: msg("A target terrain"), about: msg("The ground is to become as this terrain is now.") },
  { value: "contours", label: msg("A contour map"), about: msg("The same, but pupils see its contours only.") },
  { value: "profile", label: msg("A profile"), about: msg("Along a line the ground is to have given heights.") },
  { value: "volume", label: msg("Water held"), about: msg("A basin is to hold so much water.") },
  { value: "slope", label: msg("A path"), about: msg("A path is nowhere to be too steep.") },
  { value: "area", label: msg("Land above a level"), about: msg("So much land is to stay above water.") },
  { value: "watershed", label: msg("A watershed"), about: msg("Rain from so much land is to run through a point.") },
];

const number = (v: number, digits = 3): string => counted(Number(v.toPrecision(digits)));
export const metreWords = (v: number): string => `${number(v, 4)} m`;
export const areaWords = (m2: number): string => (m2 >= 1e5 ? `${number(m2 / 1e6)} km²` : `${number(m2 / 1e4)} ha`);
export const volumeWords = (m3: number): string =>
  m3 >= 1e6 ? msg(str`${number(m3 / 1e6)} million m³`) : `${counted(Math.round(m3))} m³`;

export const percentWords = (share: number): string => `${number(100 * share)} %`;

/** The goal as a sentence for who draws. */
export function goalWords(goal: Goal): string {
  switch (goal.type) {
    case "terrain":
      return msg(
        str`Make the ground like the target. What is within ${metreWords(goal.tolerance_m)} of it counts whole.`,
      );
    case "contours":
      return msg(
        str`Make the ground that has these contours, ${metreWords(goal.interval_m)} apart. What is within ${metreWords(goal.tolerance_m)} counts whole.`,
      );
    case "profile":
      return msg(
        str`Along the yellow line, make the ground as the profile says. What is within ${metreWords(goal.tolerance_m)} counts whole.`,
      );
    case "volume":
      return msg(
        str`Around the yellow ring, hold ${volumeWords(goal.at_least_m3)} of water, no higher than ${metreWords(goal.level_m)}.`,
      );
    case "slope":
      return msg(
        str`Along the yellow path, nothing steeper than ${number(100 * Math.min(goal.at_most, MAX_GRADE))} %.`,
      );
    case "area":
      return goal.dry
        ? msg(
            str`Keep ${areaWords(goal.at_least_m2)} dry when the sea stands at ${metreWords(goal.level_m)}. Behind a dyke counts.`,
          )
        : msg(str`Have ${areaWords(goal.at_least_m2)} of land above ${metreWords(goal.level_m)}.`);
    case "watershed":
      return msg(str`Let rain from ${areaWords(goal.at_least_m2)} run through the yellow ring.`);
  }
}
