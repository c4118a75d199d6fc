// SPEC U7, U9, U11, U17
// @vitest-environment happy-dom
import { signal } from "@preact/signals-core";
import { html } from "lit";
import { afterEach, describe, expect, it, vi } from "vitest";
import { type Flank, MAX_SLOPE_DEG } from "../../src/generated/contract.ts";
import type { EskRange } from "../../src/ui/controls/range-field.ts";
import "../../src/ui/controls/range-field.ts";
import type { EskSectionForm, SectionChange } from "../../src/ui/panels/section-form.ts";
import "../../src/ui/panels/section-form.ts";
import type { EskSegmented } from "../../src/ui/controls/segmented.ts";
import "../../src/ui/controls/segmented.ts";
import { SignalElement } from "../../src/ui/controls/signal-element.ts";
import type { EskSunPad } from "../../src/ui/controls/sun-pad.ts";
import "../../src/ui/controls/sun-pad.ts";
import { ToastList } from "../../src/app/toasts.ts";
import "../../src/ui/controls/toasts.ts";
import type { EskToasts } from "../../src/ui/controls/toasts.ts";

// The library's form controls need ElementInternals, which happy-dom lacks: plain elements stand in for them here.
vi.mock("@awesome.me/webawesome/dist/components/slider/slider.js", () => ({ default: class {} }));
vi.mock("@awesome.me/webawesome/dist/components/switch/switch.js", () => ({ default: class {} }));

async function put<T extends HTMLElement & { updateComplete: Promise<boolean> }>(
  tag: string,
  fields: Partial<T>,
): Promise<T> {
  const element = Object.assign(document.createElement(tag), fields) as T;
  document.body.append(element);
  await element.updateComplete;
  return element;
}

const all = (element: HTMLElement, selector: string): HTMLElement[] => [
  ...element.shadowRoot!.querySelectorAll<HTMLElement>(selector),
];

afterEach(() => {
  document.body.replaceChildren();
});

describe("SignalElement", () => {
  it("renders again when a signal that it read changes, and stops when it is taken away", async () => {
    const count = signal(1);
    let renderings = 0;
    class Counter extends SignalElement {
      protected override render() {
        renderings++;
        return html`<p>${count.value}</p>`;
      }
    }
    customElements.define("test-counter", Counter);
    const element = await put<Counter>("test-counter", {});
    count.value = 2;
    await element.updateComplete;
    expect(all(element, "p")[0]!.textContent).toBe("2");
    element.remove();
    const before = renderings;
    count.value = 3;
    await Promise.resolve();
    expect(renderings).toBe(before);
    document.body.append(element);
    await element.updateComplete;
    expect(all(element, "p")[0]!.textContent).toBe("3");
  });
});

describe("segments", () => {
  const segments = ["a", "b", "c"].map((value) => ({ value, label: value.toUpperCase() }));

  it("are one stop for Tab, and arrows go round", async () => {
    const element = await put<EskSegmented>("esk-segmented", { segments, value: "c", label: "Letters" });
    const radios = all(element, '[role="radio"]');
    expect(radios.map((r) => r.getAttribute("aria-checked"))).toEqual(["false", "false", "true"]);
    expect(radios.map((r) => r.getAttribute("tabindex"))).toEqual(["-1", "-1", "0"]);
    const picked = vi.fn();
    element.addEventListener("pick", (e) => picked((e as CustomEvent).detail));
    radios[2]!.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true, cancelable: true }));
    radios[1]!.click();
    radios[2]!.click();
    expect(picked.mock.calls).toEqual([["a"], ["b"]]);
  });
});

describe("the range field", () => {
  it("takes a typed number within its limits and settles", async () => {
    const element = await put<EskRange>("esk-range", {
      label: "Extent",
      unit: "m",
      min: 8,
      max: 2048,
      log: true,
      value: 100,
    });
    const events: string[] = [];
    for (const type of ["value", "settle"]) {
      element.addEventListener(type, (e) => events.push(`${type} ${(e as CustomEvent<number>).detail}`));
    }
    const input = element.shadowRoot!.querySelector("input")!;
    expect(input.value).toBe("100");
    input.value = "99999";
    input.dispatchEvent(new Event("change", { bubbles: true }));
    expect(events).toEqual(["value 2048", "settle 2048"]);
    input.value = "";
    input.dispatchEvent(new Event("change", { bubbles: true }));
    expect(events).toHaveLength(2);
  });

  it("spreads lengths logarithmically over the slider", async () => {
    const element = await put<EskRange>("esk-range", { unit: "m", min: 8, max: 2048, log: true, value: 128 });
    const slider = element.shadowRoot!.querySelector("wa-slider") as HTMLElement & { value: number };
    expect(slider.value).toBe(200);
    const moved = vi.fn();
    element.addEventListener("value", (e) => moved((e as CustomEvent<number>).detail));
    slider.value = 400;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    expect(moved).toHaveBeenCalledWith(2048);
  });
});

describe("the cross-section form", () => {
  const flank = (slope: number | null, extent: number): Flank => ({
    slope_deg: slope,
    extent_m: extent,
    shape: "concave",
  });

  async function form(left: Flank | null, right: Flank | null) {
    const element = await put<EskSectionForm>("esk-section-form", {
      fields: { left, right, plateau_radius_m: 0 },
      reliefM: 100,
      sizeM: 4096,
    });
    const changes: SectionChange[] = [];
    element.addEventListener("change", (e) => {
      if (e instanceof CustomEvent) changes.push(e.detail as SectionChange);
    });
    return { element, changes };
  }

  it("names its sliders and switches by what they are of (SPEC U349)", async () => {
    const { element } = await form(flank(30, 100), flank(40, 100));
    const words = (e: Element): string => e.textContent!.replace(/\s+/g, " ").trim();
    expect(all(element, "wa-switch").map(words)).toEqual([
      "Flank: left side",
      "Slope finds itself of the left flank",
      "Flank: right side",
      "Slope finds itself of the right flank",
    ]);
    const ranges = all(element, "esk-range") as EskRange[];
    await Promise.all(ranges.map((r) => r.updateComplete));
    const names = ranges.map((r) => words(r.shadowRoot!.querySelector('[slot="label"]')!));
    expect(new Set(names).size, "no two have the same name").toBe(names.length);
    expect(names).toContain("Slope of the right flank");
    const fields = ranges.map((r) => r.shadowRoot!.querySelector("input")!.getAttribute("aria-label"));
    expect(fields).toContain("Extent of the left flank, in metres");
  });

  it("shows one side for both while they are alike, and two when they differ", async () => {
    const { element } = await form(flank(30, 100), flank(30, 100));
    expect(all(element, ".side").map((s) => s.getAttribute("aria-label"))).toEqual(["Both sides"]);
    element.fields = { left: flank(30, 100), right: null, plateau_radius_m: 0 };
    await element.updateComplete;
    expect(all(element, ".side").map((s) => s.getAttribute("aria-label"))).toEqual(["Left side", "Right side"]);
  });

  it("changes both sides while linked, one when not", async () => {
    const { element, changes } = await form(flank(30, 100), flank(30, 100));
    all(element, "esk-range")[1]!.dispatchEvent(new CustomEvent("value", { detail: 44 }));
    expect(changes.at(-1)).toMatchObject({
      fields: { left: { slope_deg: 44 }, right: { slope_deg: 44 } },
      settled: false,
    });
    all(element, 'button[aria-pressed="true"]')[0]!.click();
    await element.updateComplete;
    all(element, "esk-range")[1]!.dispatchEvent(new CustomEvent("settle", { detail: 20 }));
    expect(changes.at(-1)).toEqual({ fields: { left: { ...flank(20, 100) } }, settled: true });
  });

  it("linking makes both sides alike", async () => {
    const { element, changes } = await form(flank(30, 100), flank(60, 50));
    all(element, 'button[aria-pressed="false"]')[0]!.click();
    expect(changes.at(-1)).toEqual({ fields: { right: flank(30, 100) }, settled: true });
  });

  it("a preset sets the whole cross-section in one step", async () => {
    const { element, changes } = await form(flank(30, 100), null);
    const cliff = all(element, ".presets button").find((b) => b.textContent?.trim() === "Cliff")!;
    cliff.click();
    expect(changes).toHaveLength(1);
    expect(changes[0]!.settled).toBe(true);
    expect(Object.keys(changes[0]!.fields).sort()).toEqual(["left", "plateau_radius_m", "right"]);
    expect(changes[0]!.fields.left!.slope_deg).toBeLessThanOrEqual(MAX_SLOPE_DEG);
  });

  it("a free slope has no slope field", async () => {
    const { element } = await form(flank(null, 100), flank(null, 100));
    expect(all(element, "esk-range").map((r) => (r as EskRange).label)).toEqual(["Plateau radius", "Extent"]);
  });
});

describe("the sun dial", () => {
  it("turns and rises by keys, within its limits", async () => {
    const element = await put<EskSunPad>("esk-sun-pad", { azimuthDeg: 2, elevationDeg: 89 });
    const moved = vi.fn();
    element.addEventListener("settle", (e) => moved((e as CustomEvent).detail));
    const dial = element.shadowRoot!.querySelector("svg")!;
    for (const key of ["ArrowLeft", "ArrowUp"])
      dial.dispatchEvent(new KeyboardEvent("keydown", { key, cancelable: true }));
    expect(moved).toHaveBeenLastCalledWith({ azimuthDeg: 357, elevationDeg: 90 });
  });
});

describe("toasts on the page", () => {
  it("say how often, and go when dismissed", async () => {
    const toasts = new ToastList();
    const element = await put<EskToasts>("esk-toasts", { toasts });
    toasts.show("This stroke is locked.", "warn");
    toasts.show("This stroke is locked.", "warn");
    await element.updateComplete;
    expect(all(element, ".times")[0]!.textContent).toBe("×2");
    all(element, "button")[0]!.click();
    await element.updateComplete;
    expect(all(element, ".toast")).toEqual([]);
    toasts.dispose();
  });
});
