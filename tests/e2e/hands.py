"""What hands do in the end-to-end tests: strokes with real pointer events, and waiting for the page, never for time."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterable, Sequence
from typing import Any

from playwright.sync_api import Page

from tests.e2e.conftest import LEVEL, Visitor

Pixel = tuple[float, float]

# Points that are samples of every level of a 4096 m terrain, so that heights compare without interpolation.
COARSE = [(128.0 * col, 128.0 * row) for row in range(33) for col in range(33)]


def polyline(points: Sequence[Pixel], steps: int = 8) -> list[Pixel]:
    """Points along straight legs, ``steps`` a leg."""
    out = [points[0]]
    for (ax, ay), (bx, by) in itertools.pairwise(points):
        out += [(ax + (bx - ax) * i / steps, ay + (by - ay) * i / steps) for i in range(1, steps + 1)]
    return out


def arch(start: Pixel, end: Pixel, rise: float, steps: int = 24) -> list[Pixel]:
    """A silhouette on screen: up by ``rise`` pixels in the middle (down for a crevice, where it is negative)."""
    (ax, ay), (bx, by) = start, end
    return [
        (ax + (bx - ax) * t, ay + (by - ay) * t - rise * math.sin(math.pi * t))
        for t in (i / steps for i in range(steps + 1))
    ]


def ellipse(centre: Pixel, rx: float, ry: float, steps: int = 28) -> list[Pixel]:
    """A closed outline on screen."""
    x, y = centre
    return [
        (x + rx * math.cos(2 * math.pi * i / steps), y + ry * math.sin(2 * math.pi * i / steps))
        for i in range(steps + 1)
    ]


def press_and_move(page: Page, path: Iterable[Pixel]) -> None:
    """Pointer down at the first pixel and along the others; the pointer stays down."""
    points = list(path)
    page.mouse.move(*points[0])
    page.mouse.down()
    for x, y in points[1:]:
        page.mouse.move(x, y)
        page.wait_for_timeout(10)


def draw(visitor: Visitor, key: str, path: Iterable[Pixel]) -> str:
    """Draw one stroke with the tool on ``key``; returns its id."""
    before = {s["id"] for s in visitor.js("() => window.esker.strokes()")}
    visitor.page.keyboard.press(key)
    press_and_move(visitor.page, path)
    visitor.page.mouse.up()
    wait(visitor, "n => window.esker.strokes().length > n && window.esker.pending() === 0", len(before))
    (made,) = {s["id"] for s in visitor.js("() => window.esker.strokes()")} - before
    return str(made)


AFTER_FRAMES = """() => new Promise((resolve) => {
  const done = () => resolve(JSON.stringify(window.esker.camera()));
  const pass = (left) => left > 0 ? requestAnimationFrame(() => pass(left - 1)) : done();
  pass(4);
})"""


def wait(visitor: Visitor, condition: str, argument: Any = None, timeout: float = 60) -> None:
    """Wait until a condition in the page holds."""
    visitor.wait(condition, argument, timeout)


def wait_settled(*visitors: Visitor) -> None:
    """Until every page has the same clock, its ops acknowledged, and exact ground."""
    for visitor in visitors:
        wait(visitor, "() => window.esker.settled()", timeout=90)
    clocks = {visitor.js("() => window.esker.clock()") for visitor in visitors}
    if len(clocks) > 1:
        for visitor in visitors:
            wait(visitor, "c => window.esker.clock() >= c && window.esker.settled()", max(clocks), timeout=90)


def wait_whole(*visitors: Visitor, level: int = LEVEL, points: Sequence[Pixel] = COARSE) -> None:
    """Until every page holds a level at all of the points: at rest everybody gets everything (docs/decisions/0005).

    What is compared to the bit is read off the same level then, however few pixels a page draws.
    """
    for visitor in visitors:
        held = "([ps, l]) => ps.every(([x, y]) => window.esker.levelAt(x, y) >= l) && window.esker.settled()"
        wait(visitor, held, [[list(p) for p in points], level], timeout=90)


def heights(visitor: Visitor, points: Sequence[Pixel]) -> list[float]:
    """Ground heights as the page shows them, metres."""
    found = visitor.js("ps => ps.map(([x, y]) => window.esker.heightAt(x, y))", [list(p) for p in points])
    return [float(h) for h in found]


def levels(visitor: Visitor, points: Sequence[Pixel]) -> list[int]:
    """Finest level that the page holds at each point."""
    found = visitor.js("ps => ps.map(([x, y]) => window.esker.levelAt(x, y))", [list(p) for p in points])
    return [int(v) for v in found]


def wait_still(visitor: Visitor, seconds: float = 60) -> None:
    """Returns when the camera has stopped: what is where on the screen stays so.

    A view that makes room for a panel sets out only when the page was laid out anew. A slow renderer comes to that
    late, so several frames lie between two looks at the camera.
    """
    end, last = time.monotonic() + seconds, None
    while (now := visitor.js(AFTER_FRAMES)) != last:
        assert time.monotonic() < end, "the camera never rests"
        last = now
        time.sleep(0.3)


def on_screen(visitor: Visitor, x: float, y: float, z: float | None = None) -> Pixel:
    """Window pixel of a point of the world; on the ground when no height is given."""
    at = visitor.js("([x, y, z]) => window.esker.project(x, y, z ?? window.esker.heightAt(x, y))", [x, y, z])
    return float(at["x"]), float(at["y"])


APART = """([one, other]) => {
  const root = document.querySelector("esk-terrain").shadowRoot;
  const [a, b] = [one, other].map((each) => root.querySelector(each)?.getBoundingClientRect());
  if (!a?.width || !b?.width) return false;
  return a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top;
}"""


def wait_apart(visitor: Visitor, one: str, other: str) -> None:
    """Waits until two parts of the page are shown and neither lies on the other; by their selectors."""
    wait(visitor, APART, [one, other])
