"""Distances from what strokes fix: what they are, and when they are made (SPEC F207 to F209)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import Stroke
from esker import contract as c
from esker.contract import BASE_FAR, Channel, SetTerrain, TerrainFields, TerrainSettings
from esker.contract.fractal import FAR_SHARE
from esker.document.birth import new_document
from esker.document.ops import StrokeSet
from esker.events import ChannelLevel
from esker.solve import far as far_module
from esker.solve.constraints.constraints import driven
from esker.solve.far import FarField, is_eroded, nowhere
from esker.solve.solver import Solver

SIZE = 4096.0
LEVEL = 2
SETTINGS = TerrainSettings(erosion=1.0)
CELL = SIZE / 256
RIDGE: c.Stroke = Stroke.profile([(1000, 1500, 0), (2000, 2100, 400), (3000, 2700, 0)], left=(35, 400), right=(35, 400))
OUTLINE = [(900, 900, 80), (1500, 900, 80), (1500, 400, 80), (900, 400, 80), (900, 880, 80)]
MESA: c.Stroke = Stroke.level(OUTLINE, left=(35, 300), right=(35, 300), plateau_radius_m=20.0)
BRUSH: c.Stroke = Stroke.paint([(500, 500), (900, 700)], "erosion", 0.7, radius_m=80)


def far(strokes: Sequence[c.Stroke], settings: TerrainSettings = SETTINGS) -> NDArray[np.float32]:
    """The finest level of a field that was never used before."""
    return driven(FarField(LEVEL).making(strokes, settings))[-1]


def at(values: NDArray[np.float32], x: float, y: float) -> float:
    """Metres at the sample nearest to a place."""
    return float(values[round(y / CELL), round(x / CELL)]) * FAR_SHARE * SIZE


def test_far_is_the_distance_from_lines_plateaux_and_the_inside_of_outlines() -> None:
    """SPEC F207: to a centimetre, up to a sixteenth of the domain."""
    found = far([RIDGE, MESA])
    # the ridge runs from (1000, 1500) to (3000, 2700)
    length = math.hypot(2000, 1200)
    for x, y in ((2000, 2096), (1600, 2000), (2400, 2240), (2800, 2400)):
        off = abs((x - 1000) * 1200 - (y - 1504 + 4) * 2000) / length
        assert at(found, x, y) == pytest.approx(min(off, SIZE / 16), abs=0.02)
    assert at(found, 800, 1504) == pytest.approx(math.hypot(200, 4), abs=0.02), "beyond its end"
    assert at(found, 1200, 640) == 0, "inside of the outline"
    assert at(found, 1600, 640) == pytest.approx(100 - 20, abs=0.02), "outside, from the plateau's edge"
    assert at(found, 3600, 800) == SIZE / 16
    assert found.min() == 0
    assert found.max() == BASE_FAR


def test_far_depends_on_the_strokes_alone_and_what_is_the_same_is_the_same_array() -> None:
    """SPEC F208: not on order, edits or other terrains between; hidden strokes and paint fix nothing."""
    fresh = far([RIDGE, MESA])
    assert np.array_equal(far([MESA, RIDGE, BRUSH, RIDGE.model_copy(update={"id": "h", "hidden": True})]), fresh)
    field = FarField(LEVEL)
    driven(field.making([MESA], SETTINGS))
    begun = field.making([RIDGE, MESA], SETTINGS)
    driven(field.making([RIDGE], SETTINGS.model_copy(update={"size_m": 2048.0})))
    first = driven(begun)
    assert np.array_equal(first[-1], fresh)
    assert [len(z) for z in first] == [65, 129, 257]
    assert np.array_equal(first[0], first[-1][::4, ::4])
    assert driven(field.making([RIDGE, MESA], SETTINGS)) is first
    moved = MESA.model_copy(update={"first": (1000.0, 900.0, 80.0)})
    assert np.array_equal(driven(field.making([RIDGE, moved], SETTINGS))[-1], far([moved, RIDGE]))
    assert field.is_quick([RIDGE, moved], SETTINGS)
    many = [RIDGE.model_copy(update={"id": f"r{k}"}) for k in range(far_module.QUICK + 1)]
    assert not field.is_quick(many, SETTINGS)


def test_far_is_made_where_there_are_gullies_and_only_there() -> None:
    """SPEC F209: by settings or by paint of more; without any it is its base, which is not sent."""
    off = SETTINGS.model_copy(update={"erosion": 0.0})
    assert driven(FarField(LEVEL).making([RIDGE], off)) is nowhere(LEVEL)
    assert is_eroded([BRUSH], off)
    assert not is_eroded([BRUSH.model_copy(update={"hidden": True})], off)
    less = BRUSH.model_copy(update={"paint": BRUSH.paint.model_copy(update={"value": -1.0}) if BRUSH.paint else None})
    assert not is_eroded([less, RIDGE], off)
    assert new_document().settings.erosion > 0
    assert TerrainSettings().erosion == 0
    one = StrokeSet.from_document(new_document())
    other, dirty = one.apply(SetTerrain(fields=TerrainFields(erosion=0.0)))
    assert dirty is None
    assert other.heights_rev == one.heights_rev
    assert other.channels_rev != one.channels_rev


@pytest.mark.parametrize("strokes", [[], [RIDGE], [RIDGE, BRUSH]])
def test_a_solve_gives_out_far_once_with_every_channel(strokes: list[c.Stroke]) -> None:
    """SPEC F207: levels coarse to fine, final, and the channels alone give the same."""
    solver = Solver("numpy", 3)
    for events in (solver.steps(strokes, SETTINGS), solver.channels(strokes, SETTINGS)):
        found = [e for e in events if isinstance(e, ChannelLevel) and e.channel == Channel.FAR]
        assert [e.level for e in found] == [0, 1]
        assert np.array_equal(found[-1].heights, driven(FarField(1).making(strokes, SETTINGS))[-1])
