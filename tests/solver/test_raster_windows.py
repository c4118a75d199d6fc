"""Windows of bins at any level: what a bin gets does not depend on the window that it is in (SPEC S40)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.api.terrain import Stroke as Make
from esker.contract import MAX_REFINED_LEVEL, Channel, Stroke, TerrainSettings
from esker.contract.fractal import PAINT_LESS, PAINT_MORE
from esker.solve.constraints import constraints, packing, raster_reference
from esker.solve.constraints.channel_targets import Layer, natural_amplitude_m
from esker.solve.constraints.constraints import BIN, BinBox, Shapes, Tables, WindowPacker, bins, everything, pack
from esker.solve.constraints.packing import Shape
from esker.solve.opencl import raster
from esker.solve.opencl.device import Device
from esker.solve.opencl.levels import PAD, ClWorkspace, Launcher
from tests.solver.scenes import PINNED, SCENES, SETTINGS, SIZE, flank, loop, ridge

SCENE = [
    *SCENES["cross"],
    loop(1500, 1600, 500, 200, flank(), "loop"),
    ridge((-3000, 700), (7000, 3500), 400, flank(38), "across"),
    Make.profile([(1900, 2000, 0), (1960, 2040, 60), (2040, 2060, 0)], left=flank(40), right=flank(20), id="small"),
]


@dataclass(frozen=True)
class Window:
    """The five constraint fields of a box, (5, rows, columns)."""

    box: BinBox
    fields: NDArray[np.float32]

    def part(self, box: BinBox, level: int) -> NDArray[np.float32]:
        """The samples of ``box``, which lies in this one's."""
        top, left = (box[0] - self.box[0]) * BIN, (box[2] - self.box[2]) * BIN
        n = grid.samples(level)
        rows, columns = min(box[1] * BIN, n) - box[0] * BIN, min(box[3] * BIN, n) - box[2] * BIN
        return self.fields[:, top : top + rows, left : left + columns]


def on_device(device: Device, tables: Tables) -> Window:
    """What the kernel says of the tables' box."""
    launch = Launcher(device, 0)
    rows, columns = tables.shape
    pitch = PAD + (tables.box[3] - tables.box[2]) * BIN
    stride = rows * pitch
    fields = [launch.zeros((2 if k == 3 else 1) * stride + PAD) for k in range(4)]
    target = raster.Target(fields[0], fields[1], fields[2], fields[3], pitch, stride)
    raster.rasterise(launch, tables, everything(tables.box), target)
    out = []
    for k, field in enumerate(fields):
        host = np.empty((2 if k == 3 else 1) * stride + PAD, dtype=np.float32)
        launch.cl.enqueue_copy(launch.queue, host, field)
        out += [channel[:, PAD : PAD + columns] for channel in host[: -PAD or None].reshape(-1, rows, pitch)]
    return Window(tables.box, np.stack(out))


def on_host(tables: Tables) -> Window:
    """What the twin says of the tables' box."""
    c = raster_reference.rasterise(tables)
    return Window(tables.box, np.stack([c.height_d, c.height_f, c.gradient_d, *c.gradient_f]))


def shared(a: BinBox, b: BinBox) -> BinBox:
    return max(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), min(a[3], b[3])


def places(level: int) -> list[tuple[BinBox, BinBox]]:
    """Pairs of windows that overlap: on crests, in flanks, inside the outline, at a corner of the domain."""
    count = bins(grid.samples(level))
    out = []
    for x, y in ((1980, 2040), (1500, 1600), (2600, 2300), (SIZE, SIZE), (0, 1500)):
        bx, by = (min(int(v / SIZE * (count - 1)), count - 2) for v in (x, y))
        first = (max(by - 2, 0), min(by + 2, count), max(bx - 2, 0), min(bx + 2, count))
        second = (max(by - 1, 0), min(by + 4, count), max(bx - 3, 0), min(bx + 1, count))
        out.append((first, second))
    return out


@pytest.mark.parametrize("level", range(5, MAX_REFINED_LEVEL + 1))
def test_overlapping_windows_agree_to_the_bit(device: Device, level: int) -> None:
    """SPEC S40, kernel and twin; and the kernel agrees with the twin where coordinates are large."""
    packer = WindowPacker(SCENE, SETTINGS)
    for a, b in places(level):
        both = shared(a, b)
        one, two = (on_device(device, packer.pack(level, box)) for box in (a, b))
        assert np.array_equal(one.part(both, level), two.part(both, level))
        twin, other = (on_host(packer.pack(level, box)) for box in (a, b))
        assert np.array_equal(twin.part(both, level), other.part(both, level))
        for k, scale in enumerate((8.0, 800.0, 4.0, 4.0, 4.0)):
            error = np.abs(one.fields[k] - twin.fields[k]) / scale
            assert np.quantile(error, 0.97) < 4e-4
            assert (error > 5e-2).mean() < 2e-2


@pytest.mark.parametrize("settings", [SETTINGS, PINNED], ids=["free", "pinned"])
def test_a_window_is_a_part_of_the_level(device: Device, settings: TerrainSettings) -> None:
    """SPEC S40: windows of a global level hold the bits of the whole."""
    level = 3
    w = ClWorkspace(device, level)
    w.load(SCENE, settings)
    fields = [
        w.height.get("d", level),
        w.height.get("s", level),
        w.gradient.get("d", level),
        w.gradient.get("f", level),
    ]
    whole = Window((0, bins(513), 0, bins(513)), np.concatenate(fields))
    packer = WindowPacker(SCENE, settings)
    for box in [b for pair in places(level) for b in pair]:
        part = on_device(device, packer.pack(level, box))
        assert np.array_equal(part.fields, whole.part(box, level))
    twin = on_host(pack(SCENE, settings, level))
    box = places(level)[0][0]
    assert np.array_equal(on_host(packer.pack(level, box)).fields, twin.part(box, level))


@pytest.mark.parametrize("level", [2, 7])
def test_channels_of_a_window(device: Device, level: int) -> None:
    """SPEC S40, S60, S64: what crests and what brushes say, kernel against twin, by windows."""
    rough = [s.model_copy(update={"amplitude_m": 10.0 + 7 * k}) for k, s in enumerate(SCENE)]
    for k, value in enumerate((1.0, -0.5)):
        rough.append(Make.paint([(1400, 1700 + 60 * k), (2700, 2300)], "amplitude", value, radius_m=90, id=f"p{k}"))
    natural = natural_amplitude_m(SETTINGS)
    packers = [WindowPacker(rough, SETTINGS, Layer(Channel.AMPLITUDE, painted)) for painted in (False, True)]
    for packer, box in itertools.product(packers, [b for pair in places(level) for b in pair]):
        tables = packer.pack(level, box)
        launch, (rows, columns) = Launcher(device, 0), tables.shape
        pitch = PAD + (box[3] - box[2]) * BIN
        d, f = (launch.zeros(k * rows * pitch + PAD) for k in (1, 2))
        raster.rasterise_channel(launch, tables, everything(box), d, f, pitch, rows * pitch, covered=True)
        host = np.empty(3 * rows * pitch + PAD, dtype=np.float32)
        launch.cl.enqueue_copy(launch.queue, host[: rows * pitch + PAD], d)
        launch.cl.enqueue_copy(launch.queue, host[rows * pitch :], f)
        expected = raster_reference.rasterise_channel(tables)
        for found, twin in zip(host[:-PAD].reshape(3, rows, pitch)[:, :, PAD : PAD + columns], expected, strict=True):
            assert np.quantile(np.abs(found - twin), 0.99) < 2e-3
            assert (np.abs(found - twin) > 0.5).mean() < 1e-2
        d_, f_, cover = expected
        means = f_[d_ > 0] / cover[d_ > 0]
        low, high = (
            (-0.5 * PAINT_LESS * natural, PAINT_MORE * natural) if packer is packers[1] else (0, 10 + 7 * len(SCENE))
        )
        assert low - 1e-5 <= means.min(initial=0)
        assert means.max(initial=0) <= high + 1e-5


def test_far_strokes_cost_nothing() -> None:
    """Only what lies near a window is packed for it."""
    far = [ridge((100 + 30 * k, 200), (140 + 30 * k, 900), 40, flank(35, 60), f"far{k}") for k in range(40)]
    packer = WindowPacker([*SCENE, *far], SETTINGS)
    box = places(10)[0][0]
    alone = WindowPacker(SCENE, SETTINGS)
    assert np.array_equal(packer.pack(10, box).knots, alone.pack(10, box).knots)
    assert len(alone.pack(10, box).pieces) < 300
    assert packer.pack(10, places(10)[3][0]).empty


def test_long_crests_have_no_grain(device: Device) -> None:
    """A profile right across a level of 65,537 samples: neighbouring samples see it as smoothly as float64 does."""
    stroke: Stroke = Make.profile([(-900, -500, 50), (5100, 4700, 90)], left=flank(35), right=flank(35), id="a")
    tables = WindowPacker([stroke], SETTINGS).pack(10, (2110, 2114, 2078, 2080))
    found, twin = on_device(device, tables), on_host(tables)
    target, expected = (w.fields[1] / np.maximum(w.fields[0], 1e-9) for w in (found, twin))
    sprung = twin.fields[0] > 0
    assert sprung.any()
    error = np.where(sprung, target - expected, 0.0)
    grain = np.abs(np.diff(error, axis=1))
    assert grain.max() < grid.quantum(10, SIZE) / 4


def test_long_segments_are_cut() -> None:
    """Float32 places an outline's crest to a part of a quantum everywhere."""
    stroke: Stroke = Make.level([(-900, -500, 50), (5100, 4700, 50)], left=flank(35), right=flank(35), id="a")
    tables = WindowPacker([stroke], SETTINGS).pack(10, (2078, 2080, 2078, 2080))
    seg = tables.segments.astype(np.float32).astype(float)
    t = np.array([6000.0, 5200.0]) / np.hypot(6000.0, 5200.0)
    s = tables.spacing_m
    off = (seg[0] + 900 / s) * t[1] - (seg[1] + 500 / s) * t[0]
    assert np.abs(off).max() < 4e-3
    assert np.hypot(seg[2], seg[3]).max() <= 1024.001


@pytest.mark.parametrize("box", [(0, 0, 0, 2), (0, 2, 5, 6), (-1, 1, 0, 1)])
def test_windows_are_checked(box: BinBox) -> None:
    with pytest.raises(ValueError, match="not within"):
        WindowPacker(SCENE, SETTINGS).pack(0, box)
    with pytest.raises(ValueError, match=r"0\.\.10"):
        WindowPacker(SCENE, SETTINGS).pack(11, (0, 1, 0, 1))


def test_a_stroke_is_made_ready_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S40: the same object under the same settings is known, the least recently used is forgotten."""
    made: list[str] = []

    def shape_for(layer: object, stroke: Stroke, settings: TerrainSettings, base: object) -> Shape | None:
        assert layer is base is None
        made.append(stroke.id)
        return real(None, stroke, settings, None)

    real = packing.shape_for
    monkeypatch.setattr(constraints, "shape_for", shape_for)
    shapes, strokes = Shapes(most=5), [s.model_copy(update={"id": str(k)}) for k, s in enumerate(SCENES["five"])]
    first = [shapes.of(s, SETTINGS, None) for s in strokes]
    assert made == list("01234")
    assert [shapes.of(s, SETTINGS, None) for s in strokes] == first
    assert len(made) == 5
    other = SETTINGS.model_copy(update={"reach_m": 77.0})
    shape = shapes.of(strokes[4], other, None)
    assert shape is not None
    assert shape.cliff == 1 / 77
    shapes.of(strokes[1], SETTINGS, None)
    shapes.of(strokes[0], SETTINGS, None)
    assert made == list("0123440")
    tables = [WindowPacker(strokes, SETTINGS, shapes=known).pack(3, (2, 20, 3, 21)) for known in (None, shapes, shapes)]
    assert len({t.knots.tobytes() + t.pieces.tobytes() + t.row_items.tobytes() for t in tables}) == 1
