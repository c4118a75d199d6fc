"""Cracks: random restricted trees on filtered pyramids, random cameras, in the browser; not one pixel may show through.

The views of CI's tests, thousands of them, of three kinds: random trees with missing branches from above, below, the
side and straight down; the same metres from the ground of the largest terrain; a metre from it, on levels without end.
Some have a look, light and the NaN scan, most show the ground in one colour (docs/renderer.md, "The crack test"). With
``--keep FILE``, which becomes the result, a run that was stopped goes on unless something that draws has changed.
``--workers N`` draws in N browsers side by side, each seed in one of them: the result is the same, but for its times.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import math
import sys
import threading
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final, NamedTuple

import psutil
from playwright.sync_api import Page

from bench.picture import _browser
from bench.room import _serving
from esker.version import VERSION

FIRST_SEED: Final = 1000
# What a page leaves behind does not pile up.
SEEDS_A_PAGE: Final = 5


class Kind(NamedTuple):
    """A test of the harness, how many views it draws of a seed, and every how many of them one in full."""

    function: str
    views: int
    full: int


KINDS: Final = {
    "trees": Kind("crackTest", 120, 10),
    "metres_from_the_ground": Kind("deepCrackTest", 20, 20),
    "a_metre_from_the_ground": Kind("walkCrackTest", 60, 20),
}
MOST_BLIND: Final = 0.1
SUMS: Final = ("views", "full", "cracks", "nans", "covered", "patches", "mixed", "blind")


def empty() -> dict[str, Any]:
    """A result without a view."""
    kinds: dict[str, Any] = {kind: dict.fromkeys(SUMS, 0) | {"failures": []} for kind in KINDS}
    return {
        "bench": "cracks",
        "version": VERSION,
        "machine": _serving.machine(),
        "next_seed": FIRST_SEED,
        "sources": sources(),
        "cpu_s": 0.0,
        **kinds,
    }


def sources() -> str:
    """SHA-256 of all that draws: a result comes from one state of the renderer and its tests."""
    digest = hashlib.sha256()
    folders = [_browser.FRONTEND / "src", _browser.FRONTEND / "test" / "gpu", _browser.ROOT / "shaders"]
    for file in sorted(file for folder in folders for file in folder.rglob("*") if file.is_file()):
        digest.update(f"{file.relative_to(_browser.ROOT)}\n".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def load(file: Path | None) -> dict[str, Any]:
    """Returns what a stopped run of the same sources has, else an empty result."""
    fresh = empty()
    if file is None or not file.exists():
        return fresh
    kept: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return kept if kept.get("sources") == fresh["sources"] else fresh


def add(result: dict[str, Any], kind: str, seed: int, report: dict[str, Any]) -> None:
    """Counts one seed's views in; failures carry the seed that repeats them."""
    for name in SUMS:
        result[kind][name] += report[name]
    result[kind]["failures"] += [f"seed {seed}: {failure}" for failure in report["failures"]]


def views_of(result: dict[str, Any]) -> int:
    """Views drawn so far."""
    return sum(int(result[kind]["views"]) for kind in KINDS)


class Run:
    """A result that several browsers add to: seeds are handed out in order, and counted in order as they come back."""

    def __init__(self, result: dict[str, Any], views: int, keep: Path | None) -> None:
        """``views``: in all. ``keep``: the file that is written after every seed."""
        self.result, self.keep = result, keep
        seeds = math.ceil((views - views_of(result)) / sum(kind.views for kind in KINDS.values()))
        self.open = deque(range(result["next_seed"], result["next_seed"] + max(0, seeds)))
        self.drawn: dict[int, tuple[dict[str, dict[str, Any]], float]] = {}
        self.lock = threading.Lock()

    def take(self) -> int | None:
        """The next seed to draw; None when there is none."""
        with self.lock:
            return self.open.popleft() if self.open else None

    def give(self, seed: int, reports: dict[str, dict[str, Any]], cpu_s: float) -> None:
        """A seed's reports by kind. Later seeds wait for earlier ones: a stopped run goes on from ``next_seed``."""
        with self.lock:
            self.drawn[seed] = (reports, cpu_s)
            while (ready := self.drawn.pop(self.result["next_seed"], None)) is not None:
                for kind, report in ready[0].items():
                    add(self.result, kind, self.result["next_seed"], report)
                self.result["next_seed"] += 1
                self.result["cpu_s"] = round(self.result["cpu_s"] + ready[1], 2)
            if self.keep:
                part = self.keep.with_suffix(".part")
                part.write_text(json.dumps(self.result, indent=1) + "\n", encoding="utf-8")
                part.replace(self.keep)
            found = sum(self.result[kind]["cracks"] for kind in KINDS)
            sys.stderr.write(f"\r{views_of(self.result)} views, {found} crack pixels")


def browser_seconds(marker: str) -> float:
    """Processor time of the browser whose command line holds ``marker``, with what it started, seconds."""
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            if any(marker in word for word in child.cmdline()):
                family = [child, *child.children(recursive=True)]
                return sum(_browser.cpu_ms(process) for process in family) / 1000
    return 0.0


def work(run: Run, base: str, marker: str) -> None:
    """Draws seeds in a browser of its own until there are none left, ``SEEDS_A_PAGE`` on a page."""
    ready = "globalThis.esker !== undefined"
    with _browser.chromium(f"--{marker}") as browser:
        seed = run.take()
        while seed is not None:
            with _browser.page(browser, f"{base}/dev/renderer.html", ready) as page:
                for _ in range(SEEDS_A_PAGE):
                    began = browser_seconds(marker)
                    run.give(seed, draw(page, seed), browser_seconds(marker) - began)
                    seed = run.take()
                    if seed is None:
                        break


def draw(page: Page, seed: int) -> dict[str, dict[str, Any]]:
    """The views of a seed, by kind."""
    call = "([name, seed, views, full]) => esker[name](seed, views, { full })"
    return {name: page.evaluate(call, [kind.function, seed, kind.views, kind.full]) for name, kind in KINDS.items()}


def failed(result: dict[str, Any]) -> bool:
    """A crack or a NaN was found, or more views than a few were blind."""
    kinds = [result[kind] for kind in KINDS]
    return any(k["cracks"] or k["nans"] or k["blind"] > MOST_BLIND * max(1, k["views"]) for k in kinds)


def main(argv: list[str]) -> int:
    """``esker bench cracks [--json] [--views N] [--keep FILE] [--workers N]``: 1 when it ``failed``."""
    parser = argparse.ArgumentParser(prog="esker bench cracks", description=__doc__)
    parser.add_argument("--views", type=int, default=10_000, help="views in all (default 10,000)")
    parser.add_argument("--keep", type=Path, help="result file, written after every seed and gone on from")
    parser.add_argument("--workers", type=int, default=1, help="browsers side by side, a core each (default 1)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    args = parser.parse_args(argv)
    run = Run(load(args.keep), args.views, args.keep)
    with _browser.pages() as base, ThreadPoolExecutor(max(1, args.workers)) as pool:
        done = [pool.submit(work, run, base, f"crack-worker-{k}") for k in range(max(1, args.workers))]
    for worker in done:
        worker.result()
    sys.stderr.write("\n")
    if args.json:
        sys.stdout.write(json.dumps(run.result, indent=1) + "\n")
    else:
        for kind in KINDS:
            sys.stdout.write(f"{kind}: {run.result[kind]}\n")
    return int(failed(run.result))
