// SPEC U693
import { signal } from "@preact/signals-core";
import { expect, test } from "vitest";
import type { OpenTerrain } from "../../src/app/open-terrain.ts";
import { Arrival } from "../../src/app/view/eye/arrival.ts";
import type { Land } from "../../src/core/camera/state.ts";

const LAND: Land = { groundM: 0, lowM: 0, peaks: [] };

/** A terrain that is opened: its ground is on its way until `settled`. */
function opened() {
  const progress = signal({ clock: 3, settled: false });
  const doc = { doc: signal({ layers: new Map() }), clock: 3, pending: signal(0) };
  const session = { progress, doc, baseBuilding: signal(false) };
  return { progress, arrival: new Arrival(session as unknown as OpenTerrain) };
}

test("a view at home stands on ground that arrives, and nobody makes the ground for it afterwards", () => {
  const { progress, arrival } = opened();
  const stood: Land[] = [];
  let asked = 0;
  const follow = (isDrawing = false) =>
    arrival.follow(
      () => {
        asked += 1;
        return LAND;
      },
      isDrawing,
      (land) => stood.push(land),
    );
  follow();
  progress.value = { clock: 3, settled: true };
  follow();
  expect(stood).toEqual([LAND, LAND]);
  for (let frame = 0; frame < 5; frame += 1) follow();
  expect(asked).toBe(2);
});

test("what is drawn ends the arrival without moving the view", () => {
  const { arrival } = opened();
  const stood: Land[] = [];
  arrival.follow(
    () => LAND,
    true,
    (land) => stood.push(land),
  );
  arrival.follow(
    () => LAND,
    false,
    (land) => stood.push(land),
  );
  expect(stood).toEqual([]);
});
