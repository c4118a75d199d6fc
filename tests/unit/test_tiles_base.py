"""The base as tiles: what is held, what is sent, and what a view selects by (SPEC T43 to T50)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from esker import grid
from esker.contract import Channel, FrameKind, View
from esker.grid import TileKey
from esker.tiles.channels import values
from esker.tiles.codec.payload import SAMPLE_LIMIT
from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.surface import total
from tests.cones import FINEST, LEVELS, SIZE_M, Bump, Client, Ground, Made, drawn, lay, near, settle, solve

TIP = Bump(200.0, 300.0, 40.0, 60.0)
LOOK = near(200.0, 275.0, 40.0, tau_px=0.7)
ABOVE = View(eye=(256.0, 256.0, 700.0), target=(256.0, 257.0, 0.0), tau_px=0.25)


class Rough(Ground):
    """No parent predicts it, so nothing can be left out."""

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rough = 2 * np.sin(x / 1.3) * np.cos(y / 1.7) + 9 * np.sin((x + 2 * y) / 31)
        return np.asarray(super().heights(x, y) + rough, dtype=np.float32)


def sent(client: Client) -> list[tuple[Channel, int]]:
    return [(plan.channel, plan.level) for plan in client.log]


def at_rest(base: Ground | None, levels: int = LEVELS, finest: int = FINEST) -> tuple[TileServer, Ground, Client]:
    """A client that has all that it wants of one cone on a base."""
    server, ground = TileServer(SIZE_M, levels, finest), Ground([TIP])
    client = Client(server)
    client.tiles.set_view(LOOK)
    lay(server, base, 1)
    solve(server, ground, 1, True, range(levels + 1))
    settle(server, ground, 1, [client], base)
    client.log.clear()
    return server, ground, client


def test_a_base_that_was_never_anything_but_zero_is_neither_held_nor_sent() -> None:
    server, ground, client = at_rest(None)
    assert not client.decoder.channels[Channel.BASE]
    assert not client.tiles.held(Channel.BASE)
    stamp = server.stamp
    assert lay(server, None, 2) == 0
    assert server.stamp == stamp
    assert server.settled()
    assert server.surface.bounds() is server.pyramid.bounds()
    assert settle(server, ground, 1, [client]) == 0
    assert client.log == []


def test_the_last_layer_that_goes_leaves_zeros() -> None:
    server, ground, client = at_rest(Rough())
    assert any(key.level > LEVELS for key in client.decoder.channels[Channel.BASE])
    assert lay(server, None, 2) == sum(4**level for level in range(LEVELS + 1))
    solve(server, ground, 2, True)
    settle(server, ground, 2, [client])
    base = client.decoder.channels[Channel.BASE]
    assert base
    assert not any(tile.samples.any() for tile in base.values())
    assert not (client.tiles.wanted_refined() - base.keys())
    found = drawn(client.decoder)
    assert all(np.array_equal(found[key], ground.samples(key)) for key in found if key.level <= LEVELS)


def test_strokes_send_no_base_and_leave_its_refined_tiles_alone() -> None:
    server, ground, client = at_rest(Rough())
    before = {key: tile.version for key, tile in client.decoder.channels[Channel.BASE].items()}
    ground.bumps.append(Bump(210.0, 310.0, 9.0, 4.0))
    for settled in (False, True):
        solve(server, ground, 2, settled)
        client.drain()
        assert {k: t.version for k, t in client.decoder.channels[Channel.BASE].items()}.items() <= before.items()
    settle(server, ground, 2, [client], Rough())
    after = client.decoder.channels[Channel.BASE]
    assert all(after[key].version == version for key, version in before.items() if key in after)
    carried = [key for plan in client.log if plan.channel == Channel.BASE for key in plan.keys]
    assert not set(carried) & before.keys(), "only tiles that the new ground is looked at with"
    client.check_newest(ground)


def test_layers_send_no_offsets_and_only_the_tiles_that_changed() -> None:
    base = Rough([Bump(100.0, 100.0, 30.0, 20.0)])
    server, ground, client = at_rest(base, levels=4, finest=4)
    base.bumps.append(Bump(400.0, 400.0, 20.0, 30.0))
    changed = {
        key
        for level in range(5)
        for key in grid.tiles(level)
        if not np.array_equal(base.samples(key), client.decoder.channels[Channel.BASE][key].samples)
    }
    assert lay(server, base, 2) == len(changed)
    assert 4 < len(changed) < 60
    solve(server, ground, 2, True, range(5))
    client.drain()
    carried = [key for plan in client.log for key in plan.keys]
    assert set(carried) == changed
    assert {plan.channel for plan in client.log if plan.keys} == {Channel.BASE}
    client.check_newest(base, Channel.BASE)


def test_the_base_of_a_tile_goes_before_the_tile() -> None:
    """SPEC T46: on every level, first look, next look and at rest."""
    for levels, finest in ((4, 4), (LEVELS, FINEST)):
        server, ground, base = TileServer(SIZE_M, levels, finest), Ground([TIP]), Rough()
        client = Client(server)
        lay(server, base, 1)
        solve(server, ground, 1, True, range(levels + 1))
        for view in (LOOK, near(60.0, 60.0, 20.0, tau_px=1.0), ABOVE):
            client.tiles.set_view(view)
            settle(server, ground, 1, [client], base)
        held: set[TileKey] = set()
        for plan in client.log:
            if plan.channel == Channel.BASE:
                held |= set(plan.keys)
            assert plan.channel == Channel.BASE or set(plan.keys) <= held
        fills = [plan for plan in client.log if plan.kind == FrameKind.FILL and plan.level == 4]
        order = [plan.channel for plan in fills if plan.tiles]
        assert order[:2] == [Channel.BASE, Channel.HEIGHT]
        assert (Channel.BASE, Channel.BASE) not in itertools.pairwise(order), "what can be shown is not kept waiting"
        assert len(fills) > 3 or finest > levels


def test_a_base_that_comes_late_opens_no_crack() -> None:
    """Tiles that have no base of their own wait once others of their level have one (``drawn``, SPEC T48)."""
    ground, base = Ground([TIP]), Rough()
    server = TileServer(SIZE_M, 4)
    client = Client(server)
    solve(server, ground, 1, True, range(5))
    client.drain()
    assert len(drawn(client.decoder)) == 341
    lay(server, base, 2)
    counts = []
    while client.step():  # checks that nothing drawn cracks
        counts.append(len(drawn(client.decoder)))
    solve(server, ground, 2, True, range(5))
    while client.step():
        counts.append(len(drawn(client.decoder)))
    assert counts[0] == 341, "with the coarsest level of the base, everything stands on what it predicts"
    assert min(counts) < 341
    assert counts[-1] == 341
    client.check_newest(base, Channel.BASE)


def test_views_select_by_the_sum() -> None:
    """A base that the strokes level out is flat; a rough base is looked into though no stroke is there (SPEC T45)."""
    base = Rough()

    class Levelled(Rough):
        def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return -super().heights(x, y)

    wanted = []
    for ground in (Ground(), Levelled()):
        server = TileServer(SIZE_M, LEVELS, FINEST)
        lay(server, base, 1)
        solve(server, ground, 1, True)
        client = ClientTiles(server)
        client.set_view(LOOK)
        wanted.append((sum(int(m.sum()) for m in client.wanted()), len(server.requests([client])[0])))
        found = server.surface.bounds()
        assert found.error.max() > 0.5 if ground.__class__ is Ground else found.error.max() == 0
    assert wanted[0][1] > 5
    assert wanted[1][1] == 0


def test_refined_tiles_are_looked_into_by_the_sum() -> None:
    """Flat offsets on a rough base are refined to the finest level, rough ones that cancel are not."""
    _, _, client = at_rest(Rough())
    assert any(key.level == FINEST for key in client.tiles.wanted_refined())
    server, base = TileServer(SIZE_M, LEVELS, FINEST), Rough()
    client = Client(server)
    client.tiles.set_view(LOOK)
    lay(server, base, 1)
    solve(server, Ground(), 1, True)

    for _ in range(3):
        for key in server.requests([client.tiles])[0]:
            under = base.tile(key).heights
            assert server.put_tile(1, Made(key, -under, under))
    assert max(key.level for key in client.tiles.wanted_refined()) <= LEVELS + 2


def test_the_ground_is_settled_when_heights_came_after_the_base() -> None:
    server, ground, base = TileServer(SIZE_M, LEVELS, FINEST), Ground([TIP]), Rough()
    lay(server, base, 1)
    solve(server, ground, 1, True)
    assert server.settled()
    for level in range(LEVELS):
        server.put_level(1, level, base.level(level) + 1, True, Channel.BASE)
    solve(server, ground, 1, True)
    assert not server.settled(), "a level of the base is of another time"
    server.put_level(1, LEVELS, base.level(LEVELS) + 1, True, Channel.BASE)
    assert not server.settled(), "these heights were solved over another base"
    client = ClientTiles(server)
    client.set_view(LOOK)
    assert server.requests([client]) == ((), 0)
    assert not server.put_tile(1, ground.tile(TileKey(LEVELS + 1, 3, 4), base))
    solve(server, ground, 1, True)
    assert server.settled()
    assert server.requests([client])[0]


def test_refined_base_is_made_once_more_when_the_layers_change() -> None:
    base = Rough()
    server, ground, client = at_rest(base)
    base.bumps.append(Bump(205.0, 305.0, 12.0, 5.0))
    lay(server, base, 2)
    client.drain()
    solve(server, ground, 2, True)
    client.drain()
    settle(server, ground, 2, [client], base)
    client.check_newest(base, Channel.BASE)
    client.check_newest(ground)
    heights = [key for plan in client.log if plan.channel == Channel.HEIGHT for key in plan.keys]
    versions = {key: tile.version for key, tile in client.decoder.held.items()}
    assert len(heights) == len(set(heights)), "offsets that did not change are not sent again"
    assert versions.keys() >= client.tiles.wanted_refined()


def test_tiles_without_a_base_and_bases_without_levels() -> None:
    """A tile that says nothing of its base stands on zero; one so small that no level sees it brings the levels."""
    server, ground = TileServer(SIZE_M, LEVELS, FINEST), Ground([TIP])
    solve(server, ground, 1, True)
    key = TileKey(LEVELS + 1, 3, 4)
    assert server.put_tile(1, ground.tile(key, Ground()))
    assert not server.base.held
    small = ground.tile(key, Ground([Bump(220.0, 300.0, 3.0, 1.0)]))
    assert small.base is not None
    assert small.base.any()
    assert server.put_tile(1, small)
    assert server.base.held
    assert server.settled()
    assert server.refined_base.verified(key) is not None
    assert server.put_tile(1, ground.tile(key))
    found = server.refined_base.verified(key)
    assert found is not None
    assert not found.state.samples.any()


def test_a_base_that_is_not_finite_changes_nothing() -> None:
    server = TileServer(SIZE_M, LEVELS)
    for value in (np.nan, np.inf):
        with pytest.raises(ValueError, match="finite"):
            server.put_level(1, 1, np.full((129, 129), value, dtype=np.float32), True, Channel.BASE)
    with pytest.raises(ValueError, match="65x65"):
        server.put_level(1, 0, np.ones((9, 9), dtype=np.float32), True, Channel.BASE)
    with pytest.raises(ValueError, match="level 3"):
        server.put_level(1, 3, np.ones((513, 513), dtype=np.float32), True, Channel.BASE)
    assert not server.base.held
    assert server.stamp == 0


def test_base_tiles_go_with_the_tiles_that_the_room_forgets() -> None:
    server, ground, base = TileServer(SIZE_M, LEVELS, FINEST, room_tiles=40), Ground([TIP]), Rough()
    client = Client(server)
    lay(server, base, 1)
    solve(server, ground, 1, True)
    for x in (60.0, 200.0, 400.0):
        client.tiles.set_view(near(x, 275.0, 40.0, tau_px=0.7))
        settle(server, ground, 1, [client], base)
        assert 0 < len(server.refined_base) <= len(server.refined) <= 40
        client.check_newest(base, Channel.BASE)


def test_a_limit_holds_for_the_base_too() -> None:
    base = Rough()
    server, ground, client = at_rest(base)
    server.limit(1)
    client.drain()
    assert max(key.level for key in client.decoder.channels[Channel.BASE]) == 1
    solve(server, ground, 2, True, range(2))
    assert server.settled()
    server.limit(LEVELS)
    solve(server, ground, 3, True)
    assert not server.settled(), "the base of the finest level is missing"
    lay(server, base, 3)
    solve(server, ground, 3, True)
    settle(server, ground, 3, [client], base)
    client.check_newest(base, Channel.BASE)
    client.check_newest(ground)


def test_sums_saturate_like_their_parts() -> None:
    top = np.array([[SAMPLE_LIMIT, -SAMPLE_LIMIT, 5]], dtype=np.int32)
    assert total(top, top).tolist() == [[SAMPLE_LIMIT, -SAMPLE_LIMIT, 10]]


def test_a_survey_finer_than_all_tiles_ends_with_them() -> None:
    """SPEC T51: where data are finer than the finest tile of the base, detail goes on below that tile."""
    server = TileServer(SIZE_M, LEVELS, FINEST)
    fine = np.full((65, 65), FINEST + 3.5, dtype=np.float32)
    server.put_level(1, 0, fine, settled=True, channel=Channel.SURVEY)
    held = server.channels[Channel.SURVEY].level(0)
    assert held is not None
    assert (values(held.samples, Channel.SURVEY) == FINEST).all()
