"""Refined tiles while solves, cameras and the refiner interrupt each other (SPEC T24 to T31)."""

from __future__ import annotations

import random

import numpy as np
import pytest

from esker.contract import Channel, FrameKind
from esker.grid import TileKey
from esker.tiles.delivery import TileServer
from tests.cones import FINEST, LEVELS, SIZE_M, Client, Ground, a_view, settle, solve


def put_channel(
    server: TileServer, rng: random.Random, clock: int, settled: bool, channel: Channel | None = None
) -> None:
    """Some level of amplitude or roughness: a patch somewhere."""
    channel = channel or rng.choice(list(server.channels))
    y, x = np.mgrid[0:65, 0:65]
    values = np.maximum(0, 9 - np.hypot(x - rng.randrange(65), y - rng.randrange(65))) / 9
    server.put_level(clock, 0, values.astype(np.float32), settled, channel)


@pytest.mark.parametrize("seed", range(6))
def test_random_sessions_come_to_rest_on_the_refined_ground(seed: int) -> None:
    rng = random.Random(seed)
    server, ground = TileServer(SIZE_M, LEVELS, FINEST), Ground()
    for _ in range(5):
        ground.edit(rng)
    clients = [Client(server) for _ in range(2)]
    for client in clients:
        client.tiles.set_view(a_view(rng, ground))
    for clock in range(1, 9):
        if clock > 1 and rng.random() < 0.8:
            ground.edit(rng)
        for settled in (False, True):
            for level in range(LEVELS + 1 if rng.random() < 0.8 else 1):
                server.put_level(clock, level, ground.level(level, settled), settled)
                if rng.random() < 0.5:
                    put_channel(server, rng, clock, settled)
                for client in clients:
                    if rng.random() < 0.7:
                        client.step()
        for _ in range(rng.choice([0, 1, 3, 8])):
            requests = list(server.requests([client.tiles for client in clients])[0])
            rng.shuffle(requests)
            for key in requests[: rng.choice([3, 20, 64])]:
                server.put_tile(clock, ground.tile(key))
            for client in clients:
                for _ in range(rng.choice([0, 1, 5, 40])):
                    client.step()
                if rng.random() < 0.2:
                    client.tiles.set_view(a_view(rng, ground))
    solve(server, ground, 99, False)
    solve(server, ground, 99, True)
    for channel in server.channels:
        put_channel(server, rng, 99, True, channel)
    settle(server, ground, 99, clients)
    for client in clients:
        client.check_newest(ground)
        for channel, pyramid in server.channels.items():
            found, newest = client.decoder.channels[channel], pyramid.level(0)
            assert newest is not None
            assert np.array_equal(found[TileKey(0, 0, 0)].samples, newest.samples)
        assert any(plan.level > LEVELS and plan.kind == FrameKind.FILL for plan in client.log)
