// Builds test/tiles/groundbench.ts as the page is built and runs it: a test runner's instrumentation would be half of the time.
import { spawnSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { join, resolve } from "node:path";
import { build } from "vite";

const root = resolve(import.meta.dirname, "..");
const outDir = mkdtempSync(join(root, "node_modules", ".ground-"));
try {
  await build({
    configFile: false,
    logLevel: "error",
    root,
    publicDir: false,
    resolve: { alias: { "@shaders": resolve(root, "../shaders") } },
    ssr: { noExternal: true },
    define: { "import.meta.dirname": JSON.stringify(resolve(root, "test/tiles")) },
    build: { ssr: resolve(root, "test/tiles/groundbench.ts"), outDir, minify: false, target: "es2023" },
  });
  process.exitCode = spawnSync(process.execPath, [join(outDir, "groundbench.js")], { stdio: "inherit" }).status ?? 1;
} finally {
  rmSync(outDir, { recursive: true });
}
