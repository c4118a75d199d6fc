/** A task as a file that teachers pass on (docs/tasks.md). Pure. */

import { msg, str } from "@lit/localize";
import { plain } from "../../../core/language.ts";
import { checkOp } from "../../../core/wire.ts";
import type { Task } from "../../../generated/contract.ts";
import { targetOf } from "./task-view.ts";

const FORMAT = "esker-task";
const VERSION = 1;
const MAX_FILE_CHARACTERS = 256 * 1024;

export interface TaskFile {
  readonly task: Task;
  readonly pictures: readonly string[];
}

export function writeTask({ task, pictures }: TaskFile, sizeM: number): string {
  return `${JSON.stringify({ format: FORMAT, version: VERSION, size_m: sizeM, task, pictures })}\n`;
}

/** The task in a file, for a terrain so wide. Throws an Error with a sentence. */
export function readTask(text: string, sizeM: number): TaskFile {
  const wrong = new Error(msg("This is not a task of Esker, or it is damaged."));
  if (text.length > MAX_FILE_CHARACTERS) throw wrong;
  let found: unknown;
  try {
    found = JSON.parse(text);
  } catch {
    throw wrong;
  }
  if (typeof found !== "object" || found === null || !("format" in found) || found.format !== FORMAT) throw wrong;
  const { version, task, pictures } = found as { version?: unknown; task?: unknown; pictures?: unknown };
  if (typeof version === "number" && version > VERSION)
    throw new Error(msg("This task was made by a newer Esker. Update, then open it again."));
  if (typeof task !== "object" || task === null) throw wrong;
  const fields = { task, task_pictures: pictures ?? [] };
  if (checkOp({ type: "terrain.set", fields }) !== null) throw wrong;
  const whole = { title: "", text: "", goal: null, difference: true, ...(task as Partial<Task>) };
  const target = targetOf(whole.goal);
  if (target !== null && target.size_m !== sizeM)
    throw new Error(
      msg(
        str`This task was made for a terrain ${plain(target.size_m / 1000)} km wide; this one is ${plain(sizeM / 1000)} km wide.`,
      ),
    );
  return { task: whole, pictures: fields.task_pictures as string[] };
}
