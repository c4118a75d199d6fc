// SPEC X30, X31
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import {
  bytesWords,
  type ExportedFile,
  Exporter,
  type ExportTransport,
  engineWords,
  exportWords,
  ofUnreal,
  sizesOf,
  waitWords,
} from "../../src/app/layers/exports.ts";
import { scalesFor, solidWords } from "../../src/app/layers/print-sizes.ts";
import { ApiError } from "../../src/app/server/api.ts";
import type { ExportEstimate, ExportRequest, ExportStatus } from "../../src/generated/contract.ts";

const status = (stage: ExportStatus["stage"], over: Partial<ExportStatus> = {}): ExportStatus => ({
  id: "a",
  stage,
  share: 0.4,
  text: "",
  file: "",
  bytes: 0,
  low_m: -5,
  high_m: 95,
  spacing_m: 4,
  ...over,
});

/** Plays the server. */
class FakeTransport implements ExportTransport {
  now: ExportStatus | ApiError = status("solving");
  begun: ExportStatus | ApiError = status("waiting", { share: 0 });
  readonly requests: ExportRequest[] = [];
  readonly estimated: ExportRequest[] = [];
  readonly cancelled: string[] = [];
  polls = 0;

  async estimate(request: ExportRequest): Promise<ExportEstimate> {
    this.estimated.push(request);
    return { bytes: 10 * (request.samples ?? 0), seconds: 3 };
  }
  async begin(request: ExportRequest): Promise<ExportStatus> {
    this.requests.push(request);
    if (this.begun instanceof ApiError) throw this.begun;
    return this.begun;
  }
  async status(): Promise<ExportStatus> {
    this.polls++;
    if (this.now instanceof ApiError) throw this.now;
    return this.now;
  }
  async file(id: string): Promise<Blob> {
    return new Blob([id]);
  }
  async cancel(id: string): Promise<void> {
    this.cancelled.push(id);
  }
}

let server: FakeTransport;
let saved: ExportedFile[];
let exporter: Exporter;
let past: number | null;
const tick = (ms = 400): Promise<unknown> => vi.advanceTimersByTimeAsync(ms);

beforeEach(() => {
  vi.useFakeTimers();
  server = new FakeTransport();
  saved = [];
  past = null;
  exporter = new Exporter(
    server,
    (file) => saved.push(file),
    () => past,
  );
});
afterEach(() => {
  exporter.dispose();
  vi.useRealTimers();
});

describe("an export", () => {
  it("goes from a request to a saved file, which can be saved again", async () => {
    past = 7;
    exporter.choose({ format: "geotiff", samples: 513, detail: false });
    await exporter.begin();
    expect(server.requests).toEqual([{ format: "geotiff", samples: 513, detail: false, at: 7 }]);
    expect(exporter.phase.value).toBe("work");
    await tick();
    expect(exporter.status.value?.share).toBe(0.4);
    await exporter.begin();
    expect(server.requests.length, "one at a time").toBe(1);
    server.now = status("done", { share: 1, file: "ridge-513.tif", bytes: 3 });
    await tick();
    expect(exporter.phase.value).toBe("done");
    exporter.save();
    expect(saved.map((f) => f.name)).toEqual(["ridge-513.tif", "ridge-513.tif"]);
    expect(await saved[0]!.blob.text()).toBe("a");
    exporter.again();
    expect([exporter.phase.value, exporter.file.value]).toEqual(["choose", null]);
  });

  it("asks for masks that sum to one, of masks only (SPEC X380)", async () => {
    exporter.choose({ format: "masks", weights: true });
    await exporter.begin();
    expect(server.requests[0]).toMatchObject({ format: "masks", weights: true });
    exporter.cancel();
    exporter.choose({ format: "glb" });
    await exporter.begin();
    expect(server.requests[1]).not.toHaveProperty("weights");
  });

  it("is cancelled on the server, also before its answer has come", async () => {
    await exporter.begin();
    exporter.cancel();
    expect(exporter.phase.value).toBe("choose");
    const beginning = exporter.begin();
    exporter.cancel();
    await beginning;
    expect(server.cancelled).toEqual(["a", "a"]);
    await tick(5000);
    expect(server.polls).toBe(0);
    expect(saved).toEqual([]);
  });

  it("outlives a server that does not answer for a while", async () => {
    await exporter.begin();
    server.now = new ApiError("unreachable", "The server does not answer.");
    await tick(10_000);
    expect(exporter.phase.value).toBe("work");
    server.now = status("done", { file: "a.png" });
    await tick(4000);
    expect(exporter.phase.value).toBe("done");
  });

  it("ends with a sentence where the server does not know it any more, and begins anew", async () => {
    await exporter.begin();
    server.now = new ApiError("no_export", "This export is not on the server any more. Export again.");
    await tick();
    expect([exporter.phase.value, exporter.problem.value]).toEqual(["failed", server.now.message]);
    server.now = status("failed", { text: "The ground is lava." });
    await exporter.begin();
    expect(exporter.problem.value).toBe("");
    await tick();
    expect([exporter.phase.value, exporter.problem.value]).toEqual(["failed", "The ground is lava."]);
    exporter.again();
    expect([exporter.phase.value, exporter.problem.value]).toEqual(["choose", ""]);
  });

  it("says why it cannot begin", async () => {
    server.begun = new ApiError("busy", "Another export of yours is still being made.");
    await exporter.begin();
    expect([exporter.phase.value, exporter.problem.value]).toEqual(["failed", server.begun.message]);
  });

  it("is given up when nobody ever answers", async () => {
    await exporter.begin();
    server.now = new ApiError("unreachable", "The server does not answer.");
    await tick(200_000);
    expect(exporter.phase.value).toBe("failed");
  });
});

describe("the choice", () => {
  it("keeps to the samples that a format has, and is estimated once hands rest", async () => {
    exporter.choose({ samples: 4097 });
    exporter.choose({ format: "glb" });
    expect(exporter.choice.value.samples).toBe(1025);
    expect(exporter.estimate.value).toBeNull();
    await tick(200);
    expect(server.estimated.map((w) => [w.format, w.samples])).toEqual([["glb", 1025]]);
    expect(exporter.estimate.value?.bytes).toBe(10_250);
  });

  it("has sizes of engines", () => {
    expect(sizesOf("png16")).toEqual([257, 505, 513, 1009, 1025, 2017, 2049, 4033, 4097]);
    expect(sizesOf("glb").at(-1)).toBe(1025);
    expect(sizesOf("png16").filter(ofUnreal)).toEqual([505, 1009, 2017, 4033]);
  });
});

describe("the words", () => {
  it("say how far it is", () => {
    expect(exportWords("work", status("detail", { share: 0.417 }))).toBe("Adding the fine detail… 42 %");
    expect(exportWords("work", status("waiting", { text: "Waiting for its turn." }))).toBe("Waiting for its turn.");
    expect(exportWords("work", null)).toBe("Waiting for the server…");
    expect(exportWords("load", status("done"))).toBe("Downloading the file…");
  });

  it("say sizes and times", () => {
    expect([900, 51_234, 1_681_000, 67_000_000].map(bytesWords)).toEqual(["1 kB", "51 kB", "1.7 MB", "67 MB"]);
    expect([3, 12, 58, 140].map(waitWords)).toEqual(["a few seconds", "10 seconds", "a minute", "2 minutes"]);
  });

  it("say how engines are set", () => {
    // 100 m in 65535 steps of 1/128 m at 100 %.
    expect(engineWords(status("done"), 1025)).toEqual([
      "0 is -5 m, 65535 is 95 m; north is up",
      "Unreal: scale 400, 400, 19.5315",
      "Unity: width and length 4096, height 100, position y -5",
    ]);
  });
});

describe("what is printed", () => {
  it("sends paper and size with maps and solids only (SPEC N48)", async () => {
    const server = new FakeTransport();
    const exporter = new Exporter(server, () => {});
    exporter.choose({ paper: { size: "a3", scale: 25_000, interval_m: 20 } });
    exporter.choose({ model: { width_mm: 90, base_mm: 2, exaggeration: 3 } });
    for (const format of ["png16", "map_pdf", "stl"] as const) {
      exporter.choose({ format });
      await exporter.begin();
      exporter.cancel();
    }
    expect(server.requests.map((r) => [r.format, r.paper, r.model])).toEqual([
      ["png16", undefined, undefined],
      ["map_pdf", { size: "a3", scale: 25_000, interval_m: 20 }, undefined],
      ["stl", undefined, { width_mm: 90, base_mm: 2, exaggeration: 3 }],
    ]);
    exporter.dispose();
  });

  it("offers a solid with as many samples as printers can lay down, and takes more (SPEC N48)", () => {
    const exporter = new Exporter(new FakeTransport(), () => {});
    exporter.choose({ format: "stl" });
    expect(exporter.choice.value.samples).toBe(513);
    exporter.choose({ samples: 1025 });
    exporter.choose({ model: { width_mm: 90, base_mm: 2, exaggeration: 3 } });
    expect(exporter.choice.value.samples).toBe(1025);
    exporter.dispose();
  });

  it("has no more samples than paper shows and printers take", () => {
    expect(sizesOf("map_svg").at(-1)).toBe(2049);
    expect(sizesOf("stl").at(-1)).toBe(1025);
  });

  it("offers scales that fit the paper, the largest picture first (SPEC N48)", () => {
    expect(scalesFor(4096, "a4").slice(0, 3)).toEqual([25_000, 30_000, 40_000]);
    expect(scalesFor(640, "a4")[0]).toBe(4000);
    expect(scalesFor(640, "a3")[0]).toBe(2500);
    for (const n of scalesFor(7777, "a3")) expect((1000 * 7777) / n).toBeLessThanOrEqual(257);
    expect(solidWords(150, 4096)).toContain("1 : 27,300");
  });
});
