// @vitest-environment happy-dom
// Every action on a key, and keys only where they are meant (SPEC I60-I64).

import { signal } from "@preact/signals-core";
import { beforeEach, describe, expect, it } from "vitest";
import type { Camera } from "../../src/core/camera/camera.ts";
import { distance } from "../../src/core/math.ts";
import { SyncDoc } from "../../src/doc/sync.ts";
import { toolDefaults } from "../../src/input/defaults.ts";
import type { Action, ActionId, ToolId } from "../../src/input/keys/action.ts";
import { createActions } from "../../src/input/keys/actions.ts";
import { actionFor, combination, Keyboard, meantForCanvas } from "../../src/input/keys/keyboard.ts";
import { createOps } from "../../src/input/sketch/strokeops.ts";
import { Navigation } from "../../src/input/tools/navigation.ts";
import { Ruler } from "../../src/input/tools/ruler.ts";
import { EMPTY, ridge } from "../doc/model.ts";
import { welcomeOf } from "../doc/welcome.ts";
import { camera, FLAT, SIZE } from "./scene.ts";

let c: Camera;
let doc: SyncDoc;
let actions: Map<string, Action>;
let time: number;
let editable: boolean;
const tool = signal<ToolId>("mountain");
const selection = signal<string | null>(null);
const fingerDraws = signal(true);

function run(id: ActionId): void {
  const action = actions.get(id)!;
  expect(action.enabled()).toBe(true);
  action.run();
}

beforeEach(() => {
  c = camera();
  time = 5_000_000;
  editable = true;
  doc = new SyncDoc("me", () => time);
  const strokes = [
    ridge("a", {
      curve: [
        [0, 0],
        [0.5, 100],
        [1, 0],
      ],
      left: { slope_deg: 20, extent_m: 100, shape: "concave" },
    }),
    ridge("b", {
      curve: [
        [0, 0],
        [1, 0],
      ],
      locked: true,
    }),
  ];
  doc.welcome(welcomeOf({ document: { ...EMPTY, strokes } }));
  tool.value = "mountain";
  selection.value = null;
  let ids = 0;
  actions = createActions({
    camera: c,
    doc,
    ground: () => FLAT,
    freeze: () => FLAT,
    canEdit: () => editable,
    tool,
    selection,
    placing: signal(null),
    ruler: new Ruler(),
    fingerDraws,
    defaults: toolDefaults(SIZE),
    newId: () => `copy${ids++}`,
    onMessage: () => {},
    cancel: () => false,
    keyPen: { show: () => {}, usable: () => false },
    now: () => time,
  });
});

const stroke = (id: string) => doc.doc.value!.strokes.get(id)!;
const key = (k: string, over: Partial<KeyboardEventInit> = {}) =>
  combination({ key: k, code: "", ctrlKey: false, metaKey: false, altKey: false, shiftKey: false, ...over });

describe("the map of actions", () => {
  it("gives every action a title and a key of its own (SPEC I60)", () => {
    const seen = new Map<string, string>();
    for (const [id, action] of actions) {
      expect(action.title.length).toBeGreaterThan(3);
      expect(action.keys.length).toBeGreaterThan(0);
      for (const k of action.keys) {
        expect(seen.get(k), `${k} of ${id}`).toBeUndefined();
        seen.set(k, id);
      }
    }
    expect(actions.size).toBeGreaterThan(30);
  });

  it("leaves undone what cannot be done", () => {
    expect(actions.get("delete")!.enabled()).toBe(false);
    expect(actions.get("undo")!.enabled()).toBe(false);
    selection.value = "b";
    expect(actions.get("delete")!.enabled()).toBe(false);
    expect(actions.get("lock")!.enabled()).toBe(true);
    editable = false;
    expect(actions.get("lock")!.enabled()).toBe(false);
    expect(actions.get("home")!.enabled()).toBe(true);
  });

  it("chooses tools", () => {
    for (const id of ["select", "crevice", "plateau", "mountain"] as const) {
      run(id);
      expect(tool.value).toBe(id);
    }
  });

  it("edits the selected stroke, one undo step each (SPEC I61)", () => {
    selection.value = "a";
    run("mirror");
    expect([stroke("a").left, stroke("a").right?.extent_m]).toEqual([null, 100]);
    run("undo");
    expect(stroke("a").left?.extent_m).toBe(100);
    run("redo");
    run("hide");
    expect(stroke("a").hidden).toBe(true);
    run("lock");
    expect(stroke("a").locked).toBe(true);
    run("lock");
    run("delete");
    expect(doc.doc.value!.strokes.has("a")).toBe(false);
    expect(selection.value).toBeNull();
    run("undo");
    expect(doc.doc.value!.strokes.has("a")).toBe(true);
  });

  it("duplicates even a locked stroke, and selects the copy", () => {
    selection.value = "b";
    run("duplicate");
    const copy = stroke("copy0");
    expect(selection.value).toBe("copy0");
    expect([copy.locked, copy.finished, copy.curve]).toEqual([
      false,
      true,
      [
        [0, 0],
        [1, 0],
      ],
    ]);
    expect(distance(copy.first, stroke("b").first)).toBeGreaterThan(50);
    run("undo");
    expect(doc.doc.value!.strokes.has("copy0")).toBe(false);
  });

  it("creates strokes of any length within the size of a message", () => {
    const curve = Array.from({ length: 4096 }, (_, i): [number, number] => [i / 4095, 100 * Math.sin(i / 50)]);
    for (const op of createOps(ridge("long", { curve, finished: true }))) expect(doc.submit(op, "g")).toBeNull();
    expect(stroke("long").curve).toEqual(curve);
    expect(stroke("long").finished).toBe(true);
  });

  it("nudges as seen on the screen; a held key is one step", () => {
    selection.value = "a";
    const before = stroke("a").first;
    run("nudge-right");
    time += 50;
    run("nudge-right");
    run("nudge-up");
    const after = stroke("a").first;
    expect(after[0] - before[0]).toBeCloseTo(32, 6); // the camera looks north: right is east
    expect(after[1] - before[1]).toBeCloseTo(16, 6);
    run("undo");
    expect(stroke("a").first).toEqual(before);
    selection.value = null;
    const { eye } = c.state.value;
    run("nudge-right");
    expect(c.state.value.eye[0]).toBeGreaterThan(eye[0]);
  });

  it("raises and lowers", () => {
    selection.value = "a";
    run("raise");
    expect(stroke("a").curve[1]![1]).toBeCloseTo(100 + 4096 / 400, 2);
    run("lower");
    run("lower");
    expect(stroke("a").curve[1]![1]).toBeLessThan(100);
  });

  it("steps through the strokes and round", () => {
    run("next-stroke");
    expect(selection.value).toBe("a");
    run("next-stroke");
    run("next-stroke");
    expect(selection.value).toBe("a");
    run("previous-stroke");
    expect(selection.value).toBe("b");
    run("cancel");
    expect(selection.value).toBeNull();
  });

  it("frames the selection, switches modes, remembers views", () => {
    selection.value = "a";
    run("frame-selection");
    for (let i = 0; i < 200 && c.update(0.02, FLAT); i++);
    expect(c.project([500, 100, 100]).visible).toBe(true);
    run("save-view-1");
    const { eye } = c.state.value;
    for (const mode of ["map", "fly", "orbit"] as const) {
      run(`camera-${mode}`);
      expect(c.state.value.mode).toBe(mode);
    }
    run("home");
    for (let i = 0; i < 200 && c.update(0.02, FLAT); i++);
    run("view-1");
    for (let i = 0; i < 200 && c.update(0.02, FLAT); i++);
    expect(distance(c.state.value.eye, eye)).toBeLessThan(0.01);
    expect(actions.get("view-2")!.enabled()).toBe(false);
  });
});

describe("keys", () => {
  it("are named the same on every layout (SPEC I62)", () => {
    expect(key("Z", { ctrlKey: true, shiftKey: true })).toBe("Ctrl+Shift+z");
    expect(key("z", { metaKey: true })).toBe("Ctrl+z");
    expect(key("?", { shiftKey: true, code: "Slash" })).toBe("?");
    expect(key("+", { shiftKey: true })).toBe("+");
    expect(key("¡", { altKey: true, code: "Digit1" })).toBe("Alt+1");
    expect(key("!", { altKey: true, shiftKey: true, code: "Digit1" })).toBe("Alt+Shift+1");
    expect(key("м", { code: "KeyV" })).toBe("v");
    expect(key("F", { shiftKey: true, code: "KeyF" })).toBe("Shift+f");
    expect(key("Delete")).toBe("Delete");
    expect(key("2", { code: "Digit2" })).toBe("2");
  });

  it("find the enabled action", () => {
    expect(actionFor(actions, "v")).toBe(actions.get("select"));
    expect(actionFor(actions, "Delete")).toBeNull();
    selection.value = "a";
    expect(actionFor(actions, "Delete")).toBe(actions.get("delete"));
  });

  it("are not taken from fields, dialogs and focused controls (SPEC I63)", () => {
    document.body.innerHTML = `<input id="i"><input id="s" type="checkbox"><div role="dialog"><p id="d"></p></div><button id="b"></button><p id="p"></p>`;
    const meant = (id: string, k: string): boolean => {
      let result = false;
      const listener = (e: KeyboardEvent): void => {
        result = meantForCanvas(e);
      };
      window.addEventListener("keydown", listener);
      document
        .getElementById(id)!
        .dispatchEvent(new KeyboardEvent("keydown", { key: k, bubbles: true, composed: true }));
      window.removeEventListener("keydown", listener);
      return result;
    };
    expect(meant("i", "b")).toBe(false);
    expect(meant("d", "b")).toBe(false);
    expect(meant("s", "b")).toBe(true);
    expect(meant("s", " ")).toBe(false);
    expect(meant("b", " ")).toBe(false);
    expect(meant("b", "ArrowUp")).toBe(false);
    expect(meant("b", "b")).toBe(true);
    expect(meant("p", " ")).toBe(true);
  });

  it("W flies in fly mode, and is free elsewhere (SPEC I64)", () => {
    const navigation = new Navigation(c, () => FLAT);
    const keyboard = new Keyboard(c, navigation, actions, { key: () => false });
    const frames: FrameRequestCallback[] = [];
    const original = globalThis.requestAnimationFrame;
    globalThis.requestAnimationFrame = (run) => frames.push(run);
    const press = (type: string): void =>
      void window.dispatchEvent(new KeyboardEvent(type, { key: "w", code: "KeyW" }));
    press("keydown");
    expect(frames.length).toBe(0);
    c.setMode("fly");
    const { eye, target } = c.state.value;
    press("keydown");
    frames.shift()!(performance.now() + 100);
    const moved = c.state.value.eye;
    expect(distance(moved, eye)).toBeGreaterThan(1);
    expect(distance(moved, target)).toBeLessThan(distance(eye, target));
    press("keyup");
    frames.shift()!(performance.now() + 200);
    expect(frames.length).toBe(0);
    globalThis.requestAnimationFrame = original;
    keyboard.dispose();
    navigation.dispose();
  });
});
