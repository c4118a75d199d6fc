"""Cracks: random restricted trees on filtered pyramids, random cameras, in the browser; not one pixel may show through.

The views of CI's tests, thousands of them. Each seed draws ``VIEWS`` views of random trees with missing branches from
above, below, the side and straight down, then as many a metre from the ground, on levels without an end. With
``--keep FILE`` a run that was stopped goes on where it ended, and the file is the result.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any, Final

from esker.bench import _browser, _serving
from esker.version import VERSION

VIEWS: Final = 20
FIRST_SEED: Final = 1000
KINDS: Final = {"trees": "crackTest", "a_metre_from_the_ground": "walkCrackTest"}
WHOLE: Final = 256 * 192
MOST_BLIND: Final = 0.1
SUMS: Final = ("views", "cracks", "nans", "covered", "patches", "mixed")


def empty() -> dict[str, Any]:
    """A result without a view."""
    kinds: dict[str, Any] = {kind: dict.fromkeys(SUMS, 0) | {"blind": 0, "failures": []} for kind in KINDS}
    return {"bench": "cracks", "version": VERSION, "machine": _serving.machine(), "next_seed": FIRST_SEED, **kinds}


def load(file: Path | None) -> dict[str, Any]:
    """What a stopped run has, or an empty result."""
    if file is None or not file.exists():
        return empty()
    kept: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return kept


def add(result: dict[str, Any], kind: str, seed: int, report: dict[str, Any]) -> None:
    """Counts one seed's views in; failures carry the seed that repeats them."""
    for name in SUMS:
        result[kind][name] += report[name]
    for failure in report["failures"]:
        if failure.endswith(f": {WHOLE}"):
            # Nothing at all was drawn: detail had raised the ground above the eye. A crack is seen between ground.
            result[kind]["blind"] += 1
            result[kind]["cracks"] -= WHOLE
        else:
            result[kind]["failures"].append(f"seed {seed}: {failure}")


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
        while sum(result[kind]["views"] for kind in KINDS) < args.views:
            seed = result["next_seed"]
            # A page for every seed: what one leaves behind does not reach the next.
            with _browser.page(browser, f"{base}/dev/renderer.html", ready) as page:
                for kind, function in KINDS.items():
                    add(result, kind, seed, page.evaluate(f"([s, n]) => esker.{function}(s, n)", [seed, VIEWS]))
            result["next_seed"] = seed + 1
            if args.keep:
                args.keep.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
            found = sum(result[kind]["cracks"] for kind in KINDS)
            views = sum(result[kind]["views"] for kind in KINDS)
            sys.stderr.write(f"\r{views} views, {found} crack pixels")
    sys.stderr.write("\n")
    if args.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        for kind in KINDS:
            sys.stdout.write(f"{kind}: {result[kind]}\n")
    return int(failed(result))
