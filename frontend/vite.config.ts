import { resolve } from "node:path";
import { defineConfig } from "vitest/config";
import { licences } from "./licences.ts";

/** Rooms whose tests show components, or put something in place of modules. */
const APART = ["app", "input", "ui"].map((room) => `test/${room}/*.test.ts`);

// The page is built once and served by the Python server from the same origin; shaders are imported with `?raw`.
export default defineConfig({
  base: "/",
  resolve: { alias: { "@shaders": resolve(import.meta.dirname, "../shaders") } },
  plugins: [licences(resolve(import.meta.dirname, "../NOTICE"))],
  server: { fs: { allow: [resolve(import.meta.dirname, "..")] } },
  build: { target: "es2023", outDir: "dist", assetsInlineLimit: 0, chunkSizeWarningLimit: 1500 },
  worker: { format: "es" },
  // Limits end what hangs. A busy machine takes its time. Files that show components or put something in place of modules
  // have a world each; the others share one, for a seventh less
  // processor time in all.
  test: {
    pool: "threads",
    testTimeout: 300_000,
    hookTimeout: 300_000,
    projects: [
      { extends: true, test: { name: "apart", include: APART } },
      { extends: true, test: { name: "together", include: ["test/**/*.test.ts"], exclude: APART, isolate: false } },
    ],
  },
});
