"""A Chromium of one's own for a benchmark: pages and folders that it is served, and the time of its GPU process."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final

import psutil
from playwright.sync_api import Browser, Page, sync_playwright

from esker import resources

ROOT: Final = resources.sources()
FRONTEND: Final = ROOT / "frontend"
SOFTWARE_ADAPTER: Final = (
    "--no-sandbox",
    "--enable-unsafe-webgpu",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-angle=swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--no-first-run",
)
"""Headless Chromium needs these for WebGPU and WebGL on the software adapter (DESIGN 16). The tests use them too."""
FLAGS: Final = (
    *SOFTWARE_ADAPTER,
    "--disable-backgrounding-occluded-windows",
    "--disable-renderer-backgrounding",
    "--enable-precise-memory-info",
    "--js-flags=--expose-gc",
)


def vite(*arguments: str) -> list[str]:
    """The command that runs Vite: with the Node.js beside this Python, where set-up put one, else with the system's.

    Raises FileNotFoundError where there is none.
    """
    beside = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    node = shutil.which("node", path=beside)
    if node is None:
        raise FileNotFoundError("Node.js is missing: `make setup` installs it beside this Python.")
    return [node, str(FRONTEND / "node_modules" / "vite" / "bin" / "vite.js"), *arguments]


@contextmanager
def pages() -> Iterator[str]:
    """Builds and serves the pages of frontend/dev; gives the base address. Raises CalledProcessError."""
    with tempfile.TemporaryDirectory(prefix="esker-bench-") as folder:
        command = vite("build", "--config", "dev/vite.config.ts", "--outDir", folder, "--logLevel", "warn")
        subprocess.run(command, cwd=FRONTEND, check=True, stdout=sys.stderr)
        with files(Path(folder)) as base:
            yield base


class _Files(SimpleHTTPRequestHandler):
    """Files for pages of any origin, without a log."""

    def end_headers(self) -> None:
        self.send_header("Access-Control-Allow-Origin", "*")
        super().end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        del format, args


@contextmanager
def files(folder: Path) -> Iterator[str]:
    """Serves a folder; gives the base address."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Files, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join(10)


@contextmanager
def chromium(*flags: str) -> Iterator[Browser]:
    """The browser at $CHROMIUM or on the path, with more ``flags``. Raises RuntimeError when there is none."""
    path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        raise RuntimeError("Chromium is missing: run `make browser`.")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*FLAGS, *flags])
        try:
            yield browser
        finally:
            browser.close()


def gpu_process() -> psutil.Process:
    """The GPU process of the browser that this process started. Raises RuntimeError unless there is exactly one."""
    found = [p for p in psutil.Process().children(recursive=True) if "--type=gpu-process" in p.cmdline()]
    if len(found) != 1:
        raise RuntimeError(f"{len(found)} GPU processes")
    return found[0]


def cpu_ms(process: psutil.Process) -> float:
    """Processor time that a process has used, milliseconds; the clock ticks every 10."""
    times = process.cpu_times()
    return 1000 * float(times.user + times.system)


@contextmanager
def page(browser: Browser, url: str, ready: str, width: int = 1024, height: int = 768) -> Iterator[Page]:
    """A page, ready when ``ready`` holds in it. Raises RuntimeError for errors that it reported."""
    problems: list[str] = []
    made = browser.new_page(viewport={"width": width, "height": height})
    made.set_default_timeout(600_000)
    made.on("pageerror", lambda error: problems.append(str(error)))
    made.on("console", lambda line: problems.append(line.text) if line.type == "error" else None)
    try:
        made.goto(url)
        made.wait_for_function(ready)
        yield made
    finally:
        made.close()
    if problems:
        raise RuntimeError("; ".join(problems))
