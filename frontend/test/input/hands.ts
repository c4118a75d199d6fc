/** Synthetic pointers over a canvas with a real controller, camera and document, for the input tests (SPEC I40-I54). */

import { afterEach, beforeEach, expect, vi } from "vitest";
import type { Camera } from "../../src/core/camera/camera.ts";
import type { Vec3 } from "../../src/core/types.ts";
import { SyncDoc } from "../../src/doc/sync.ts";
import type { Stroke } from "../../src/generated/contract.ts";
import { InputController, type InputOptions } from "../../src/input/controller.ts";
import { toolDefaults } from "../../src/input/defaults.ts";
import type { RefusedHere } from "../../src/input/say.ts";
import type { HandleKind } from "../../src/input/tools/handles.ts";
import { EMPTY, ridge } from "../doc/model.ts";
import { welcomeOf } from "../doc/welcome.ts";
import { camera, FLAT, SIZE } from "./scene.ts";

// Read as live bindings; only this module assigns them.
export type PointerType = "mouse" | "pen" | "touch";

export let canvas: HTMLElement;
export let c: Camera;
export let doc: SyncDoc;
export let input: InputController;
export let messages: string[];
/** Ops of the tools that were refused, with the codes. */
export let refusals: RefusedHere[];
export let cursors: (Vec3 | null)[];
export let time: number;
let editable: boolean;

export function open(mode: "orbit" | "map" = "orbit", over: Partial<InputOptions> = {}): void {
  canvas = document.createElement("div");
  // The page shows 500 x 400 CSS pixels for 1000 x 800 device pixels.
  canvas.getBoundingClientRect = () => ({ left: 10, top: 20, width: 500, height: 400 }) as DOMRect;
  document.body.append(canvas);
  c = camera(mode);
  time = 1_000_000;
  doc = new SyncDoc("me", () => time);
  doc.welcome(welcomeOf({ document: EMPTY }));
  messages = [];
  refusals = [];
  cursors = [];
  editable = true;
  input = new InputController({
    canvas,
    camera: c,
    doc,
    ground: () => FLAT,
    freeze: () => FLAT,
    clientId: "me",
    canEdit: () => editable,
    defaults: toolDefaults(SIZE),
    onCursor: (p) => cursors.push(p),
    onMessage: (m, refused) => {
      messages.push(m);
      if (refused !== undefined) refusals.push(refused);
    },
    now: () => time,
    ...over,
  });
}

/** A pointer event at a device pixel. */
export function fire(type: string, x: number, y: number, init: PointerEventInit = {}): void {
  time += 20;
  vi.advanceTimersByTime(20);
  const at = { clientX: 10 + x / 2, clientY: 20 + y / 2 };
  canvas.dispatchEvent(
    new PointerEvent(type, {
      pointerId: 1,
      pointerType: "mouse",
      button: 0,
      bubbles: true,
      cancelable: true,
      ...at,
      ...init,
    }),
  );
}

export function at(p: Vec3): [number, number] {
  const { x, y } = c.project(p);
  return [x, y];
}

/** Goes down, moves in steps over world points, and is lifted unless told otherwise. */
export function stroke(path: readonly Vec3[], init: PointerEventInit = {}, release = true): void {
  fire("pointerdown", ...at(path[0]!), init);
  for (let i = 1; i < path.length; i++) {
    const [a, b] = [at(path[i - 1]!), at(path[i]!)];
    for (let k = 1; k <= 10; k++)
      fire("pointermove", a[0] + ((b[0] - a[0]) * k) / 10, a[1] + ((b[1] - a[1]) * k) / 10, init);
  }
  if (release) fire("pointerup", ...at(path.at(-1)!), init);
}

export const PEAK: readonly Vec3[] = [
  [1400, 1700, 0],
  [2048, 1700, 300],
  [2700, 1700, 0],
];
export const strokes = (): Stroke[] => [...doc.doc.value!.strokes.values()];
export const only = (): Stroke => {
  expect(strokes().length).toBe(1);
  return strokes()[0]!;
};

export function place(over: Partial<Stroke> = {}): Stroke {
  const flank = { slope_deg: 35, extent_m: 512, shape: "concave" as const };
  const s = ridge("r", {
    first: [1400, 1700, 0],
    last: [2700, 1700, 0],
    curve: [
      [0, 0],
      [0.25, 150],
      [0.5, 300],
      [0.75, 150],
      [1, 0],
    ],
    left: flank,
    right: { ...flank },
    finished: true,
    ...over,
  });
  expect(doc.submit({ type: "stroke.begin", stroke: s })).toBeNull();
  return s;
}

export function handle(kind: HandleKind) {
  return input.handles.value.find((h) => h.kind === kind)!;
}

/** From now on the link only looks. */
export function lookOnly(): void {
  editable = false;
}

/** Lets time pass without an event. */
export function pass(ms: number): void {
  time += ms;
}

/** Opens a controller before each test and closes it after. */
export function openForEach(): void {
  beforeEach(() => {
    vi.useFakeTimers();
    open();
  });
  afterEach(() => {
    input.dispose();
    canvas.remove();
    vi.useRealTimers();
  });
}
