"""A flight over endless ground in the browser: memory of the device and of the page, tiles made, flicker at rest.

The camera goes round over 4 km of hills, 12 m above the ground, whose detail is made on the way. What the page holds on
the device is counted from every buffer and texture that it makes and destroys.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from bench.picture import _browser
from bench.room import _serving
from esker.version import VERSION

STEP_M = 3.0


def measure(minutes: float, frames: int, moments: int) -> dict[str, Any]:
    """A flight of at least so many minutes and frames; largest and last memory, and growth over its second half."""
    ready = "globalThis.bench !== undefined"
    options = {"frames": frames, "seconds": 60 * minutes, "moments": moments, "stepM": STEP_M}
    with _browser.pages() as base, _browser.chromium() as browser:
        with _browser.page(browser, f"{base}/dev/bench.html", ready) as page:
            page.set_default_timeout(60_000 * (minutes + 20))
            path: list[dict[str, Any]] = page.evaluate("o => bench.flight(o)", options)
        with _browser.page(browser, f"{base}/dev/bench.html", ready) as page:
            page.evaluate("() => bench.hills()")
            flicker = page.evaluate("() => bench.flicker(5)")
    half = path[len(path) // 2]
    return {
        "frames": path[-1]["frame"] + 1,
        "seconds": round(path[-1]["seconds"], 1),
        "metres": STEP_M * path[-1]["frame"],
        "patches": [min(m["patches"] for m in path), max(m["patches"] for m in path)],
        "tiles_made_a_frame": round(sum(m["uploads"] for m in path[1:]) / max(1, len(path) - 1), 2),
        "device_mib": {
            "largest": round(max(m["deviceBytes"] for m in path) / 2**20, 1),
            "second_half": round((path[-1]["deviceBytes"] - half["deviceBytes"]) / 2**20, 2),
        },
        "heap_mib": {
            "largest": round(max(m["heapBytes"] for m in path) / 2**20, 1),
            "second_half": round((path[-1]["heapBytes"] - half["heapBytes"]) / 2**20, 2),
        },
        "at_rest": flicker,
    }


def main(argv: list[str]) -> int:
    """``esker bench flight [--json] [--minutes M] [--frames N]``."""
    parser = argparse.ArgumentParser(prog="esker bench flight", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--frames", type=int, default=300, help="at least so many")
    parser.add_argument("--moments", type=int, default=41, help="when memory is looked at")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    args = parser.parse_args(argv)
    result = {"bench": "flight", "version": VERSION, "machine": _serving.machine()}
    result |= measure(args.minutes, args.frames, args.moments)
    text = json.dumps(result, indent=1) if args.json else "\n".join(f"{k}: {v}" for k, v in result.items())
    sys.stdout.write(text + "\n")
    return 0
