"""Quantised levels, versions and bounds (SPEC T3, T7, T15, Q6)."""

from __future__ import annotations

import gc
import sys

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.contract import Predictor
from esker.grid import TileKey
from esker.tiles.codec.frame import TileRecord
from esker.tiles.codec.payload import SAMPLE_LIMIT
from esker.tiles.delivery import TileServer
from esker.tiles.ledger import state_of
from esker.tiles.plans import ENTRY_BYTES, EncodedTiles
from esker.tiles.pyramid import Pyramid, quantise

SIZE_M = 1024.0
LEVELS = 3
ROOT = TileKey(0, 0, 0)


def heights(level: int, seed: int = 0, scale: float = 40.0) -> NDArray[np.float32]:
    n = grid.samples(level)
    return (np.random.default_rng(seed).normal(size=(n, n)) * scale).astype(np.float32)


def filled(seed: int = 0) -> Pyramid:
    pyramid = Pyramid(SIZE_M, LEVELS)
    for level in range(LEVELS + 1):
        pyramid.settle(1, level, heights(level, seed + level))
    return pyramid


def test_quantisation_is_half_to_even_in_steps_of_a_256th_of_a_cell() -> None:
    q = grid.quantum(0, SIZE_M)
    assert q == 1024 / 64 / 256
    steps = np.array([0.5, 1.5, 2.5, -0.5, -1.5, 0.49, 0.51, 7.0], dtype=np.float32)
    h = np.zeros((65, 65), dtype=np.float32)
    h[0, :8] = steps * np.float32(q)
    assert quantise(h, 0, SIZE_M)[0, :8].tolist() == [0, 2, 2, 0, -2, 0, 1, 7]


def test_quantisation_saturates() -> None:
    h = np.zeros((65, 65), dtype=np.float32)
    h[0, 0], h[0, 1] = 3e38, -3e38
    assert quantise(h, 0, SIZE_M)[0, :2].tolist() == [SAMPLE_LIMIT, -SAMPLE_LIMIT]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_heights_that_are_not_finite_are_refused_and_change_nothing(bad: float) -> None:
    pyramid = filled()
    before, stamp = pyramid.level(1), pyramid.stamp
    h = heights(1, 77)
    h[5, 6] = bad
    with pytest.raises(ValueError, match="not finite"):
        pyramid.preview(2, 1, h)
    assert pyramid.level(1) is before
    assert pyramid.stamp == stamp


def test_wrong_levels_and_shapes_are_refused() -> None:
    pyramid = Pyramid(SIZE_M, LEVELS)
    with pytest.raises(ValueError, match="level 4"):
        pyramid.preview(1, 4, heights(4))
    with pytest.raises(ValueError, match="65x65"):
        pyramid.preview(1, 0, heights(1))


def test_a_preview_moves_samples_in_steps_and_settling_to_where_they_belong() -> None:
    q = np.float32(grid.quantum(0, SIZE_M))
    pyramid = Pyramid(SIZE_M, 0)
    base = np.full((65, 65), 10 * q, dtype=np.float32)
    pyramid.preview(1, 0, base)
    moved = base.copy()
    moved[3, 3] += np.float32(7.9) * q
    assert pyramid.preview(2, 0, moved) == 0
    moved[4, 4] += np.float32(8.1) * q
    moved[5, 5] -= np.float32(21) * q
    assert pyramid.preview(3, 0, moved) == 1
    level = pyramid.level(0)
    assert level is not None
    assert [int(level.samples[i, i]) for i in (3, 4, 5)] == [10, 18, 10 - 24]
    assert pyramid.settle(4, 0, moved) == 1
    level = pyramid.level(0)
    assert level is not None
    assert [int(level.samples[i, i]) for i in (3, 4, 5)] == [18, 18, -11]
    assert np.array_equal(level.samples, quantise(moved, 0, SIZE_M))


@pytest.mark.parametrize(
    ("row", "col", "changed"),
    [
        (10, 10, {(0, 0)}),
        (64, 10, {(0, 0), (0, 1)}),
        (10, 64, {(0, 0), (1, 0)}),
        (64, 64, {(0, 0), (0, 1), (1, 0), (1, 1)}),
        (512, 512, {(7, 7)}),
        (0, 512, {(7, 0)}),
        (128, 511, {(7, 1), (7, 2)}),
    ],
)
def test_versions_change_where_samples_do_and_nowhere_else(row: int, col: int, changed: set[tuple[int, int]]) -> None:
    pyramid = Pyramid(SIZE_M, LEVELS)
    h = heights(LEVELS)
    assert pyramid.settle(1, LEVELS, h) == 64
    before = pyramid.level(LEVELS)
    h[row, col] += 5
    assert pyramid.settle(2, LEVELS, h) == len(changed)
    after = pyramid.level(LEVELS)
    assert before is not None
    assert after is not None
    assert {(int(x), int(y)) for y, x in np.argwhere(before.versions != after.versions)} == changed
    assert after.versions.max() == after.changed == after.stamp
    assert not after.samples.flags.writeable


def test_an_unchanged_level_keeps_its_samples_and_versions_but_is_newer() -> None:
    pyramid = filled()
    before = pyramid.level(2)
    assert pyramid.settle(5, 2, heights(2, 2)) == 0
    after = pyramid.level(2)
    assert before is not None
    assert after is not None
    assert after.stored is before.stored
    assert after.stamp > before.stamp
    assert after.changed == before.changed
    assert after.clock == 5


def brute(pyramid: Pyramid, key: TileKey) -> tuple[float, float, float]:
    """Lowest, highest and largest error of a tile and all its descendants, sample by sample."""
    q = grid.quantum(key.level, SIZE_M)
    level = pyramid.level(key.level)
    assert level is not None
    r, c = 64 * key.y, 64 * key.x
    mine = level.samples[r : r + 65, c : c + 65] * q
    low, high, error = float(mine.min()), float(mine.max()), 0.0
    parent = pyramid.level(key.level - 1) if key.level else None
    if parent is not None:
        p = parent.samples * (2 * q)
        at = np.arange(65) / 2
        rows, cols = r / 2 + at, c / 2 + at
        r0, r1 = np.floor(rows).astype(int), np.ceil(rows).astype(int)
        c0, c1 = np.floor(cols).astype(int), np.ceil(cols).astype(int)
        drawn = (p[np.ix_(r0, c0)] + p[np.ix_(r0, c1)] + p[np.ix_(r1, c0)] + p[np.ix_(r1, c1)]) / 4
        error = float(np.abs(mine - drawn).max())
    if key.level < LEVELS:
        for child in key.children():
            below = brute(pyramid, child)
            low, high, error = min(low, below[0]), max(high, below[1]), max(error, below[2])
    return low, high, error


def assert_bounds(pyramid: Pyramid) -> None:
    bounds = pyramid.bounds()
    for level in range(LEVELS + 1):
        for key in grid.tiles(level):
            i = bounds.starts[level] + (key.y << level) + key.x
            low, high, error = brute(pyramid, key)
            assert bounds.low[i] == pytest.approx(low, abs=1e-3)
            assert bounds.high[i] == pytest.approx(high, abs=1e-3)
            assert error - 1e-3 <= bounds.error[i] <= error + grid.quantum(0, SIZE_M)
            ground = grid.tile_rect(key, SIZE_M)
            assert bounds.x[i] - bounds.half[i] == ground.x0
            assert bounds.y[i] + bounds.half[i] == ground.y1
            assert bounds.spacing[i] == grid.spacing(level, SIZE_M)


def test_bounds_hold_every_sample_and_every_error_also_after_local_edits() -> None:
    pyramid = filled()
    assert_bounds(pyramid)
    for level in range(LEVELS + 1):
        h = heights(level, level)
        n = h.shape[0]
        h[n // 3, n // 5 : n // 5 + 4] += 500
        pyramid.settle(2, level, h)
    assert_bounds(pyramid)
    coarse = heights(1, 1)
    coarse[20, 20] -= 900  # changes the error of level 2, whose own samples stay
    pyramid.settle(3, 1, coarse)
    assert_bounds(pyramid)


def test_levels_that_were_never_put_are_not_valid() -> None:
    pyramid = Pyramid(SIZE_M, LEVELS)
    pyramid.preview(1, 0, heights(0))
    pyramid.preview(1, 1, heights(1))
    assert pyramid.bounds().valid.tolist() == [True] * 5 + [False] * 80


def test_the_cache_of_coded_tiles_is_bounded_and_forgets_the_oldest() -> None:
    limit = 10 * (100 + ENTRY_BYTES)
    cache = EncodedTiles(limit)
    for i in range(30):
        cache.put((0, *ROOT, i, 0, 0, 0), TileRecord(0, 0, Predictor.ZERO, 0, i, 0, bytes(100)))
        assert cache.get((0, *ROOT, 0, 0, 0, 0)) is not None  # used again and again, so it stays
    assert cache.bytes <= limit
    assert cache.get((0, *ROOT, 1, 0, 0, 0)) is None
    assert cache.get((0, *ROOT, 29, 0, 0, 0)) == TileRecord(0, 0, Predictor.ZERO, 0, 29, 0, bytes(100))


def test_the_garbage_collector_does_not_go_through_coded_tiles() -> None:
    """SPEC S593: records and keys of small tiles held the whole server up for a third of a second."""
    cache = EncodedTiles()
    for i in range(100):
        cache.put((0, *ROOT, i, 0, 0, 0), TileRecord(0, 0, Predictor.ZERO, 0, i, 0, bytes(10)))
    gc.collect()
    assert not any(gc.is_tracked(held) for entry in cache._items.items() for held in entry)
    assert cache.bytes >= sum(sys.getsizeof(held) for entry in cache._items.items() for held in entry)


def test_small_tiles_count_for_what_they_take() -> None:
    """SPEC S593: payloads of ten bytes were as many as three million in a room before they counted."""
    cache = EncodedTiles(limit=100 * ENTRY_BYTES)
    for i in range(1000):
        cache.put((0, *ROOT, i, 0, 0, 0), TileRecord(0, 0, Predictor.ZERO, 0, i, 0, b""))
    assert len(cache._items) == 100


def test_clients_share_coded_tiles() -> None:
    from esker.tiles.delivery import ClientTiles

    server = TileServer(SIZE_M, LEVELS)
    for level in range(LEVELS + 1):
        server.put_level(1, level, heights(level, level), True)
    plans = []
    for _ in range(2):
        client = ClientTiles(server)
        while (plan := client.plan()) is not None:
            plans.append(plan.encode())
            client.commit(plan)
    half = len(plans) // 2
    assert plans[:half] == plans[half:]
    assert server.cache.bytes - ENTRY_BYTES * len(server.cache._items) < sum(len(p) for p in plans[:half])


def test_earlier_states_of_levels_are_kept_only_while_somebody_holds_tiles_of_them() -> None:
    """SPEC S588: a client that is behind is told of its tiles as a change; when all have the newest nothing is kept."""
    from esker.tiles.delivery import ClientTiles

    server = TileServer(SIZE_M, LEVELS)
    quick, slow = ClientTiles(server), ClientTiles(server)

    def put(clock: int) -> None:
        for level in range(LEVELS + 1):
            server.put_level(clock, level, heights(level, level) + np.float32(clock), True)

    def served(client: ClientTiles) -> int:
        size = 0
        while (plan := client.plan()) is not None:
            size += len(plan.encode()) if plan.level < LEVELS else 0
            client.commit(plan)
        return size

    def earlier() -> list[int]:
        return [len(server.pyramid.states(level)) - 1 for level in range(LEVELS + 1)]

    put(1)
    whole = served(quick), served(slow)
    assert server.forget_earlier([quick, slow]) == 0
    put(2)
    put(3)
    served(quick)
    assert earlier() == [2] * (LEVELS + 1)
    assert server.forget_earlier([quick, slow]) == LEVELS + 1
    assert earlier() == [1] * (LEVELS + 1), "the states that the slow one has"
    assert served(slow) < 0.01 * whole[1], "told as a change"
    server.forget_earlier([quick, slow])
    assert earlier() == [0] * (LEVELS + 1)
    put(4)
    assert server.forget_earlier([]) == LEVELS + 1, "nobody is there"


@pytest.mark.parametrize("amplitude", [1, 900], ids=["fits in 16 bits", "does not fit everywhere"])
def test_levels_that_rest_take_half_of_the_memory_and_say_the_same(amplitude: int) -> None:
    """SPEC S592: previews and settled levels, in bursts with rests between, give the bytes that they give without."""
    from esker.tiles.delivery import ClientTiles

    servers = [TileServer(SIZE_M, 3), TileServer(SIZE_M, 3)]
    clients = [ClientTiles(server) for server in servers]

    def said(client: ClientTiles) -> bytes:
        frames = b""
        while (plan := client.plan()) is not None:
            frames += plan.encode()
            client.commit(plan)
        return frames

    for clock, settled in enumerate((True, False, False, True, False), start=1):
        for level in range(4):
            ground = heights(level, level) * np.float32(amplitude) + np.float32(500 + clock)
            for server in servers:
                server.put_level(clock, level, ground.copy(), settled)
            assert said(clients[0]) == said(clients[1])
        servers[0].pyramid.narrow()
        stored = [state.stored.dtype for level in range(4) for state in servers[0].pyramid.states(level)[:1]]
        assert stored[3] == (np.int16 if amplitude == 1 else np.int32)
        assert stored[0] == np.int32, "what is small stays"
        narrow, wide = (server.heights(3) for server in servers)
        assert narrow is not None
        assert wide is not None
        assert np.array_equal(narrow, wide)
    assert (servers[0].pyramid.bounds().low == servers[1].pyramid.bounds().low).all()


def test_a_level_at_rest_is_known_to_be_the_one_that_its_children_followed() -> None:
    """SPEC S592: else every first preview after a rest would look for what had moved."""
    pyramid = Pyramid(SIZE_M, 3)
    for level in range(4):
        pyramid.settle(1, level, heights(level, level))
    pyramid.narrow()
    assert pyramid._parents[3] is not None
    now = pyramid.level(2)
    assert now is not None
    assert now.stored.dtype == np.int16
    assert pyramid._parents[3].stored is now.stored


@pytest.mark.parametrize("rests", [False, True])
def test_all_clients_hold_one_copy_of_a_tile_that_others_are_refined_from(rests: bool) -> None:
    """SPEC S592: a tile of a level at rest is made anew whenever somebody asks for it."""
    server = TileServer(SIZE_M, LEVELS, LEVELS + 1)
    for level in range(LEVELS + 1):
        server.put_level(1, level, heights(level, level), True)
    if rests:
        server.pyramid.narrow()
    finest, key = server.pyramid.level(LEVELS), TileKey(LEVELS, 1, 2)
    assert finest is not None
    first, second = (server.refined.kept(key, state_of(finest, key)) for _ in range(2))
    assert first is second
    assert first.samples.base is None, "it keeps no whole level"
    assert np.array_equal(first.samples, finest.samples[128:193, 64:129])


def test_a_pyramid_knows_where_its_ground_last_changed() -> None:
    pyramid = Pyramid(SIZE_M, 2)
    for level in range(3):
        pyramid.settle(1, level, np.zeros((grid.samples(level),) * 2, dtype=np.float32))
    first = pyramid.changes().copy()
    h = np.zeros((grid.samples(2),) * 2, dtype=np.float32)
    h[10, 10] = 5
    pyramid.settle(2, 2, h)
    assert (pyramid.changes() > first).tolist() == [[y == x == 0 for x in range(4)] for y in range(4)]
