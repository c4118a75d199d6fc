"""Cracks: random restricted trees on filtered pyramids, random cameras, in the browser; not one pixel may show through.

The views of CI's tests, thousands of them, of three kinds: random trees with missing branches from above, below, the
side and straight down; the same metres from the ground of the largest terrain; a metre from it, on levels without end.
Some have a look, light and the NaN scan, most show the ground in one colour (docs/renderer.md, "The crack test"). With
``--keep FILE``, which becomes the result, a run that was stopped goes on unless something that draws has changed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from pathlib import Path
from typing import Any, Final, NamedTuple

import psutil
from playwright.sync_api import Page

from esker.bench import _browser, _serving
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
    """What a stopped run of the same sources has, else an empty result."""
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


def browser_seconds() -> float:
    """Processor time of the browser that this process started, seconds."""
    return sum(_browser.cpu_ms(process) for process in psutil.Process().children(recursive=True)) / 1000


def draw(page: Page, result: dict[str, Any], views: int, keep: Path | None) -> None:
    """Up to ``SEEDS_A_PAGE`` seeds on one page, counted into the result, as long as there are fewer than ``views``."""
    for _ in range(SEEDS_A_PAGE):
        if views_of(result) >= views:
            return
        seed, began = result["next_seed"], browser_seconds()
        for name, kind in KINDS.items():
            call = f"([seed, views, full]) => esker.{kind.function}(seed, views, {{ full }})"
            add(result, name, seed, page.evaluate(call, [seed, kind.views, kind.full]))
        result["next_seed"] = seed + 1
        result["cpu_s"] = round(result["cpu_s"] + browser_seconds() - began, 2)
        if keep:
            keep.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        found = sum(result[kind]["cracks"] for kind in KINDS)
        sys.stderr.write(f"\r{views_of(result)} views, {found} crack pixels")


def failed(result: dict[str, Any]) -> bool:
    """A crack or a NaN was found, or more views than a few were blind."""
    kinds = [result[kind] for kind in KINDS]
    return any(k["cracks"] or k["nans"] or k["blind"] > MOST_BLIND * max(1, k["views"]) for k in kinds)


def main(argv: list[str]) -> int:
    """``esker bench cracks [--json] [--views N] [--keep FILE]``: 1 when it ``failed``."""
    parser = argparse.ArgumentParser(prog="esker bench cracks", description=__doc__)
    parser.add_argument("--views", type=int, default=10_000, help="views in all (default 10,000)")
    parser.add_argument("--keep", type=Path, help="result file, written after every seed and gone on from")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    args = parser.parse_args(argv)
    result = load(args.keep)
    ready = "globalThis.esker !== undefined"
    with _browser.pages() as base, _browser.chromium() as browser:
        while views_of(result) < args.views:
            with _browser.page(browser, f"{base}/dev/renderer.html", ready) as page:
                draw(page, result, args.views, args.keep)
    sys.stderr.write("\n")
    if args.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        for kind in KINDS:
            sys.stdout.write(f"{kind}: {result[kind]}\n")
    return int(failed(result))
