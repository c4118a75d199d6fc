/**
 * Texts that show all that is in them, in the order in which it is (twin of `plain` in `backend/esker/contract/values.py`).
 *
 * The server takes the same characters out of every name that it is given; this page does so too, so that both have the
 * same document before and after.
 */

import { type SimpleOp, type Task, UNSEEN } from "../generated/contract.ts";

const RANGES = Object.entries(UNSEEN).map(([first, last]) => [Number(first), last] as const);
const SPACES: ReadonlySet<number> = new Set([9, 10, 13]);

/** A text without controls, without what turns the direction of text around, and without what takes no room. */
export function plainText(text: string): string {
  let out = "";
  for (const character of text) {
    const code = character.codePointAt(0) ?? 0;
    if (SPACES.has(code)) out += " ";
    else if (!RANGES.some(([first, last]) => code >= first && code <= last)) out += character;
  }
  return out;
}

function plainFields<T extends object>(value: T): T {
  let out = value;
  for (const [key, field] of Object.entries(value)) {
    if (typeof field !== "string") continue;
    const text = plainText(field);
    if (text !== field) out = { ...out, [key]: text };
  }
  return out;
}

/** A text of paragraphs that shows all that is in it: its line ends stay (twin of `plain_text` in `contract/tasks.py`). */
export function plainParagraphs(text: string): string {
  return text.replaceAll("\r", "").split("\n").map(plainText).join("\n");
}

/** The task of a terrain as the server keeps it. */
export function plainTask(task: Task): Task {
  return { ...task, title: plainText(task.title), text: plainParagraphs(task.text) };
}

/** An op whose names are plain. */
export function plainOp(op: SimpleOp): SimpleOp {
  switch (op.type) {
    case "stroke.begin":
      return { ...op, stroke: plainFields(op.stroke) };
    case "stroke.set":
      return { ...op, fields: plainFields(op.fields) } as SimpleOp;
    case "terrain.set":
      return {
        ...op,
        fields: plainFields(op.fields.task ? { ...op.fields, task: plainTask(op.fields.task) } : op.fields),
      };
    case "layer.set":
      return { ...op, fields: plainFields(op.fields) };
    case "layer.add":
      return { ...op, layer: { ...plainFields(op.layer), facts: plainFields(op.layer.facts) } };
    default:
      return op;
  }
}
