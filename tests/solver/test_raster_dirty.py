"""An edit inside a stroke rasterises what it can reach, and leaves the bits of a full raster (SPEC S15, S41)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from esker.api.terrain import Stroke as Make
from esker.contract import Stroke, StrokeFields
from esker.document.strokes import world_points
from esker.solve.constraints import packing
from esker.solve.constraints.constraints import BIN, Packer, bins, everything, whole
from esker.solve.constraints.packing import window_of
from esker.solve.opencl.device import Device
from esker.solve.opencl.levels import ClWorkspace
from tests.solver.scenes import SCENES, SETTINGS, flank

LEVEL = 3
FIXED = SCENES["cross"]


def fields(w: ClWorkspace) -> list[NDArray[np.float32]]:
    systems = (w.height, w.gradient)
    return [system.get(name, LEVEL) for system in systems for name in ("d", system.static)]


def count(w: ClWorkspace, strokes: list[Stroke]) -> int:
    """Bins that a workspace would do for these strokes after the last ones, and does."""
    tables, window = w.packer.pack(strokes, SETTINGS)
    if window is None:
        return 0
    w.rasterise(tables, window)
    return int((window.spans[:, 1] - window.spans[:, 0]).sum())


def river(points: NDArray[np.float64]) -> Stroke:
    """A line drawn pen down, of one height, curved in plan: each append keeps the frame, as the points are drawn."""
    return Make.level(points, left=flank(30, 200), right=flank(40, 150), id="drawn")


def drawn(rng: np.random.Generator, n: int, closed: bool = False) -> NDArray[np.float64]:
    turn = np.cumsum(rng.normal(0, 0.3, n))
    steps = np.column_stack([np.cos(turn), np.sin(turn)]) * rng.uniform(10, 60, n)[:, None]
    points = np.array([700.0, 1800.0]) + np.cumsum(steps, axis=0)
    return np.column_stack([points, np.full(n, 60.0)])


def appended(s: Stroke, points: NDArray[np.float64]) -> Stroke:
    """The stroke with more points in the same frame."""
    frame = np.array(s.last[:2]) - np.array(s.first[:2])
    q = points[:, :2] - np.array(s.first[:2])
    length2 = float(frame @ frame)
    more = tuple((float(a @ frame / length2), float(a @ [-frame[1], frame[0]] / length2)) for a in q)
    return s.model_copy(update={"curve": s.curve + more})


@pytest.mark.parametrize("seed", range(4))
def test_random_appends_leave_the_bits_of_a_full_raster(device: Device, seed: int) -> None:
    """SPEC S41: points added, the tail drawn again, a point in the midst moved."""
    rng = np.random.default_rng(seed)
    points = drawn(rng, 60)
    stroke = river(points[:20])
    w, fresh = ClWorkspace(device, LEVEL), ClWorkspace(device, LEVEL)
    w.load([*FIXED, stroke], SETTINGS)
    for at in (24, 31, 32, 50, 60):
        stroke = appended(stroke, points[len(stroke.curve) : at])
        if rng.random() < 0.5:
            curve = list(stroke.curve)
            k = int(rng.integers(len(curve)))
            curve[k] = (curve[k][0] + 0.01, curve[k][1])
            stroke = stroke.model_copy(update={"curve": tuple(curve)})
        assert count(w, [*FIXED, stroke]) > 0
        fresh.packer.forget()
        count(fresh, [*FIXED, stroke])
        for a, b in zip(fields(w), fields(fresh), strict=True):
            assert np.array_equal(a, b)


@pytest.mark.parametrize("seed", range(6))
def test_profiles_on_the_same_line(device: Device, seed: int) -> None:
    """SPEC S41: heights of a part drawn anew, the end drawn on or taken back, in the same vertical plane."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, 80)
    z = 150 + np.cumsum(rng.normal(0, 9, 80))
    stroke = Make.profile([(600, 900, 0), (3300, 2700, 0)], left=flank(35, 900), right=flank(45, 300), id="drawn")
    if seed % 2:
        stroke = stroke.model_copy(update={"plateau_radius_m": 30.0})
    stroke = stroke.model_copy(update={"curve": tuple(zip(u[:50].tolist(), z[:50].tolist(), strict=True))})
    w, fresh = ClWorkspace(device, LEVEL), ClWorkspace(device, LEVEL)
    w.load([*FIXED, stroke], SETTINGS)
    for length in (52, 60, 60, 75, 70, 80, 80):
        heights = [h for _, h in stroke.curve][:length] + z[len(stroke.curve) : length].tolist()
        if rng.random() < 0.6:
            k = int(rng.integers(length - 3))
            heights[k : k + 3] = [h + rng.normal(0, 20) for h in heights[k : k + 3]]
        stroke = stroke.model_copy(update={"curve": tuple(zip(u[:length].tolist(), heights, strict=True))})
        count(w, [*FIXED, stroke])
        fresh.packer.forget()
        count(fresh, [*FIXED, stroke])
        for a, b in zip(fields(w), fields(fresh), strict=True):
            assert np.array_equal(a, b)


def test_one_more_point_costs_little(device: Device) -> None:
    """SPEC S41: of a line across the domain only the bins near its end are done again."""
    points = np.column_stack(
        [np.linspace(300, 3800, 60), 2000 + 300 * np.sin(np.linspace(0, 9, 60)), np.full(60, 50.0)]
    )
    stroke = river(points[:-1])
    w = ClWorkspace(device, LEVEL)
    w.load([stroke], SETTINGS)
    assert 0 < count(w, [appended(stroke, points[-1:])]) < 120
    side = flank(50, 100)
    flat = Make.profile([(300, 300, 0), (3800, 3700, 0)], left=side, right=side, id="p")
    flat = flat.model_copy(update={"curve": tuple((k / 99, 40.0) for k in range(100))})
    bump = flat.model_copy(update={"curve": (*flat.curve[:40], (40 / 99, 50.0), *flat.curve[41:])})
    w.load([], SETTINGS)
    whole = count(w, [flat])
    assert 0 < count(w, [bump]) < whole / 3


@pytest.mark.parametrize("name", ["cross", "fifty", "loops", "bare"])
def test_what_a_crest_reaches_lies_in_its_window(device: Device, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S41: windows leave out bins, at the corners too, of which no bit depends on the crest."""
    strokes = list(SCENES[name])
    w, wide = ClWorkspace(device, LEVEL), ClWorkspace(device, LEVEL)
    count(w, strokes[1:])
    done = count(w, strokes)
    monkeypatch.setattr(packing, "window_of", lambda *at: everything(at[-1]))
    count(wide, strokes[1:])
    assert done < count(wide, strokes)
    for a, b in zip(fields(w), fields(wide), strict=True):
        assert np.array_equal(a, b)


def test_windows_are_round() -> None:
    """A point's window leaves out the corners of the square around what it reaches, and no bin that it touches."""
    at, reach = np.array([[520.0], [520.0]]), 200.0
    window = window_of(at, at, reach, whole(5))
    assert window is not None
    rows, columns = np.meshgrid(np.arange(64) * BIN, np.arange(64) * BIN, indexing="ij")
    near = [np.maximum(np.maximum(v - 520, 520 - (v + BIN - 1)), 0) for v in (rows, columns)]
    touched = np.hypot(*near) <= reach
    spans = {window.first + j: (int(a), int(b)) for j, (a, b) in enumerate(window.spans)}
    for row in range(64):
        inside = np.flatnonzero(touched[row])
        low, high = spans.get(row, (0, 0))
        assert (high > low) == bool(len(inside))
        if len(inside):
            assert (low, high) == (inside[0], inside[-1] + 1)


def test_fields_that_no_table_holds_change_nothing() -> None:
    """A label or a lock is no reason to rasterise; a flank is one for the whole stroke."""
    packer = Packer(LEVEL)
    stroke = SCENES["one"][0]
    packer.pack([stroke], SETTINGS)
    assert packer.pack([stroke.model_copy(update={"label": "Ridge", "locked": True})], SETTINGS)[1] is None
    packer.pack([stroke], SETTINGS)
    wide = stroke.model_copy(update={"left": flank(20, 700)})
    window = packer.pack([wide], SETTINGS)[1]
    assert window is not None
    assert len(window.spans) > bins(513) / 4
    assert len(world_points(stroke)) == len(stroke.curve)
    assert "label" in StrokeFields.model_fields
