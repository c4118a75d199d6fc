"""Refinement above the global levels (SPEC S50..S56): windows that agree to the bit, purity, stopping, accuracy."""

from __future__ import annotations

import dataclasses
import random
import tracemalloc
from collections.abc import Callable, Generator, Iterator, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.contract import MAX_REFINED_LEVEL, Stroke, TerrainSettings
from esker.events import Done
from esker.grid import TileKey
from esker.solve.constraints.tables import BinBox, Tables
from esker.solve.opencl.device import Device
from esker.solve.refine.cache import FieldCache
from esker.solve.refine.cl_engine import ClEngine
from esker.solve.refine.engine import (
    FIRST_SWEEPS,
    GRADIENT_LOW,
    LAST_SWEEPS,
    Engine,
    Fields,
    NumpyEngine,
    Pending,
    Span,
    Step,
    StrokeWindows,
    gradient_weights,
    height_weights,
    step,
)
from esker.solve.refine.refinement import RefinedTile, Refiner
from esker.solve.refine.stroke_set import Strokes
from esker.solve.solver import Basis, Solver
from tests.solver.scenes import PINNED, SCENES, SETTINGS, flank, ridge

LOW = 1


def settled(solver: Solver, strokes: Sequence[Stroke], settings: TerrainSettings, level: int) -> Basis:
    """What refinement starts from."""
    found: list[Basis] = [r.basis for r in solver.steps(strokes, settings, level, basis=True) if isinstance(r, Done)]
    return found[-1]


@pytest.fixture(scope="module")
def engine(device: Device) -> ClEngine:
    return ClEngine(device)


@pytest.fixture(scope="module")
def basis(solver: Solver) -> Basis:
    return settled(solver, SCENES["five"], SETTINGS, LOW)


class Counting:
    """An engine that counts its steps."""

    def __init__(self, engine: Engine) -> None:
        self.engine, self.device, self.ahead, self.steps = engine, engine.device, engine.ahead, 0
        self.begun, self.is_empty = 0, True

    def begin(self, at: Step, strokes: StrokeWindows, parent: Fields) -> Pending:
        self.steps += 1
        return self.engine.begin(at, strokes, parent)

    def clear(self) -> None:
        self.engine.clear()

    def release(self) -> bool:
        return self.engine.release()


def made(refiner: Refiner, keys: Sequence[TileKey]) -> dict[TileKey, RefinedTile]:
    """All of these tiles; checks that each came once, in order."""
    tiles = [t for t in refiner.tiles(keys) if t is not None]
    assert [t.key for t in tiles] == list(dict.fromkeys(keys))
    return {t.key: t for t in tiles}


def patch(level: int, x0: int, y0: int, side: int) -> list[TileKey]:
    return [TileKey(level, x, y) for y in range(y0, y0 + side) for x in range(x0, x0 + side)]


def bits(tiles: dict[TileKey, RefinedTile]) -> dict[TileKey, bytes]:
    return {key: tile.heights.tobytes() for key, tile in tiles.items()}


def computed(engine: Engine, basis: Basis, core: Span) -> Fields:
    """One step above the basis for any samples."""
    at = step(basis.level + 1, core)
    p = at.parent
    ground = np.concatenate([basis.gradient, basis.heights[None]])
    pending = engine.begin(at, Strokes(basis.strokes, basis.settings), ground[:, p.r0 : p.r1, p.c0 : p.c1])
    return pending.fields()


def random_spans(rng: random.Random, n: int) -> Iterator[tuple[Span, Span, Span]]:
    """Two windows that overlap and what they share, wherever in the level."""
    for _ in range(8):
        r, c = sorted(rng.sample(range(n), 4)), sorted(rng.sample(range(n), 4))
        yield Span(r[0], r[2], c[1], c[3]), Span(r[1], r[3], c[0], c[2]), Span(r[1], r[2], c[1], c[2])


@pytest.mark.parametrize("settings", [SETTINGS, PINNED], ids=["free", "pinned"])
def test_windows_agree_to_the_bit_on_what_they_share(
    solver: Solver, engine: ClEngine, settings: TerrainSettings
) -> None:
    """SPEC S50: whatever their extent, and at the borders of the level."""
    start = settled(solver, SCENES["five"], settings, 2)
    for one, other, both in random_spans(random.Random(5), grid.samples(3)):
        parts = [
            field[:, both.r0 - at.r0 : both.r1 - at.r0, both.c0 - at.c0 : both.c1 - at.c0]
            for at, field in ((one, computed(engine, start, one)), (other, computed(engine, start, other)))
        ]
        assert parts[0].tobytes() == parts[1].tobytes(), (one, other)


def test_kernels_are_their_twin(engine: ClEngine, basis: Basis) -> None:
    """SPEC S2: to float32 rounding, inside and at corners; ties may fall otherwise on single samples."""
    n = grid.samples(LOW + 1)
    for core in (Span(0, 70, 0, 70), Span(n - 90, n, n - 77, n), Span(100, 171, 64, 129)):
        a, b = computed(engine, basis, core), computed(NumpyEngine(), basis, core)
        relief = float(np.ptp(basis.heights))
        assert np.abs(a[2] - b[2]).max() < 1e-4 * relief
        assert np.quantile(np.abs(a[2] - b[2]), 0.99) < 1e-6 * relief
        assert np.abs(a[:2] - b[:2]).max() < 1e-3


def test_neighbouring_tiles_share_their_edges(engine: ClEngine, basis: Basis) -> None:
    """SPEC S50: also across the groups that are computed together, and on levels above each other."""
    for level in (LOW + 1, LOW + 3):
        side = min(6, 1 << level)
        tiles = made(Refiner(basis, engine, FieldCache()), patch(level, (1 << level) - side, 0, side))
        for key, tile in tiles.items():
            east, north = tiles.get(TileKey(level, key.x + 1, key.y)), tiles.get(TileKey(level, key.x, key.y + 1))
            assert east is None or tile.heights[:, -1].tobytes() == east.heights[:, 0].tobytes()
            assert north is None or tile.heights[-1].tobytes() == north.heights[0].tobytes()


def test_order_cache_and_interleaving_do_not_change_bits(engine: ClEngine, basis: Basis) -> None:
    """SPEC S51."""
    keys = [*patch(LOW + 2, 1, 2, 3), *patch(LOW + 3, 6, 7, 2)]
    expected = bits(made(Refiner(basis, engine, FieldCache()), keys))
    shuffled = random.Random(1).sample(keys, len(keys))
    assert bits(made(Refiner(basis, engine, FieldCache()), shuffled)) == expected
    tiny = Refiner(basis, engine, FieldCache(1))
    assert bits({k: made(tiny, [k])[k] for k in keys[::-1]}) == expected
    cache = FieldCache()
    runs = [Refiner(basis, engine, cache).tiles(part) for part in (keys[:5], keys[3:])]
    found: dict[TileKey, RefinedTile] = {}
    while runs:
        for run in list(runs):
            item = next(run, "end")
            if isinstance(item, RefinedTile):
                found[item.key] = item
            elif item == "end":
                runs.remove(run)
    assert bits(found) == expected


def test_known_constraints_do_not_change_bits(device: Device, basis: Basis, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S51: bins from the cache are those of the rasteriser, whatever was kept, dropped or of other strokes."""
    keys = [*patch(LOW + 3, 3, 3, 4), TileKey(LOW + 3, 15, 15)]
    fresh = ClEngine(device)
    expected = bits(made(Refiner(basis, fresh, FieldCache()), keys))
    small = ClEngine(device)
    small.bin_cache.most = 1
    assert bits(made(Refiner(basis, small, FieldCache()), keys[::-1])) == expected
    assert len(small.bin_cache) == 1
    with monkeypatch.context() as patched:
        patched.setattr(Strokes, "shared_tables", None)
        assert bits(made(Refiner(basis, fresh, FieldCache()), keys)) == expected
    moved = dataclasses.replace(
        basis, strokes=(*basis.strokes[1:], ridge((900, 900), (1500, 1400), 150, flank(), "new"))
    )
    assert bits(made(Refiner(moved, fresh, FieldCache()), keys)) == bits(
        made(Refiner(moved, ClEngine(device), FieldCache()), keys)
    )
    last = Refiner(basis, fresh, FieldCache())
    assert bits(made(last, keys)) == expected
    last.clear()
    assert len(fresh.bin_cache) == len(last.cache) == 0


def test_tables_of_a_larger_box_serve(device: Device, solver: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S51: with outlines, whose insides are listed by row, at every place in the larger box."""
    start = settled(solver, [*SCENES["loops"], *SCENES["five"]], SETTINGS, LOW)
    keys = [*patch(LOW + 4, 9, 10, 4), *patch(LOW + 4, 14, 13, 3), TileKey(LOW + 4, 31, 0)]
    shared = bits(made(Refiner(start, ClEngine(device), FieldCache()), keys))

    def own(strokes: Strokes, level: int, box: BinBox) -> Generator[None, None, Tables]:
        yield
        return strokes.tables(level, box)

    monkeypatch.setattr(Strokes, "shared_tables", own)
    assert bits(made(Refiner(start, ClEngine(device), FieldCache()), keys)) == shared


def test_content_says_what_a_tile_depends_on(engine: ClEngine) -> None:
    """SPEC S52: equal content, and the tile comes from the cache; strokes within reach, settings, ground change it."""
    n = grid.samples(4)
    basis = Basis(tuple(SCENES["five"]), SETTINGS, 4, np.zeros((n, n), np.float32), np.zeros((2, n, n), np.float32))
    counting, cache, key = Counting(engine), FieldCache(), TileKey(6, 8, 8)
    near = ridge((500, 500), (700, 560), 60, flank(), "near")
    far = ridge((3500, 3500), (3700, 3560), 60, flank(), "far")
    before = Refiner(basis, counting, cache)
    tile = made(before, [key])[key]
    done = counting.steps
    assert tile.content == before.content(key)
    elsewhere = Refiner(dataclasses.replace(basis, strokes=(*basis.strokes, far)), counting, cache)
    again = made(elsewhere, [key])[key]
    assert again.content == tile.content
    assert np.shares_memory(again.heights, tile.heights)
    assert counting.steps == done
    named = tuple(s.model_copy(update={"label": "x", "finished": not s.finished}) for s in basis.strokes)
    assert Refiner(dataclasses.replace(basis, strokes=named), counting, cache).content(key) == tile.content
    lifted = basis.heights.copy()
    lifted[140, 140] += 1
    for other in (
        dataclasses.replace(basis, strokes=(*basis.strokes, near)),
        dataclasses.replace(basis, settings=basis.settings.model_copy(update={"reach_m": 100.0})),
        dataclasses.replace(basis, heights=lifted),
    ):
        assert Refiner(other, counting, cache).content(key) != tile.content
    assert before.content(TileKey(6, 9, 8)) != tile.content


def test_a_closed_run_harms_nothing_and_what_it_made_is_kept(engine: ClEngine, basis: Basis) -> None:
    """SPEC S53: stop between steps, resume cheaply."""
    keys, counting = patch(LOW + 3, 2, 2, 5), Counting(engine)
    expected = bits(made(Refiner(basis, counting, FieldCache()), keys))
    whole, counting.steps = counting.steps, 0
    refiner = Refiner(basis, counting, FieldCache())
    while counting.steps < whole - 1:
        run = refiner.tiles(keys)
        before = counting.steps
        while counting.steps == before:
            next(run)
        run.close()  # type: ignore[attr-defined]
    assert bits(made(refiner, keys)) == expected
    assert counting.steps == whole
    assert made(refiner, []) == {}
    assert list(made(refiner, [keys[0], keys[0]])) == [keys[0]]


def test_who_is_in_a_hurry_waits_for_no_device(engine: ClEngine, basis: Basis) -> None:
    """SPEC S53: None comes while the device works, however often, and changes no bit."""
    keys = patch(LOW + 3, 2, 2, 5)
    calm = list(Refiner(basis, engine, FieldCache()).tiles(keys))
    engine.clear()
    hasty: list[RefinedTile | None] = []
    calls = 0

    def urgent() -> bool:
        nonlocal calls
        calls += 1
        return calls % 3 > 0

    hasty = list(Refiner(basis, engine, FieldCache()).tiles(keys, urgent))
    assert hasty.count(None) - calm.count(None) == sum(k % 3 > 0 for k in range(1, calls + 1)) > 0
    assert [t and (t.key, t.heights.tobytes()) for t in hasty if t] == [
        t and (t.key, t.heights.tobytes()) for t in calm if t
    ]


def test_bands_of_bins_do_not_change_bits(engine: ClEngine, basis: Basis, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S51: what is rasterised at a stretch is only a matter of time."""
    keys = patch(LOW + 3, 2, 2, 3)
    expected = bits(made(Refiner(basis, engine, FieldCache()), keys))
    monkeypatch.setattr("esker.solve.refine.cl_engine.BAND_BINS", 20)
    engine.clear()
    assert bits(made(Refiner(basis, engine, FieldCache()), keys)) == expected


def test_no_step_is_longer_than_a_group(engine: ClEngine, basis: Basis) -> None:
    """SPEC S53: None after every step, so that solves take precedence."""
    counting = Counting(engine)
    seen = 0
    for item in Refiner(basis, counting, FieldCache()).tiles(patch(LOW + 3, 0, 0, 9)):
        assert counting.steps - seen <= 1
        seen = counting.steps
        assert item is None or not item.heights.flags.writeable


def test_pinned_borders_stay_pinned(solver: Solver, engine: ClEngine) -> None:
    """SPEC S54: the border is at its base on every level; beyond a free one the ground goes on."""
    across = [ridge((-500, 1000), (2000, 1300), 200, flank(), "across")]
    pinned = Refiner(settled(solver, across, PINNED, LOW), engine, FieldCache())
    free = Refiner(settled(solver, across, SETTINGS, LOW), engine, FieldCache())
    level = LOW + 2
    n = grid.samples(level)
    rows = slice(0, n)
    assert not pinned.window(level, rows, slice(0, 1)).any()
    assert not pinned.window(level, slice(n - 1, n), rows).any()
    assert free.window(level, rows, slice(0, 1)).max() > 50


@pytest.mark.parametrize(("scene", "most", "mean"), [("one", 5e-3, 3e-4), ("bare", 1.6e-2, 2e-3)])
def test_refined_heights_are_close_to_a_global_solve(
    solver: Solver, engine: ClEngine, scene: str, most: float, mean: float
) -> None:
    """SPEC S55: against solves of the finer level. Coarse grids: twice the error of 1025."""
    refiner = Refiner(settled(solver, SCENES[scene], SETTINGS, 3), engine, FieldCache())
    exact, n = solver.solve(SCENES[scene], SETTINGS, 4)[4], grid.samples(4)
    error = np.abs(refiner.window(4, slice(0, n), slice(0, n)) - exact) / np.ptp(exact)
    assert error.max() < most
    assert np.sqrt((error.astype(np.float64) ** 2).mean()) < mean


def test_flat_ground_stays_flat(solver: Solver, engine: ClEngine) -> None:
    """SPEC S9 above the global levels."""
    refiner = Refiner(settled(solver, [], SETTINGS, LOW), engine, FieldCache())
    assert not made(refiner, [TileKey(6, 11, 3)])[TileKey(6, 11, 3)].heights.any()


def test_the_finest_level_costs_what_is_looked_at(engine: ClEngine, basis: Basis) -> None:
    """SPEC S56: corner tiles of level 10 with memory for their neighbourhoods alone, and sharper than their parents."""
    refiner, last = Refiner(basis, engine, FieldCache()), (1 << MAX_REFINED_LEVEL) - 1
    keys = [TileKey(MAX_REFINED_LEVEL, x, y) for x in (0, last) for y in (0, last)]
    tracemalloc.start()
    tiles = made(refiner, keys)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 128 << 20
    corner = tiles[keys[0]].heights[0, 0], tiles[keys[3]].heights[-1, -1]
    assert corner == pytest.approx(
        (basis.heights[0, 0], basis.heights[-1, -1]), abs=0.02 * float(np.ptp(basis.heights))
    )


def test_windows_for_exports(engine: ClEngine, basis: Basis) -> None:
    """SPEC S56: any rectangle of samples, of the global levels too; wrong ones are refused."""
    refiner = Refiner(basis, engine, FieldCache())
    level = LOW + 2
    said: list[float] = []
    part = refiner.window(level, slice(70, 331), slice(129, 200), said.append)
    assert part.shape == (261, 71)
    assert said[-1] == 1.0
    assert said == sorted(said)
    tile = made(refiner, [TileKey(level, 2, 2)])[TileKey(level, 2, 2)].heights
    assert part[128 - 70 : 193 - 70, :64].tobytes() == np.ascontiguousarray(tile[:, 1:]).tobytes()
    coarse: NDArray[np.float32] = refiner.window(0, slice(3, 9), slice(0, 65))
    assert coarse.tobytes() == np.ascontiguousarray(basis.heights[::2, ::2][3:9]).tobytes()
    for wrong in (
        lambda: refiner.window(MAX_REFINED_LEVEL + 1, slice(0, 1), slice(0, 1)),
        lambda: refiner.window(2, slice(0, 9999), slice(0, 1)),
        lambda: refiner.window(2, slice(5, 5), slice(0, 1)),
        lambda: refiner.content(TileKey(LOW, 0, 0)),
        lambda: refiner.content(TileKey(3, 8, 0)),
        lambda: refiner.content(TileKey(MAX_REFINED_LEVEL + 1, 0, 0)),
    ):
        with pytest.raises(ValueError, match=r"level|tile|range"):
            wrong()


@pytest.mark.parametrize(
    ("weights", "low", "most"),
    [(gradient_weights, GRADIENT_LOW, 6e-3), (lambda: height_weights(FIRST_SWEEPS), 0.25, 4e-2)],
)
def test_the_sweeps_damp_what_they_promise(weights: Callable[[], NDArray[np.float64]], low: float, most: float) -> None:
    """Their polynomial is small in float32, in the order in which they are done, from the start and from the end."""
    at = np.linspace(0, 2, 8001).astype(np.float32)
    for order in (weights(), weights()[::-1]):
        product, growth = np.ones_like(at), 0.0
        for w in order.astype(np.float32):
            product = product * (1 - w * at)
            growth = max(growth, float(np.abs(product).max()))
        assert np.abs(product[at >= low]).max() < most
        assert growth < 400


@pytest.mark.parametrize("sweeps", [FIRST_SWEEPS, LAST_SWEEPS])
def test_the_sweeps_of_the_height_are_the_best_in_the_mean(sweeps: int) -> None:
    """SPEC S55: no polynomial of degree n with p(0) = 1 has a smaller integral of its square over [0, 2]."""
    nodes, shares = np.polynomial.legendre.leggauss(sweeps + 1)
    product = np.prod(1 - height_weights(sweeps)[:, None] * (1 + nodes), axis=0)
    assert (shares * product**2).sum() == pytest.approx(2 / (sweeps + 1) ** 2, rel=1e-9)


def test_steps_under_way_of_two_refiners_do_not_mix(engine: ClEngine, basis: Basis, solver: Solver) -> None:
    """SPEC S51, S53: rooms share an engine; what one has begun the other may push out, or nobody ever fetch."""
    other = settled(solver, SCENES["cross"], SETTINGS, LOW)
    keys = patch(LOW + 2, 0, 0, 8)
    expected = [bits(made(Refiner(start, engine, FieldCache()), keys)) for start in (basis, other)]
    refiners = [Refiner(start, engine, FieldCache()) for start in (basis, other)]
    runs = [refiner.tiles(keys) for refiner in refiners]
    found: list[dict[TileKey, RefinedTile]] = [{}, {}]
    lost = Refiner(basis, engine, FieldCache()).tiles(keys[::-1])
    for n in range(400):
        if n == 3:
            next(lost)
            del lost
        item = next(runs[n % 2], None)
        if item is not None:
            found[n % 2][item.key] = item
    assert [bits(tiles) for tiles in found] == expected
