// @vitest-environment happy-dom
// Who yields where strokes meet (SPEC U316).
import { expect, it, vi } from "vitest";
import "../../src/ui/panels/meeting-form.ts";
import type { EskMeetingForm, MeetingRow, YieldChange } from "../../src/ui/panels/meeting-form.ts";

// The library's slider needs ElementInternals, which happy-dom lacks.
vi.mock("@awesome.me/webawesome/dist/components/slider/slider.js", () => ({ default: class {} }));

it("lists who crosses, at which heights, and lets either yield", async () => {
  const form = document.createElement("esk-meeting-form") as EskMeetingForm;
  const row: MeetingRow = { id: "low", name: "Mountain", mine: 700, theirs: 260, yields: false, locked: false };
  form.rows = [row, { ...row, id: "held", locked: true, yields: true }];
  form.editable = true;
  document.body.append(form);
  await form.updateComplete;
  const heard: YieldChange[] = [];
  const selected: string[] = [];
  form.addEventListener("change", (e) => heard.push((e as CustomEvent<YieldChange>).detail));
  form.addEventListener("select", (e) => selected.push((e as CustomEvent<string>).detail));
  const buttons = [...form.renderRoot.querySelectorAll("button")];
  expect(form.renderRoot.textContent).toContain("at 260 m, this one at 700 m");
  for (const button of buttons) button.click();
  expect(selected).toEqual(["low", "held"]);
  expect(heard).toEqual([{ id: "low", yields: 1, settled: true }]);
  expect(buttons[3]!.disabled).toBe(true);
  const slider = form.renderRoot.querySelector("esk-range")!;
  slider.dispatchEvent(new CustomEvent("settle", { detail: 100 }));
  await form.updateComplete;
  expect(heard.at(-1)).toEqual({ id: null, yields: 1, settled: true });
  expect(form.renderRoot.textContent).toContain("Gives way to every other stroke.");
  form.editable = false;
  form.rows = [];
  await form.updateComplete;
  expect(form.renderRoot.textContent).toContain("No other stroke crosses this one.");
  form.remove();
});
