"""Sums of strokes that stay, kept while others change: the bits are those of a full raster (SPEC S442)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from esker.api.terrain import Stroke as Make
from esker.contract import CURRENT_EDITION, Stroke, TerrainSettings
from esker.solve.base import Base
from esker.solve.constraints import kept_sums
from esker.solve.opencl.device import Device
from esker.solve.opencl.levels import ClWorkspace
from tests.solver.adverse import Adversary
from tests.solver.bases import plane
from tests.solver.scenes import SETTINGS, SIZE, flank

LEVEL = 2
NEW = SETTINGS.model_copy(update={"edition": CURRENT_EDITION})


def many(seed: int, count: int = 12) -> list[Stroke]:
    """Strokes of all kinds, a00 and on, which reach nearly everywhere."""
    strokes: list[Stroke] = []
    adversary = Adversary(seed)
    while len(strokes) < count:
        strokes += adversary.scene()[0]
    return [s.model_copy(update={"id": f"a{k:02d}"}) for k, s in enumerate(strokes[:count])]


def drawn(name: str, length: int, seed: int = 0) -> Stroke:
    """A ridge of which so many points are drawn."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0.2, 0.8, 40)
    points = np.column_stack([u * SIZE, (0.3 + 0.4 * u) * SIZE, 200 + 40 * rng.normal(size=40)])
    return Make.profile(points[: max(length, 2)], left=flank(30, 400), right=flank(40, 300), id=name)


def fields(w: ClWorkspace) -> dict[str, Any]:
    return {f"{s}{n}": getattr(w, s).get(n, LEVEL) for s in ("height", "gradient") for n in ("d", getattr(w, s).static)}


def checked(
    w: ClWorkspace, device: Device, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None
) -> None:
    """Loads strokes after those of before, and compares with a workspace that has never had any."""
    fresh = ClWorkspace(device, LEVEL, base is not None)
    for each in (w, fresh):
        each.load(strokes, settings, base)
    got, want = fields(w), fields(fresh)
    for name, value in got.items():
        assert np.array_equal(value, want[name]), name


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["b", "a05-drawn", "Z"])
def test_a_line_that_is_drawn(device: Device, seed: int, name: str) -> None:
    """SPEC S442: with an id after all others, among them, before them; it is drawn, changed, moved, taken away."""
    w, strokes = ClWorkspace(device, LEVEL), many(seed)
    line = [drawn(name, length, seed) for length in (5, 9, 14, 22, 40, 30)]
    moved = line[-1].model_copy(update={"first": (900.0, 700.0, 0.0)})
    for stroke in (*line, moved, moved.model_copy(update={"plateau_radius_m": 90.0})):
        checked(w, device, [*strokes, stroke], NEW)
    checked(w, device, strokes, NEW)
    if name == "b":
        assert w._kept is not None
        assert (w._kept._slots > 0).any(), "it is of use"


@pytest.mark.parametrize("seed", range(2))
def test_people_who_draw_at_once(device: Device, seed: int) -> None:
    """SPEC S442: now this stroke changes and now that, settings, and one that is in the sums."""
    rng = np.random.default_rng(seed)
    w, strokes, settings = ClWorkspace(device, LEVEL), {s.id: s for s in many(seed)}, NEW
    for k in range(24):
        name = str(rng.choice(["b1", "b2", "b9", "a07", "a11"]))
        if k == 12:
            settings = NEW.model_copy(update={"reach_m": 300.0})
        strokes[name] = drawn(name, int(rng.integers(2, 40)), k)
        if k % 5 == 4:
            strokes.pop(str(rng.choice(list(strokes))))
        checked(w, device, list(strokes.values()), settings)


def test_over_a_base_that_changes(device: Device) -> None:
    """SPEC S442: sums of before hold for the base of before."""
    w, strokes = ClWorkspace(device, LEVEL, True), many(5)
    for k, base in enumerate((plane(0.2, -0.1, 500), plane(0.2, -0.1, 500), plane(0.1, 0.1, 100))):
        for length in (4 + k, 8 + k, 20 + k):
            checked(w, device, [*strokes, drawn("b", length)], NEW, base)


def test_more_bins_than_there_is_room_for(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_sums, "MOST_BINS", 5)
    w, strokes = ClWorkspace(device, LEVEL), many(2)
    for length in (5, 9, 14):
        checked(w, device, [*strokes, drawn("b", length)], NEW)
    assert w._kept is not None
    assert (w._kept._slots > 0).sum() == 5


def test_a_raster_that_was_left_keeps_nothing(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S442: sums that were to be made, and were not."""
    monkeypatch.setattr("esker.solve.opencl.device_workspace.RASTER_BINS", 20)
    w, strokes = ClWorkspace(device, LEVEL), many(3)
    checked(w, device, [*strokes, drawn("b", 4)], NEW)
    left = w.loading([*strokes, drawn("b", 30)], NEW)
    next(left)
    left.close()  # type: ignore[attr-defined]
    checked(w, device, [*strokes, drawn("b", 31)], NEW)
    checked(w, device, [*strokes, drawn("b", 12)], NEW)
