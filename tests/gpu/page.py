"""The renderer's harness page in a real Chromium: Vite serves the sources, nothing is built."""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from bench.picture._browser import vite
from tests.browser import FLAGS, chromium_path, free_port

FRONTEND = Path(__file__).resolve().parents[2] / "frontend"


@functools.cache
def _vite() -> str:
    """Address of the server of the sources. It is started once for all modules and ends with this process."""
    port = free_port()
    # No file watching: an edit during the run must not reload the page.
    env = {**os.environ, "CI": "1", "CHOKIDAR_USEPOLLING": "0"}
    process = subprocess.Popen(
        vite("--port", str(port), "--strictPort", "--host", "127.0.0.1", "--mode", "test"),
        cwd=FRONTEND,
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    atexit.register(_end, process)
    assert process.stdout is not None
    seen = ""
    for line in process.stdout:
        seen += line
        if "Local" in line:
            return f"http://127.0.0.1:{port}"
    raise RuntimeError(f"vite did not start:\n{seen}")


def _end(process: subprocess.Popen[str]) -> None:
    with contextlib.suppress(ProcessLookupError):  # it has ended by itself
        os.killpg(process.pid, signal.SIGTERM)
    process.wait(20)
    if process.stdout is not None:
        process.stdout.close()


@contextmanager
def open_harness(name: str = "renderer") -> Iterator[Page]:
    """A page of frontend/dev, ready. Console errors fail the caller at the end."""
    problems: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path(), args=FLAGS)
        try:
            page = browser.new_page(viewport={"width": 800, "height": 600})
            page.on("pageerror", lambda error: problems.append(str(error)))
            page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
            page.goto(f"{_vite()}/dev/{name}.html")
            page.wait_for_function("globalThis.esker !== undefined || globalThis.bench !== undefined", timeout=60_000)
            yield page
        finally:
            browser.close()
    assert not problems, problems
