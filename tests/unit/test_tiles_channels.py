"""Delivery of the channels other than heights: whole levels, coarse to fine (SPEC T23, T34)."""

from __future__ import annotations

import numpy as np
import pytest

from esker import grid
from esker.contract import Channel
from esker.tiles.channels import values
from esker.tiles.delivery import TileServer
from tests.cones import SIZE_M, Client


def test_channels_go_whole_coarse_to_fine_after_the_heights() -> None:
    server = TileServer(SIZE_M, 4)
    client = Client(server)
    for level in range(5):
        n = grid.samples(level)
        server.put_level(1, level, np.zeros((n, n), dtype=np.float32), True)
    for channel, value in ((Channel.AMPLITUDE, 1.0), (Channel.SNOW, -1.0)):
        for level in range(3):
            n = grid.samples(level)
            server.put_level(1, level, np.full((n, n), value, dtype=np.float32), True, channel)
    client.drain()
    order = [(plan.channel, plan.level) for plan in client.log]
    assert order[3:9] == [(ch, level) for ch in (Channel.AMPLITUDE, Channel.SNOW) for level in range(3)]
    held = {ch: len(tiles) for ch, tiles in client.decoder.channels.items() if tiles and ch != Channel.HEIGHT}
    assert held == {Channel.AMPLITUDE: 21, Channel.SNOW: 21}, "a channel that was never put sends nothing"
    assert client.tiles.held(Channel.AMPLITUDE).keys() == client.decoder.channels[Channel.AMPLITUDE].keys()


@pytest.mark.parametrize(
    ("channel", "scale", "base"),
    [(Channel.AMPLITUDE, 64, 0.0), (Channel.ROUGHNESS, 1024, 0.5), (Channel.SNOW, 1024, 0.0)],
)
def test_channels_have_the_same_quantum_on_every_level(channel: Channel, scale: int, base: float) -> None:
    server = TileServer(SIZE_M, 4)
    rng = np.random.default_rng(3)
    for level in range(3):
        n = grid.samples(level)
        wanted = rng.uniform(0, 1, (n, n)).astype(np.float32)
        server.put_level(1, level, wanted, True, channel)
        found = server.channels[channel].level(level)
        assert found is not None
        assert np.array_equal(found.samples, np.rint((wanted - np.float32(base)) * scale).astype(np.int32))
        assert np.abs(values(found.samples, channel) - wanted).max() <= 0.5 / scale + 1e-6
    with pytest.raises(ValueError, match="level 3"):
        server.put_level(1, 3, np.zeros((513, 513), dtype=np.float32), True, channel)


def test_a_channel_follows_its_parents_without_doubling() -> None:
    """A preview within the dead zone of what every decoder shows by itself costs nothing (SPEC T34)."""
    server = TileServer(SIZE_M, 3)
    amplitude = server.channels[Channel.AMPLITUDE]
    for clock, (coarse, fine) in enumerate(((8.0, 8.0), (48.0, 49.4)), start=1):
        for level, quanta in ((0, coarse), (1, fine)):
            n = grid.samples(level)
            server.put_level(
                clock, level, np.full((n, n), quanta / 64, dtype=np.float32), clock == 1, amplitude.channel
            )
    found = amplitude.level(1)
    assert found is not None
    assert np.unique(found.samples).tolist() == [48]


@pytest.mark.parametrize(("channel", "base"), [(Channel.ROUGHNESS, 0.5), (Channel.WETNESS, 0.0), (Channel.FAR, 1.0)])
def test_a_channel_that_nobody_speaks_of_is_not_sent(channel: Channel, base: float) -> None:
    """SPEC T36: until somebody does; then once more when it is back at its base."""
    server = TileServer(SIZE_M, 4)
    client = Client(server)

    def put(clock: int, away: float) -> list[int]:
        for level in range(3):
            n = grid.samples(level)
            values = np.full((n, n), base, dtype=np.float32)
            if level == 2:  # between the samples of coarser levels
                values[65, 65] += away
            server.put_level(clock, level, values, True, channel)
        before = len(client.log)
        client.drain()
        return [plan.level for plan in client.log[before:]]

    assert put(1, 0.0) == []
    assert put(2, 0.25) == [0, 1, 2]
    assert len(client.decoder.channels[channel]) == 21
    assert put(3, 0.25) == []
    assert put(4, 0.0) == [2]
    assert not any(tile.samples.any() for tile in client.decoder.channels[channel].values())
    server.limit(3)
    client.drain()
    assert {key.level for key in client.decoder.channels[channel]} == {0, 1}
    with pytest.raises(ValueError, match="65x65"):
        TileServer(SIZE_M, 4).put_level(1, 0, np.zeros((9, 9), dtype=np.float32), True, Channel.SNOW)
