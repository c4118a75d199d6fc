/**
 * The rules of the contract for what this page sends, checked before it is sent (twin of the models of the contract).
 *
 * The server closes a connection for good when a message is malformed, so a slip in the page (a NaN from a degenerate
 * drag, a label too long) must be found here and refused like any other op. `tests/vectors/messages.json` holds the
 * cases that both languages read.
 */

import {
  ABSOLUTE_BOUND_M,
  EDGE_POINTS,
  MAX_DETAIL,
  MAX_GRID_SAMPLES,
  MAX_GRID_SPACING_M,
  MAX_NAME_LENGTH,
  MAX_OPS_PER_GROUP,
  MAX_OPS_PER_MESSAGE,
  MAX_POINTS_PER_APPEND,
  MAX_POINTS_PER_STROKE,
  MAX_SLOPE_DEG,
  MAX_VERTICAL_SCALE,
  MIN_GRID_SIDE,
  MIN_GRID_SPACING_M,
} from "../generated/contract.ts";

/** Null when the value is well formed, else what is wrong with it. */
export type Check = (value: unknown) => string | null;
interface Field {
  readonly check: Check;
  readonly required: boolean;
}
type Shape = Readonly<Record<string, Field>>;

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
  (pattern: RegExp): Check =>
  (v) =>
    typeof v === "string" && pattern.test(v) ? null : "has a form that is not allowed";

const oneOf =
  (...values: unknown[]): Check =>
  (v) =>
    values.includes(v) ? null : `must be one of ${values.join(", ")}`;

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
  (...checks: Check[]): Check =>
  (v) => {
    if (!Array.isArray(v) || v.length !== checks.length) return `must hold ${checks.length} numbers`;
    return checks.map((check, i) => check(v[i])).find((wrong) => wrong !== null) ?? null;
  };

const record =
  (shape: Shape): Check =>
  (v) => {
    if (typeof v !== "object" || v === null || Array.isArray(v)) return "must be an object";
    for (const [name, x] of Object.entries(v)) {
      const field = Object.hasOwn(shape, name) ? shape[name] : undefined;
      const wrong = field === undefined ? "is not known" : x === undefined && !field.required ? null : field.check(x);
      if (wrong !== null) return `${name} ${wrong}`;
    }
    const missing = Object.keys(shape).find((name) => shape[name]!.required && !Object.hasOwn(v, name));
    return missing === undefined ? null : `${missing} is missing`;
  };

/** An object whose `type` names its shape. */
const union = (shapes: Readonly<Record<string, Shape>>): Check => {
  const checks = new Map(
    Object.entries(shapes).map(([type, shape]) => [type, record({ type: need(oneOf(type)), ...shape })] as const),
  );
  return (v) => {
    if (typeof v !== "object" || v === null) return "must be an object";
    const check = checks.get(String((v as { type?: unknown }).type));
    return check === undefined ? "type is not known" : check(v);
  };
};

function need(check: Check): Field {
  return { check, required: true };
}

function may(check: Check): Field {
  return { check, required: false };
}

const metres = number(-ABSOLUTE_BOUND_M, ABSOLUTE_BOUND_M);
const metreLength = number(0, ABSOLUTE_BOUND_M);
const vec3 = tuple(metres, metres, metres);
const point = tuple(number(-1e7, 1e7), number(-1e7, 1e7));
const id = matches(/^[A-Za-z0-9_-]{1,40}$/);
const name = text(0, MAX_NAME_LENGTH);
const colour = matches(/^#[0-9a-f]{6}$/);
const clock = integer(0, 2 ** 53);
const bool: Check = (v) => (typeof v === "boolean" ? null : "must be true or false");
const curve = list(point, 0, MAX_POINTS_PER_STROKE);
const flank = nullable(
  record({
    slope_deg: may(nullable(number(0, MAX_SLOPE_DEG))),
    extent_m: may(metreLength),
    shape: may(oneOf("straight", "concave", "convex")),
  }),
);
const reach = number(0, ABSOLUTE_BOUND_M);
const paint = record({
  channel: need(oneOf("roughness", "amplitude", "snow", "grass", "forest", "wetness")),
  value: need(number(-1, 1)),
  radius_m: need(metreLength),
});

const strokeShape: Shape = {
  id: need(id),
  author: may(name),
  kind: need(oneOf("profile", "level", "paint")),
  first: need(vec3),
  last: need(vec3),
  curve: need(curve),
  left: may(flank),
  right: may(flank),
  plateau_radius_m: may(metreLength),
  amplitude_m: may(metreLength),
  roughness: may(number(0, 1)),
  paint: may(nullable(paint)),
  locked: may(bool),
  hidden: may(bool),
  label: may(name),
  finished: may(bool),
};

const side = integer(MIN_GRID_SIDE, MAX_GRID_SAMPLES);
const unit = number(0, 1);
const line = text(0, 240);
const step = number(MIN_GRID_SPACING_M, MAX_GRID_SPACING_M);
const facts = record({
  rows: need(side),
  cols: need(side),
  low_m: need(metres),
  high_m: need(metres),
  valid: may(unit),
  geo: may(bool),
  crs: may(name),
  format: may(name),
  file: may(name),
  edge: may(list(point, 0, EDGE_POINTS)),
});

const layerShape: Shape = {
  id: need(id),
  content: need(matches(/^[0-9a-f]{64}$/)),
  facts: need(facts),
  author: may(name),
  name: may(name),
  anchor: need(tuple(metres, metres)),
  rotation_deg: may(number(-360, 360)),
  spacing_m: need(tuple(step, step)),
  scale: may(number(-MAX_VERTICAL_SCALE, MAX_VERTICAL_SCALE)),
  lift_m: may(metres),
  accuracy_m: need(metreLength),
  priority: may(integer(-1e6, 1e6)),
  hidden: may(bool),
  outline: may(unit),
  source: may(line),
  licence: may(line),
};

/** Null is well formed for every field of a partial update; `apply` says where it has a meaning. */
function partial(shape: Shape, names: readonly string[]): Check {
  return record(Object.fromEntries(names.map((n) => [n, may(nullable(shape[n]!.check))])));
}

const strokeFields = partial(
  strokeShape,
  Object.keys(strokeShape).filter((n) => !["id", "author", "kind", "finished"].includes(n)),
);
const layerFields = partial(
  layerShape,
  Object.keys(layerShape).filter((n) => !["id", "content", "facts", "author"].includes(n)),
);
const terrainFields = record({
  title: may(nullable(name)),
  reach_m: may(nullable((v) => (v === 0 ? "must be above 0" : reach(v)))),
  border: may(nullable(oneOf("free", "pinned"))),
  sea_level_m: may(nullable(metres)),
  lakes_m: may(nullable(metreLength)),
  seed: may(nullable(integer(0, 2 ** 32 - 1))),
  look: may(nullable(oneOf("natural", "alpine", "desert", "paper"))),
  detail: may(nullable(number(0, MAX_DETAIL))),
  rule: may(nullable(oneOf("landscape", "smooth", "plain"))),
  sun_azimuth_deg: may(nullable(number(0, 360))),
  sun_elevation_deg: may(nullable(number(0, 90))),
  place: may(nullable(record({ lat_deg: need(number(-89, 89)), lon_deg: need(number(-180, 180)) }))),
});

const simpleOps: Readonly<Record<string, Shape>> = {
  "stroke.begin": { stroke: need(record(strokeShape)) },
  "stroke.append": {
    stroke: need(id),
    start: need(integer(0, MAX_POINTS_PER_STROKE)),
    points: need(list(point, 0, MAX_POINTS_PER_APPEND)),
    last: need(vec3),
  },
  "stroke.finish": { stroke: need(id) },
  "stroke.set": { stroke: need(id), fields: need(strokeFields) },
  "stroke.anchor": { stroke: need(id), which: need(oneOf("first", "last")), to: need(vec3) },
  "stroke.delete": { stroke: need(id) },
  "stroke.restore": { stroke: need(id) },
  "layer.add": { layer: need(record(layerShape)) },
  "layer.set": { layer: need(id), fields: need(layerFields) },
  "layer.delete": { layer: need(id) },
  "layer.restore": { layer: need(id) },
  "terrain.set": { fields: need(terrainFields) },
};

/** Checks an op against the contract. */
export const checkOp: Check = union({
  ...simpleOps,
  group: { ops: need(list(union(simpleOps), 1, MAX_OPS_PER_GROUP)) },
});

const envelope = record({ id: need(matches(/^[A-Za-z0-9_-]{1,40}:[0-9]{1,12}$/)), op: need(checkOp) });

/** Checks a message of this page against the contract. */
export const checkClientMessage: Check = union({
  hello: {
    protocol: need(integer(Number.MIN_SAFE_INTEGER, Number.MAX_SAFE_INTEGER)),
    terrain: need(id),
    secret: need(text(1, 128)),
    client: need(id),
    name: may(name),
    colour: may(nullable(colour)),
    clock: may(nullable(clock)),
    at: may(nullable(clock)),
  },
  ops: { ops: need(list(envelope, 1, MAX_OPS_PER_MESSAGE)) },
  view: {
    eye: need(vec3),
    target: need(vec3),
    fov_deg: may(number(1, 170, true)),
    width: may(integer(1, 16384)),
    height: may(integer(1, 16384)),
    tau_px: may(number(0.25, 64)),
  },
  presence: {
    cursor: may(nullable(vec3)),
    tool: may(text(0, 24)),
    stroke: may(nullable(id)),
    eye: may(nullable(vec3)),
    target: may(nullable(vec3)),
  },
  credit: { bytes: need(integer(0, 2 ** 31)) },
  rename: { name: need(name), colour: may(nullable(colour)) },
  seek: { clock: need(clock) },
  ping: { t: need(number(-Number.MAX_VALUE, Number.MAX_VALUE)) },
});
