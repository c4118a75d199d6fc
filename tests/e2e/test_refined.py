"""Near the ground: refined levels, what strokes ask of the detail, settings of the solver (SPEC E8..E11)."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import Stroke, connect
from esker.api.terrain import Terrain, default_solver
from esker.events import Done
from esker.grid import quantum, samples, spacing
from esker.solve.refine.refinement import Refiner
from tests.e2e.conftest import LEVEL, SCALE, Server, Visitor, Visitors
from tests.e2e.hands import arch, draw, heights, levels, on_screen, wait, wait_settled, wait_still, wait_whole

SIZE = 4096.0
SOLVED = LEVEL
Point = tuple[float, float]


CREST: Point = (1600.0, 2350.0)
RISE = 420.0
NEAR = {"mode": "orbit", "eye": [1585.0, 2322.0, RISE + 8], "target": [1603.0, 2354.0, RISE - 3]}


def two_people(
    visitors: Visitors, server: Server, watched_on_map: bool = False, on_a_ridge: bool = False, **options: Any
) -> tuple[Visitor, Visitor, str, str]:
    """Ada owns the terrain, Ben has an edit link; both see it, Ben on the map where he only watches.

    ``on_a_ridge``: a program has drawn a mountain, and both remember a view of its crest.
    """
    terrain, secret = server.create(title="Near the ground")
    if on_a_ridge:
        along = [(900 + 1400 * t, 2200 + 300 * t, RISE * math.sin(math.pi * t)) for t in np.linspace(0, 1, 25)]
        with connect(f"{server.url}/t/{terrain}#{secret}", "Cleo") as program:
            program.add(Stroke.profile(along))
            program.wait()
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "Ben"}, secret))
    ada = visitors(**options)
    scale = options.get("device_scale_factor", SCALE)
    ben = visitors(480, 360, device_scale_factor=scale, seen=False, on_map=watched_on_map)
    if on_a_ridge:
        view = json.dumps(json.dumps({"1": NEAR}))
        for person in (ada, ben):
            person.context.add_init_script(f"localStorage.setItem('esker.views.{terrain}', {view})")
    ada.open(f"/t/{terrain}#{secret}")
    ben.open(f"/t/{terrain}#{link['secret']}")
    return ada, ben, terrain, secret


def stand(visitor: Visitor) -> None:
    """Go to the remembered view."""
    visitor.page.keyboard.press("Alt+1")
    wait(visitor, "e => Math.hypot(...window.esker.camera().eye.map((v, i) => v - e[i])) < 0.5", NEAR["eye"])


def crest_of(stroke: dict[str, Any]) -> tuple[float, float, float]:
    """The highest point of a profile stroke in the world."""
    u, rise = max(stroke["curve"], key=lambda p: p[1])
    x, y, z = (a + u * (b - a) for a, b in zip(stroke["first"], stroke["last"], strict=True))
    return x, y, z + rise


def wait_refined(visitor: Visitor, at: Point, level: int) -> None:
    """Until the place is held at a level, nothing is refined any more, and no tile has come for a while."""
    wait(visitor, "([x, y, l]) => window.esker.levelAt(x, y) >= l", [*at, level], timeout=90)
    held = -1
    while held != (held := visitor.js("() => window.esker.tiles().held")):
        wait(visitor, "() => window.esker.settled() && window.esker.refining() === 0", timeout=90)
        visitor.page.wait_for_timeout(700)


def around(at: Point, reach: float, count: int = 9) -> list[Point]:
    """A grid of places on the lattice of level 8 about one."""
    step = spacing(8, SIZE)
    ticks = np.linspace(-reach, reach, count)
    return [(round((at[0] + dx) / step) * step, round((at[1] + dy) / step) * step) for dx in ticks for dy in ticks]


class Truth:
    """Heights of any level of the terrain as it is on the server now, solved and refined here."""

    def __init__(self, server: Server, terrain: str, secret: str, folder: Path) -> None:
        archive = folder / "now.esker"
        archive.write_bytes(server.request("GET", f"/api/terrains/{terrain}/archive", secret=secret))
        loaded = Terrain.load(archive)
        solver = default_solver()
        *_, last = solver.steps(loaded.strokes, loaded.settings, SOLVED, basis=True)
        assert isinstance(last, Done)
        self.refiner: Refiner = solver.refiner(last.basis)

    def window(self, level: int, rows: slice, cols: slice) -> NDArray[np.float32]:
        return self.refiner.window(level, rows, cols)


def check(visitor: Visitor, places: list[Point], truth: Truth) -> dict[int, int]:
    """The page's heights are those of the truth within a quantum of the level held; how many places at each level."""
    seen: dict[int, int] = {}
    held = levels(visitor, places)
    for level in sorted(set(held)):
        s = spacing(level, SIZE)
        # Samples of the level itself, so that nothing is interpolated.
        snapped = [(round(x / s) * s, round(y / s) * s) for (x, y), at in zip(places, held, strict=True) if at == level]
        snapped = [p for p, at in zip(snapped, levels(visitor, snapped), strict=True) if at == level]
        index = np.array([(round(y / s), round(x / s)) for x, y in snapped]).reshape(-1, 2)
        if not index.size:
            continue
        (r0, c0), (r1, c1) = index.min(axis=0), np.minimum(index.max(axis=0) + 1, samples(level))
        window = truth.window(level, slice(int(r0), int(r1)), slice(int(c0), int(c1)))
        shown = np.array(heights(visitor, snapped))
        off = np.abs(shown - window[index[:, 0] - r0, index[:, 1] - c0])
        assert off.max() <= quantum(level, SIZE) + 1e-3, f"level {level}: {off.max()} m"
        seen[level] = len(snapped)
    return seen


def test_a_crest_sharpens_as_one_comes_near(visitors: Visitors, server: Server, tmp_path: Path) -> None:
    """E8: finer levels come where somebody stands, are right, and are right again after the ground has changed."""
    ada, ben, terrain, secret = two_people(
        visitors, server, on_a_ridge=True, width=480, height=360, device_scale_factor=0.5
    )
    wait_settled(ada, ben)
    x, y, z = (*CREST, RISE)
    assert 0 <= max(levels(ada, around((x, y), 20))) <= SOLVED
    for person in (ada, ben):
        stand(person)
    for person in (ada, ben):
        wait_refined(person, (x, y), 7)
    ada.shot("refined-1-crest")
    places = around((x, y), 12)
    before = heights(ada, places)
    seen = check(ada, places, Truth(server, terrain, secret, tmp_path))
    assert max(seen) > 6
    assert sum(seen.values()) > len(places) // 2
    assert levels(ada, places) == levels(ben, places)
    assert before == heights(ben, places)
    counts = ada.js("() => window.esker.tiles().levels")
    assert sum(counts[SOLVED + 1 :]) <= 512, "sparse: only what is near"

    # Ben steps back and draws across: what Ada stands on follows, and is put right.
    ben.page.keyboard.press("Home")
    wait(ben, "p => Math.hypot(...window.esker.camera().eye.map((v, k) => v - p[k])) > 800", [x, y, z])
    wait_still(ben)
    draw(ben, "b", arch(on_screen(ben, x - 300, y - 200), on_screen(ben, x + 300, y + 100), 60))
    wait(ada, "n => window.esker.strokes().length === n", 2)
    wait_refined(ada, (x, y), 7)
    after = heights(ada, places)
    assert np.abs(np.subtract(after, before)).max() > 0.1  # the new stroke passes by, below the summit
    check(ada, places, Truth(server, terrain, secret, tmp_path))
    ada.shot("refined-2-crossed")
    assert not ada.errors
    assert not ben.errors


def test_reach_and_border_move_everybodys_ground(visitors: Visitors, server: Server) -> None:
    """E9: both settings by pointer and by keyboard, seen on the other page, taken back by undo."""
    ada, ben, _, _ = two_people(visitors, server, watched_on_map=True, width=640, height=480)
    draw(ada, "b", arch(on_screen(ada, 1500, 350), on_screen(ada, 2700, 300), 90))
    wait_settled(ada, ben)
    # On the border below the ridge, and well beyond the ridge's flanks.
    edge, beyond = (2112.0, 0.0), (2112.0, 2304.0)
    wait_whole(ben, points=[edge, beyond])
    free = heights(ben, [edge, beyond])
    assert free[0] > 5
    ada.page.keyboard.press("v")
    ada.page.keyboard.press("i")
    ada.page.get_by_role("radio", name="Terrain").click()
    ada.page.get_by_role("radio", name="Pinned").click()
    wait(ben, "([x, y]) => Math.abs(window.esker.heightAt(x, y)) < 0.1 && window.esker.settled()", list(edge))
    slider = ada.page.get_by_role("slider", name="Distance")
    slider.focus()
    ada.page.keyboard.press("End")
    wait(ben, "([x, y, h]) => window.esker.heightAt(x, y) > h + 0.4 && window.esker.settled()", [*beyond, free[1]])
    ada.shot("settings-terrain")
    ada.page.locator(".viewport").focus()
    for _ in range(4):
        if ada.js("() => window.esker.pending()") == 0:
            ada.page.keyboard.press("Control+z")
        wait(ada, "() => window.esker.pending() === 0")
        if ada.page.get_by_role("radio", name="Free").get_attribute("aria-checked") == "true":
            break
    wait_settled(ada, ben)
    wait_whole(ben, points=[edge, beyond])
    again = heights(ben, [edge, beyond])
    assert np.abs(np.subtract(again, free)).max() <= 2 * quantum(SOLVED, SIZE)
    assert not ada.errors
    assert not ben.errors


def test_amplitude_and_roughness_reach_the_other_page(visitors: Visitors, server: Server) -> None:
    """E10: set in the inspector, solved, streamed as channels, undone."""
    ada, ben, _, _ = two_people(visitors, server, watched_on_map=True, width=640, height=480)
    mountain = draw(ada, "b", arch(on_screen(ada, 900, 2200), on_screen(ada, 2300, 2500), 110))
    wait_settled(ada, ben)
    x, y, z = crest_of({s["id"]: s for s in ada.js("() => window.esker.strokes()")}[mountain])
    assert ben.js("([x, y]) => window.esker.amplitudeAt(x, y)", [x, y]) == 0
    ada.page.keyboard.press("v")
    ada.page.mouse.click(*on_screen(ada, x, y, z))
    wait(ada, "id => window.esker.selection() === id", mountain)
    ada.page.keyboard.press("i")
    for name, value in (("Amplitude, in metres", "40"), ("Roughness, in per cent", "90")):
        field = ada.page.get_by_role("spinbutton", name=name)
        field.fill(value)
        field.press("Tab")
    there = "([x, y]) => [window.esker.amplitudeAt(x, y), window.esker.roughnessAt(x, y)]"
    wait(ben, "([x, y]) => window.esker.amplitudeAt(x, y) > 30 && window.esker.roughnessAt(x, y) > 0.8", [x, y])
    amplitude, roughness = ben.js(there, [x, y])
    assert amplitude <= 40.1
    assert roughness <= 0.901
    far = ben.js(there, [3900, 200])
    assert far[0] < 4
    assert abs(far[1] - 0.5) < 0.1
    for _ in range(3):
        ada.page.keyboard.press("x")
    ada.page.wait_for_timeout(1500)
    ada.shot("detail-overlay")
    ada.page.locator(".viewport").focus()
    ada.page.keyboard.press("Control+z")
    ada.page.keyboard.press("Control+z")
    wait(ben, "([x, y]) => window.esker.amplitudeAt(x, y) < 0.1", [x, y])
    assert not ada.errors
    assert not ben.errors


def test_settings_fit_the_smallest_window(visitors: Visitors, server: Server) -> None:
    """E11: at 320 x 480 by touch every control of the terrain panel can be reached, and nothing scrolls sideways."""
    terrain, secret = server.create(title="Small")
    eve = visitors(width=320, height=480, has_touch=True, is_mobile=True, on_map=True)
    eve.open(f"/t/{terrain}#{secret}")
    eve.page.get_by_role("button", name="Inspector").first.tap()
    eve.page.get_by_role("radio", name="Terrain").tap()
    for name in ("Pinned", "Free"):
        eve.page.get_by_role("radio", name=name).scroll_into_view_if_needed()
        eve.page.get_by_role("radio", name=name).tap()
        wait(eve, "() => window.esker.pending() === 0")
    slider = eve.page.get_by_role("slider", name="Distance")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    assert box is not None
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= 320
    assert eve.js("() => document.scrollingElement.scrollWidth") <= 320
    eve.shot("settings-small")
    assert not eve.errors
