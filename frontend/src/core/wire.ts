/**
 * Checks what this page sends before it sends it, by the table that `esker.contract.emit` writes from the models of the
 * contract (SPEC H472).
 *
 * The server closes a connection for good when a message is malformed, so a slip in the page (a NaN from a degenerate
 * drag, a label too long) must be found here and refused like any other op. `tests/vectors/messages.json` holds the
 * cases that both languages read.
 */

import { WIRE_MODELS, WIRE_UNIONS, type WireCheck, type WireModel } from "../generated/wire.ts";

/** Null when the value is well formed, else what is wrong with it. */
export type Check = (value: unknown) => string | null;

const number =
  (low: number, high: number, exclusive = false): Check =>
  (v) =>
    typeof v === "number" && v >= low && v <= high && !(exclusive && (v === low || v === high))
      ? null
      : `must be a number from ${low} to ${high}`;

const integer =
  (low: number, high: number): Check =>
  (v) =>
    Number.isInteger(v) && (v as number) >= low && (v as number) <= high
      ? null
      : `must be a whole number from ${low} to ${high}`;

const text =
  (low: number, high: number): Check =>
  (v) =>
    typeof v === "string" && [...v].length >= low && [...v].length <= high
      ? null
      : `must be a text of ${low} to ${high} characters`;

const matches =
  (pattern: RegExp, most: number): Check =>
  (v) =>
    typeof v === "string" && v.length <= most && pattern.test(v) ? null : "has a form that is not allowed";

const oneOf =
  (values: readonly unknown[]): Check =>
  (v) =>
    values.includes(v) ? null : `must be one of ${values.join(", ")}`;

const bool: Check = (v) => (typeof v === "boolean" ? null : "must be true or false");

const nullable =
  (check: Check): Check =>
  (v) =>
    v === null ? null : check(v);

const list =
  (item: Check, low: number, high: number): Check =>
  (v) => {
    if (!Array.isArray(v) || v.length < low || v.length > high) return `must be a list of ${low} to ${high} items`;
    for (const [i, x] of v.entries()) {
      const wrong = item(x);
      if (wrong !== null) return `item ${i} ${wrong}`;
    }
    return null;
  };

const tuple =
  (checks: readonly Check[]): Check =>
  (v) => {
    if (!Array.isArray(v) || v.length !== checks.length) return `must hold ${checks.length} numbers`;
    return checks.map((check, i) => check(v[i])).find((wrong) => wrong !== null) ?? null;
  };

const record = ({ must, may }: WireModel): Check => {
  const required = new Map(Object.entries(must).map(([name, check]) => [name, checkOf(check)]));
  const optional = new Map(Object.entries(may).map(([name, check]) => [name, checkOf(check)]));
  return (v) => {
    if (typeof v !== "object" || v === null || Array.isArray(v)) return "must be an object";
    for (const [name, x] of Object.entries(v)) {
      const check = required.get(name) ?? optional.get(name);
      const wrong = check === undefined ? "is not known" : x === undefined && optional.has(name) ? null : check(x);
      if (wrong !== null) return `${name} ${wrong}`;
    }
    const missing = [...required.keys()].find((name) => !Object.hasOwn(v, name));
    return missing === undefined ? null : `${missing} is missing`;
  };
};

/** An object whose `type` names its model. */
const union = (models: readonly string[]): Check => {
  const checks = new Map(models.flatMap((name) => typesOf(name).map((type) => [type, modelCheck(name)] as const)));
  return (v) => {
    if (typeof v !== "object" || v === null) return "must be an object";
    const check = checks.get(String((v as { type?: unknown }).type));
    return check === undefined ? "type is not known" : check(v);
  };
};

/** The values that the field `type` of a model may have. */
function typesOf(model: string): readonly string[] {
  const type = WIRE_MODELS[model]?.must.type;
  return type !== undefined && "oneOf" in type ? type.oneOf : [];
}

const made = new Map<string, Check>();

function modelCheck(name: string): Check {
  const check = made.get(name) ?? record(WIRE_MODELS[name]!);
  made.set(name, check);
  return check;
}

/** The function for a row of the table. */
function checkOf(rule: WireCheck): Check {
  if ("number" in rule) return number(...rule.number);
  if ("between" in rule) return number(...rule.between, true);
  if ("integer" in rule) return integer(...rule.integer);
  if ("text" in rule) return text(...rule.text);
  if ("matches" in rule) return matches(new RegExp(rule.matches), rule.most ?? Number.POSITIVE_INFINITY);
  if ("oneOf" in rule) return oneOf(rule.oneOf);
  if ("bool" in rule) return bool;
  if ("nullable" in rule) return nullable(checkOf(rule.nullable));
  if ("list" in rule) return list(checkOf(rule.list), ...rule.length);
  if ("tuple" in rule) return tuple(rule.tuple.map(checkOf));
  return "model" in rule ? modelCheck(rule.model) : union(rule.union);
}

/** Checks an op against the contract. */
export const checkOp: Check = union(WIRE_UNIONS.Op);

/** Checks a message of this page against the contract. */
export const checkClientMessage: Check = union(WIRE_UNIONS.ClientMessage);
