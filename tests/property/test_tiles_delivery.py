"""Random solves, views and interruptions: what clients hold is whole, seamless and in the end the newest
(SPEC T7 to T14)."""

from __future__ import annotations

import random
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.contract import FrameKind, Predictor, View
from esker.grid import TileKey
from esker.tiles.codec.frame import read_frame
from esker.tiles.decoder import FrameDecoder
from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.plans import FramePlan

SIZE_M = 512.0
LEVELS = 4


class Ground:
    """A ground that edits change locally, seen at every level; previews of coarse levels are a little wrong."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        n = grid.samples(LEVELS)
        self.fine = np.zeros((n, n), dtype=np.float32)

    def edit(self) -> None:
        n = self.fine.shape[0]
        r, c, w = self.rng.randrange(n), self.rng.randrange(n), self.rng.choice([3, 9, 40, 200])
        window = self.fine[max(0, r - w) : r + w, max(0, c - w) : c + w]
        y, x = np.mgrid[0 : window.shape[0], 0 : window.shape[1]]
        bump = np.sin(np.pi * y / window.shape[0]) * np.sin(np.pi * x / window.shape[1])
        window += np.float32(self.rng.uniform(-30, 30)) * bump.astype(np.float32)

    def level(self, level: int, settled: bool) -> NDArray[np.float32]:
        out = self.fine[:: 1 << (LEVELS - level), :: 1 << (LEVELS - level)].copy()
        if not settled:
            out *= np.float32(1 - 0.02 * (LEVELS - level))
        return out


class Client:
    """A client's half on the server, and the decoder that the page would run."""

    def __init__(self, server: TileServer, rest_level: int = 4) -> None:
        self.server = server
        self.tiles = ClientTiles(server, rest_level)
        self.decoder = FrameDecoder()
        self.waiting: FramePlan | None = None
        self.log: list[tuple[FrameKind, int]] = []

    def begin(self) -> bool:
        """Plans a frame, as the room does before it hands the plan to an encoding thread."""
        if self.waiting is None:
            self.waiting = self.tiles.plan()
        return self.waiting is not None

    def finish(self) -> None:
        """The frame was coded and sent; the ground may have changed meanwhile."""
        plan = self.waiting
        if plan is None:
            return
        self.waiting = None
        self.decoder.decode(plan.encode())
        self.tiles.commit(plan)
        self.log.append((plan.kind, plan.level))
        self.check()

    def drain(self) -> None:
        self.finish()
        while self.begin():
            self.finish()

    def check(self) -> None:
        held = self.decoder.held
        assert self.tiles.held() == {k: t.version for k, t in held.items()}
        assert all(k.level == 0 or k.parent() in held for k in held)
        for key, tile in held.items():
            east, north = held.get(key._replace(x=key.x + 1)), held.get(key._replace(y=key.y + 1))
            assert east is None or np.array_equal(tile.samples[:, -1], east.samples[:, 0]), key
            assert north is None or np.array_equal(tile.samples[-1], north.samples[0]), key

    def check_newest(self) -> None:
        held = self.decoder.held
        for level, wanted in enumerate(self.tiles.wanted()):
            newest = self.server.pyramid.level(level)
            assert newest is not None
            for y, x in np.argwhere(wanted):
                assert TileKey(level, int(x), int(y)) in held
        for key, tile in held.items():
            newest = self.server.pyramid.level(key.level)
            assert newest is not None
            r, c = 64 * key.y, 64 * key.x
            assert np.array_equal(tile.samples, newest.samples[r : r + 65, c : c + 65])
            assert tile.version == newest.versions[key.y, key.x]


def a_view(rng: random.Random) -> View:
    eye = (rng.uniform(-200, 700), rng.uniform(-200, 700), rng.uniform(5, 400))
    target = (rng.uniform(0, 512), rng.uniform(0, 512), 0.0)
    return View(eye=eye, target=target, width=800, height=600, tau_px=rng.choice([0.5, 1.5, 4.0]))


def solve(server: TileServer, ground: Ground, clock: int, settled: bool, levels: Iterable[int]) -> None:
    for level in levels:
        server.put_level(clock, level, ground.level(level, settled), settled)


@pytest.mark.parametrize("seed", range(12))
def test_random_sessions_end_with_the_newest_ground(seed: int) -> None:
    rng = random.Random(seed)
    server, ground = TileServer(SIZE_M, LEVELS), Ground(rng)
    clients = [Client(server) for _ in range(3)]
    for clock in range(1, 22):
        ground.edit()
        for level in range(rng.choice([1, 2, 3, LEVELS + 1, LEVELS + 1])):
            server.put_level(clock, level, ground.level(level, False), False)
            for client in clients:
                if rng.random() < 0.5:
                    client.finish()
                if rng.random() < 0.6:
                    client.begin()
        for client in clients:
            if rng.random() < 0.3:
                client.tiles.set_view(a_view(rng))
            if rng.random() < 0.1:
                client.drain()
    solve(server, ground, 99, False, range(LEVELS + 1))
    solve(server, ground, 99, True, range(LEVELS + 1))
    for client in clients:
        client.drain()
        client.check_newest()
        assert client.tiles.plan() is None
        assert len(client.decoder.held) == sum(4**level for level in range(LEVELS + 1))


@pytest.mark.parametrize("seed", range(4))
def test_a_complete_preview_serves_every_wanted_tile(seed: int) -> None:
    rng = random.Random(1000 + seed)
    server, ground = TileServer(SIZE_M, LEVELS), Ground(rng)
    client = Client(server)
    client.tiles.set_view(a_view(rng))
    for clock in range(6):
        ground.edit()
        solve(server, ground, clock, False, range(LEVELS + 1))
        client.drain()
        client.check_newest()


def test_levels_go_coarse_to_fine_then_fills() -> None:
    rng = random.Random(5)
    server, ground = TileServer(SIZE_M, LEVELS), Ground(rng)
    for _ in range(6):
        ground.edit()
    solve(server, ground, 1, False, range(LEVELS + 1))
    client = Client(server)
    client.drain()
    assert client.log == [(FrameKind.LEVEL, 0), (FrameKind.LEVEL, 1), (FrameKind.LEVEL, 2)]
    client.log.clear()
    client.tiles.set_view(View(eye=(250.0, 200.0, 30.0), target=(260.0, 300.0, 0.0), tau_px=0.25))
    client.drain()
    assert client.log
    assert all(kind == FrameKind.FILL for kind, _ in client.log)
    assert [level for _, level in client.log] == sorted(level for _, level in client.log)


def test_fills_go_by_projected_error() -> None:
    rng = random.Random(6)
    server, ground = TileServer(SIZE_M, LEVELS), Ground(rng)
    for _ in range(8):
        ground.edit()
    client = Client(server, rest_level=-1)
    solve(server, ground, 1, True, range(LEVELS + 1))
    client.drain()
    view = View(eye=(250.0, 200.0, 30.0), target=(260.0, 300.0, 0.0), tau_px=0.25)
    client.tiles.set_view(view)
    plan = client.tiles.plan()
    assert plan is not None
    from esker.tiles.quadtree import select

    error = select(server.pyramid.bounds(), view)[1][plan.level]
    order = [float(error[k.y, k.x]) for k in plan.keys]
    assert len(order) > 3
    assert order == sorted(order, reverse=True)


def test_without_a_view_levels_0_to_2_and_nothing_else_while_unsettled() -> None:
    server, ground = TileServer(SIZE_M, LEVELS), Ground(random.Random(1))
    client = Client(server)
    assert client.tiles.plan() is None
    ground.edit()
    solve(server, ground, 1, False, range(LEVELS + 1))
    client.drain()
    assert {k.level for k in client.decoder.held} == {0, 1, 2}
    assert len(client.decoder.held) == 21


def test_an_overtaken_level_is_never_sent() -> None:
    server, ground = TileServer(SIZE_M, LEVELS), Ground(random.Random(2))
    for _ in range(5):
        ground.edit()
    client = Client(server)
    client.tiles.set_view(View(eye=(250.0, 200.0, 30.0), target=(260.0, 300.0, 0.0), tau_px=0.25))
    solve(server, ground, 1, False, range(LEVELS + 1))
    client.drain()
    before = {k: t.version for k, t in client.decoder.held.items() if k.level > 1}
    ground.fine += 5
    solve(server, ground, 2, False, range(LEVELS + 1))
    ground.fine += 5
    solve(server, ground, 3, False, range(2))
    client.drain()
    assert {k: t.version for k, t in client.decoder.held.items() if k.level > 1} == before
    solve(server, ground, 3, False, range(2, LEVELS + 1))
    client.drain()
    client.check_newest()


ABOVE = View(eye=(256.0, 256.0, 700.0), target=(256.0, 257.0, 0.0), tau_px=0.25)


def rough_everywhere() -> Ground:
    """Rough at the finest level only, so that a view from above wants every tile."""
    ground = Ground(random.Random(3))
    y, x = np.mgrid[0 : ground.fine.shape[0], 0 : ground.fine.shape[1]]
    ground.fine += np.where((x + y) % 2 == 0, 2.0, -2.0).astype(np.float32)
    ground.fine[::2, ::2] = 0
    return ground


def test_new_tiles_wait_where_their_ancestors_are_newer_and_only_there() -> None:
    """A fine tile of an old solve beside moved neighbours would crack; far from the edit it may go."""
    server, ground = TileServer(SIZE_M, LEVELS), rough_everywhere()
    client = Client(server)
    solve(server, ground, 1, False, range(LEVELS + 1))
    client.drain()
    ground.fine[:500, :500] += 50
    solve(server, ground, 2, False, range(2))
    client.drain()
    client.tiles.set_view(ABOVE)
    client.drain()
    fine = {(k.x, k.y) for k in client.decoder.held if k.level == 4}
    # Level 0 moved up to its sample 31, in block 7 (4 cells: one fine tile); a block more holds back level 3's tile 4.
    assert fine == {(x, y) for x in range(16) for y in range(16) if x > 9 or y > 9}
    solve(server, ground, 2, False, range(2, LEVELS + 1))
    client.drain()
    client.check_newest()
    assert sum(k.level == 4 for k in client.decoder.held) == 256


def test_new_tiles_wait_while_their_neighbours_are_of_an_older_put() -> None:
    server, ground = TileServer(SIZE_M, LEVELS), rough_everywhere()
    client = Client(server, rest_level=-1)
    client.tiles.set_view(View(eye=(100.0, 256.0, 20.0), target=(100.0, 257.0, 0.0), tau_px=4.0))
    solve(server, ground, 1, False, range(LEVELS + 1))
    client.drain()
    first = {k for k in client.decoder.held if k.level == 4}
    assert 0 < len(first) < 100
    ground.fine[:, :1000] += 3  # moves all tiles of levels 3 and 4 that are held, and more
    for level in (3, 4):
        server.put_level(2, level, ground.level(level, False), False)
    ground.fine[1024, 1024] += 90
    server.put_level(3, 0, ground.level(0, False), False)  # far away; yet it overtakes both levels
    client.tiles.set_view(ABOVE)
    client.drain()
    assert {k for k in client.decoder.held if k.level == 4} == first
    solve(server, ground, 3, False, range(LEVELS + 1))
    client.drain()
    client.check_newest()
    assert sum(k.level == 4 for k in client.decoder.held) == 256


def test_dropping_a_tile_drops_its_descendants() -> None:
    server, ground = TileServer(SIZE_M, LEVELS), Ground(random.Random(4))
    for _ in range(9):
        ground.edit()
    client = Client(server, rest_level=-1)
    client.tiles.set_view(View(eye=(100.0, 100.0, 30.0), target=(110.0, 140.0, 0.0), tau_px=0.25))
    solve(server, ground, 1, False, range(LEVELS + 1))
    client.drain()
    assert any(k.level == 4 for k in client.decoder.held)
    client.tiles.set_view(View(eye=(500.0, 500.0, 900.0), target=(1000.0, 1000.0, 1200.0)))
    ground.fine += 9
    solve(server, ground, 2, False, range(LEVELS + 1))
    client.drain()
    assert not any(k.level == 4 for k in client.decoder.held)
    client.check_newest()


def test_an_uncommitted_plan_changes_nothing_and_encodes_alike_in_any_thread() -> None:
    server, ground = TileServer(SIZE_M, LEVELS), Ground(random.Random(7))
    ground.edit()
    solve(server, ground, 1, False, range(LEVELS + 1))
    client = ClientTiles(server)
    plan = client.plan()
    assert plan is not None
    first = plan.encode()
    for _ in range(3):
        ground.edit()
    solve(server, ground, 2, True, range(LEVELS + 1))
    server.cache = type(server.cache)()
    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(lambda _: plan.encode(), range(12))) == {first}
    again = client.plan()
    assert again is not None
    assert again.level == 0
    assert again.clock == 2
    assert client.held() == {}


def predictors(plan: FramePlan) -> list[Predictor]:
    return [tile.predictor for tile in read_frame(plan.encode())[2]]


def test_a_local_change_is_coded_as_a_change() -> None:
    """The new tile is the old one moved along with its parent: what is left to send is small (SPEC T22)."""
    server, ground = TileServer(SIZE_M, LEVELS), rough_everywhere()
    ground.fine += np.random.default_rng(1).normal(size=ground.fine.shape).astype(np.float32)
    client = Client(server)
    solve(server, ground, 1, True, range(LEVELS + 1))
    client.drain()
    ground.fine[300:330, 300:330] += 3
    solve(server, ground, 2, True, range(LEVELS + 1))
    sizes = []
    while client.begin():
        assert client.waiting is not None
        assert set(predictors(client.waiting)) <= {Predictor.PREVIOUS, Predictor.HELD}
        sizes.append(len(client.waiting.encode()))
        client.finish()
    client.check_newest()
    assert sum(sizes) < 9000  # the same tiles coded afresh take 16 KB a level


def test_a_client_far_behind_is_served_afresh() -> None:
    """The server remembers a few past states only; tiles older than these are predicted from their parent."""
    server, ground = TileServer(SIZE_M, LEVELS), Ground(random.Random(10))
    for _ in range(5):
        ground.edit()
    solve(server, ground, 0, True, range(LEVELS + 1))
    client = Client(server)
    client.drain()
    for clock in range(1, 12):
        ground.fine += 1
        solve(server, ground, clock, True, range(LEVELS + 1))
    seen: set[Predictor] = set()
    while client.begin():
        assert client.waiting is not None
        seen |= set(predictors(client.waiting))
        client.finish()
    client.check_newest()
    assert seen == {Predictor.ZERO, Predictor.PARENT}


def test_changes_beyond_32_bits_are_coded_afresh() -> None:
    server = TileServer(SIZE_M, 1)
    client = Client(server)
    for clock, sign in enumerate((1, -1, 1)):
        for level in range(2):
            n = grid.samples(level)
            stripes = np.where(np.arange(n) % 2 == 0, 1e30, -1e30).astype(np.float32) * sign
            server.put_level(clock, level, np.broadcast_to(stripes, (n, n)).copy(), True)
        client.drain()
        client.check_newest()


def test_nothing_changed_means_nothing_sent() -> None:
    server, ground = TileServer(SIZE_M, LEVELS), Ground(random.Random(8))
    ground.edit()
    solve(server, ground, 1, True, range(LEVELS + 1))
    client = Client(server)
    client.drain()
    client.log.clear()
    for level in range(LEVELS + 1):
        assert server.put_level(2, level, ground.level(level, True), True) == 0
    client.drain()
    assert client.log == []


def test_levels_that_moved_with_their_parents_are_confirmed() -> None:
    """A fine level that ends where it was still needs its LEVEL frame: the page shows a preview of it."""
    server, ground = TileServer(SIZE_M, LEVELS), Ground(random.Random(9))
    for _ in range(4):
        ground.edit()
    solve(server, ground, 1, True, range(LEVELS + 1))
    client = Client(server)
    client.drain()
    client.log.clear()
    server.put_level(2, 0, ground.level(0, True) + 3, False)
    client.drain()
    solve(server, ground, 2, True, range(LEVELS + 1))
    client.drain()
    assert [(FrameKind.LEVEL, level) for level in range(1, LEVELS + 1)] == client.log[2:]
