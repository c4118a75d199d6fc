"""Real ground on the page: a GeoTIFF is dropped, a stroke crosses it, a grid is laid on it by hand (SPEC U26-U32).

The files are small cuts of surveys of Mount St Helens (tests/e2e/files/make_files.py).
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from esker.api.terrain import Terrain
from esker.contract import DEFAULT_LEVEL, DEFAULT_SIZE_M
from esker.grid import quantum, spacing
from tests.e2e.conftest import Server, Visitor, Visitors, serving
from tests.e2e.hands import (
    COARSE,
    arch,
    draw,
    heights,
    levels,
    on_screen,
    polyline,
    press_and_move,
    wait,
    wait_settled,
    wait_still,
    wait_whole,
)

FILES = Path(__file__).parent / "files"
DROP = """([name, text]) => {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([bytes], name));
  const target = document.querySelector("esk-terrain");
  for (const type of ["dragenter", "dragover", "drop"])
    target.dispatchEvent(new DragEvent(type, { dataTransfer, bubbles: true, cancelable: true, composed: true }));
}"""
TOLERANCE = quantum(DEFAULT_LEVEL, DEFAULT_SIZE_M)
SURVEY_M = 10.0
"""Spacing of the first survey, between those of the two finest levels."""
IMPORTED_S = 240
"""A file is read by another process; in a clean checkout the first one also compiles the loops that lay it."""
CRATER = (1990.0, 1900.0)


def drop(visitor: Visitor, name: str) -> None:
    """Let a file fall on the page."""
    visitor.js(DROP, [name, base64.b64encode((FILES / name).read_bytes()).decode()])


def handle(visitor: Visitor, kind: str) -> tuple[float, float]:
    """Window pixel of a handle of the grid in hand."""
    (found,) = visitor.js("k => window.esker.handles().filter((h) => h.kind === k)", kind)
    return float(found["x"]), float(found["y"])


def drag(visitor: Visitor, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag with the real pointer."""
    press_and_move(visitor.page, polyline([start, end], 12))
    visitor.page.mouse.up()


def knob(visitor: Visitor, rotation_deg: float) -> tuple[float, float]:
    """Where on the map the turning knob of the grid in hand would be at another rotation (it lies unturned)."""
    laid = visitor.js("() => window.esker.placing()")
    half = 47.5 * np.array(laid["spacing_m"])
    reach = half[1] + 0.09 * 2 * float(np.hypot(*half))
    turn = math.radians(rotation_deg)
    x, y = np.array(laid["anchor"]) + half + reach * np.array([-math.sin(turn), math.cos(turn)])
    return float(x), float(y)


def layers(visitor: Visitor) -> list[dict[str, Any]]:
    """Layers as the page holds them, the most believed first."""
    found: list[dict[str, Any]] = visitor.js("() => window.esker.layers()")
    return found


def twin(server: Server, terrain: str, secret: str, path: Path) -> Terrain:
    """The terrain as Python makes it, from the archive with its grids."""
    path.write_bytes(server.request("GET", f"/api/terrains/{terrain}/archive", secret=secret))
    return Terrain.load(path)


def apart(visitor: Visitor, made: Terrain) -> float:
    """Greatest difference of the page's ground to Python's, metres, where the page holds the finest solved level."""
    whole = made.heights(DEFAULT_LEVEL)[::32, ::32]
    wait_whole(visitor, level=DEFAULT_LEVEL)
    held = np.array(levels(visitor, COARSE)) == DEFAULT_LEVEL
    assert held.mean() > 0.3
    return float(np.abs(np.array(heights(visitor, COARSE)) - whole.ravel())[held].max())


def off_the_data(visitor: Visitor, made: Terrain) -> float:
    """Greatest difference of the page's ground to ``Terrain.sample``, in quanta of the level that the page holds there.

    Tiles coarser than the survey show it within a quarter of their spacing, finer ones as it is (docs/patchwork.md).
    """
    worst = 0.0
    shown, at = np.array(heights(visitor, COARSE)), np.array(levels(visitor, COARSE))
    for level in np.unique(at):
        step = spacing(int(level), DEFAULT_SIZE_M)
        here = at == level
        wanted = made.sample(np.array(COARSE)[here], tolerance=step / 4 if step > SURVEY_M else 0.0)
        worst = max(worst, float(np.abs(shown[here] - np.asarray(wanted)).max()) / quantum(int(level), DEFAULT_SIZE_M))
    return worst


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """A server that solves all that the product's does: 10 m of a survey lie between its levels."""
    yield from serving(tmp_path, DEFAULT_LEVEL)


def test_real_ground_is_dropped_sketched_on_and_refined_by_a_turned_grid(
    visitors: Visitors, server: Server, tmp_path: Path
) -> None:
    terrain, secret = server.create(title="Helens")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "Ben"}, secret))
    ada, ben = visitors(960, 640), visitors(480, 400, on_map=True)
    ada.open(f"/t/{terrain}#{secret}")
    ben.open(f"/t/{terrain}#{link['secret']}")

    # Ada lets a GeoTIFF fall on the page; Ben watches it come and sees the mountain.
    drop(ada, "helens.tif")
    for visitor in (ada, ben):
        wait(visitor, "() => window.esker.layers().length === 1", timeout=IMPORTED_S)
    wait_settled(ada, ben)
    (valley,) = layers(ben)
    assert valley["facts"]["geo"]
    assert abs(valley["spacing_m"][0] - 10) < 0.05
    assert max(heights(ben, COARSE)) > 2400
    made = twin(server, terrain, secret, tmp_path / "one.esker")
    assert apart(ben, made) <= TOLERANCE
    assert off_the_data(ben, made) <= 1.0
    assert off_the_data(ada, made) <= 1.0
    assert ada.js("() => window.esker.seams()") == 0.0 == ben.js("() => window.esker.seams()")
    ada.shot("elevation-1-dropped")
    ben.shot("elevation-2-seen-by-another")

    # A stroke across real ground, with the pointer: it stands on it and the rest keeps its detail.
    before = heights(ben, COARSE)
    draw(ada, "b", arch(on_screen(ada, 1250, 1250), on_screen(ada, 2500, 1200), 26))
    wait_settled(ada, ben)
    (stroke,) = ada.js("() => window.esker.strokes()")
    assert stroke["first"][2] > 1500
    wait_whole(ben, level=DEFAULT_LEVEL)
    after = heights(ben, COARSE)
    assert max(np.subtract(after, before)) > 20
    made = twin(server, terrain, secret, tmp_path / "two.esker")
    assert apart(ben, made) <= TOLERANCE
    ada.shot("elevation-3-stroke-across")

    # A finer survey without any place: laid by hand, moved, turned by its knob, made smaller by a corner.
    drop(ada, "dome.npy")
    wait(ada, "() => window.esker.placing() !== null")
    wait_still(ada)
    ada.shot("elevation-3b-in-hand")
    assert layers(ben) == [valley]
    (x0, y0), (x1, y1) = handle(ada, "grid-0"), handle(ada, "grid-2")
    drag(ada, (x1, y1), (x0 + 0.2 * (x1 - x0), y0 + 0.2 * (y1 - y0)))
    drag(ada, handle(ada, "grid-move"), on_screen(ada, *CRATER))
    drag(ada, handle(ada, "grid-turn"), on_screen(ada, *knob(ada, 27.0)))
    laid = ada.js("() => window.esker.placing()")
    assert 10 < laid["rotation_deg"] < 45
    assert laid["spacing_m"][0] < SURVEY_M
    ada.page.wait_for_timeout(600)
    ada.shot("elevation-4-laid-by-hand")
    ada.page.keyboard.press("Enter")
    for visitor in (ada, ben):
        wait(visitor, "() => window.esker.layers().length === 2", timeout=IMPORTED_S)
    wait_settled(ada, ben)
    dome = layers(ben)[0]
    assert dome["facts"]["rows"] == 96
    assert math.isclose(dome["rotation_deg"], laid["rotation_deg"], abs_tol=1e-6)
    assert np.allclose(dome["anchor"], laid["anchor"])
    assert np.allclose(dome["spacing_m"], laid["spacing_m"])
    made = twin(server, terrain, secret, tmp_path / "three.esker")
    assert apart(ben, made) <= TOLERANCE
    assert ada.js("() => window.esker.seams()") == 0.0 == ben.js("() => window.esker.seams()")
    ada.page.wait_for_timeout(1000)
    ada.shot("elevation-5-finer-grid")
    ben.shot("elevation-6-seen-by-another")

    # Undone by its author it is gone for everybody; what was there before is back, bit for bit.
    ada.page.keyboard.press("Control+z")
    wait(ben, "() => window.esker.layers().length === 1")
    wait_settled(ada, ben)
    wait_whole(ben, level=DEFAULT_LEVEL)
    assert heights(ben, COARSE) == after
    for visitor in (ada, ben):
        assert visitor.errors == []
        assert visitor.foreign == []
