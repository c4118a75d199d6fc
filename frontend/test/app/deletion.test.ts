import { afterEach, describe, expect, it, vi } from "vitest";
import { ApiError } from "../../src/app/server/api.ts";
import { Deletion, untilDay } from "../../src/app/server/deletion.ts";

function answers(status: number, body: unknown): ReturnType<typeof vi.fn> {
  const fetched = vi.fn(async () => new Response(JSON.stringify(body), { status }));
  vi.stubGlobal("fetch", fetched);
  return fetched;
}

afterEach(() => vi.unstubAllGlobals());

describe("deletion of a terrain (SPEC U250)", () => {
  it("deletes with the owner's secret and knows until when it can be brought back", async () => {
    const fetched = answers(200, { id: "t", until: 1000 });
    const deletion = new Deletion("t", () => "secret");
    await deletion.delete();
    expect(fetched).toHaveBeenCalledWith("/api/terrains/t", {
      method: "DELETE",
      headers: { Authorization: "Bearer secret" },
    });
    expect(deletion.deleted.value).toEqual({ until: 1000, restorable: true });
  });

  it("asks why a terrain does not open", async () => {
    answers(410, { code: "deleted", message: "This terrain was deleted.", until: 5, restorable: true });
    const deletion = new Deletion("t", () => "secret");
    expect(await deletion.ask()).toBe(true);
    expect(deletion.deleted.value).toEqual({ until: 5, restorable: true });
  });

  it.each([
    [410, { code: "deleted", message: "This terrain was deleted.", until: 5, restorable: false }],
    [404, { code: "no_terrain", message: "There is no such terrain on this server." }],
    [502, "a proxy"],
  ])("cannot bring back what it may not, or what is not there (%s)", async (status, body) => {
    answers(status, body);
    const deletion = new Deletion("t", () => "secret");
    expect(await deletion.ask()).toBe(false);
    expect(deletion.deleted.value?.restorable ?? false).toBe(false);
  });

  it("brings back, and says so when that fails", async () => {
    answers(410, { code: "deleted", message: "This terrain was deleted.", until: 5, restorable: true });
    const deletion = new Deletion("t", () => "secret");
    await deletion.ask();
    answers(507, { code: "storage", message: "The server has no room for this." });
    await expect(deletion.bringBack()).rejects.toThrow(ApiError);
    expect(deletion.deleted.value).not.toBeNull();
    answers(200, { id: "t" });
    await deletion.bringBack();
    expect(deletion.deleted.value).toBeNull();
  });

  it("names the day", () => {
    const noon = new Date(2026, 10, 30, 12).getTime() / 1000;
    expect(untilDay({ until: noon, restorable: true }, "en-GB")).toBe("until Monday 30 November");
  });
});
