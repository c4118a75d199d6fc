/** Why a ground has so many points, in the language of the page. The server's sentence is English; elsewhere its figures become words here. Pure. */

import { msg, str } from "@lit/localize";
import { fixed, language } from "../../../core/language.ts";
import type { Score } from "../../../generated/contract.ts";
import { areaWords, type Goal, metreWords, percentWords, volumeWords } from "./words.ts";

const near = (m: number): string => `${fixed(m, m < 10 ? 1 : 0)} m`;

function worded(goal: Goal, figures: readonly number[]): string | null {
  const [first, second, third, fourth] = figures;
  if (first === undefined || second === undefined) return null;
  switch (goal.type) {
    case "terrain":
    case "contours":
      return fourth
        ? msg(
            str`${first} % of the ground that is to be shaped is within ${near(second)} of the target; the mean difference is ${near(third!)}.`,
          )
        : msg(
            str`${first} % of the ground is within ${near(second)} of the target; the mean difference is ${near(third!)}.`,
          );
    case "profile":
      return msg(
        str`${first} % of the line is within ${near(second)} of the profile; the mean difference is ${near(third!)}.`,
      );
    case "volume": {
      if (third === undefined) return msg("No water stays at the point; it runs away.");
      const held = msg(str`The lake holds ${volumeWords(first)} of the ${volumeWords(second)} asked for.`);
      const level = near(third);
      return fourth
        ? msg(str`${held} It stands at ${level}, where it would run over.`)
        : msg(str`${held} It stands at ${level}, as high as it may.`);
    }
    case "slope":
      return msg(
        str`${first} % of the path is no steeper than ${percentWords(second)}; the steepest place has ${percentWords(third!)}.`,
      );
    case "area":
      return goal.dry
        ? msg(
            str`${areaWords(first)} of the ${areaWords(second)} asked for stay dry with the sea at ${metreWords(third!)}.`,
          )
        : msg(str`${areaWords(first)} of the ${areaWords(second)} asked for are above ${metreWords(third!)}.`);
    case "watershed":
      return msg(str`Rain from ${areaWords(first)} of the ${areaWords(second)} asked for runs through the point.`);
  }
}

/** The sentence of a score without its points. */
export function scoreWords(goal: Goal | null, score: Pick<Score, "text" | "figures">): string {
  const ours = language() === "en" || goal === null ? null : worded(goal, score.figures ?? []);
  return ours ?? score.text.replace(/^\d+ of 100: /, "").replace(/^./, (letter) => letter.toUpperCase());
}
