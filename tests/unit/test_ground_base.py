"""The streamed ground over a base, for Python (SPEC T47)."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from esker import grid
from esker.api.live.ground import StreamedGround
from esker.contract import Channel
from esker.grid import TileKey
from esker.tiles.codec.payload import child_window, predict
from esker.tiles.delivery import ClientTiles, TileServer
from tests.cones import LEVELS, SIZE_M, Bump, Ground, lay, solve


def streamed() -> StreamedGround:
    sync = SimpleNamespace(confirmed=SimpleNamespace(settings=SimpleNamespace(size_m=SIZE_M), clock=1))
    return StreamedGround(cast(Any, sync), threading.Condition(), lambda: None, lambda: None)


def drain(client: ClientTiles, ground: StreamedGround) -> None:
    while (plan := client.plan()) is not None:
        with ground._changed:
            ground.applied(plan.encode())
        client.commit(plan)


def quanta(heights: np.ndarray, level: int) -> np.ndarray:
    return np.rint(heights / grid.quantum(level, SIZE_M)).astype(np.int64)


def test_heights_are_offsets_plus_base_and_the_base_can_be_had_alone() -> None:
    server, found = TileServer(SIZE_M, LEVELS), streamed()
    offsets, base = Ground([Bump(200, 300, 60, 40)]), Ground([Bump(300, 200, 200, 90)])
    client = ClientTiles(server)
    lay(server, base, 1)
    solve(server, offsets, 1, True)
    drain(client, found)
    for level in range(LEVELS + 1):
        for key in grid.tiles(level):
            want = offsets.samples(key) + base.samples(key)
            assert np.array_equal(quanta(found.tile(*key), level), want)
            assert np.array_equal(quanta(found.tile(*key, channel=Channel.BASE), level), base.samples(key))
        whole = found.heights(level)
        assert np.array_equal(whole[:65, :65], found.tile(level, 0, 0))
    assert found.tiles(Channel.BASE) == found.tiles()
    found.connected()
    assert not found.tiles(Channel.BASE)


def test_while_a_base_is_late_it_is_what_the_levels_above_predict() -> None:
    server, found = TileServer(SIZE_M, LEVELS), streamed()
    offsets, base = Ground([Bump(200, 300, 60, 40)]), Ground([Bump(300, 200, 200, 90)])
    client = ClientTiles(server)
    solve(server, offsets, 1, True)
    drain(client, found)
    with pytest.raises(KeyError):
        found.tile(0, 0, 0, Channel.BASE)
    assert np.array_equal(quanta(found.tile(2, 1, 2), 2), offsets.samples(TileKey(2, 1, 2)))
    server.put_level(2, 0, base.level(0), True, Channel.BASE)
    drain(client, found)
    once = child_window(predict(base.samples(TileKey(0, 0, 0)).astype(np.int32)), 0, 1)
    twice = child_window(predict(once.astype(np.int32)), 1, 2)
    assert np.array_equal(quanta(found.tile(1, 0, 1), 1), offsets.samples(TileKey(1, 0, 1)) + once)
    assert np.array_equal(quanta(found.tile(2, 1, 2), 2), offsets.samples(TileKey(2, 1, 2)) + twice)
