"""Paint on the channels (DESIGN 5.4, 10). Rules: tests/spec/solver.md, "Paint"."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from esker import Stroke as Make
from esker import Terrain
from esker import contract as c
from esker.contract import AMPLITUDE_QUANTA_PER_M, BIAS_QUANTA, Channel, Stroke, TerrainSettings
from esker.contract.fractal import ALPHA, PAINT_LESS, PAINT_MORE
from esker.events import Level
from esker.solve.assembly import system
from esker.solve.channels import ChannelSolver, at_base
from esker.solve.constraints import raster_reference
from esker.solve.constraints.channel_targets import PAINTED, Layer, contributors
from esker.solve.constraints.constraints import Packer, WindowPacker, pack
from esker.solve.opencl.device import Device, open_device
from esker.solve.solver import Solver
from tests.solver.twins import tile_device

SETTINGS = TerrainSettings()
LEVEL = 2
SIZE = SETTINGS.size_m
NATURAL_M = ALPHA * SIZE / 64
LINE = [(1000, 1500), (2000, 1500), (3000, 1500)]
MOUNTAIN = Make.profile(
    [(600, 1500, 0), (2000, 1500, 500), (3400, 1500, 0)], amplitude_m=40, roughness=0.9, id="mountain"
)

Values = NDArray[np.float32]


def paint(channel: c.PaintChannel, value: float, radius_m: float = 200, *, line: object = LINE) -> Stroke:
    return Make.paint(line, channel, value, radius_m, id=f"{channel}{100 * value:.0f}")  # type: ignore[arg-type]


def solved(
    strokes: Sequence[Stroke], settings: TerrainSettings = SETTINGS, device: str | None = None
) -> dict[Channel, Values]:
    return dict(ChannelSolver(open_device(device), LEVEL).solve(strokes, settings))


def at(values: Values, x: float, y: float) -> float:
    s = SIZE / (len(values) - 1)
    return float(values[round(y / s), round(x / s)])


@pytest.mark.parametrize("device", [None, "numpy"])
@pytest.mark.parametrize(
    ("channel", "value", "on_line"),
    [
        ("snow", 1.0, 1.0),
        ("grass", -1.0, -1.0),
        ("forest", 0.5, 0.5),
        ("wetness", -0.25, -0.25),
        ("roughness", 1.0, 1.0),
        ("roughness", -1.0, 0.0),
        ("amplitude", 0.5, 0.5 * PAINT_MORE * NATURAL_M),
        ("amplitude", -1.0, -PAINT_LESS * NATURAL_M),
    ],
)
def test_a_brush_paints_its_ring(channel: c.PaintChannel, value: float, on_line: float, device: str | None) -> None:
    """SPEC S64: what was asked on the line, fading to the base at the radius, and nothing well outside."""
    got = solved([paint(channel, value)], device=device)
    mine, base = got.pop(PAINTED[channel]), 0.5 if channel == "roughness" else 0.0
    scale = abs(on_line - base)
    across = [at(mine, 2000, 1500 + d) for d in range(0, 400, 16)]
    assert abs(across[0] - on_line) < 0.02 * scale
    shares = [(v - base) / (on_line - base) for v in across]
    assert all(b <= a + 1e-3 for a, b in itertools.pairwise(shares))
    assert shares[100 // 16] > 0.7
    assert 0.02 < shares[200 // 16] < 0.4
    assert max(shares[280 // 16 :]) < 0.01
    for other, values in got.items():
        assert values is at_base(other, LEVEL)[-1], "an untouched channel is nobody's work"


@pytest.mark.parametrize("reach", [64.0, 128.0, None])
def test_the_twin_and_a_direct_solve_agree(reach: float | None) -> None:
    """SPEC S2, S65: to a quantum; and endless diffusion does not carry paint over the terrain."""
    settings = SETTINGS.model_copy(update={"reach_m": reach})
    strokes = [paint("snow", 1.0), paint("snow", -0.6, 90, line=[(1800, 1000), (2100, 2100)]), MOUNTAIN]
    fast, twin = (solved(strokes, settings, device)[Channel.SNOW] for device in (None, "numpy"))
    tables = pack(strokes, settings.model_copy(update={"reach_m": 16.0}), LEVEL, Layer(Channel.SNOW, painted=True))
    d, f, _ = raster_reference.rasterise_channel(tables)
    a, b = system(d, f, tables.screening)
    exact = spla.spsolve(a.tocsc(), b).reshape(d.shape)
    assert np.abs(twin - exact).max() < 0.5 / BIAS_QUANTA
    assert np.quantile(np.abs(fast - exact), 0.999) < 1 / BIAS_QUANTA
    assert np.abs(fast[-20:]).max() < 1e-6


def test_paint_lies_over_what_strokes_say() -> None:
    """SPEC S66: it takes the mountain's amplitude away under the brush, and leaves it as it is elsewhere."""
    dab, taken = paint("amplitude", -1.0, 150, line=[(2000, 1400), (2000, 1600)]), PAINT_LESS * NATURAL_M
    alone, both = solved([MOUNTAIN]), solved([MOUNTAIN, dab])
    assert at(alone[Channel.AMPLITUDE], 2000, 1500) == pytest.approx(40, rel=0.02)
    assert at(both[Channel.AMPLITUDE], 2000, 1500) == pytest.approx(-taken, abs=0.02 * (40 + taken))
    far = np.abs(both[Channel.AMPLITUDE] - alone[Channel.AMPLITUDE])[:, :70]
    assert far.max() < 1e-4
    assert np.array_equal(both[Channel.ROUGHNESS], alone[Channel.ROUGHNESS])


@pytest.fixture(scope="module", params=["rows", "tiles"])
def kernels(request: pytest.FixtureRequest, device: Device) -> Device:
    """Both kinds of kernels: by rows and by tiles."""
    found = device if request.param == "rows" else tile_device("full")
    assert found is not None, "the row-wise device is there"
    return found


def test_both_kinds_of_kernels_are_the_twin(kernels: Device) -> None:
    """SPEC S2, S65: values with their cover, and values alone."""
    strokes = [MOUNTAIN, paint("amplitude", 0.6), paint("snow", -1.0, 70), paint("snow", 0.5, line=[(2000, 1300)])]
    found, twin = (dict(ChannelSolver(d, LEVEL).solve(strokes, SETTINGS)) for d in (kernels, None))
    for channel, quantum in ((Channel.SNOW, 1 / BIAS_QUANTA), (Channel.AMPLITUDE, 1 / AMPLITUDE_QUANTA_PER_M)):
        error = np.abs(found[channel] - twin[channel])
        assert np.quantile(error, 0.999) < quantum
        assert error.max() < 0.02 * np.ptp(twin[channel])


def test_overlaps_do_not_depend_on_order_or_history(kernels: Device) -> None:
    """SPEC S15, S66: to the bit; opposite paint on one place comes to nothing."""
    more, less = paint("snow", 1.0), paint("snow", -1.0, 120)
    solver = ChannelSolver(kernels, LEVEL)
    fresh = dict(solver.solve([more, less], SETTINGS))[Channel.SNOW]
    dict(solver.solve([less], SETTINGS))
    dict(solver.solve([], SETTINGS))
    again = dict(solver.solve([less, more, MOUNTAIN], SETTINGS))[Channel.SNOW]
    assert np.array_equal(fresh, again)
    assert abs(at(fresh, 2000, 1500)) < 0.02
    assert at(fresh, 2000, 1500 + 112) > 0.3


def test_a_line_that_grows_is_the_line_drawn_at_once(kernels: Device) -> None:
    """SPEC S15, S41: windows of what changed, point by point, to the bit."""
    points = [(600 + 140 * k, 900 + 300 * np.sin(k / 3)) for k in range(20)]
    solver, whole = ChannelSolver(kernels, LEVEL), paint("forest", 0.8, 60, line=points)
    for count in range(1, 21):
        part = whole.model_copy(update={"curve": whole.curve[:count]})
        grown = dict(solver.solve([part, MOUNTAIN], SETTINGS))[Channel.FOREST]
    at_once = dict(ChannelSolver(kernels, LEVEL).solve([whole], SETTINGS))[Channel.FOREST]
    assert np.array_equal(grown, at_once)


def test_paint_without_effect_costs_nothing() -> None:
    """SPEC S67: hidden, empty, of value 0, or no point at all."""
    snow = paint("snow", 1.0)
    for stroke in (
        snow.model_copy(update={"hidden": True}),
        snow.model_copy(update={"curve": ()}),
        paint("snow", 0.0),
    ):
        got = solved([stroke, MOUNTAIN])
        assert got[Channel.SNOW] is at_base(Channel.SNOW, LEVEL)[-1]
        assert got[Channel.WETNESS] is at_base(Channel.WETNESS, LEVEL)[-1]


def test_what_did_not_change_is_the_same_array() -> None:
    """SPEC S67: so nobody quantises, compares or sends it again."""
    solver = ChannelSolver(open_device(), LEVEL)
    snow, wet = paint("snow", 1.0), paint("wetness", 1.0)
    first = dict(solver.pyramids(contributors([snow, wet, MOUNTAIN], SETTINGS), SETTINGS))
    moved = MOUNTAIN.model_copy(update={"amplitude_m": 3.0})
    second = dict(solver.pyramids(contributors([snow.model_copy(update={"label": "x"}), moved], SETTINGS), SETTINGS))
    same = {channel for channel in first if all(a is b for a, b in zip(first[channel], second[channel], strict=True))}
    assert same == set(first) - {Channel.AMPLITUDE, Channel.WETNESS}


@pytest.mark.parametrize("border", ["free", "pinned"])
def test_heights_know_nothing_of_paint(border: c.Border) -> None:
    """SPEC S68: not a bit, nor a bin, nor a refined window's digest."""
    settings = SETTINGS.model_copy(update={"border": border})
    strokes = [MOUNTAIN, *(paint(channel, 1.0) for channel in PAINTED)]
    solver = Solver()
    bare, painted = (solver.solve(s, settings, 2) for s in ([MOUNTAIN], strokes))
    assert all(np.array_equal(a, b) for a, b in zip(bare.levels, painted.levels, strict=True))
    packer = Packer(2)
    packer.pack([MOUNTAIN], settings)
    assert packer.pack(strokes, settings)[1] is None
    assert packer.pack([MOUNTAIN.model_copy(update={"amplitude_m": 1.0, "roughness": 0.1})], settings)[1] is None
    assert WindowPacker(strokes, settings).reaching(5, (0, 129, 0, 129)) == [MOUNTAIN]


def test_channels_alone_are_those_of_a_solve() -> None:
    """SPEC S63."""
    strokes = [MOUNTAIN, paint("snow", 1.0), paint("amplitude", 0.3)]
    solver = Solver()
    whole = [r for r in solver.steps(strokes, SETTINGS, 3) if isinstance(r, Level) and r.channel != Channel.HEIGHT]
    alone = [r for r in Solver().channels(strokes, SETTINGS, 3) if isinstance(r, Level)]
    one, other = ({(r.channel, r.level, r.settled): r.heights for r in some} for some in (whole, alone))
    assert len(whole) == len(one) == len(alone)
    assert one.keys() == other.keys()
    assert all(np.array_equal(one[key], other[key]) for key in one)
    with pytest.raises(ValueError, match="level must be"):
        next(iter(solver.channels(strokes, SETTINGS, 7)))


@pytest.mark.parametrize(
    "line",
    [[(5, 5)], [(5, 5), (5, 5)], [(-9000, 900), (9000, 900)], [(0, 0), (4096, 4096), (0, 0)], [(-500, -500)]],
    ids=["point", "twice", "far", "back", "outside"],
)
@pytest.mark.parametrize("radius", [0.0, 3000.0])
def test_any_line_will_do(line: list[tuple[float, float]], radius: float) -> None:
    """SPEC S64: finite, within what was asked, kernel as twin."""
    strokes = [paint("snow", 1.0, radius, line=line), paint("roughness", -1.0, radius, line=line)]
    fast, twin = (solved(strokes, device=device) for device in (None, "numpy"))
    for channel, low, high in ((Channel.SNOW, 0.0, 1.0), (Channel.ROUGHNESS, 0.0, 0.5)):
        assert np.isfinite(fast[channel]).all()
        assert low <= fast[channel].min()
        assert fast[channel].max() <= high
        assert np.abs(fast[channel] - twin[channel]).max() < 4 / BIAS_QUANTA


def test_what_a_paint_stroke_must_be() -> None:
    with pytest.raises(ValueError, match="less than or equal to 1"):
        Make.paint(LINE, "snow", 1.5)
    with pytest.raises(ValueError, match="channel"):
        Make.paint(LINE, "height")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="points must be finite"):
        Make.paint([(1, np.nan)], "snow")
    with pytest.raises(ValueError, match="only a paint stroke"):
        Terrain().add(MOUNTAIN.model_copy(update={"paint": c.Paint(channel="snow", value=1.0, radius_m=9.0)}))
    stroke = Make.paint([(1, 2, 3), (4, 5, 6)], "grass", -1, 7, label="meadow")
    assert (stroke.kind, stroke.first, stroke.last, stroke.label) == ("paint", (1, 2, 0), (4, 5, 0), "meadow")
    assert stroke.paint == c.Paint(channel="grass", value=-1.0, radius_m=7.0)
