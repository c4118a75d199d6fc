// @vitest-environment happy-dom
// The projector's page, and the pages in words about the browser's warning (SPEC U670, U671, U672).
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { rememberTerrain } from "../../src/app/device/storage.ts";
import { ApiError, api, type RoomFacts } from "../../src/app/server/api.ts";
import { route } from "../../src/app/server/router.ts";
import { helpPage } from "../../src/ui/room/help-pages.ts";
import { type EskRoom, roomPage } from "../../src/ui/room/room-page.ts";

vi.mock("@awesome.me/webawesome/dist/components/qr-code/qr-code.js", () => ({ default: class {} }));

const facts: RoomFacts = {
  kind: "terrain",
  terrain: "t",
  role: "edit",
  title: "Valley",
  here: 1,
  expires_s: 800,
  warned: true,
};
const owned = { id: "t", title: "Valley", secret: "owner-secret", role: "owner", opened: 1 } as const;

beforeEach(() => localStorage.clear());
afterEach(() => {
  document.body.replaceChildren();
  vi.restoreAllMocks();
  vi.useRealTimers();
});

async function room(code: string, told: RoomFacts | ApiError): Promise<EskRoom> {
  const ask = vi.spyOn(api, "room");
  if (told instanceof ApiError) ask.mockRejectedValue(told);
  else ask.mockResolvedValue(told);
  const page = roomPage(code) as EskRoom;
  document.body.append(page);
  await vi.waitFor(() => expect(page.facts !== null || page.problem !== "" || code === "").toBe(true));
  await page.updateComplete;
  return page;
}

const words = (page: EskRoom): string => page.renderRoot.textContent!.replace(/\s+/g, " ");

describe("the projector's page (SPEC U670)", () => {
  it("shows the address with its scheme, the code and its picture, and who is in", async () => {
    rememberTerrain(localStorage, owned);
    const page = await room("K7M2QX", facts);
    expect(words(page)).toContain(`Open ${window.location.origin} and type`);
    expect(window.location.origin).toMatch(/^https?:\/\//);
    expect(page.renderRoot.querySelector(".code")!.textContent!.trim()).toBe("K7M 2QX");
    expect(page.renderRoot.querySelector(".code")!.getAttribute("aria-label")).toBe("Code K 7 M 2 Q X");
    const picture = page.renderRoot.querySelector("wa-qr-code") as HTMLElement & { value: string };
    expect(picture.value).toBe(`${window.location.origin}/join#K7M2QX`);
    expect(picture.getAttribute("label")).toContain("K7M2QX");
    expect(words(page)).toContain("1 is in");
    expect(words(page)).toContain("Show Details");
    expect(document.body.innerHTML + (page.renderRoot as ShadowRoot).innerHTML).not.toContain("owner-secret");
  });

  it("counts on by itself, and goes on asking while the server does not answer", async () => {
    vi.useFakeTimers();
    const ask = vi.spyOn(api, "room").mockResolvedValue({ ...facts, warned: false });
    const page = roomPage("K7M2QX") as EskRoom;
    document.body.append(page);
    await vi.advanceTimersByTimeAsync(10);
    ask.mockRejectedValueOnce(new ApiError("unreachable", "The server does not answer."));
    await vi.advanceTimersByTimeAsync(3000);
    await page.updateComplete;
    expect(words(page)).toContain("The server does not answer.");
    expect(words(page)).not.toContain("Show Details");
    ask.mockResolvedValue({ ...facts, here: 12 });
    await vi.advanceTimersByTimeAsync(3000);
    await page.updateComplete;
    expect(words(page)).toContain("12 are in");
    expect(words(page)).not.toContain("does not answer");
    page.remove();
    await vi.advanceTimersByTimeAsync(9000);
    expect(ask).toHaveBeenCalledTimes(3);
  });

  it("prolongs a code of this device's own terrain, and tries that once where it may not", async () => {
    rememberTerrain(localStorage, owned);
    const prolong = vi.spyOn(api, "prolong").mockRejectedValue(new ApiError("bad_code", "no"));
    vi.useFakeTimers();
    vi.spyOn(api, "room").mockResolvedValue({ ...facts, expires_s: 200 });
    document.body.append(roomPage("K7M2QX"));
    await vi.advanceTimersByTimeAsync(7000);
    expect(prolong).toHaveBeenCalledTimes(1);
    expect(prolong).toHaveBeenCalledWith("t", "owner-secret", "K7M2QX");
  });

  it("says what to do without a code that runs, and offers the terrains of this device (SPEC U671)", async () => {
    rememberTerrain(localStorage, owned);
    rememberTerrain(localStorage, { ...owned, id: "v", title: "Mine not", role: "view" });
    const page = await room("ZZZZZZ", new ApiError("bad_code", "This code is wrong."));
    expect(words(page)).toContain("The code ZZZ ZZZ has ended, or was never one.");
    expect(words(page)).toContain("press Share, then Show a code");
    const offered = [...page.renderRoot.querySelectorAll("li button")];
    expect(offered.map((each) => each.textContent!.trim())).toEqual(["Valley"]);
    const assign = vi.spyOn(window.location, "assign").mockImplementation(() => {});
    vi.spyOn(api, "code").mockResolvedValue({ code: "ABCDEF", expires_s: 900 });
    (offered[0] as HTMLButtonElement).click();
    await vi.waitFor(() => expect(assign).toHaveBeenCalledWith("/room#ABCDEF"));
    const form = page.renderRoot.querySelector("form")!;
    form.querySelector("input")!.value = "k7m 2qx";
    form.dispatchEvent(new Event("submit", { cancelable: true }));
    expect(assign).toHaveBeenLastCalledWith("/room#K7M2QX");
  });
});

describe("help in words (SPEC U672)", () => {
  it("names the button of each browser, and this server", () => {
    const page = helpPage("warning", "192.168.1.20:8000").textContent!.replace(/\s+/g, " ");
    for (const each of ["Proceed to 192.168.1.20 (unsafe)", "Continue to", "visit this website", "Accept the Risk"])
      expect(page).toContain(each);
    expect(page).toContain("https://192.168.1.20:8000");
  });

  it("has a recipe for each kind of device, with the file", () => {
    const page = helpPage("devices", "192.168.1.20:8000");
    const heads = [...page.querySelectorAll("h2")].map((each) => each.textContent);
    expect(heads).toEqual(expect.arrayContaining(["Managed Chromebooks", "iPads", "Windows"]));
    expect(page.querySelector('a[href="/esker-ca.pem"]')).not.toBeNull();
  });

  it("is where the addresses lead", () => {
    const at = (path: string) => route(new URL(path, "https://here"));
    expect(at("/room#K7M2QX")).toEqual({ page: "room", code: "K7M2QX" });
    expect(at("/room")).toEqual({ page: "room", code: "" });
    expect(at("/help/warning")).toEqual({ page: "help", topic: "warning" });
    expect(at("/help/devices")).toEqual({ page: "help", topic: "devices" });
    expect(at("/help/else").page).toBe("missing");
  });
});
