"""Amplitude and roughness, diffused (DESIGN 5.4). Rules: tests/spec/solver.md, "The channels"."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import scipy.sparse.linalg as spla

from esker import Stroke as Make
from esker import grid
from esker.contract import (
    AMPLITUDE_QUANTA_PER_M,
    BASE_AMPLITUDE_M,
    BASE_ROUGHNESS,
    ROUGHNESS_QUANTA,
    Channel,
    Stroke,
    TerrainSettings,
)
from esker.events import Level
from esker.solve.assembly import system
from esker.solve.channels import ChannelSolver, channel_level
from esker.solve.constraints import raster_reference
from esker.solve.constraints.channel_targets import Layer
from esker.solve.constraints.constraints import pack
from esker.solve.opencl.device import open_device
from esker.solve.solver import Solver

SETTINGS = TerrainSettings()
LEVEL = 2
ROUGH = Make.profile(
    [(600, 2000, 0), (2000, 2000, 500), (3400, 2000, 0)], left=(35, 400), right=(35, 400), amplitude_m=40,
    roughness=0.9, id="rough",
)  # fmt: skip
SMOOTH = Make.level(
    [(700, 900, 80), (1500, 900, 80), (1500, 400, 80)], left=(35, 300), right=(35, 300), amplitude_m=4,
    roughness=0.1, id="smooth",
)  # fmt: skip


def channels(
    strokes: list[Stroke], settings: TerrainSettings = SETTINGS, device: str | None = None, level: int = LEVEL
) -> dict[Channel, np.ndarray]:
    return dict(ChannelSolver(open_device(device), level).solve(strokes, settings))


def at(values: np.ndarray, x: float, y: float) -> float:
    s = SETTINGS.size_m / (len(values) - 1)
    return float(values[round(y / s), round(x / s)])


def test_no_strokes_leave_the_base() -> None:
    """SPEC S60: exactly, for every channel."""
    got = channels([])
    assert got.keys() == set(Channel) - {Channel.HEIGHT, Channel.BASE, Channel.SURVEY, Channel.FAR}
    for channel, values in got.items():
        assert (values == (BASE_ROUGHNESS if channel == Channel.ROUGHNESS else 0)).all()


def test_a_stroke_has_its_values_and_far_ground_the_base() -> None:
    """SPEC S60."""
    got = channels([ROUGH])
    amplitude, roughness = got[Channel.AMPLITUDE], got[Channel.ROUGHNESS]
    assert at(amplitude, 2000, 2000) == pytest.approx(40, rel=0.02)
    assert at(roughness, 2000, 2000) == pytest.approx(0.9, abs=0.02)
    assert at(amplitude, 2000, 2300) == pytest.approx(40, rel=0.05), "inside the flank"
    assert at(amplitude, 2000, 4000) < 0.2
    assert at(roughness, 2000, 4000) == pytest.approx(BASE_ROUGHNESS, abs=0.01)


def test_values_lie_between_those_of_the_strokes_and_the_base() -> None:
    """SPEC S61: a maximum principle, and monotone decay away from one stroke."""
    got = channels([ROUGH, SMOOTH])
    assert got[Channel.AMPLITUDE].min() >= 0
    assert got[Channel.AMPLITUDE].max() <= 40 + 1 / AMPLITUDE_QUANTA_PER_M
    assert got[Channel.ROUGHNESS].min() >= 0.1 - 1 / ROUGHNESS_QUANTA
    assert got[Channel.ROUGHNESS].max() <= 0.9 + 1 / ROUGHNESS_QUANTA
    alone = channels([ROUGH])[Channel.AMPLITUDE]
    line = [at(alone, 2000, y) for y in range(2700, 4096, 64)]
    assert all(far <= near + 1e-3 for near, far in itertools.pairwise(line))


@pytest.mark.parametrize("reach", [128.0, 1000.0, None])
def test_the_twin_and_a_direct_solve_agree(reach: float | None) -> None:
    """SPEC S2, S62: to a quantum, where float32 and float64 see the same bands."""
    settings = SETTINGS.model_copy(update={"reach_m": reach})
    fast, twin = channels([ROUGH, SMOOTH], settings), channels([ROUGH, SMOOTH], settings, "numpy")
    amplitude = (Channel.AMPLITUDE, BASE_AMPLITUDE_M, 1 / AMPLITUDE_QUANTA_PER_M)
    roughness = (Channel.ROUGHNESS, BASE_ROUGHNESS, 1 / ROUGHNESS_QUANTA)
    for channel, base, quantum in (amplitude, roughness):
        tables = pack([ROUGH, SMOOTH], settings, LEVEL, Layer(channel, painted=False))
        d, f, _ = raster_reference.rasterise_channel(tables)
        a, b = system(d, f, tables.screening)
        exact = spla.spsolve(a.tocsc(), b).reshape(d.shape) + base
        assert np.abs(twin[channel] - exact).max() < quantum / 2
        error = np.abs(fast[channel] - exact)
        assert np.quantile(error, 0.999) < quantum
        assert error.max() < 0.01 * np.ptp(exact), "beyond ties of the rasteriser"


def test_the_order_of_strokes_and_what_came_before_do_not_matter() -> None:
    """SPEC S15: to the bit."""
    fresh = channels([ROUGH, SMOOTH])
    solver = ChannelSolver(open_device(), LEVEL)
    list(solver.solve([SMOOTH], SETTINGS))
    list(solver.solve([ROUGH], SETTINGS.model_copy(update={"reach_m": None})))
    again = dict(solver.solve([SMOOTH, ROUGH], SETTINGS))
    for channel, values in fresh.items():
        assert np.array_equal(values, again[channel])


def test_a_failed_raster_is_not_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    solver = ChannelSolver(open_device(), LEVEL)
    list(solver.solve([ROUGH], SETTINGS))
    with monkeypatch.context() as broken:
        broken.setattr("esker.solve.opencl.raster.rasterise_channel", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            list(solver.solve([ROUGH, SMOOTH], SETTINGS))
    got = dict(solver.solve([ROUGH, SMOOTH], SETTINGS))
    assert np.array_equal(got[Channel.AMPLITUDE], channels([ROUGH, SMOOTH])[Channel.AMPLITUDE])


def test_a_solve_gives_out_its_channels() -> None:
    """SPEC S63: coarse to fine, final, each the injection of the next finer, two levels below the heights."""
    results = [r for r in Solver().steps([ROUGH], SETTINGS, 3) if isinstance(r, Level)]
    for channel in set(Channel) - {Channel.HEIGHT, Channel.BASE, Channel.SURVEY, Channel.FAR}:
        mine = [r for r in results if r.channel == channel]
        assert [r.level for r in mine] == list(range(channel_level(3) + 1))
        assert all(r.settled and not r.heights.flags.writeable for r in mine)
        assert all(r.heights.shape == (grid.samples(r.level),) * 2 for r in mine)
        for coarse, fine in itertools.pairwise(mine):
            assert np.array_equal(coarse.heights, fine.heights[::2, ::2])
    order = [(r.channel, r.level, r.settled) for r in results]
    preview, final = (order.index((Channel.HEIGHT, 3, settled)) for settled in (False, True))
    assert order.index((Channel.SNOW, 0, True)) < preview < order.index((Channel.AMPLITUDE, 0, True)) < final
    finest: Level = results[-1]
    assert finest.channel == Channel.HEIGHT
    assert finest.level == 3
    assert [channel_level(top) for top in (0, 1, 2, 4, 6)] == [0, 0, 0, 2, 4]
