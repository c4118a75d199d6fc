"""Heights above a base: kernels, equations, purity, refinement (SPEC S90 to S97)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from bench.solver import _exact
from esker import grid
from esker.api.terrain import Stroke as Make
from esker.contract import Channel, Stroke, TerrainSettings
from esker.events import Done, Level
from esker.grid import TileKey
from esker.solve import reference
from esker.solve.assembly import assemble
from esker.solve.channels import ChannelSolver, channel_level
from esker.solve.constraints import constraints, raster_reference
from esker.solve.constraints.constraints import Packer, WindowPacker, pack
from esker.solve.constraints.packing import Packed, Shape, pack_one
from esker.solve.constraints.tables import BinBox
from esker.solve.detail import detailed, settle
from esker.solve.opencl.device import Device, open_device
from esker.solve.opencl.gpu_levels import GpuWorkspace
from esker.solve.opencl.levels import ClWorkspace
from esker.solve.refine.cache import FieldCache
from esker.solve.refine.engine import NumpyEngine
from esker.solve.refine.refinement import Refiner
from esker.solve.solver import Basis, Solver
from esker.synthesis.interpolate import Window
from tests.solver.bases import Analytic, hills, mirrored, mound, plane, rough
from tests.solver.scenes import PINNED, SCENES, SETTINGS, SIZE, flank, mixed
from tests.solver.twins import close, noise, small_tiles, stiffness, tile_device

HILLS, ROUGH, TILTED = hills(), rough(), plane(0.2, -0.1, 500)
FLAT = Analytic("flat", lambda x, y: 0 * (x + y), 0.0, 0.0)


def lifted(strokes: Sequence[Stroke], by: float) -> list[Stroke]:
    """Strokes of flat ground, drawn on higher ground."""

    def up(p: tuple[float, float, float]) -> tuple[float, float, float]:
        return p[0], p[1], p[2] + by

    return [s.model_copy(update={"first": up(s.first), "last": up(s.last)}) for s in strokes]


FIVE = lifted(SCENES["five"], 300)


@pytest.fixture(scope="module", params=["rows", "tiles"])
def kernels(request: pytest.FixtureRequest, device: Device) -> Device:
    """What rasterises over a base is the same for tiles of all sizes (``gpu_program.OVER_SOURCES``)."""
    found = device if request.param == "rows" else tile_device("full")
    assert found is not None
    return found


def workspace(device: Device, level: int) -> ClWorkspace | GpuWorkspace:
    return (ClWorkspace if device.plan is None else GpuWorkspace)(device, level, based=True)


def basis_of(solver: Solver, strokes: Sequence[Stroke], level: int, base: Analytic) -> Basis:
    found: list[Basis] = [
        r.basis for r in solver.steps(strokes, SETTINGS, level, basis=True, base=base) if isinstance(r, Done)
    ]
    return found[-1]


@pytest.mark.parametrize("level", [0, 1, 3])
def test_what_is_owed_to_the_base(kernels: Device, level: int) -> None:
    """SPEC S90: the kernel against its twin, on noise, all rows or some."""
    w, n = workspace(kernels, level), grid.samples(level)
    over = w._over
    assert over is not None
    fields = {"d": stiffness(n)[0], "raw": noise((n, n), 2), "base": noise((n, n), 3), "share": noise((n, n), 4)}
    fields["target"] = noise((n, n), 5)
    for name, value in fields.items():
        w.height.put("d", level, value[None])
        if name != "d":
            queue, shape, pad = w.height._queue, w.height.shapes[level], w.height.pad
            host = np.zeros(shape.stride + pad, dtype=np.float32)
            host[pad : pad + n * shape.pitch].reshape(n, shape.pitch)[:, :n] = value
            queue.cl.enqueue_copy(queue.queue, getattr(over, name), host)
    w.height.put("d", level, fields["d"][None])
    w.height.put("s", level, np.zeros((1, n, n)))
    slack = 0.2
    over.add(w.height.fields["d", level], w.height.fields["s", level], slack, (5, n - 7))
    expected = reference.over_base(fields["raw"], fields["d"], fields["share"], fields["target"], fields["base"], slack)
    some = np.zeros((n, n))
    some[5 : n - 7] = expected[5 : n - 7]
    close(w.height.get("s", level)[0], some)
    over.add(w.height.fields["d", level], w.height.fields["s", level], slack, (0, n))
    close(w.height.get("s", level)[0], expected)


@pytest.mark.parametrize("base", [HILLS, ROUGH], ids=["hills", "rough"])
def test_constraints_are_the_twin_s(kernels: Device, base: Analytic) -> None:
    """SPEC S90: the rasteriser over a base, ties between strokes aside."""
    level, strokes = 2, [*FIVE, *lifted(SCENES["loops"], 250)]
    w = workspace(kernels, level)
    w.load(strokes, PINNED, base)
    under = base.level(level).astype(np.float64)
    c = raster_reference.rasterise(pack(strokes, PINNED, level, base=base), under)
    static = reference.over_base(c.height_f, c.height_d, c.share, c.target, under, grid.spacing(level, SIZE))
    got = [w.height.get("d", level)[0], w.height.get("s", level)[0], w.gradient.get("d", level)[0]]
    got += list(w.gradient.get("f", level))
    for a, b in zip(got, [c.height_d, static, c.gradient_d, *c.gradient_f], strict=True):
        error = np.abs(a - b) / max(1.0, float(np.abs(b).max()))
        assert np.quantile(error, 0.99) < 2e-5
        assert (error > 2e-2).mean() < 2e-3
    assert 1.0 <= c.share.max() <= 1.5, "one, or what a shoulder's height changes with its crest's"


def test_manufactured_ground(device: Device) -> None:
    """SPEC S91: where the ground's own differences are prescribed everywhere, what stands above a base is the ground
    less the base, to its finest detail."""
    level = 2
    w, n = workspace(device, level), grid.samples(level)
    y, x = np.mgrid[0:n, 0:n] / (n - 1)
    ground = 300 * np.sin(3 * x + 1) * np.cos(2 * y - 0.5) + 200 * x * y
    under = ROUGH.level(level).astype(np.float64)
    d = np.zeros((n, n))
    d[n // 3, n // 2] = -1
    f = np.where(d < 0, ground - under, -reference.laplacian(ground[None])[0])
    f = reference.over_base(f, d, np.ones((n, n)), np.zeros((n, n)), under, 0.0)
    w.height.put("d", level, d[None])
    w.height.put("s", level, f[None])
    w.height.coarsen(0.0)
    for k in range(level + 1):
        w.height.put("f", k, w.height.get("s", k))
    errors = list(_exact.errors_per_cycle(w.height, ground - under, 12))
    assert errors[-1] < 4e-6 * np.ptp(ground - under)


@pytest.mark.parametrize(
    ("scene", "base", "settings", "level"),
    [
        ("one", TILTED, SETTINGS, 2), ("five", ROUGH, SETTINGS, 2), ("loops", HILLS, SETTINGS, 1),
        ("bare", ROUGH, SETTINGS, 2), ("cross", HILLS, PINNED, 2),
        ("fifty", ROUGH, TerrainSettings(reach_m=None), 2),
    ],
)  # fmt: skip
def test_direct_solve(solver: Solver, scene: str, base: Analytic, settings: TerrainSettings, level: int) -> None:
    """SPEC S91."""
    strokes = lifted(SCENES[scene], (base.low + base.high) / 2)
    heights = solver.solve(strokes, settings, level, base=base)[level]
    a, b = assemble(strokes, settings, level, base)
    exact = spla.spsolve(a.tocsc(), b).reshape(heights.shape)
    relief = max(float(np.ptp(exact)), 1.0)
    assert np.abs(heights - exact).max() / relief < 1e-3
    assert np.sqrt(np.mean((heights - exact) ** 2)) / relief < 1e-4
    assert abs(a - a.T).max() < 1e-12


def test_no_opencl_gives_the_same(solver: Solver) -> None:
    """SPEC S90: the whole solve, NumPy float64."""
    a, b = (s.solve(FIVE, SETTINGS, 2, base=ROUGH)[2] for s in (solver, Solver("numpy")))
    assert np.abs(a - b).max() < grid.quantum(2, SIZE)


def test_tiles_settle_like_rows(solver: Solver) -> None:
    """SPEC S90, S22."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ESKER_KERNELS", "tiles")
        tiles = small_tiles(Solver())
    error = np.abs(solver.solve(FIVE, SETTINGS, 3, base=ROUGH)[3] - tiles.solve(FIVE, SETTINGS, 3, base=ROUGH)[3])
    assert (error >= grid.quantum(3, SIZE)).sum() <= 4


def test_a_blank_base_is_no_base(solver: Solver) -> None:
    """SPEC S92: a plane at 0, and the same strokes on a plane that is 500 m higher."""
    without = solver.solve(SCENES["five"], SETTINGS, 3)[3]
    assert np.abs(solver.solve(SCENES["five"], SETTINGS, 3, base=FLAT)[3] - without).max() < grid.quantum(3, SIZE) / 4
    high = solver.solve(lifted(SCENES["five"], 500), SETTINGS, 3, base=plane(0, 0, 500))[3]
    assert np.abs(high - without).max() < grid.quantum(3, SIZE)


def test_without_strokes_nothing_is_added(solver: Solver) -> None:
    """SPEC S92: exactly 0 above any base."""
    assert not solver.solve([], SETTINGS, 2, base=ROUGH)[2].any()
    hidden = [s.model_copy(update={"hidden": True}) for s in FIVE]
    assert not solver.solve(hidden, SETTINGS, 2, base=ROUGH)[2].any()


def test_bases_leave_grounds_without_one_alone(solver: Solver) -> None:
    """SPEC S93: no bit of a terrain without layers knows that others have some."""
    before = solver.solve(SCENES["five"], SETTINGS, 3)[3]
    solver.solve(SCENES["five"], SETTINGS, 3, base=ROUGH)
    assert np.array_equal(solver.solve(SCENES["five"], SETTINGS, 3)[3], before)
    assert np.array_equal(Solver().solve(SCENES["five"], SETTINGS, 3)[3], before)


def test_mirror(solver: Solver) -> None:
    """SPEC S94: strokes and base mirrored, ground mirrored."""

    def west(p: tuple[float, float, float]) -> tuple[float, float, float]:
        return SIZE - p[0], p[1], p[2]

    strokes = [
        s.model_copy(update={"first": west(s.first), "last": west(s.last), "left": s.right, "right": s.left})
        for s in FIVE
        if s.kind == "profile"
    ]
    straight = [s for s in FIVE if s.kind == "profile"]
    a = solver.solve(straight, SETTINGS, 3, base=ROUGH)[3]
    b = solver.solve(strokes, SETTINGS, 3, base=mirrored(ROUGH))[3]
    assert np.ptp(a) > 100
    assert np.abs(a - b[:, ::-1]).max() < 0.05 * np.ptp(a) / 100


def test_any_order_of_edits_and_of_bases(solver: Solver) -> None:
    """SPEC S93: strokes come and go, layers arrive, move and leave, in any order: the same bits as from nothing."""
    strokes, level = lifted(mixed(20, 7), 300), 2
    mounds = [mound(1000 + 700 * k, 2800 - 500 * k, 400, 60 - 50 * k, HILLS) for k in range(3)]
    fresh = Solver().solve(strokes, SETTINGS, level, base=HILLS)[level]
    for seed in range(6):
        order = np.random.default_rng(seed)
        now: dict[str, Stroke] = {}
        for k in order.permutation(len(strokes)):
            now[strokes[k].id] = strokes[k]
            if order.random() < 0.4:
                base = [None, HILLS, *mounds][int(order.integers(5))]
                stop = bool(order.random() < 0.5)
                solver.solve(list(now.values()), SETTINGS, level, base=base, should_stop=[bool, lambda: True][stop])
        assert np.array_equal(solver.solve(list(now.values()), SETTINGS, level, base=HILLS)[level], fresh)


def test_a_changed_base_rasterises_where_it_changed(device: Device) -> None:
    """SPEC S93: a layer that comes somewhere costs what lies there."""
    other = mound(1000, 2800, 300, 1.0, HILLS)
    packer = Packer(3)
    packer.pack(FIVE, SETTINGS, HILLS)
    assert packer.pack(FIVE, SETTINGS, HILLS)[1] is None
    within = Analytic(other.name, other.formula, HILLS.low, HILLS.high)
    window = packer.pack(FIVE, SETTINGS, within)[1]
    assert window is not None
    assert 0 < (window.spans[:, 1] - window.spans[:, 0]).sum() <= 7 * 7
    w, fresh = workspace(device, 3), workspace(device, 3)
    w.load(FIVE, SETTINGS, HILLS)
    w.load(FIVE, SETTINGS, within)
    fresh.load(FIVE, SETTINGS, within)
    for name in ("d", "s"):
        for level in (3, 2):
            assert np.array_equal(w.height.get(name, level), fresh.height.get(name, level))


def test_channels_know_how_high_a_crest_stands(solver: Solver) -> None:
    """SPEC S95: bands are as wide above the base as they are there, and paint lies on the ground wherever that is."""
    rough_wall = Make.profile(
        [(600, 2048, 400), (3500, 2048, 400)], left=flank(45, 2000, "straight"), right=flank(45, 2000, "straight"),
        roughness=0.9, id="w",
    )  # fmt: skip
    snow = Make.paint([(1000, 3500), (3000, 3500)], "snow", 1.0, radius_m=100, id="p")
    got = {}
    for at in (0.0, 350.0):
        base = plane(0, 0, at)
        for kind in (open_device(), None):
            made = dict(ChannelSolver(kind, 2).solve([rough_wall, snow], SETTINGS, base))
            got[at, kind is None] = made
        for channel in (Channel.ROUGHNESS, Channel.SNOW):
            assert np.abs(got[at, True][channel] - got[at, False][channel]).max() < 2e-3
    row = int((2048 + 200) / 16)
    assert got[0.0, False][Channel.ROUGHNESS][row, 128] > 0.85
    assert got[350.0, False][Channel.ROUGHNESS][row, 128] < 0.8
    assert np.array_equal(got[0.0, False][Channel.SNOW], got[350.0, False][Channel.SNOW])
    results = [r for r in solver.channels([rough_wall], SETTINGS, 4, base=plane(0, 0, 350.0)) if isinstance(r, Level)]
    last = [r for r in results if r.channel == Channel.ROUGHNESS][-1]
    assert np.array_equal(last.heights, got[350.0, False][Channel.ROUGHNESS])


def test_the_base_s_own_levels(solver: Solver) -> None:
    """SPEC S96: BASE on every level that is solved, SURVEY on those of the channels."""
    results = list(solver.base_levels(HILLS, 3))
    assert [(r.channel, r.level) for r in results] == [
        *((Channel.BASE, level) for level in range(4)),
        *((Channel.SURVEY, level) for level in range(channel_level(3) + 1)),
    ]
    for r in results:
        expected = HILLS.level(r.level) if r.channel == Channel.BASE else HILLS.survey(r.level)
        assert r.settled
        assert np.array_equal(r.heights, expected)
    with pytest.raises(ValueError, match=r"0\.\.6"):
        list(solver.base_levels(HILLS, 7))


def test_detail_stands_on_the_sum(solver: Solver) -> None:
    """SPEC S96: guides of synthesis are base and offsets together."""
    settled = settle(solver, FIVE, SETTINGS, 2, base=HILLS)
    assert settled.basis.base is HILLS
    assert np.array_equal(settled.channels["survey"], HILLS.survey(0))
    made = detailed(solver, settled, 3)
    part = slice(100, 140)
    quantum = 2 * grid.quantum(2, SIZE)
    assert np.abs(made.site.guides[2] - (settled.basis.heights + HILLS.level(2))).max() < quantum
    refined = solver.refiner(settled.basis).window(3, part, part) + HILLS.window(3, part, part)
    assert np.abs(made.base(Window(3, 100, 140, 100, 140)) - refined).max() < quantum


# --- refinement ---


def test_refined_windows_agree_to_the_bit(solver: Solver) -> None:
    """SPEC S50, S97: any windows, any order, tiles and their edges; with the base of each tile."""
    basis = basis_of(solver, FIVE, 1, ROUGH)
    one, other = (Refiner(basis, solver.refiner(basis)._engine, FieldCache()) for _ in range(2))
    keys = [TileKey(3, x, y) for y in (2, 3, 4) for x in (2, 3)]
    a = {t.key: t for t in one.tiles(keys) if t is not None}
    b = {t.key: t for key in keys[::-1] for t in other.tiles([key]) if t is not None}
    for key in keys:
        assert a[key].heights.tobytes() == b[key].heights.tobytes()
        rows, columns = (slice(64 * k, 64 * k + 65) for k in (key.y, key.x))
        under = a[key].base
        assert under is not None
        assert not under.flags.writeable
        assert np.array_equal(under, ROUGH.window(3, rows, columns))
        assert np.array_equal(one.window(3, rows, columns), a[key].heights)
    assert np.array_equal(a[keys[0]].heights[:, -1], a[keys[1]].heights[:, 0])
    assert np.array_equal(a[keys[0]].heights[-1], a[keys[2]].heights[0])


def test_refinement_is_its_twin_s_and_near_a_global_solve(solver: Solver) -> None:
    """SPEC S2, S55 over a rough base."""
    basis = basis_of(solver, FIVE, 2, ROUGH)
    kernel, twin = solver.refiner(basis), Refiner(basis, NumpyEngine(), FieldCache())
    key = TileKey(3, 3, 4)
    a, b = (next(t for t in r.tiles([key]) if t is not None).heights for r in (kernel, twin))
    assert np.quantile(np.abs(a - b), 0.99) < 1e-6 * np.ptp(basis.heights)
    assert np.abs(a - b).max() < 0.05
    whole = solver.solve(FIVE, SETTINGS, 3, base=ROUGH)[3]
    error = np.abs(kernel.window(3, slice(128, 385), slice(128, 385)) - whole[128:385, 128:385])
    assert error.max() < 5e-3 * np.ptp(whole)


def test_content_is_local(solver: Solver) -> None:
    """SPEC S52, S97: what a layer changes near a tile changes its content, elsewhere it does not."""
    near = mound(1800, 1800, 200, 30, HILLS)
    far = mound(300, 3800, 200, 30, HILLS)
    key = TileKey(6, 28, 28)
    contents = []
    for base in (HILLS, far, near, None):
        basis = basis_of(solver, [], 4, HILLS)
        basis = Basis(basis.strokes, basis.settings, 4, basis.heights, basis.gradient, base)
        contents.append(solver.refiner(basis).content(key))
    assert contents[0] == contents[1]
    assert len(set(contents)) == 3


def test_windows_of_bins_agree() -> None:
    """SPEC S40 over a base: the twin in a window has the bits of the whole level."""
    packer, level = WindowPacker(FIVE, SETTINGS, base=ROUGH), 3
    whole = raster_reference.rasterise(pack(FIVE, SETTINGS, level, base=ROUGH), ROUGH.level(level))
    box = (10, 14, 12, 17)
    rows, columns = slice(160, 224), slice(192, 272)
    part = raster_reference.rasterise(packer.pack(level, box), ROUGH.window(level, rows, columns))
    assert np.array_equal(part.height_f, whole.height_f[rows, columns])
    assert np.array_equal(part.share, whole.share[rows, columns])
    assert part.share.any()
    assert packer.grounds[FIVE[0].id].half > 100


def test_a_base_is_asked_on_one_device(solver: Solver) -> None:
    """SPEC S93: kinds of devices differ in their last bits, so all that a solver asks of a base is made on its own."""
    asked: list[Any] = []

    class Watched(Analytic):
        def level(self, level: int, device: Any = None) -> NDArray[np.float32]:
            asked.append(device)
            return super().level(level, device)

        def window(self, level: int, rows: slice, cols: slice, device: Any = None) -> NDArray[np.float32]:
            asked.append(device)
            return super().window(level, rows, cols, device)

        def changed(self, other: Any) -> grid.Rect | None:
            """Asked where the solver's last scene stood on another base: it compares levels of its own accord."""
            before = len(asked)
            rect = super().changed(other)
            del asked[before:]
            return rect

    # the base's own use of ``window`` in ``level`` and ``changed`` is not the solver's
    base = Watched("watched", HILLS.formula, HILLS.low, HILLS.high, kept={k: HILLS.level(k) for k in range(5)})
    folded = [s.model_copy(update={"curve": s.curve[:20] + s.curve[10:]}) for s in FIVE]
    for one in (solver, Solver("numpy")):
        asked.clear()
        settled = settle(one, folded, SETTINGS, 1, base=base)
        list(one.base_levels(base, 1))
        next(t for t in one.refiner(settled.basis).tiles([TileKey(2, 1, 1)]) if t is not None)
        detailed(one, settled, 2).window(2, slice(3, 9), slice(3, 9))
        assert len(asked) > 8
        own = None if one.device is None else one.device.context
        assert {None if device is None else device.context for device in asked} == {own}


def test_dragging_a_layer_packs_what_it_touches(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S93: strokes away from where the base changed are as they were, and a solver keeps its workspace."""
    packed: list[str] = []

    def counted(shape: Shape, s: float, box: BinBox) -> Packed | None:
        packed.append(shape.crest.stroke.id)
        return pack_one(shape, s, box)

    monkeypatch.setattr(constraints, "pack_one", counted)
    strokes = [
        Make.profile([(x, 500 + x / 3, 500), (x + 300, 900 + x / 3, 500)], left=flank(), right=flank(), id=f"s{x}")
        for x in (400, 1600, 2800)
    ]
    packer = Packer(3)
    packer.pack(strokes, SETTINGS, HILLS)
    for name, at, expected in (("far", (500, 3500), set()), ("near", (1750, 1250), {"s1600"})):
        packed.clear()
        there = mound(*at, 150, 20.0, HILLS)
        within = Analytic(name, there.formula, HILLS.low, HILLS.high)
        packer.pack(strokes, SETTINGS, within)
        assert set(packed) == expected
        packer.pack(strokes, SETTINGS, HILLS)
    packed.clear()
    peak = mound(500, 3500, 60, 200.0, HILLS)
    high = Analytic("higher", peak.formula, HILLS.low, peak.high)
    packer.pack(strokes, SETTINGS, high)
    assert set(packed) == {"s400", "s1600", "s2800"}, "they may reach farther"


def test_one_workspace_follows_a_layer(solver: Solver) -> None:
    """SPEC S93: each place of a dragged layer is a new base; the next one begins with the raster of the last."""
    one = Solver()
    for k in range(3):
        base = mound(1000 + 100 * k, 2800, 300, 10.0, HILLS)
        found = one.solve(FIVE, SETTINGS, 2, base=base)[2]
        assert len(one._pool.idle) == 1
        assert np.array_equal(found, solver.solve(FIVE[::-1], SETTINGS, 2, base=base)[2])
