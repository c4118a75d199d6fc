// @vitest-environment happy-dom
// Erosion in the terrain panel (SPEC F210).
import { signal } from "@preact/signals-core";
import { expect, it, vi } from "vitest";
import type { TerrainFields } from "../../src/generated/contract.ts";
import type { EskTerrainPanel } from "../../src/ui/panels/terrain-panel.ts";
import "../../src/ui/panels/terrain-panel.ts";
import { SETTINGS } from "../settings.ts";

vi.mock("@awesome.me/webawesome/dist/components/slider/slider.js", () => ({ default: class {} }));
vi.mock("@awesome.me/webawesome/dist/components/switch/switch.js", () => ({ default: class {} }));

it("sets strength, size and hold, each drag one step to undo, and only under the rule that has gullies", async () => {
  const heard: [TerrainFields, string][] = [];
  const gestures: string[] = [];
  const panel = document.createElement("esk-terrain-panel") as EskTerrainPanel;
  const doc = signal({ settings: { ...SETTINGS, erosion: 1 } } as never);
  Object.assign(panel, {
    doc,
    canEdit: signal(true),
    tiles: { tile: () => undefined },
    edits: {
      newGesture: () => `g${gestures.push("")}`,
      setTerrain: (fields: TerrainFields, gesture: string) => heard.push([fields, gesture]),
    },
  });
  document.body.append(panel);
  await panel.updateComplete;
  const range = (of: string): Element | null => panel.renderRoot.querySelector(`esk-range[of="${of}"]`);
  const move = (of: string, kind: string, detail: number): void => {
    range(of)!.dispatchEvent(new CustomEvent(kind, { detail }));
  };
  move("of the erosion", "value", 1.44);
  move("of the erosion", "settle", 1.52);
  move("of the gullies", "settle", 12);
  move("of the crests", "settle", 35);
  expect(heard).toEqual([
    [{ erosion: 1.4 }, "g1"],
    [{ erosion: 1.5 }, "g1"],
    [{ erosion_scale: 12 }, "g2"],
    [{ hold: 0.35 }, "g3"],
  ]);
  doc.value = { settings: { ...SETTINGS, rule: "smooth" } } as never;
  await panel.updateComplete;
  expect(range("of the erosion")).toBeNull();
});
