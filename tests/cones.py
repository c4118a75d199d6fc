"""Cones, a client that checks all that it is sent, and a refiner of arithmetic: for the tests of refined tiles."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import Channel, View
from esker.grid import TileKey
from esker.tiles.codec.payload import Wide, child_window, predict
from esker.tiles.decoder import FrameDecoder, HeldTile
from esker.tiles.delivery import MOST_REQUESTS, ClientTiles, TileServer
from esker.tiles.plans import FramePlan

SIZE_M = 512.0
LEVELS, FINEST = 2, 6
Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Bump:
    x: float
    y: float
    radius: float
    height: float

    def at(self, x: Floats, y: Floats) -> Floats:
        """A cone: its tip and its foot have errors that shrink by a half a level."""
        return np.asarray(np.maximum(0, 1 - np.hypot(x - self.x, y - self.y) / self.radius) * self.height)


class Ground:
    """Cones: the same function of the place at every level, so neighbouring tiles agree to the bit."""

    def __init__(self, bumps: Iterable[Bump] = ()) -> None:
        self.bumps = list(bumps)
        self.scale = 1.0

    def heights(self, x: Floats, y: Floats) -> NDArray[np.float32]:
        out = np.zeros(np.broadcast_shapes(x.shape, y.shape))
        for bump in self.bumps:
            out += bump.at(x, y)
        return (out * self.scale).astype(np.float32)

    def level(self, level: int, settled: bool = True) -> NDArray[np.float32]:
        at = np.arange(grid.samples(level)) * grid.spacing(level, SIZE_M)
        found = self.heights(at[None, :], at[:, None])
        return found if settled else found * np.float32(1 - 0.02 * (LEVELS + 1 - level))

    def tile(self, key: TileKey, base: Ground | None = None) -> Made:
        step = grid.spacing(key.level, SIZE_M)
        x, y = ((np.arange(65) + 64 * place) * step for place in (key.x, key.y))
        under = None if base is None else base.heights(x[None, :], y[:, None])
        return Made(key, self.heights(x[None, :], y[:, None]), under)

    def samples(self, key: TileKey) -> Wide:
        """Quanta of a tile."""
        quanta: Wide = np.rint(self.tile(key).heights * np.float32(1 / grid.quantum(key.level, SIZE_M))).astype(
            np.int32
        )
        return quanta

    def edit(self, rng: random.Random) -> None:
        """Another cone, sometimes one less; or all a little higher, by less than a quantum of the coarse levels."""
        if rng.random() < 0.3:
            self.scale *= 1 + rng.uniform(-1e-4, 1e-4)
            return
        if len(self.bumps) > 4 and rng.random() < 0.4:
            self.bumps.pop(rng.randrange(len(self.bumps)))
        place = rng.uniform(0, SIZE_M), rng.uniform(0, SIZE_M)
        self.bumps.append(Bump(*place, rng.choice([9.0, 40.0, 150.0]), rng.uniform(-30, 30)))


@dataclass(frozen=True)
class Made:
    key: TileKey
    heights: NDArray[np.float32]
    base: NDArray[np.float32] | None = None
    content: bytes = b""


BESIDE = ((1, 0), (0, 1), (1, 1), (1, -1))
"""Directions of half of a tile's neighbours; the other half look back at it."""


def rim(samples: Wide) -> tuple[bytes, ...]:
    """What a tile shares with its neighbours ``BESIDE`` it, in their order, then with those on the other sides.

    Bytes: to compare two small arrays takes many times as long.
    """
    first, last = samples[0].tobytes(), samples[64].tobytes()
    step = samples.itemsize
    return (
        samples[:, 64].tobytes(), last, last[-step:], first[-step:],
        samples[:, 0].tobytes(), first, first[:step], last[:step],
    )  # fmt: skip


def shown(held: dict[TileKey, HeldTile], key: TileKey, memo: dict[TileKey, Wide]) -> Wide:
    """What the page shows of a tile: its samples, moved along with its parent since then (in whole quanta)."""
    if key not in memo:
        tile = held[key]
        out: Wide = tile.samples.astype(np.int64)
        if key.level:
            assert tile.parent_then is not None
            now = shown(held, key.parent(), memo)
            then = tile.parent_then
            if not np.array_equal(now, then):
                out = out + child_window(predict(now.astype(np.int32)), key.x, key.y)
                out = out - child_window(predict(then), key.x, key.y)
        memo[key] = out
    return memo[key]


def drawn(decoder: FrameDecoder) -> dict[TileKey, Wide]:
    """What the page draws (``frontend/src/tiles/store.ts``), in whole quanta: offsets plus base.

    A tile waits for its own base, but while no tile of its level has one, all stand on what the level above predicts.
    """
    heights, base = decoder.channels[Channel.HEIGHT], decoder.channels[Channel.BASE]
    offsets: dict[TileKey, Wide] = {}
    if not base:
        return {key: shown(heights, key, offsets) for key in heights}
    own: dict[TileKey, Wide] = {}
    ground: dict[TileKey, Wide] = {}
    out: dict[TileKey, Wide] = {}
    levels = {key.level for key in base}
    for key in sorted(heights):
        if key.level and key.parent() not in out:
            continue
        if key in base:
            ground[key] = shown(base, key, own)
        elif key.level and key.level not in levels:
            ground[key] = child_window(predict(ground[key.parent()].astype(np.int32)), key.x, key.y)
        else:
            continue
        out[key] = shown(heights, key, offsets) + ground[key]
    return out


class Client:
    """A client's half on the server, and the decoder that the page would run."""

    def __init__(self, server: TileServer) -> None:
        self.server = server
        self.tiles = ClientTiles(server)
        self.decoder = FrameDecoder()
        self.log: list[FramePlan] = []

    def step(self) -> bool:
        plan = self.tiles.plan()
        if plan is None:
            return False
        self.decoder.decode(plan.encode())
        self.tiles.commit(plan)
        self.log.append(plan)
        self.check()
        return True

    def drain(self) -> None:
        while self.step():
            pass

    def check(self) -> None:
        held = self.decoder.held
        for channel, sent in self.decoder.channels.items():
            assert self.tiles.held(channel) == {k: t.version for k, t in sent.items()}
        both = ((held, self.tiles._refined), (self.decoder.channels[Channel.BASE], self.tiles._refined_base))
        for sent, ledger in both:
            assert all(k.level == 0 or k.parent() in sent for k in sent)
            assert sum(k.level > self.server.levels for k in sent) <= self.server.refined.client_tiles
            for tiles in ledger._held.values():
                for key, known in tiles.items():
                    then = sent[key].parent_then
                    assert then is not None
                    assert np.array_equal(known.base.samples, then), "both sides predict from the same parent"
            memo: dict[TileKey, Wide] = {}
            seamless({key: tile.samples for key, tile in sent.items()})
            seamless({key: shown(sent, key, memo) for key in sent})
        if self.decoder.channels[Channel.BASE]:
            seamless(drawn(self.decoder))

    def check_newest(self, ground: Ground, channel: Channel = Channel.HEIGHT) -> None:
        """All that is wanted is held, as the ground is, and nothing moves along any more."""
        held = self.decoder.channels[channel]
        wanted = self.tiles.wanted_refined()
        assert wanted <= held.keys()
        memo: dict[TileKey, Wide] = {}
        for key, tile in held.items():
            assert shown(held, key, memo) is not None
            assert np.array_equal(memo[key], tile.samples), "a tile still rides along"
            if key.level <= self.server.levels or key in wanted:
                assert np.array_equal(tile.samples, ground.samples(key)), key


def seamless(tiles: dict[TileKey, Wide]) -> None:
    """Neighbours of one level agree on their edges and corners to the bit."""
    for level, at in itertools.groupby(sorted(tiles), key=lambda key: key.level):
        sides = {(key.x, key.y): rim(tiles[key]) for key in at}
        for (x, y), mine in sides.items():
            for (dx, dy), said in zip(BESIDE, mine[: len(BESIDE)], strict=True):
                theirs = sides.get((x + dx, y + dy))
                if theirs is not None:
                    assert said == theirs[len(BESIDE) + BESIDE.index((dx, dy))], (level, x, y, dx, dy)


def near(x: float, y: float, z: float = 6.0, turn: float = 0.0, **fields: object) -> View:
    target = (x + 40 * math.sin(turn), y + 40 * math.cos(turn), 0.0)
    settings = {"width": 400, "height": 300, "tau_px": 2.0} | fields
    return View.model_validate({"eye": (x, y, z), "target": target, **settings})


def a_view(rng: random.Random, ground: Ground) -> View:
    """Near one of the cones, looking anywhere."""
    bump = rng.choice(ground.bumps)
    x, y = (min(SIZE_M, max(0.0, at + rng.gauss(0, 30))) for at in (bump.x, bump.y))
    return near(x, y, rng.choice([3.0, 15.0, 80.0]), rng.uniform(0, 6.28))


def lay(server: TileServer, base: Ground | None, clock: int) -> int:
    """Puts the base of every level; None: the layers are gone. Returns how many tiles changed."""
    made = Ground() if base is None else base
    levels = range(server.levels + 1)
    return sum(server.put_level(clock, level, made.level(level), True, Channel.BASE) for level in levels)


def solve(server: TileServer, ground: Ground, clock: int, settled: bool, levels: Iterable[int] | None = None) -> None:
    for level in range(LEVELS + 1) if levels is None else levels:
        server.put_level(clock, level, ground.level(level, settled), settled)


def settle(
    server: TileServer, ground: Ground, clock: int, clients: Iterable[Client], base: Ground | None = None
) -> int:
    """Refines whatever is wanted, sends whatever is owed, until neither is left; returns how many tiles were made."""
    made = 0
    clients = list(clients)
    for _ in range(200):
        requests, count = server.requests([client.tiles for client in clients])
        assert len(requests) <= min(count, MOST_REQUESTS)
        for key in requests:
            assert server.put_tile(clock, ground.tile(key, base))
            made += 1
        for client in clients:
            client.drain()
        if not requests:
            return made
    raise AssertionError("it never comes to rest")
