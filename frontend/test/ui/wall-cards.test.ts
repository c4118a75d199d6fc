// @vitest-environment happy-dom
import { render } from "lit";
import { expect, test } from "vitest";
import type { WallCopy } from "../../src/generated/contract.ts";
import { wallCards } from "../../src/ui/pages/wall-cards.ts";

const still = { isChosen: false, isShown: false, onPress: () => {} };

function copy(number: number, name: string): WallCopy {
  return {
    number,
    names: [name],
    strokes: 1,
    last: null,
    online: 1,
    frozen: false,
    score: null,
  } as unknown as WallCopy;
}

test("a card keeps its picture when the order changes (L155)", () => {
  const place = document.createElement("div");
  const [ada, ben, cho] = [copy(1, "Ada"), copy(2, "Ben"), copy(3, "Cho")] as const;
  render(
    wallCards([ada, ben, cho], 200, () => still),
    place,
  );
  const canvases = new Map([...place.querySelectorAll("canvas")].map((canvas) => [canvas.dataset.copy, canvas]));
  render(
    wallCards([cho, ada], 200, () => still),
    place,
  );
  const after = [...place.querySelectorAll("canvas")];
  expect(after.map((canvas) => canvas.dataset.copy)).toEqual(["3", "1"]);
  expect(after).toEqual([canvases.get("3"), canvases.get("1")]);
  for (const canvas of after)
    expect(canvas.closest("li")?.textContent).toContain({ 3: "Cho", 1: "Ada" }[canvas.dataset.copy!]);
});
