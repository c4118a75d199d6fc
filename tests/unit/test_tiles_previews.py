"""Previews that agree over the levels, and that cost what is new (SPEC T3, T34, T35, T53)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from esker import grid
from esker.contract import View
from esker.tiles.codec.frame import read_frame
from esker.tiles.codec.payload import SAMPLE_LIMIT, follow, predict
from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.pyramid import PREVIEW_STEP, Level, Pyramid, follow_parents
from esker.tiles.stabiliser import moved_along

SIZE_M = 1024.0
LEVELS = 3
Heights = NDArray[np.float32]


def step(index: int) -> int:
    """Quanta in which a preview changes a level."""
    return max(1, PREVIEW_STEP >> (LEVELS - index))


def ground(level: int, height: float, wrong: float = 0.0) -> Heights:
    """A hill on waves; ``wrong``: by how much of its height a coarse level misses the hill."""
    n = grid.samples(level)
    y, x = np.mgrid[0:n, 0:n] * (SIZE_M / (n - 1))
    hill = height * (1 - wrong) * np.exp(-((x - 400) ** 2 + (y - 300) ** 2) / 140**2)
    return np.asarray(30 * np.sin(x / 60) * np.cos(y / 45) + hill, dtype=np.float32)


def level(pyramid: Pyramid, index: int) -> Level:
    found = pyramid.level(index)
    assert found is not None
    return found


def solve(pyramid: Pyramid, clock: int, height: float, *, show: bool, settle: bool = False) -> None:
    for index in range(LEVELS + 1):
        wrong = 0.05 * (LEVELS - index)
        (pyramid.preview if show or index in (0, LEVELS) else pyramid.note)(clock, index, ground(index, height, wrong))
    for index in range(LEVELS + 1) if settle else ():
        pyramid.settle(clock, index, ground(index, height))


@pytest.fixture
def settled() -> Pyramid:
    pyramid = Pyramid(SIZE_M, LEVELS)
    solve(pyramid, 1, 100.0, show=True, settle=True)
    return pyramid


def test_a_preview_that_is_not_shown_changes_nothing_until_the_finest_brings_its_injection(settled: Pyramid) -> None:
    before = [level(settled, index) for index in range(LEVELS + 1)]
    for index in (1, 2):
        settled.note(2, index, ground(index, 130.0, 0.2))
        assert level(settled, index) is before[index]
    settled.preview(2, LEVELS, ground(LEVELS, 130.0))
    stamps = [level(settled, index).stamp for index in range(LEVELS + 1)]
    assert stamps == sorted(stamps), "coarse before fine"
    for index in range(LEVELS + 1):
        quantum = grid.quantum(index, SIZE_M)
        off = np.abs(level(settled, index).samples * quantum - ground(index, 130.0)).max() / quantum
        assert off <= step(index) + 0.05, "injected, not as solved there"
        assert level(settled, index).clock == 2


def test_a_coarse_preview_that_was_shown_stays_as_it_was_shown(settled: Pyramid) -> None:
    solve(settled, 2, 130.0, show=True)
    shown = [level(settled, index).samples.copy() for index in range(LEVELS)]
    settled.preview(2, LEVELS, ground(LEVELS, 130.0))
    for index in range(LEVELS):
        np.testing.assert_array_equal(level(settled, index).samples, shown[index])


def test_a_finest_preview_keeps_what_a_newer_coarsest_one_has_moved(settled: Pyramid) -> None:
    """SPEC T53."""
    for clock, height in ((2, 120.0), (3, 150.0), (4, 160.0)):  # 3 and 4 are drawn while 2 is solved
        settled.preview(clock, 0, ground(0, height))
    coarse = level(settled, 0)
    settled.preview(2, LEVELS, ground(LEVELS, 120.0))
    assert level(settled, 0) is coarse, "what is newer is not taken back"
    finest = level(settled, LEVELS)
    assert finest.clock == 2
    assert finest.stamp > coarse.stamp, "it may be sent"
    quantum = grid.quantum(LEVELS, SIZE_M)
    off = np.abs(finest.samples * quantum - ground(LEVELS, 160.0)).max()
    assert off < 0.02 * 40, "40 m, as smooth as level 0 can say them"
    for index in range(1, LEVELS):
        apart = 1 << (LEVELS - index)
        injected = finest.samples[::apart, ::apart] * quantum
        off = np.abs(level(settled, index).samples * grid.quantum(index, SIZE_M) - injected).max()
        assert off < (2 * PREVIEW_STEP + 0.6) * quantum
    settled.preview(4, LEVELS, ground(LEVELS, 160.0))
    assert level(settled, 0) is not coarse or level(settled, 0).clock == 4
    assert (
        np.abs(level(settled, LEVELS).samples * quantum - ground(LEVELS, 160.0)).max() <= (PREVIEW_STEP + 0.1) * quantum
    )


def test_a_finest_preview_without_a_coarsest_one_of_its_own_is_shown_as_it_is(settled: Pyramid) -> None:
    settled.preview(3, 0, ground(0, 150.0))
    settled.preview(2, LEVELS, ground(LEVELS, 120.0))
    quantum = grid.quantum(LEVELS, SIZE_M)
    assert (
        np.abs(level(settled, LEVELS).samples * quantum - ground(LEVELS, 120.0)).max() <= (PREVIEW_STEP + 0.1) * quantum
    )
    assert level(settled, 0).clock == 2


@pytest.mark.parametrize("at", [(30, 30), (0, 0), (64, 10), (5, 64)])
def test_what_level_0_moves_is_interpolated_as_tiles_are(at: tuple[int, int]) -> None:
    then = np.zeros((65, 65), dtype=np.int32)
    now = then.copy()
    now[at] = 4096
    heights = np.zeros((129, 129), dtype=np.float32)
    assert moved_along(heights, then, then, 0.5) is heights
    found = moved_along(heights, then, now, 0.5)
    np.testing.assert_array_equal(found[::2, ::2], now * np.float32(0.5))
    inner = np.s_[4:-4, 4:-4]  # beside the domain's border tiles are predicted one-sidedly
    np.testing.assert_allclose(found[inner], predict(now)[inner] * 0.25, atol=0.5)


def test_levels_that_move_go_before_a_new_selection(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC T54."""
    server = TileServer(SIZE_M, LEVELS)
    client = ClientTiles(server, rest_level=-1)
    client.set_view(View(eye=(400, -300, 500), target=(400, 300, 0), tau_px=0.5))
    solve(server.pyramid, 1, 100.0, show=True, settle=True)
    _drain(client)
    solve(server.pyramid, 2, 150.0, show=False)
    selected = []
    monkeypatch.setattr(ClientTiles, "_select", lambda _, view: selected.append(view))
    for level in range(LEVELS + 1):
        plan = client.plan(hurry=True)
        assert plan is not None
        assert plan.level == level
        client.commit(plan)
    assert client.plan(hurry=True) is None
    assert not selected
    client.plan()
    assert len(selected) == 1, "in a hurry it was not forgotten"


def test_agreeing_previews_cost_a_fraction_of_the_bytes() -> None:
    spent = []
    for show in (True, False):
        server = TileServer(SIZE_M, LEVELS)
        client = ClientTiles(server, rest_level=-1)
        client.set_view(View(eye=(400, -300, 500), target=(400, 300, 0), tau_px=0.5))
        solve(server.pyramid, 1, 100.0, show=show, settle=True)
        _drain(client)
        total = 0
        for clock in range(2, 8):
            solve(server.pyramid, clock, 100.0 + 5 * clock, show=show)
            total += _drain(client)
        spent.append(total)
    assert spent[1] < 0.7 * spent[0]


def _drain(client: ClientTiles) -> int:
    total = 0
    while (plan := client.plan()) is not None:
        data = plan.encode()
        read_frame(data)
        total += len(data)
        client.commit(plan)
    return total


def _level(index: int, samples: NDArray[np.int32], stamp: int, old: Level | None = None) -> Level:
    side = 1 << index
    versions = np.full((side, side), stamp, dtype=np.uint32)
    if old is not None:
        for y in range(side):
            for x in range(side):
                place = np.s_[64 * y : 64 * y + 65, 64 * x : 64 * x + 65]
                if np.array_equal(old.samples[place], samples[place]):
                    versions[y, x] = old.versions[y, x]
    return Level(index, samples, versions, stamp, stamp, stamp, False)


@given(st.integers(0, 2**32 - 1), st.integers(0, 1), st.sampled_from([10, 3000, SAMPLE_LIMIT]))
@hypothesis_settings(max_examples=25, deadline=None)
def test_a_level_follows_its_parents_as_every_decoder_does(seed: int, patches: int, scale: int) -> None:
    rng = np.random.default_rng(seed)
    samples = rng.integers(-scale, scale, (257, 257), dtype=np.int32, endpoint=True)
    then = _level(1, rng.integers(-scale, scale, (129, 129), dtype=np.int32, endpoint=True), 1)
    moved = then.samples.copy()
    for _ in range(patches + 1):
        r, c = rng.integers(0, 120, 2)
        moved[r : r + 9, c : c + 9] = rng.integers(-scale, scale, moved[r : r + 9, c : c + 9].shape)
    now = _level(1, moved, 2, then)
    found = follow_parents(samples, then, now)
    for y in range(4):
        for x in range(4):
            place = np.s_[64 * y : 64 * y + 65, 64 * x : 64 * x + 65]
            above = np.s_[64 * (y // 2) : 64 * (y // 2) + 65, 64 * (x // 2) : 64 * (x // 2) + 65]
            want = follow(samples[place], then.samples[above], now.samples[above], x, y)
            np.testing.assert_array_equal(found[place], np.clip(want, -SAMPLE_LIMIT, SAMPLE_LIMIT))


def test_errors_of_previews_are_bounded_however_long_one_draws(settled: Pyramid) -> None:
    for clock in range(2, 20):
        solve(settled, clock, 100.0 + 3.1 * clock, show=False)
    for index in range(1, LEVELS + 1):
        quantum = grid.quantum(index, SIZE_M)
        want = ground(index, 100.0 + 3.1 * 19) / quantum
        assert np.abs(level(settled, index).samples - want).max() <= step(index) + 0.05
    solve(settled, 20, 120.0, show=False, settle=True)
    for index in range(LEVELS + 1):
        want = np.rint(ground(index, 120.0) / np.float32(grid.quantum(index, SIZE_M)))
        np.testing.assert_array_equal(level(settled, index).samples, want)
