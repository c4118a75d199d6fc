// SPEC U26, U27, U30
// @vitest-environment happy-dom
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { keepImport, keepImports, keptImports } from "../../src/app/device/kept-imports.ts";
import { type ImportJob, Imports, type ImportTransport } from "../../src/app/layers/imports.ts";
import { importingWords, OtherImports } from "../../src/app/layers/others.ts";
import { ApiError } from "../../src/app/server/api.ts";
import type { ImportAnswers, Importing, ImportStatus } from "../../src/generated/contract.ts";
import { MAX_GRID_BYTES } from "../../src/generated/contract.ts";

const status = (stage: ImportStatus["stage"], over: Partial<ImportStatus> = {}): ImportStatus => ({
  id: "a",
  stage,
  share: 0.3,
  text: "",
  report: null,
  layer: null,
  ...over,
});

/** Plays the server: an upload waits until the test lets it go on. */
class FakeTransport implements ImportTransport {
  now: ImportStatus | ApiError = status("reading");
  readonly uploads: { file: File; onShare: (share: number) => void; signal: AbortSignal }[] = [];
  readonly answers: ImportAnswers[] = [];
  readonly cancelled: string[] = [];
  polls = 0;
  answered: ImportStatus | ApiError = status("mipmaps");
  #go: ((s: ImportStatus | ApiError) => void)[] = [];

  upload(file: File, onShare: (share: number) => void, signal: AbortSignal): Promise<ImportStatus> {
    this.uploads.push({ file, onShare, signal });
    return new Promise((resolve, reject) => {
      this.#go.push((s) => (s instanceof ApiError ? reject(s) : resolve(s)));
    });
  }
  async arrive(s: ImportStatus | ApiError = status("reading")): Promise<void> {
    this.#go.shift()!(s);
    await vi.advanceTimersByTimeAsync(0);
  }
  async status(): Promise<ImportStatus> {
    this.polls++;
    if (this.now instanceof ApiError) throw this.now;
    return this.now;
  }
  async answer(_id: string, answers: ImportAnswers): Promise<ImportStatus> {
    this.answers.push(answers);
    if (this.answered instanceof ApiError) throw this.answered;
    return this.answered;
  }
  async cancel(id: string): Promise<void> {
    this.cancelled.push(id);
  }
}

let server: FakeTransport;
let imports: Imports;
let arrived: ImportJob[];

const file = (name: string, bytes = 10): File => {
  const made = new File(["x"], name);
  Object.defineProperty(made, "size", { value: bytes });
  return made;
};
const phases = (): string[] => imports.jobs.value.map((j) => j.phase);
const tick = (ms = 250): Promise<unknown> => vi.advanceTimersByTimeAsync(ms);

beforeEach(() => {
  vi.useFakeTimers();
  server = new FakeTransport();
  arrived = [];
  imports = new Imports(server, (job) => arrived.push(job));
});
afterEach(() => {
  imports.dispose();
  vi.useRealTimers();
  window.sessionStorage.clear();
});

describe("files on their way", () => {
  it("go one after the other, with the real share of their bytes", async () => {
    imports.add([file("a.tif")]);
    imports.add([file("b.tif")]);
    expect(phases()).toEqual(["upload", "waiting"]);
    server.uploads[0]!.onShare(0.45);
    expect(imports.jobs.value[0]!.share).toBe(0.45);
    await server.arrive();
    expect(phases()).toEqual(["work", "waiting"]);
    server.now = status("errors", { share: 0.8 });
    await tick();
    expect(imports.jobs.value[0]).toMatchObject({ phase: "work", share: 0.8 });
    server.now = status("done", { layer: "layer-1", share: 1 });
    await tick();
    expect(arrived.map((j) => j.status?.layer)).toEqual(["layer-1"]);
    expect(phases()).toEqual(["done", "upload"]);
    expect(server.uploads[1]!.file.name).toBe("b.tif");
  });

  it("are asked after about four times a second, not after they are over", async () => {
    imports.add([file("a.tif")]);
    await server.arrive();
    await tick(1000);
    expect(server.polls).toBe(4);
    server.now = status("done", { layer: "l" });
    await tick(5000);
    expect(server.polls).toBe(5);
  });

  it("are refused before they leave when they are too large or empty", () => {
    imports.add([file("big.tif", MAX_GRID_BYTES + 1), file("none.tif", 0), file("good.tif")]);
    expect(phases()).toEqual(["refused", "refused", "upload"]);
    expect(imports.jobs.value[0]!.problem).toContain("256 MB");
  });

  it("say the server's sentence when they are refused", async () => {
    imports.add([file("a.tif")]);
    await server.arrive();
    server.now = status("refused", { text: "It has only one row." });
    await tick();
    expect(imports.jobs.value[0]).toMatchObject({ phase: "refused", problem: "It has only one row." });
    imports.dismiss(imports.jobs.value[0]!.key);
    expect(phases()).toEqual([]);
  });

  it("are cancelled wherever they stand", async () => {
    imports.add([file("a.tif"), file("b.tif"), file("c.tif")]);
    imports.cancel(imports.jobs.value[0]!.key);
    expect(server.uploads[0]!.signal.aborted).toBe(true);
    expect(server.cancelled).toEqual([]);
    await server.arrive(new ApiError("cancelled", ""));
    await server.arrive(status("reading", { id: "b" }));
    imports.cancel(imports.jobs.value[1]!.key);
    expect(server.cancelled).toEqual(["b"]);
    expect(phases()).toEqual(["cancelled", "cancelled", "upload"]);
    server.now = status("done", { id: "b", layer: "l" });
    await tick(2000);
    expect(phases()[1]).toBe("cancelled");
    expect(arrived).toEqual([]);
  });

  it("are cancelled at the server too when the word comes after the upload", async () => {
    imports.add([file("a.tif")]);
    imports.cancel(imports.jobs.value[0]!.key);
    await server.arrive(status("reading", { id: "late" }));
    expect(server.cancelled).toEqual(["late"]);
  });

  it("send their answers once and go on; a refusal of them is said", async () => {
    imports.add([file("a.tif")]);
    await server.arrive(status("question"));
    const { key } = imports.jobs.value[0]!;
    expect(phases()).toEqual(["question"]);
    server.answered = new ApiError("malformed", "Not a number.");
    expect(await imports.answer(key, { answers: { size: "x" } })).toBe("Not a number.");
    expect(phases()).toEqual(["question"]);
    server.answered = status("mipmaps", { share: 0.5 });
    expect(await imports.answer(key, { answers: { size: "100" } })).toBeNull();
    expect(phases()).toEqual(["work"]);
    expect(server.answers.at(-1)).toEqual({ answers: { size: "100" } });
  });

  it("outlive a server that is silent for a moment, not one that has forgotten them", async () => {
    imports.add([file("a.tif")]);
    await server.arrive();
    server.now = new ApiError("unreachable", "No answer.");
    await tick(2000);
    expect(phases()).toEqual(["work"]);
    server.now = status("saving", { share: 0.9 });
    await tick(3000);
    expect(imports.jobs.value[0]!.share).toBe(0.9);
    server.now = new ApiError("no_import", "There is no such import.");
    await tick(3000);
    expect(imports.jobs.value[0]).toMatchObject({ phase: "failed", problem: "There is no such import." });
  });

  it("wait while the server still clears away the one before", async () => {
    imports.add([file("a.tif")]);
    await server.arrive(new ApiError("busy", "Another file of yours is still being brought in."));
    expect(phases()).toEqual(["waiting"]);
    await tick(1500);
    expect(phases()).toEqual(["upload"]);
    for (let i = 0; i < 9; i++) {
      await server.arrive(new ApiError("busy", "Another file."));
      if (phases()[0] !== "waiting") break;
      await tick(1500);
    }
    expect(phases()).toEqual(["failed"]);
  });

  it("are followed by a page that is loaded anew", async () => {
    keepImport("t", { id: "j1", file: "a.tif" });
    for (const { id, file: name } of keptImports("t")) imports.resume(id, name);
    server.now = status("done", { id: "j1", layer: "l" });
    await tick();
    expect(arrived.map((j) => j.file)).toEqual(["a.tif"]);
    keepImports("t", []);
    expect(keptImports("t")).toEqual([]);
    window.sessionStorage.setItem("esker.jobs.t", '[{"id":3},"x"]');
    expect(keptImports("t")).toEqual([]);
  });
});

describe("what others bring in", () => {
  const message = (stage: ImportStatus["stage"], share = 0.45, id = "o"): Importing => ({
    type: "importing",
    author: "Ana",
    file: "rainier.tif",
    status: status(stage, { id, share }),
  });

  it("is one line each, while it lasts", async () => {
    const others = new OtherImports();
    others.receive(message("reading"));
    others.receive(message("errors", 0.7));
    expect(others.list.value.map(importingWords)).toEqual(["Ana is bringing in rainier.tif, 70 %"]);
    others.receive(message("done"));
    expect(others.list.value.map(importingWords)).toEqual(["Ana has brought in rainier.tif"]);
    await tick(4000);
    expect(others.list.value).toEqual([]);
    others.receive(message("reading"));
    others.receive(message("cancelled"));
    expect(others.list.value).toEqual([]);
    others.receive(message("reading"));
    await tick(30_000);
    expect(others.list.value).toEqual([]);
  });

  it("leaves out what turns out to be mine", () => {
    const others = new OtherImports();
    others.receive(message("reading"));
    others.receive(message("question", 0.3, "p"));
    others.leaveOut(new Set(["o"]));
    expect(others.list.value.map(importingWords)).toEqual(["Ana is placing rainier.tif"]);
    others.dispose();
  });
});
