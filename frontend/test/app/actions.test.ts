// SPEC U9
// @vitest-environment happy-dom
import { readFileSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { signal } from "@preact/signals-core";
import { describe, expect, it, vi } from "vitest";
import { pageActions } from "../../src/app/page-actions.ts";
import { OVERLAYS } from "../../src/app/view/overlays.ts";
import { keyLabel } from "../../src/app/words/keys.ts";
import { Camera } from "../../src/core/camera/camera.ts";
import type { Ground, Scene } from "../../src/core/types.ts";
import { SyncDoc } from "../../src/doc/sync.ts";
import { toolDefaults } from "../../src/input/defaults.ts";
import type { Action, ToolId } from "../../src/input/keys/action.ts";
import { createActions } from "../../src/input/keys/actions.ts";
import { Ruler } from "../../src/input/tools/ruler.ts";

const GUIDE = resolve(import.meta.dirname, "../../../docs/user-guide.md");
const MARKS = /(<!-- keys:.*?-->\n\| what \| keys \|\n\|---\|---\|\n)([\s\S]*?)(<!-- \/keys -->)/;

const flat: Ground = { sizeM: 4096, heightAt: () => 0, raycast: () => null };

function everyAction() {
  const commands = {
    panel: vi.fn(),
    help: vi.fn(),
    share: vi.fn(),
    export: vi.fn(),
    layers: vi.fn(),
    addGround: vi.fn(),
    region: vi.fn(),
    toLand: vi.fn(),
    history: vi.fn(),
    toNow: vi.fn(() => false),
  };
  const stage = {
    showStrokes: signal(true),
    toggleStrokes: () => {
      stage.showStrokes.value = !stage.showStrokes.value;
    },
    overlay: signal<Scene["overlay"]>("none"),
  };
  const actions: Map<string, Action> = createActions({
    camera: new Camera(4096),
    doc: new SyncDoc("me", () => 0),
    ground: () => flat,
    freeze: () => flat,
    ruler: new Ruler(),
    defaults: toolDefaults(4096),
    canEdit: () => true,
    tool: signal<ToolId>("select"),
    selection: signal<string | null>(null),
    placing: signal(null),
    fingerDraws: signal(true),
    newId: () => "id",
    onMessage: () => {},
    cancel: () => false,
    keyPen: { show: () => {}, usable: () => false },
    now: () => 0,
  });
  pageActions(actions, stage, commands);
  return { actions, commands, stage };
}

describe("actions", () => {
  it("have a title and a key each, and no key means two things", () => {
    const { actions } = everyAction();
    const seen = new Map<string, string>();
    for (const [id, action] of actions) {
      expect(action.title, id).not.toBe("");
      expect(action.keys.length, id).toBeGreaterThan(0);
      for (const key of action.keys) {
        expect(seen.get(key), `${key} of ${id}`).toBeUndefined();
        seen.set(key, id);
      }
    }
  });

  it("of the page do what they say", () => {
    const { actions, commands, stage } = everyAction();
    actions.get("help")!.run();
    actions.get("inspector")!.run();
    actions.get("share")!.run();
    actions.get("export")!.run();
    const asked = [commands.help, commands.panel, commands.share, commands.export];
    expect(asked.map((f) => f.mock.calls.length)).toEqual([1, 1, 1, 1]);
    actions.get("toggle-strokes")!.run();
    expect(stage.showStrokes.value).toBe(false);
    const overlays = Array.from({ length: OVERLAYS.length }, () => {
      actions.get("next-overlay")!.run();
      return stage.overlay.value;
    });
    expect(overlays).toEqual([
      ...[
        "contours",
        "slope",
        "detail",
        "snow",
        "forest",
        "grass",
        "wetness",
        "erosion",
        "influence",
        "patches",
        "none",
      ],
    ]);
  });

  // To write the table anew: ESKER_WRITE_GUIDE=1 npx vitest run test/app/actions
  it("stand in the user guide with the same keys", () => {
    const rows = [...everyAction().actions.values()].map(
      (a) => `| ${a.title} | ${a.keys.map((k) => `\`${keyLabel(k)}\``).join(" or ")} |`,
    );
    const table = `${rows.join("\n")}\n`;
    const guide = readFileSync(GUIDE, "utf8");
    expect(guide).toMatch(MARKS);
    const wanted = guide.replace(MARKS, (_, head: string, _old: string, tail: string) => head + table + tail);
    if (process.env.ESKER_WRITE_GUIDE) writeFileSync(GUIDE, wanted);
    else expect(guide).toBe(wanted);
  });

  it("have keys that belong to one action each", () => {
    const owners = new Map<string, string[]>();
    for (const [id, action] of everyAction().actions)
      for (const key of action.keys) owners.set(key, [...(owners.get(key) ?? []), id]);
    expect([...owners].filter(([, ids]) => ids.length > 1)).toEqual([]);
  });
});
