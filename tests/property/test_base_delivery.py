"""Base and offsets while layers, strokes, cameras and the refiner interrupt each other (SPEC T43 to T50)."""

from __future__ import annotations

import random

import numpy as np
import pytest

from esker.contract import Channel
from esker.tiles.delivery import TileServer
from tests.cones import FINEST, LEVELS, SIZE_M, Bump, Client, Ground, a_view, drawn, lay, near, settle, solve


class Layers(Ground):
    """Elevation layers: a rough slope that no parent predicts, and cones that come and go."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__()
        self.lift = rng.uniform(200, 900)
        for _ in range(6):
            self.edit(rng)

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rough = np.sin(x / 0.7) * np.cos(y / 1.1) + 3 * np.sin((x + y) / 9)
        return np.asarray(super().heights(x, y) + (self.lift + 0.3 * x - 0.2 * y + rough), dtype=np.float32)


def change(rng: random.Random, base: Layers | None) -> Layers | None:
    """A layer comes, moves a little, or is the last to go."""
    if base is None:
        return Layers(rng)
    if rng.random() < 0.15:
        return None
    if rng.random() < 0.3:
        base.lift += rng.uniform(-40, 40)
    base.edit(rng)
    return base


@pytest.mark.parametrize("seed", range(8))
def test_random_sessions_come_to_rest_on_offsets_plus_base(seed: int) -> None:
    """Every frame leaves the drawn ground without a crack (``Client.check``); the end is the sum, exactly."""
    rng = random.Random(seed)
    server, ground = TileServer(SIZE_M, LEVELS, FINEST), Ground()
    for _ in range(4):
        ground.edit(rng)
    base = None if seed % 2 else Layers(rng)
    clients = [Client(server) for _ in range(2)]
    for client in clients:
        client.tiles.set_view(a_view(rng, ground))
    for clock in range(1, 10):
        if rng.random() < 0.6:
            base = change(rng, base)
            whole = rng.random() < 0.8
            for level in range(LEVELS + 1 if whole else rng.randrange(LEVELS + 1)):
                server.put_level(clock, level, (base or Ground()).level(level), True, Channel.BASE)
                for client in clients:
                    if rng.random() < 0.6:
                        client.step()
            if not whole:
                lay(server, base, clock)
        if rng.random() < 0.6:
            ground.edit(rng)
        for settled in (False, True):
            for level in range(LEVELS + 1 if rng.random() < 0.85 else 1):
                server.put_level(clock, level, ground.level(level, settled), settled)
                for client in clients:
                    if rng.random() < 0.6:
                        client.step()
        for _ in range(rng.choice([0, 1, 4, 12])):
            requests = list(server.requests([client.tiles for client in clients])[0])
            rng.shuffle(requests)
            for key in requests[: rng.choice([3, 20, 64])]:
                server.put_tile(clock, ground.tile(key, base))
            for client in clients:
                for _ in range(rng.choice([0, 1, 5, 60])):
                    client.step()
                if rng.random() < 0.2:
                    client.tiles.set_view(a_view(rng, ground))
    lay(server, base, 99)
    solve(server, ground, 99, True)
    settle(server, ground, 99, clients, base)
    for client in clients:
        client.check_newest(ground)
        under = base or Ground()
        if client.decoder.channels[Channel.BASE]:
            client.check_newest(under, Channel.BASE)
        found = drawn(client.decoder)
        wanted = client.tiles.wanted_refined()
        assert wanted <= found.keys()
        for key, samples in found.items():
            if key.level <= LEVELS or key in wanted:
                assert np.array_equal(samples, ground.samples(key) + under.samples(key)), key
        assert sum(key.level <= LEVELS for key in found) == sum(4**level for level in range(LEVELS + 1))


@pytest.mark.parametrize("seed", range(2))
def test_whole_levels_of_both_streams_interrupt_each_other(seed: int) -> None:
    """Levels that come by FILL, to a client that looks around and is slow: tiles wait for their base, none cracks."""
    rng = random.Random(50 + seed)
    server, ground = TileServer(SIZE_M, 3), Ground([Bump(200.0, 300.0, 60.0, 40.0)])
    base: Layers | None = None
    client, waited = Client(server), 0
    for level in range(4):
        server.put_level(0, level, ground.level(level), True)
    while len(client.decoder.held) < 85:
        assert client.step()
    for clock in range(1, 6):
        if clock == 1 or rng.random() < 0.7:
            base = change(rng, base)
            lay(server, base, clock)
        if rng.random() < 0.7:
            ground.edit(rng)
        for level in range(4 if rng.random() < 0.8 else rng.randrange(4)):
            server.put_level(clock, level, ground.level(level), clock % 2 == 0)
            for _ in range(rng.choice([0, 0, 1, 4])):
                client.step()
                waited += len(client.decoder.held) - len(drawn(client.decoder))
        if rng.random() < 0.6:
            client.tiles.set_view(near(rng.uniform(0, SIZE_M), rng.uniform(0, SIZE_M), 60.0, rng.uniform(0, 6)))
    lay(server, base, 99)
    for level in range(4):
        server.put_level(99, level, ground.level(level), True)
    while client.step():
        waited += len(client.decoder.held) - len(drawn(client.decoder))
    client.check_newest(ground)
    under = base or Ground()
    found = drawn(client.decoder)
    assert len(found) == 85
    assert all(np.array_equal(found[key], ground.samples(key) + under.samples(key)) for key in found)
    assert waited > 0


@pytest.mark.parametrize("seed", range(4))
def test_bounds_of_the_sum_are_those_of_summed_samples(seed: int) -> None:
    """Whatever changed, and in whatever order the levels came (SPEC T45)."""
    rng = random.Random(100 + seed)
    server, ground, base = TileServer(SIZE_M, 3), Ground(), Layers(rng)
    for clock in range(1, 6):
        ground.edit(rng)
        if clock != 3:
            base.bumps.append(Bump(rng.uniform(0, SIZE_M), rng.uniform(0, SIZE_M), 30.0, rng.uniform(-20, 20)))
            lay(server, base, clock)
        for level in range(4 if clock > 2 else 2):
            server.put_level(clock, level, ground.level(level), True)
        if rng.random() < 0.5:
            server.surface.bounds()
    server.surface.bounds()
    server.put_level(6, 1, ground.level(1) + np.float32(5), False)  # moves no sample of level 2, but its error
    found = server.surface.bounds()
    plain = TileServer(SIZE_M, 3)
    for level in range(4):
        one, other = server.pyramid.level(level), server.base.level(level)
        assert one is not None
        assert other is not None
        quantum = np.float64(SIZE_M / (64 << level) / 256)
        plain.put_level(1, level, ((one.samples + other.samples) * quantum).astype(np.float32), True)
    wanted = plain.surface.bounds()
    for name in ("low", "high", "error", "valid"):
        assert np.allclose(getattr(found, name), getattr(wanted, name), rtol=0, atol=float(quantum)), name
    fine = [
        np.abs(getattr(server.surface.sub_patches(3), name) - getattr(plain.surface.sub_patches(3), name).astype(int))
        for name in ("low", "high", "error")
    ]
    assert max(int(a.max()) for a in fine) <= 1, "float32 of a sum of 900 m is no finer"
