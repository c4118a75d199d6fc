// SPEC U3, U4
// @vitest-environment happy-dom
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { EskLanding } from "../../src/ui/pages/landing.ts";
import "../../src/ui/pages/landing.ts";
import { keepStarted } from "../../src/app/device/kept-imports.ts";
import { rememberTerrain } from "../../src/app/device/storage.ts";

type Answer = { readonly status?: number; readonly body: unknown };
let answers: Record<string, Answer>;
let asked: { path: string; init: RequestInit }[];
const assign = vi.fn();

beforeEach(() => {
  localStorage.clear();
  answers = {
    "GET /api/templates": { body: [{ id: "canyon", title: "Canyon", description: "A river." }] },
    "GET /api/lessons": { body: [{ id: "dam-a-valley", title: "Dam a valley", description: "Hold.", minutes: 45 }] },
  };
  asked = [];
  assign.mockReset();
  vi.spyOn(window.location, "assign").mockImplementation(assign);
  vi.stubGlobal("fetch", async (path: string, init: RequestInit) => {
    asked.push({ path, init });
    const answer = answers[`${init.method} ${path}`];
    if (!answer) throw new TypeError("network");
    const status = answer.status ?? 200;
    return { ok: status < 400, status, json: async () => answer.body, text: async () => JSON.stringify(answer.body) };
  });
});
afterEach(() => {
  document.body.replaceChildren();
  vi.unstubAllGlobals();
  vi.restoreAllMocks();
});

async function landing(): Promise<EskLanding> {
  const element = document.createElement("esk-landing") as EskLanding;
  document.body.append(element);
  await vi.waitFor(() => expect(element.templates).not.toBeNull());
  await element.updateComplete;
  return element;
}

const one = <T extends Element>(element: EskLanding, selector: string) =>
  element.shadowRoot!.querySelector<T>(selector)!;

/** Stands for the request that tells how much has left; `fetch` does not. */
class FakeRequest extends EventTarget {
  static last: FakeRequest;
  readonly upload = new EventTarget();
  status = 0;
  responseText = "";
  path = "";
  aborted = false;
  readonly headers: Record<string, string> = {};
  constructor() {
    super();
    FakeRequest.last = this;
  }
  open(_method: string, path: string): void {
    this.path = path;
  }
  setRequestHeader(name: string, value: string): void {
    this.headers[name] = value;
  }
  send(): void {}
  abort(): void {
    this.aborted = true;
  }
  answer(status: number, body: unknown): void {
    this.status = status;
    this.responseText = JSON.stringify(body);
    this.dispatchEvent(new Event("load"));
  }
  leave(loaded: number, total: number): void {
    this.upload.dispatchEvent(Object.assign(new Event("progress"), { lengthComputable: true, loaded, total }));
  }
}

function fall(file: File): void {
  const event = Object.assign(new Event("drop", { cancelable: true }), { dataTransfer: { files: [file] } });
  window.dispatchEvent(event);
}

async function join(element: EskLanding, text: string): Promise<void> {
  one<HTMLInputElement>(element, "#join").value = text;
  one(element, "form").dispatchEvent(new Event("submit", { cancelable: true }));
  await new Promise((done) => setTimeout(done));
  await element.updateComplete;
}

describe("the landing page", () => {
  it("shows the starting terrains and opens a copy of one", async () => {
    answers["POST /api/terrains"] = { status: 201, body: { id: "new1", secret: "s/1", role: "owner" } };
    const element = await landing();
    const card = one<HTMLButtonElement>(element, "button.card");
    expect(card.textContent).toContain("Canyon");
    card.click();
    await vi.waitFor(() => expect(assign).toHaveBeenCalledWith("/t/new1#s%2F1"));
    expect(asked.at(-1)!.init.body).toBe('{"template":"canyon","language":"en"}');
  });

  it("shows lessons, each with its plan (SPEC L132)", async () => {
    const element = await landing();
    await vi.waitFor(() => expect(element.renderRoot.querySelector("a.plan")).not.toBeNull());
    const plan = one<HTMLAnchorElement>(element, "a.plan");
    expect(plan.getAttribute("href")).toBe("/lessons/dam-a-valley");
    expect(plan.textContent).toContain("45 minutes");
  });

  it("says what the server said when it refuses, and lets one try again", async () => {
    answers["POST /api/terrains"] = {
      status: 429,
      body: { code: "rate_limited", message: "Too many. Wait a minute." },
    };
    const element = await landing();
    const button = one<HTMLButtonElement>(element, "button.primary");
    button.click();
    await vi.waitFor(() => expect(element.problem).toBe("Too many. Wait a minute."));
    await element.updateComplete;
    expect(button.disabled).toBe(false);
    expect(one(element, "#problem").textContent).toBe("Too many. Wait a minute.");
  });

  it("joins by code and by link, and asks nothing of the server for what it cannot read", async () => {
    answers["POST /api/join"] = { body: { id: "t1", secret: "fresh", role: "edit" } };
    const element = await landing();
    asked.length = 0;
    await join(element, "what?");
    expect(element.problem).toMatch(/neither a (join )?code/);
    expect(asked).toEqual([]);
    await join(element, `${window.location.origin}/t/t9#key`);
    expect(assign).toHaveBeenLastCalledWith("/t/t9#key");
    await join(element, "k7m 2qx");
    await vi.waitFor(() => expect(assign).toHaveBeenLastCalledWith("/t/t1#fresh"));
    expect(asked[0]!.init.body).toBe('{"code":"K7M2QX"}');
  });

  it("lists recent terrains and forgets one when asked", async () => {
    rememberTerrain(localStorage, { id: "a", title: "Ana's land", secret: "s", role: "owner", opened: Date.now() });
    const element = await landing();
    expect(one<HTMLAnchorElement>(element, ".recent").getAttribute("href")).toBe("/t/a#s");
    one<HTMLButtonElement>(element, ".recents button").click();
    await element.updateComplete;
    expect(one(element, ".recents")).toBeNull();
  });

  it("stands without the server, and says so", async () => {
    answers = {};
    const element = await landing();
    expect(element.shadowRoot!.textContent).toContain("The server does not answer.");
    expect(one<HTMLButtonElement>(element, "button.primary").disabled).toBe(false);
  });

  it("is not busy any more when one comes back to it", async () => {
    const element = await landing();
    element.busy = "new";
    window.dispatchEvent(new Event("pageshow"));
    expect(element.busy).toBe("");
  });
});

describe("a file that falls on the landing page (SPEC U31)", () => {
  it("makes a terrain of its ground, with the real share of its bytes, and goes on there", async () => {
    vi.stubGlobal("XMLHttpRequest", FakeRequest);
    const element = await landing();
    fall(new File(["x"], "St Helens.tif"));
    await vi.waitFor(() =>
      expect(FakeRequest.last?.path).toMatch(/^\/api\/terrains\/from-grid\?name=St%20Helens\.tif&client=[0-9a-f]{32}$/),
    );
    FakeRequest.last.leave(45, 100);
    await element.updateComplete;
    expect(one(element, ".file").textContent).toContain("Uploading, 45 %");
    FakeRequest.last.answer(201, { id: "t1", secret: "s", role: "owner", import: { id: "job" } });
    await vi.waitFor(() => expect(assign).toHaveBeenCalledWith("/t/t1#s"));
    expect(window.sessionStorage.getItem("esker.jobs.t1")).toBe('[{"id":"job","file":"St Helens.tif"}]');
    window.sessionStorage.clear();
  });

  it("leads to the file of mine that is in the way, and cancels it (SPEC P348)", async () => {
    vi.stubGlobal("XMLHttpRequest", FakeRequest);
    keepStarted(localStorage, { terrain: "t1", secret: "s1", job: "j1", file: "first.tif" });
    const element = await landing();
    fall(new File(["x"], "second.tif"));
    await vi.waitFor(() => expect(FakeRequest.last?.path).toContain("second.tif"));
    FakeRequest.last.answer(409, { code: "busy", message: "Another file of yours is still being brought in." });
    await vi.waitFor(() => expect(one(element, ".problem").textContent).toContain("first.tif"));
    answers["DELETE /api/terrains/t1/imports/j1"] = { status: 204, body: null };
    [...element.shadowRoot!.querySelectorAll<HTMLElement>(".problem button")]
      .find((b) => b.textContent === "Cancel it")!
      .click();
    await vi.waitFor(() => expect(asked.some((a) => a.path === "/api/terrains/t1/imports/j1")).toBe(true));
    await vi.waitFor(() => expect(one(element, ".problem").textContent).toBe(""));
  });

  it("says why it cannot", async () => {
    vi.stubGlobal("XMLHttpRequest", FakeRequest);
    const element = await landing();
    fall(new File(["x"], "a.txt"));
    await vi.waitFor(() => expect(FakeRequest.last.path).toContain("a.txt"));
    FakeRequest.last.answer(400, { code: "refused", message: "It is in no format that can be read." });
    await vi.waitFor(() => expect(element.problem).toBe("It is in no format that can be read."));
    expect(element.busy).toBe("");
  });

  it("opens when it is an archive", async () => {
    answers["POST /api/terrains/import"] = { status: 201, body: { id: "old", secret: "k", role: "owner" } };
    await landing();
    fall(new File(["x"], "land.ESKER"));
    await vi.waitFor(() => expect(assign).toHaveBeenCalledWith("/t/old#k"));
  });
});
