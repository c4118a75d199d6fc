import { resolve } from "node:path";
import { defineConfig } from "vite";

// The pages of this folder, built for the benchmarks: no server that reloads them, no file that changes under them.
const root = resolve(import.meta.dirname, "..");
export default defineConfig({
  root,
  base: "./",
  resolve: { alias: { "@shaders": resolve(root, "../shaders") } },
  build: {
    target: "es2023",
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 1500,
    emptyOutDir: true,
    rollupOptions: { input: ["bench", "renderer"].map((page) => resolve(root, "dev", `${page}.html`)) },
  },
  worker: { format: "es" },
});
