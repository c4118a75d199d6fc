// SPEC U26, U27, U28, U30
// @vitest-environment happy-dom
import { type Signal, signal } from "@preact/signals-core";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { KeptImport } from "../../src/app/device/kept-imports.ts";
import { Groundwork, VIEW_ONLY } from "../../src/app/layers/groundwork.ts";
import { rangeWords } from "../../src/app/layers/import-questions.ts";
import { Camera } from "../../src/core/camera/camera.ts";
import type { Ground, Vec3 } from "../../src/core/types.ts";
import { SyncDoc } from "../../src/doc/sync.ts";
import type { ImportAnswers, ImportStatus, Layer, Progress } from "../../src/generated/contract.ts";
import type { Placing } from "../../src/input/tools/placement.ts";
import "../../src/ui/panels/layers-panel.ts";
import type { EskLayersPanel } from "../../src/ui/panels/layers-panel.ts";
import { EMPTY } from "../doc/model.ts";
import { welcomeOf } from "../doc/welcome.ts";
import { layer, REPORT } from "../ui/grids.ts";

const ground: Ground = { sizeM: 4096, heightAt: () => 0, raycast: () => null };
const question = (id = "j"): ImportStatus => ({
  id,
  stage: "question",
  share: 0.3,
  text: "",
  report: REPORT,
  layer: null,
});

let doc: SyncDoc;
let placing: Signal<Placing | null>;
const progress = signal<Progress | null>(null);
const settled = (clock: number): Progress => ({
  type: "progress",
  clock,
  level: 4,
  of: 4,
  settled: true,
  note: "",
  refining: 0,
  laying: false,
});
let work: Groundwork;
let said: string[];
const frame = vi.fn();
let kept: readonly KeptImport[];
let editable: boolean;
let now: ImportStatus;
let answers: ImportAnswers[];
let cancelled: string[];

function open(layers: Layer[] = []): void {
  doc = new SyncDoc("me", () => 0);
  doc.welcome(welcomeOf({ document: { ...EMPTY, layers } }));
  work = new Groundwork({
    sizeM: 4096,
    doc,
    camera: Object.assign(new Camera(4096), { frame }),
    placing,
    canEdit: () => editable,
    ground: () => ground,
    transport: {
      upload: async () => now,
      status: async () => now,
      answer: async (_id, given) => {
        answers.push(given);
        now = { ...now, stage: "mipmaps" };
        return now;
      },
      cancel: async (id) => void cancelled.push(id),
    },
    calm: () => false,
    kept: [],
    keep: (list) => {
      kept = list;
    },
    say: (text) => said.push(text),
    progress,
    author: () => "Ana",
  });
}

const drop = async (name = "dome.npy"): Promise<void> => {
  work.add([new File(["x"], name)]);
  await vi.advanceTimersByTimeAsync(0);
};

beforeEach(() => {
  vi.useFakeTimers();
  frame.mockReset();
  progress.value = null;
  placing = signal<Placing | null>(null);
  [said, kept, answers, cancelled, editable, now] = [[], [], [], [], true, question()];
});
afterEach(() => {
  work.dispose();
  document.body.replaceChildren();
  vi.useRealTimers();
});

describe("a picture without a size (SPEC U345)", () => {
  it("begins as relief of a quarter of its side, framed in the view", async () => {
    const picture = {
      ...REPORT,
      low_m: 0,
      high_m: 6553.5,
      questions: [
        { id: "range", text: "How high? Write low..high.", options: [], default: "0..6553.5" },
        { id: "size", text: "How wide?", options: [], default: "fit" },
      ],
    };
    now = { ...question(), report: picture };
    open();
    await drop("heights.png");
    const job = work.imports.jobs.value[0]!;
    expect(work.answersTo(job).range).toBe("0..1020");
    expect(placing.value).toMatchObject({ low_m: 0, high_m: 1020 });
    expect(frame).toHaveBeenCalledTimes(1);
    const heights = (frame.mock.calls[0]![0] as readonly Vec3[]).map((p) => p[2]);
    expect([Math.min(...heights), Math.max(...heights)]).toEqual([0, 1020]);
    work.setAnswer(job, "range", "5..9");
    expect(work.answersTo(job).range, "what somebody says counts").toBe("5..9");
    expect(rangeWords("How high? Write low..high.")).toBe("How high?");
  });
});

describe("real ground on the page", () => {
  it("lets a person lay a grid without a place, and sends where", async () => {
    open();
    await drop();
    const held = placing.value!;
    expect(held).toMatchObject({ rows: 96, cols: 96, low_m: 2000, high_m: 2200 });
    expect(work.visual.value).not.toBeNull();
    expect(work.footprints.value.filter((f) => f.strong).map((f) => f.id)).toEqual(["import-1"]);
    held.moveTo({ anchor: [100, 200], rotation_deg: 27, spacing_m: [2, 2], scale: 1, lift_m: 5 }, "g");
    held.finish();
    await vi.advanceTimersByTimeAsync(0);
    expect(answers).toEqual([
      { answers: { size: "fit" }, anchor: [100, 200], rotation_deg: 27, spacing_m: [2, 2], scale: 1, lift_m: 5 },
    ]);
    expect(placing.value).toBeNull();
    expect(kept).toEqual([{ id: "j", file: "dome.npy" }]);
    now = { ...now, stage: "done", layer: "l1" };
    await vi.advanceTimersByTimeAsync(250);
    expect(work.onItsWay, "until its ground is there (SPEC U346)").toContain("The ground of dome.npy is on its way");
    progress.value = settled(0);
    expect(work.onItsWay).toBeNull();
    expect(said.at(-1)).toBe("dome.npy is part of the ground now.");
    expect(kept).toEqual([]);
  });

  it("asks before it places a grid whose questions were out of sight", async () => {
    const nodata = { id: "nodata", text: "Is 0 nodata?", options: ["0", "none"], default: "0" };
    now = { ...question(), report: { ...REPORT, questions: [...REPORT.questions, nodata] } };
    open();
    await drop();
    placing.value!.finish();
    await vi.advanceTimersByTimeAsync(0);
    expect(answers).toEqual([]);
    expect(placing.value).not.toBeNull();
    expect(work.asking.value).toBe(1);
    expect(said.at(-1)).toBe("One question about the file first.");
    work.questionsSeen(work.imports.jobs.value[0]!);
    placing.value!.finish();
    await vi.advanceTimersByTimeAsync(0);
    expect(answers).toMatchObject([{ answers: { size: "fit", nodata: "0" } }]);
  });

  it("gives the file up on Esc", async () => {
    open();
    await drop();
    placing.value!.cancel();
    expect(cancelled).toEqual(["j"]);
    expect(placing.value).toBeNull();
    expect(work.imports.jobs.value[0]!.phase).toBe("cancelled");
  });

  it("follows the answers: heights of the range, and hands off where a place is given", async () => {
    const place = { id: "place", text: "Where?", options: ["EPSG:4326", "middle"], default: "EPSG:4326" };
    const range = { id: "range", text: "How high?", options: [], default: "0..100" };
    now = { ...question(), report: { ...REPORT, questions: [place, range] } };
    open();
    await drop();
    const [job] = work.imports.jobs.value;
    expect(placing.value).toBeNull();
    work.setAnswer(job!, "place", "middle");
    expect(placing.value).toMatchObject({ low_m: 0, high_m: 100 });
    work.setAnswer(job!, "range", "10..4000");
    expect(placing.value).toMatchObject({ low_m: 10, high_m: 4000 });
    work.setAnswer(job!, "place", "EPSG:32610");
    expect(placing.value).toBeNull();
    await work.answer(job!);
    expect(answers).toEqual([{ answers: { place: "EPSG:32610", range: "10..4000" } }]);
  });

  it("tells people who may only look", () => {
    open();
    editable = false;
    work.add([new File(["x"], "a.tif")]);
    expect(said).toEqual([VIEW_ONLY]);
    expect(work.imports.jobs.value).toEqual([]);
  });

  it("does not call my own file somebody else's", async () => {
    open();
    await drop();
    const message = (id: string, author: string) => ({
      type: "importing" as const,
      author,
      file: "dome.npy",
      status: { ...question(id), stage: "reading" as const },
    });
    work.receive(message("j", "Ana"));
    expect(work.others.list.value).toEqual([]);
    work.receive(message("other", "Ben"));
    expect(work.others.list.value.length).toBe(1);
  });

  it("moves a layer live, one step of undo a gesture, and lets go of one that is deleted", () => {
    open([layer("a")]);
    work.togglePlacing(doc.doc.value!.layers.get("a")!);
    const held = placing.value!;
    held.moveTo({ ...held.place.peek(), anchor: [500, 600] }, "g1");
    held.moveTo({ ...held.place.peek(), anchor: [700, 600] }, "g1");
    expect(doc.doc.value!.layers.get("a")).toMatchObject({ anchor: [700, 600] });
    doc.undo();
    expect(held.place.value.anchor).toEqual([100, 200]);
    held.moveTo({ ...held.place.peek(), rotation_deg: 27 }, "g2");
    held.cancel();
    expect(doc.doc.value!.layers.get("a")).toMatchObject({ rotation_deg: 0 });
    expect(placing.value).toBeNull();
    work.togglePlacing(doc.doc.value!.layers.get("a")!);
    doc.submit({ type: "layer.delete", layer: "a" });
    expect(placing.value).toBeNull();
    expect(work.selected.value).toBeNull();
  });
});

describe("the layers panel", () => {
  async function panel(): Promise<EskLayersPanel> {
    const element = document.createElement("esk-layers-panel") as EskLayersPanel;
    const edits = {
      submit: (op: Parameters<SyncDoc["submit"]>[0]) => doc.submit(op) === null,
      newGesture: () => "g",
    };
    Object.assign(element, {
      doc: doc.doc,
      groundwork: work,
      placing,
      sizeM: 4096,
      canEdit: signal(editable),
      actions: new Map(),
      edits,
    });
    document.body.append(element);
    await element.updateComplete;
    return element;
  }
  const all = (e: Element, selector: string) => [...e.shadowRoot!.querySelectorAll<HTMLElement>(selector)];
  const names = (e: Element) => all(e, ".label").map((l) => l.textContent);

  it("says what one can do while there is none, and asks for a file", async () => {
    open();
    const element = await panel();
    const browse = vi.fn();
    element.addEventListener("browse", browse);
    expect(element.shadowRoot!.textContent).toContain("Drop a file with heights");
    all(element, ".add")[0]!.click();
    expect(browse).toHaveBeenCalledOnce();
  });

  it("lists layers as they are believed; arrow keys on the handle change that", async () => {
    open([layer("a", { name: "Valley" }), layer("b", { priority: 2 })]);
    const element = await panel();
    expect(names(element)).toEqual(["b.tif", "Valley"]);
    all(element, ".order")[1]!.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowUp", bubbles: true }));
    await element.updateComplete;
    expect(names(element)).toEqual(["Valley", "b.tif"]);
    doc.undo();
    await element.updateComplete;
    expect(names(element)).toEqual(["b.tif", "Valley"]);
  });

  it("hides and deletes, and undo brings back", async () => {
    open([layer("a")]);
    const element = await panel();
    const button = (label: string) => all(element, "button").find((b) => b.getAttribute("aria-label") === label)!;
    button("Hide a.tif").click();
    expect(doc.doc.value!.layers.get("a")!.hidden).toBe(true);
    await element.updateComplete;
    button("Delete a.tif").click();
    expect(doc.doc.value!.layers.size).toBe(0);
    doc.undo();
    expect(doc.doc.value!.layers.size).toBe(1);
  });

  it("changes nothing for people who may only look", async () => {
    editable = false;
    open([layer("a"), layer("b")]);
    const element = await panel();
    expect(all(element, ".order, .add")).toEqual([]);
    expect(all(element, ".icon-btn").every((b) => (b as HTMLButtonElement).disabled)).toBe(true);
  });
});
