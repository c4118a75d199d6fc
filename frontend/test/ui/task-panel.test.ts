// @vitest-environment happy-dom
// The task for who draws, and for who leads (SPEC L114).
import { signal } from "@preact/signals-core";
import { afterEach, expect, it, vi } from "vitest";
import { NOBODY_LEADS } from "../../src/app/lesson/lesson-view.ts";
import type { TaskView } from "../../src/app/lesson/task/task-view.ts";
import type { Lesson, Score, Task, TerrainFields } from "../../src/generated/contract.ts";
import { Ruler } from "../../src/input/tools/ruler.ts";
import { TileStore } from "../../src/tiles/store.ts";
import type { EskTaskPanel } from "../../src/ui/task/task-panel.ts";
import "../../src/ui/task/task-panel.ts";

// The library's switch needs ElementInternals, which happy-dom lacks.
vi.mock("@awesome.me/webawesome/dist/components/switch/switch.js", () => ({ default: class {} }));

const TASK: Task = {
  title: "Keep dry",
  text: "One.\n\nTwo <b>.",
  goal: { type: "area", level_m: 8, at_least_m2: 4e6, dry: true },
  difference: true,
};

async function panel(task: Task | null, conducts: boolean, score: Score | null = null) {
  const sent: TerrainFields[] = [];
  const view = {
    task: signal(task),
    pictures: signal<string[]>([]),
    broken: signal(null),
    target: signal(null),
    mayDiffer: signal(false),
    contourMap: signal([]),
    contours: signal(false),
    sizeM: 4096,
    differs: false,
  } as unknown as TaskView;
  const made = document.createElement("esk-task-panel") as EskTaskPanel;
  const lesson: Lesson = { ...NOBODY_LEADS, conducts };
  Object.assign(made, {
    view,
    score: signal(score),
    lesson: signal(lesson),
    ruler: new Ruler(),
    tiles: new TileStore(4096, 6, 4),
  });
  made.edits = { newGesture: () => "g", setTerrain: (fields) => sent.push(fields) > 0 };
  document.body.append(made);
  await made.updateComplete;
  return { made, sent };
}

const words = (made: Element): string => made.shadowRoot!.textContent.replaceAll(/\s+/g, " ");
const button = (made: Element, name: string): HTMLButtonElement =>
  [...made.shadowRoot!.querySelectorAll("button")].find((each) => each.textContent.includes(name))!;

afterEach(() => document.body.replaceChildren());

it("tells pupils what is asked and how far they are, and lets them write nothing", async () => {
  const text = "62 of 100: 2.5 km² of the 4 km² asked for stay dry with the sea at 8.0 m.";
  const { made } = await panel(TASK, false, { type: "score", clock: 3, points: 62, text, figures: [] });
  const said = words(made);
  for (const part of ["Keep dry", "One.", "Two <b>.", "Keep 4 km² dry", "62 of 100", "2.5 km² of the 4 km²"])
    expect(said).toContain(part);
  expect(made.shadowRoot!.querySelector("b")).toBeNull();
  expect(button(made, "Change the task")).toBeUndefined();
});

it("has words where there is no task, and where nothing is scored yet", async () => {
  expect(words((await panel(null, false)).made)).toContain("This terrain has no task.");
  expect(words((await panel(TASK, false)).made)).toContain("counted when the ground has come to rest");
});

it("lets who leads write a task, and says what it lacks", async () => {
  const { made, sent } = await panel(null, true);
  button(made, "Write a task").click();
  await made.updateComplete;
  const form = made.shadowRoot!.querySelector("esk-task-form")! as EskTaskPanel;
  await form.updateComplete;
  const put = (name: string, value: string, kind = "input"): void => {
    const field = form.shadowRoot!.querySelector<HTMLInputElement>(`[name=${name}]`)!;
    field.value = value;
    field.dispatchEvent(new Event(kind));
  };
  put("title", "Dam it");
  put("goal", "volume", "change");
  await form.updateComplete;
  button(form, "Set the task").click();
  await form.updateComplete;
  expect(words(form)).toContain("Choose the point on the ground first.");
  expect(sent).toEqual([]);
  button(form, "Choose the point").click();
  made.ruler.add([900, 700]);
  await form.updateComplete;
  button(form, "Take this point").click();
  await form.updateComplete;
  button(form, "Set the task").click();
  expect(sent).toMatchObject([{ task: { title: "Dam it", goal: { type: "volume", point: [900, 700] } } }]);
  expect(made.ruler.kind.value).toBeNull();
});
