"""Store, selection and delivery of tiles above the global levels (SPEC T24 to T32, Q7, Q8)."""

from __future__ import annotations

import random

import numpy as np
import pytest

from esker import grid
from esker.contract import MAX_REFINED_LEVEL, MAX_REFINED_TILES, FrameKind, Predictor, View
from esker.grid import TileKey
from esker.tiles import sparse
from esker.tiles.codec.frame import read_frame
from esker.tiles.delivery import ClientTiles, TileServer
from tests.cones import FINEST, LEVELS, SIZE_M, Bump, Client, Ground, Made, near, settle, solve

TIP = Bump(200.0, 300.0, 40.0, 60.0)
LOOK = near(200.0, 275.0, 40.0, tau_px=0.7)


def at_rest(view: object = LOOK, finest: int = FINEST, **limits: int) -> tuple[TileServer, Ground, Client]:
    """A client that has all that it wants of one cone."""
    server, ground = TileServer(SIZE_M, LEVELS, finest, **limits), Ground([TIP])
    client = Client(server)
    client.tiles.set_view(view)  # type: ignore[arg-type]
    solve(server, ground, 1, True)
    settle(server, ground, 1, [client])
    client.check_newest(ground)
    client.log.clear()
    return server, ground, client


def levels_of(client: Client) -> list[int]:
    return [sum(k.level == level for k in client.decoder.held) for level in range(FINEST + 1)]


def test_what_a_view_shows_comes_before_what_a_step_nearer_shows() -> None:
    """SPEC T12."""
    rng, levels = random.Random(3), 4
    server = TileServer(SIZE_M, levels)
    bumps = [Bump(rng.uniform(0, SIZE_M), rng.uniform(0, SIZE_M), 30.0, rng.uniform(0.5, 3.0)) for _ in range(60)]
    for level in range(levels + 1):
        server.put_level(1, level, Ground(bumps).level(level), True)
    client = ClientTiles(server, rest_level=-1)
    client.set_view(View(eye=(256, -150, 120), target=(256, 256, 0), width=800, height=600, tau_px=1.0))
    came: list[TileKey] = []
    while (plan := client.plan()) is not None:
        came += plan.keys
        client.commit(plan)
    shown = {TileKey(level, int(x), int(y)) for level, m in enumerate(client.shown()) for y, x in np.argwhere(m)}
    wanted = {TileKey(level, int(x), int(y)) for level, m in enumerate(client.wanted()) for y, x in np.argwhere(m)}
    assert set(came) == wanted
    assert 21 < len(shown) < len(wanted)
    assert set(came[: len(shown)]) == shown


# --- what is wanted ---------------------------------------------------------------------------------------------------


def test_crests_are_refined_to_the_finest_level_and_only_where_one_looks() -> None:
    _, _, client = at_rest()
    counts = levels_of(client)
    assert all(counts[LEVELS + 1 :])
    assert counts[FINEST] < 60, "the whole level has 4096"
    finest = [k for k in client.decoder.held if k.level == FINEST]
    width = SIZE_M / (1 << FINEST)
    assert all(np.hypot((k.x + 0.5) * width - TIP.x, (k.y + 0.5) * width - TIP.y) < 60 for k in finest)


def test_smooth_land_is_looked_into_once_and_not_sent() -> None:
    """A dome: its error falls to a quarter a level, so half the parent's is no good guess."""
    server = TileServer(SIZE_M, LEVELS, FINEST)

    class Dome(Ground):
        def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return np.asarray(-((x - 256) ** 2 + (y - 256) ** 2) / 100, dtype=np.float32)

    ground, client = Dome(), Client(server)
    client.tiles.set_view(near(200.0, 280.0, 40.0))
    solve(server, ground, 1, True)
    made = settle(server, ground, 1, [client])
    assert 0 < made < 40
    assert levels_of(client)[FINEST] == 0
    assert settle(server, ground, 1, [client]) == 0


def test_flat_land_is_never_refined() -> None:
    server, ground = TileServer(SIZE_M, LEVELS, FINEST), Ground()
    client = Client(server)
    client.tiles.set_view(near(200.0, 280.0, 1.8))
    solve(server, ground, 1, True)
    assert settle(server, ground, 1, [client]) == 0


@pytest.mark.parametrize("levels", [LEVELS, 4])
@pytest.mark.parametrize("seed", range(4))
def test_the_selection_is_closed_under_parents_and_restricted(seed: int, levels: int) -> None:
    rng = random.Random(seed)
    server, ground = TileServer(SIZE_M, levels, FINEST), Ground()
    for _ in range(6):
        ground.edit(rng)
    ground.bumps.append(TIP)
    client = ClientTiles(server)
    client.set_view(near(200.0, 275.0, 50.0, rng.uniform(-0.5, 0.5), tau_px=0.5))
    solve(server, ground, 1, True, range(levels + 1))
    while requests := server.requests([client])[0]:
        assert all(server.put_tile(1, ground.tile(key)) for key in requests)
    wanted, below = client.wanted_refined(), client.wanted()
    assert wanted
    for key in wanted:
        up = key.parent()
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                x, y = up.x + dx, up.y + dy
                if 0 <= x < 1 << up.level and 0 <= y < 1 << up.level:
                    assert TileKey(up.level, x, y) in wanted if up.level > levels else below[levels][y, x]
    for level in range(1, levels + 1):
        for y, x in np.argwhere(below[level]):
            assert below[level - 1][y >> 1, x >> 1]


def test_requests_go_coarse_to_fine_then_by_screen_error_and_after_their_parents() -> None:
    server, ground = TileServer(SIZE_M, LEVELS, FINEST), Ground([TIP, Bump(220.0, 330.0, 9.0, 4.0)])
    client = ClientTiles(server)
    client.set_view(LOOK)
    solve(server, ground, 1, True)
    seen: list[int] = []
    while requests := server.requests([client])[0]:
        assert [k.level for k in requests] == sorted(k.level for k in requests)
        errors = dict(client.missing())
        for level in {k.level for k in requests}:
            here = [errors[k] for k in requests if k.level == level]
            assert here == sorted(here, reverse=True)
        for key in requests:
            assert key.level == LEVELS + 1 or server.refined.get(key.parent()) or key.parent() in requests
            server.put_tile(1, ground.tile(key))
        seen += [k.level for k in requests]
    assert set(seen) == set(range(LEVELS + 1, FINEST + 1))


@pytest.mark.parametrize("eye_m", [6.0, 40.0])
def test_several_unknown_levels_are_requested_at_once_near_a_crest(
    eye_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC Q7: fewer rounds than levels, the same tiles wanted in the end, and few made for nothing."""

    def made(likely: float) -> tuple[int, int, set[TileKey]]:
        monkeypatch.setattr(sparse, "LIKELY", likely)
        server, ground = TileServer(SIZE_M, LEVELS, FINEST), Ground([TIP, Bump(220.0, 330.0, 9.0, 4.0)])
        client = ClientTiles(server)
        client.set_view(near(200.0, 275.0, eye_m, tau_px=0.7))
        solve(server, ground, 1, True)
        rounds = 0
        while requests := server.requests([client])[0]:
            rounds += 1
            assert all(server.put_tile(1, ground.tile(key)) for key in requests)
        return rounds, len(server.refined), client.wanted_refined()

    guessed, one_by_one = made(sparse.LIKELY), made(np.inf)
    assert one_by_one[0] >= FINEST - LEVELS
    assert guessed[0] < one_by_one[0]
    assert guessed[1] < 1.25 * one_by_one[1]
    assert guessed[2] == one_by_one[2]


def test_clients_requests_are_merged() -> None:
    server, ground = TileServer(SIZE_M, LEVELS, FINEST), Ground([TIP])
    clients = [ClientTiles(server) for _ in range(3)]
    for client, view in zip(clients, (LOOK, LOOK, near(100.0, 300.0, 5.0, turn=1.57)), strict=True):
        client.set_view(view)
    solve(server, ground, 1, True)
    requests, count = server.requests(clients)
    assert len(requests) == len(set(requests)) == count
    assert set(requests) == {key for client in clients for key, _ in client.missing()}


def test_nothing_is_wanted_while_the_ground_moves() -> None:
    server, ground, client = at_rest()
    client.tiles.set_view(near(220.0, 320.0, 5.0))
    assert server.requests([client.tiles])[0]
    solve(server, ground, 2, False, range(1))
    assert server.requests([client.tiles]) == ((), 0)
    assert not server.put_tile(1, ground.tile(TileKey(LEVELS + 1, 3, 4)))


def test_a_preview_that_is_only_noted_ends_nothing() -> None:
    """The worker holds back coarse previews that the finest follows at once (docs/decisions/0014)."""
    server, ground, client = at_rest()
    epoch = server.refined.epoch
    server.note(2, 0, ground.level(0, False))
    assert (server.refined.active, server.refined.epoch, server.refined.clock) == (True, epoch, 1)
    assert server.requests([client.tiles]) == ((), 0), "what was made is still right"
    server.put_level(2, LEVELS, ground.level(LEVELS, False), False)
    assert not server.refined.active


def test_a_new_crest_on_land_that_was_found_smooth_is_found() -> None:
    """What was learnt of a tile counts only while its ground stays."""
    server, ground = TileServer(SIZE_M, LEVELS, FINEST), Ground([Bump(200.0, 300.0, 400.0, 3.0)])
    client = Client(server)
    client.tiles.set_view(LOOK)
    solve(server, ground, 1, True)
    settle(server, ground, 1, [client])
    ground.bumps.append(TIP)
    solve(server, ground, 2, True)
    settle(server, ground, 2, [client])
    assert levels_of(client)[FINEST] > 0
    client.check_newest(ground)


# --- what is sent -----------------------------------------------------------------------------------------------------


def test_refined_tiles_ride_along_with_an_edit_and_are_put_right_at_rest() -> None:
    """Nothing is dropped while somebody draws in view (docs/decisions/0015-refined-tiles.md)."""
    server, ground, client = at_rest()
    before = {k for k in client.decoder.held if k.level > LEVELS}
    ground.bumps[0] = Bump(TIP.x, TIP.y, TIP.radius, TIP.height + 3)
    solve(server, ground, 2, False)
    client.drain()
    assert before <= client.decoder.held.keys()
    assert {plan.level for plan in client.log} == {0, 1, 2}
    client.log.clear()
    solve(server, ground, 2, True)
    client.drain()
    assert not any(plan.level > LEVELS for plan in client.log), "not before it has been made anew"
    client.log.clear()
    settle(server, ground, 2, [client])
    client.check_newest(ground)
    frames = [plan for plan in client.log if plan.kind == FrameKind.LEVEL]
    assert [plan.level for plan in frames] == list(range(LEVELS + 1, FINEST + 1))
    used = {tile.predictor for plan in frames for tile in read_frame(plan.encode())[2]}
    assert used & {Predictor.PREVIOUS, Predictor.HELD}


def test_a_change_is_small_to_send() -> None:
    server, ground, client = at_rest()
    fresh = Client(server)
    fresh.tiles.set_view(LOOK)
    fresh.drain()
    whole = sum(len(plan.encode()) for plan in fresh.log if plan.level > LEVELS)
    ground.bumps.append(Bump(TIP.x - 14, TIP.y - 14, 6.0, 0.5))
    solve(server, ground, 2, True)
    settle(server, ground, 2, [client])
    client.check_newest(ground)
    changed = sum(len(plan.encode()) for plan in client.log if plan.level > LEVELS)
    assert 0 < changed < whole / 3


def test_made_anew_with_the_same_samples_nothing_is_sent() -> None:
    server, ground, client = at_rest()
    solve(server, ground, 2, True)
    assert settle(server, ground, 2, [client]) > 0
    assert [(plan.level, plan.keys, plan.drops) for plan in client.log if plan.level > LEVELS] == []


def test_tiles_out_of_view_that_moved_are_dropped() -> None:
    server, ground, client = at_rest()
    client.tiles.set_view(near(200.0, 275.0, 40.0, turn=3.14, tau_px=0.7))
    ground.bumps[0] = Bump(TIP.x, TIP.y, TIP.radius, TIP.height + 3)
    solve(server, ground, 2, True)
    settle(server, ground, 2, [client])
    client.check_newest(ground)
    assert any(plan.drops for plan in client.log)
    for key, tile in client.decoder.held.items():
        want = np.rint(ground.tile(key).heights * np.float32(1 / grid.quantum(key.level, SIZE_M)))
        assert np.array_equal(tile.samples, want), "nothing old is left"


def test_tiles_out_of_view_that_did_not_move_stay() -> None:
    server, ground, client = at_rest()
    before = {k for k in client.decoder.held if k.level > LEVELS}
    client.tiles.set_view(near(200.0, 275.0, 40.0, turn=3.14, tau_px=0.7))
    ground.bumps.append(Bump(480.0, 40.0, 9.0, 5.0))
    solve(server, ground, 2, True)
    client.drain()
    assert before <= client.decoder.held.keys()
    frames = [plan for plan in client.log if plan.level > LEVELS]
    assert [(plan.kind, plan.level) for plan in frames] == [(FrameKind.LEVEL, i) for i in range(LEVELS + 1, FINEST + 1)]
    assert not any(plan.tiles or plan.drops for plan in frames), "they were previews only while the root was shown"


def crumb(key: TileKey, other: TileKey) -> Bump:
    """A bump so small that only one sample of two neighbours sees it, on their common edge, and no coarser one."""
    step = grid.spacing(key.level, SIZE_M)
    if key.y == other.y:
        col, row = 64 * max(key.x, other.x), 64 * key.y + 33
    else:
        col, row = 64 * key.x + 33, 64 * max(key.y, other.y)
    return Bump(col * step, row * step, 0.9 * step, 0.05)


def pairs(keys: set[TileKey], others: set[TileKey], level: int) -> list[tuple[TileKey, TileKey]]:
    """Tiles of a level in ``keys`` beside one in ``others``."""
    near_by = [(k, k._replace(x=k.x + dx, y=k.y + dy)) for k in keys for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    return sorted((k, n) for k, n in near_by if k.level == level and n in others)


def make_all_but(server: TileServer, ground: Ground, clock: int, client: Client, late: TileKey) -> None:
    """Refines what is wanted, without one tile and what depends on it."""
    for _ in range(20):
        requests = [k for k in server.requests([client.tiles])[0] if k.level <= late.level and k != late]
        for key in requests:
            server.put_tile(clock, ground.tile(key))
        client.drain()
    assert {k for k, _ in client.tiles.missing() if k.level <= late.level} == {late}


def test_a_new_version_waits_for_a_neighbour_that_it_would_not_fit() -> None:
    """The whole levels do not see the change: nothing rides along, and yet two tiles differ on their common edge."""
    server, ground, client = at_rest()
    wanted = client.tiles.wanted_refined()
    one, late = pairs(wanted, wanted, LEVELS + 2)[0]
    before = client.decoder.held[one].version
    ground.bumps.append(crumb(one, late))
    solve(server, ground, 2, True)
    make_all_but(server, ground, 2, client, late)
    assert client.decoder.held[one].version == before
    assert server.put_tile(2, ground.tile(late))
    client.drain()
    assert client.decoder.held[one].version > before
    assert server.refined.verified(late)


def test_a_new_tile_waits_for_a_neighbour_that_it_would_not_fit() -> None:
    server, ground, client = at_rest()
    old = {k for k in client.decoder.held if k.level > LEVELS}
    client.tiles.set_view(near(200.0, 275.0, 40.0, turn=0.6, tau_px=0.7))
    fresh = client.tiles.wanted_refined() - old
    one, late = pairs(fresh, old & client.tiles.wanted_refined(), LEVELS + 2)[0]
    ground.bumps.append(crumb(one, late))
    solve(server, ground, 2, True)
    make_all_but(server, ground, 2, client, late)
    assert one not in client.decoder.held
    assert server.put_tile(2, ground.tile(late))
    client.drain()
    assert one in client.decoder.held


def test_a_neighbour_that_nobody_looks_at_makes_way() -> None:
    server, ground, client = at_rest()
    old = {k for k in client.decoder.held if k.level > LEVELS}
    client.tiles.set_view(near(200.0, 275.0, 40.0, turn=0.9, tau_px=0.7))
    wanted = client.tiles.wanted_refined()
    one, left = pairs(wanted & old, old - wanted, LEVELS + 2)[0]
    ground.bumps.append(crumb(one, left))
    solve(server, ground, 2, True)
    settle(server, ground, 2, [client])
    client.check_newest(ground)
    assert left not in client.decoder.held


def test_a_client_holds_no_more_than_its_share_and_keeps_what_it_looks_at() -> None:
    server, ground, client = at_rest(room_tiles=60)
    assert server.refined.client_tiles == 60
    rng = random.Random(4)
    for clock in range(6):
        client.tiles.set_view(near(200.0 + 5 * clock, 280.0, rng.choice([3.0, 18.0]), rng.uniform(-1, 1), tau_px=1.0))
        settle(server, ground, 1, [client])
        client.check_newest(ground)
        assert len(client.tiles.wanted_refined()) <= 60
        assert len(server.refined) <= 60
    assert any(plan.drops and plan.kind == FrameKind.FILL for plan in client.log)


def test_the_room_is_bounded_whatever_everybody_wants() -> None:
    server, ground = TileServer(SIZE_M, LEVELS, FINEST, room_tiles=50), Ground([TIP, Bump(400.0, 100.0, 60.0, 30.0)])
    clients = [Client(server) for _ in range(2)]
    clients[0].tiles.set_view(LOOK)
    clients[1].tiles.set_view(near(400.0, 80.0, 10.0, tau_px=1.0))
    solve(server, ground, 1, True)
    settle(server, ground, 1, clients)
    assert len(server.refined) <= 50
    assert server.requests([c.tiles for c in clients]) == ((), 0), "what there is no room for is not asked for"


def test_clients_share_what_they_hold() -> None:
    """Sixty people on one spot cost the samples once."""
    server, ground = TileServer(SIZE_M, LEVELS, FINEST), Ground([TIP])
    clients = [Client(server) for _ in range(2)]
    for client in clients:
        client.tiles.set_view(LOOK)
    solve(server, ground, 1, True)
    settle(server, ground, 1, clients)
    mine, theirs = ([*c.tiles._refined._held.values()] for c in clients)
    for a, b in zip(mine, theirs, strict=True):
        assert a.keys() == b.keys()
        assert all(a[k].state is b[k].state and a[k].base is b[k].base for k in a)


def test_a_client_may_hold_what_the_contract_says() -> None:
    assert TileServer(SIZE_M, 4, 8).refined.client_tiles == MAX_REFINED_TILES


# --- what is refused --------------------------------------------------------------------------------------------------


def test_levels_that_cannot_be_refined_are_refused() -> None:
    for levels, finest in ((4, MAX_REFINED_LEVEL + 1), (4, 3)):
        with pytest.raises(ValueError, match="refined to level"):
            TileServer(SIZE_M, levels, finest)
    server, ground, _ = at_rest()
    for key in (TileKey(LEVELS, 0, 0), TileKey(FINEST + 1, 0, 0), TileKey(FINEST, 64, 0), TileKey(FINEST, 0, -1)):
        with pytest.raises(ValueError, match="not refined here"):
            server.put_tile(1, ground.tile(key))


def test_heights_that_are_not_a_tile_are_refused_and_change_nothing() -> None:
    server, ground, _ = at_rest()
    key = next(k for k in server.requests([])[0] or [TileKey(LEVELS + 1, 3, 4)])
    before, stamp = server.refined.get(key), server.refined.stamp
    bad = ground.tile(key).heights.copy()
    bad[3, 3] = np.nan
    for heights in (bad, np.zeros((64, 65), dtype=np.float32)):
        with pytest.raises(ValueError, match="65x65"):
            server.put_tile(1, Made(key, heights))
    assert (server.refined.get(key), server.refined.stamp) == (before, stamp)


def test_a_tile_of_an_older_solve_or_without_its_parent_is_not_taken() -> None:
    server, ground, _ = at_rest()
    solve(server, ground, 5, True)
    assert not server.put_tile(4, ground.tile(TileKey(LEVELS + 1, 3, 4)))
    assert not server.put_tile(5, ground.tile(TileKey(LEVELS + 2, 6, 9))), "its parent is not of this solve yet"
    assert server.put_tile(5, ground.tile(TileKey(LEVELS + 1, 3, 4)))
    assert server.put_tile(5, ground.tile(TileKey(LEVELS + 2, 6, 9)))


# --- levels that are not solved for a while ---------------------------------------------------------------------------


def test_levels_above_a_limit_are_forgotten_and_come_back() -> None:
    server, ground, client = at_rest()
    server.limit(1)
    for level in range(2):
        server.put_level(2, level, ground.level(level), True)
    client.drain()
    assert {k.level for k in client.decoder.held} == {0, 1}
    assert server.settled()
    assert server.requests([client.tiles]) == ((), 0)
    server.limit(LEVELS)
    assert not server.settled()
    solve(server, ground, 3, True)
    settle(server, ground, 3, [client])
    client.check_newest(ground)
    assert levels_of(client)[FINEST] > 0
