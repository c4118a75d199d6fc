// @vitest-environment happy-dom
// The keys go from part to part (SPEC U34).
import { afterEach, describe, expect, it } from "vitest";
import { deepFocus, firstFocusable, nextRegion } from "../../src/app/view/regions.ts";

function page(html: string): ShadowRoot {
  const host = document.createElement("div");
  document.body.append(host);
  const root = host.attachShadow({ mode: "open" });
  root.innerHTML = html;
  return root;
}

afterEach(() => {
  document.body.innerHTML = "";
});

describe("F6", () => {
  it("goes through the parts that are there, and round; Shift+F6 the other way", () => {
    const root = page(`<div class="viewport" tabindex="0"></div><esk-tools><button id="b"></button></esk-tools>
      <esk-view-bar><button disabled></button><button tabindex="-1"></button></esk-view-bar>
      <esk-top-bar><a href="/" id="a"></a></esk-top-bar>`);
    const inside = root.querySelector("esk-tools")!;
    const shadow = inside.attachShadow({ mode: "open" });
    shadow.innerHTML = `<p><button id="deep"></button></p>`;
    const go = (back = false): string => {
      nextRegion(root, back);
      return deepFocus()!.id || deepFocus()!.className;
    };
    expect([go(), go(), go(), go()]).toEqual(["deep", "a", "viewport", "deep"]);
    expect([go(true), go(true)]).toEqual(["viewport", "a"]);
  });

  it("finds nothing where nothing can be reached", () => {
    const root = page(`<section><button disabled></button><input hidden><button tabindex="-1"></button></section>`);
    expect(firstFocusable(root.querySelector("section")!)).toBeNull();
  });
});
