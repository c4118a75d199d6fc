"""Writes ``tiles.json``: frames and what they decode to, read by pytest and vitest (DESIGN 6, 14).

Run ``python tests/vectors/make_tiles.py`` after a change of the wire format. Samples are given as the SHA-256 of their
little-endian int32 bytes, row 0 south.
"""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import FRAME_HEADER, Channel, Filter, FrameKind, Predictor, View
from esker.grid import TileKey
from esker.tiles.bounds import block_reduce, parent_distance
from esker.tiles.codec.filters import pack_smallest
from esker.tiles.codec.frame import GROUND, FrameHead, TileRecord, ratio, write_frame
from esker.tiles.codec.payload import SAMPLE_LIMIT, pack, predict
from esker.tiles.decoder import DecodedFrame, FrameDecoder
from esker.tiles.delivery import ClientTiles, TileServer

PATH = Path(__file__).with_name("tiles.json")
SIZE_M = 1000.0
LEVELS = 3
NEAR = View(eye=(430.0, 380.0, 60.0), target=(520.0, 900.0, 40.0), width=640, height=480)


def surface(level: int, seed: int) -> NDArray[np.float32]:
    """A ridge with one spike, metres; the same ground at every level, but for the spike."""
    n = grid.samples(level)
    y, x = np.mgrid[0:n, 0:n] * (SIZE_M / (n - 1))
    bump = 120 * np.exp(-(((x - 400 - 9 * seed) / 90) ** 2)) * np.cos(y / 130)
    bump[n // 5, n // 3] += 0.5
    return np.asarray(bump, dtype=np.float32)


def session() -> list[bytes]:
    """Every frame of a client that opens, looks closer, and sees two edits and a drop."""
    server = TileServer(SIZE_M, LEVELS)
    client = ClientTiles(server, rest_level=-1)
    frames: list[bytes] = []

    def drain() -> None:
        while (plan := client.plan()) is not None:
            frames.append(plan.encode())
            client.commit(plan)

    for level in range(LEVELS + 1):
        server.put_level(1, level, surface(level, 0), settled=False)
    drain()
    client.set_view(NEAR)
    drain()
    for level in range(LEVELS + 1):
        server.put_level(2, level, surface(level, 1), settled=False)
        drain()
    client.set_view(NEAR.model_copy(update={"target": (430.0, -900.0, 40.0)}))
    for level in range(LEVELS + 1):
        server.put_level(3, level, surface(level, 2), settled=True)
    drain()
    return frames


def interrupted() -> list[bytes]:
    """A slow client while somebody draws: solves are cut short, views move, frames come late (seeded)."""
    rng = np.random.default_rng(11)
    server = TileServer(SIZE_M, LEVELS)
    client = ClientTiles(server)
    frames: list[bytes] = []
    n = grid.samples(LEVELS)
    ground = np.zeros((n, n), dtype=np.float32)

    def send(most: int) -> None:
        for _ in range(most):
            plan = client.plan()
            if plan is None:
                return
            frames.append(plan.encode())
            client.commit(plan)

    for clock in range(1, 13):
        r, c, w = int(rng.integers(n)), int(rng.integers(n)), int(rng.integers(8, 90))
        window = ground[max(0, r - w) : r + w, max(0, c - w) : c + w]
        window += np.outer(*(np.sin(np.linspace(0, np.pi, k)) for k in window.shape)).astype(np.float32) * 60
        if clock % 3 == 0:
            eye = (float(rng.uniform(0, 1000)), float(rng.uniform(0, 1000)), 300.0)
            client.set_view(View(eye=eye, target=(500.0, 500.0, 0.0), width=640, height=480, tau_px=0.5))
        for level in range(LEVELS + 1 if clock % 4 == 0 else int(rng.integers(1, LEVELS + 1))):
            preview = ground[:: 1 << (LEVELS - level), :: 1 << (LEVELS - level)] * np.float32(
                1 - 0.03 * (LEVELS - level)
            )
            server.put_level(clock, level, preview, settled=False)
            send(int(rng.integers(0, 3)))
    for level in range(LEVELS + 1):
        server.put_level(12, level, ground[:: 1 << (LEVELS - level), :: 1 << (LEVELS - level)].copy(), settled=True)
    send(100)
    return frames


def confirmed() -> list[bytes]:
    """A parent moves, its children are confirmed as they are, then all move: coded against the parent in between."""
    server = TileServer(SIZE_M, 1)
    client = ClientTiles(server)
    noise = np.random.default_rng(5).normal(size=(129, 129)).astype(np.float32) * np.float32(0.06)
    bump = np.outer(np.hanning(129), np.hanning(129)).astype(np.float32)
    frames = []
    for clock, (coarse, fine) in enumerate(((0, 0), (20, 0), (45, 20))):
        server.put_level(clock, 0, (coarse * bump)[::2, ::2].copy(), settled=True)
        server.put_level(clock, 1, fine * bump + noise, settled=True)
        while (plan := client.plan()) is not None:
            frames.append(plan.encode())
            client.commit(plan)
    return frames


def extreme() -> list[bytes]:
    """Samples at both limits, so that every intermediate value is as large as it can be."""
    sign = np.where(np.indices((65, 65)).sum(axis=0) % 2, 1, -1)
    parent = (sign * SAMPLE_LIMIT).astype(np.int32)
    child = np.ascontiguousarray(np.flipud(-parent) + np.eye(65, dtype=np.int32))
    np.clip(child, -SAMPLE_LIMIT, SAMPLE_LIMIT, out=child)
    frames = []
    for level, samples, base in ((0, parent, None), (1, child, parent)):
        residual = samples if base is None else samples - predict(base)[64:, 64:]
        made, shift, payload = pack_smallest(residual, tuple(Filter))
        kind = Predictor.ZERO if base is None else Predictor.PARENT
        at = 0 if base is None else 1
        record = TileRecord(at, at, kind, shift, level + 1, 0 if base is None else 1, payload, made)
        frames.append(write_frame(FrameHead(FrameKind.FILL, level, 7, False), [], [record]))
    return frames


def channels() -> list[bytes]:
    """Every channel beside heights: flat, then a patch that grows and settles."""
    server = TileServer(SIZE_M, LEVELS)
    client = ClientTiles(server)
    frames: list[bytes] = []
    units = {Channel.BASE: 700.0, Channel.HEIGHT: 40.0, Channel.AMPLITUDE: 30.0, Channel.ROUGHNESS: 0.4}
    units |= {Channel.SNOW: 1.0, Channel.GRASS: -1.0, Channel.FOREST: 0.3, Channel.WETNESS: -0.2}
    units |= {Channel.SURVEY: 3.0, Channel.EROSION: 0.5, Channel.FAR: 0.6}
    bases = {Channel.ROUGHNESS: 0.5, Channel.SURVEY: -1.0}

    def drain() -> None:
        while (plan := client.plan()) is not None:
            frames.append(plan.encode())
            client.commit(plan)

    for clock in range(3):
        for channel, unit in units.items():
            for level in range(LEVELS + 1 if channel in GROUND else LEVELS - 1):
                n = grid.samples(level)
                y, x = np.mgrid[0:n, 0:n] * (SIZE_M / (n - 1))
                patch = np.exp(-(((x - 300) / 80) ** 2) - ((y - 420) / 150) ** 2) * unit * clock
                base = bases.get(channel, 0.0)
                server.put_level(clock, level, (base + patch).astype(np.float32), clock == 2, channel)
        drain()
    return frames


class Made:
    """A refined tile of an analytic ground: a crest with a kink, at any level the same function of the place."""

    base: NDArray[np.float32] | None = None
    content = b""

    def __init__(self, key: TileKey, lift: float, wrinkles: float = 0.4, size_m: float = SIZE_M) -> None:
        self.key = key
        step = size_m / (64 << key.level)
        y, x = (np.arange(65) + 64 * np.array([[key.y], [key.x]])) * step
        self.heights = crest(x[None, :], y[:, None], lift, wrinkles)


def crest(x: NDArray[np.float64], y: NDArray[np.float64], lift: float, wrinkles: float = 0.4) -> NDArray[np.float32]:
    """A roof along x = 437.3 m with wrinkles, lifted towards the north-west."""
    h = (
        90
        - 0.9 * np.abs(x - 437.3 - 0.1 * y)
        + wrinkles * np.abs(np.sin(y / 7.1))
        + lift * np.exp(-(x**2 + (y - 900) ** 2) / 3e5)
    )
    return np.asarray(h, dtype=np.float32)


def refined() -> list[bytes]:
    """Tiles of levels 2 to 9 over levels 0 and 1: they come, ride along with an edit, are put right, and go."""
    server = TileServer(SIZE_M, 1, 9)
    client = ClientTiles(server)
    frames: list[bytes] = []

    def drain() -> None:
        while (plan := client.plan()) is not None:
            frames.append(plan.encode())
            client.commit(plan)

    def solve(clock: int, lift: float) -> None:
        for level in (0, 1):
            n = grid.samples(level)
            y, x = np.mgrid[0:n, 0:n] * (SIZE_M / (n - 1))
            server.put_level(clock, level, crest(x, y, lift), True)
            drain()

    def settle(clock: int, lift: float) -> None:
        while requests := server.requests([client])[0]:
            for key in requests:
                assert server.put_tile(clock, Made(key, lift))
            drain()

    client.set_view(View(eye=(486.0, 480.0, 91.3), target=(486.3, 483.0, 89.9), width=120, height=240, tau_px=6.0))
    solve(1, 0)
    settle(1, 0)
    solve(2, 12)
    settle(2, 12)
    client.set_view(View(eye=(486.0, 480.0, 60.0), target=(486.3, -483.0, 80.0), width=120, height=240, tau_px=6.0))
    solve(3, 9)
    settle(3, 9)
    return frames


def plateau(x: NDArray[np.float64], y: NDArray[np.float64], lift: float) -> NDArray[np.float32]:
    """Rolling land at 300 m, with a hill that moves north."""
    rolling = 300 + 0.2 * x + 12 * np.sin(x / 290) * np.cos(y / 310)
    return np.asarray(rolling + 40 * np.exp(-((x - 480) ** 2 + (y - 400 - 9 * lift) ** 2) / 4e4), dtype=np.float32)


def based() -> list[bytes]:
    """A base comes late, under tiles that are held, moves while somebody draws, and goes; some tiles are refined."""
    rng = np.random.default_rng(7)
    server = TileServer(SIZE_M, 3, 4)
    client = ClientTiles(server, rest_level=2)
    frames: list[bytes] = []

    def send(most: int = 1000) -> None:
        for _ in range(most):
            plan = client.plan()
            if plan is None:
                return
            frames.append(plan.encode())
            client.commit(plan)

    def put(clock: int, channel: Channel, lift: float, settled: bool = True) -> None:
        for level in range(4):
            n = grid.samples(level)
            y, x = np.mgrid[0:n, 0:n] * (SIZE_M / (n - 1))
            ground = plateau(x, y, lift) if channel == Channel.BASE else crest(x, y, lift, 0.0)
            server.put_level(clock, level, ground * np.float32(lift >= 0), settled, channel)
            send(int(rng.integers(0, 3)))

    def settle(clock: int, lift: float, hill: float | None) -> None:
        while requests := server.requests([client])[0]:
            for key in requests:
                tile = Made(key, lift, 0.0)
                if hill is not None:
                    step = SIZE_M / (64 << key.level)
                    y, x = (np.arange(65) + 64 * np.array([[key.y], [key.x]])) * step
                    tile.base = plateau(x[None, :], y[:, None], hill)
                assert server.put_tile(clock, tile)
            send()

    client.set_view(View(eye=(430.0, 430.0, 480.0), target=(500.0, 520.0, 380.0), width=160, height=120, tau_px=4.0))
    put(1, Channel.HEIGHT, 0)
    settle(1, 0, None)
    send()
    put(2, Channel.BASE, 0)
    put(2, Channel.HEIGHT, 3)
    settle(2, 3, 0)
    put(3, Channel.HEIGHT, 9, settled=False)
    put(4, Channel.BASE, 2)
    put(4, Channel.HEIGHT, 9)
    settle(4, 9, 2)
    send()
    put(5, Channel.BASE, -1)
    put(5, Channel.HEIGHT, 9)
    settle(5, 9, None)
    send()
    return frames


def malformed() -> list[dict[str, str]]:
    """Frames that every decoder must refuse, each applied to the state that ``session``'s first two frames leave."""
    first = session()[0]
    head = FRAME_HEADER.itemsize
    offset = {name: FRAME_HEADER.fields[name][1] for name in FRAME_HEADER.names or ()}  # type: ignore[index]

    def patched(data: bytes, at: int, value: bytes) -> bytes:
        return data[:at] + value + data[at + len(value) :]

    def retold(
        level: int, records: list[TileRecord], drops: list[tuple[int, int]], channel: Channel = Channel.HEIGHT
    ) -> bytes:
        head = FrameHead(FrameKind.LEVEL, level, 1, False, channel)
        return write_frame(head, drops, records)

    wave = np.rint(40 * np.sin(np.arange(65 * 65) / 9)).astype(np.int32).reshape(65, 65)
    coded, wide = pack(wave), pack(np.full((65, 65), (1 << 29) + 1, dtype=np.int32))
    assert coded
    assert wide

    def one(predictor: Predictor, base: int = 0, payload: bytes = coded[1], x: int = 0, shift: int = 0) -> TileRecord:
        return TileRecord(x, 0, predictor, shift, 9, base, payload)

    flat = one(Predictor.ZERO, payload=b"")
    last = retold(0, [flat], [])
    coding = len(last) - 4
    cases = {
        "empty": b"",
        "header cut": first[: head - 1],
        "wrong magic": patched(first, 0, b"\0\0"),
        "wrong protocol": patched(first, offset["protocol"], b"\x63"),
        "unknown kind": patched(first, offset["kind"], bytes([max(Channel) + 1])),
        "level too fine": patched(first, offset["level"], b"\x0b"),
        "channel level too fine": retold(5, [], [], Channel.AMPLITUDE),
        "channel predicted from the heights": retold(1, [one(Predictor.PARENT, 1, b"")], [], Channel.ROUGHNESS),
        "unknown channel": patched(first, offset["channel"], b"\xff"),
        "more tiles than bytes": patched(first, offset["tiles"], b"\xff\xff"),
        "more drops than bytes": patched(first, offset["drops"], b"\xff\xff"),
        "tile numbers cut": last[:-2],
        "payload cut": first[:-5],
        "bytes after the end": first + b"\0",
        "tile outside": retold(0, [one(Predictor.ZERO, x=1)], []),
        "drop outside": retold(1, [], [(2, 0)]),
        "shift too large": patched(last, coding, b"\x80\x02\x12\x00\x00"),
        "number too long": patched(last, coding, b"\x80" * 6),
        "version below zero": patched(last, coding + 1, b"\x01"),
        "version beyond 32 bits": patched(last, coding + 1, b"\xff\xff\xff\xff\x7f\x00\x00"),
        "payload length beyond any tile": patched(last, coding + 3, b"\x81\x80\x10"),
        "payload longer than the frame": patched(last, coding + 3, b"\x01"),
        "bytes left over": retold(0, [one(Predictor.ZERO, payload=coded[1] + bytes(8))], []),
        "numbers beyond 32 bits": retold(0, [one(Predictor.ZERO, payload=b"\x00" * 3000)], []),
        "shifted beyond 32 bits": retold(0, [one(Predictor.ZERO, payload=wide[1], shift=15)], []),
        "parent not held": retold(3, [one(Predictor.PARENT, 1)], []),
        "wrong parent version": retold(1, [one(Predictor.PARENT, 99)], []),
        "previous version not held": retold(1, [one(Predictor.PREVIOUS, 77)], []),
        "previous of a tile not held": retold(2, [one(Predictor.PREVIOUS, 1)], []),
        "root predicted from a parent": retold(0, [one(Predictor.PARENT, 1)], []),
        "tile twice": retold(0, [flat, flat], []),
        "tile sent and dropped": retold(0, [flat], [(0, 0)]),
        "sample out of range": retold(0, [one(Predictor.ZERO, payload=wide[1])], []),
    }
    return [{"name": name, "frame": base64.b64encode(data).decode()} for name, data in cases.items()]


def told(decoder: FrameDecoder, frame: bytes) -> dict[str, Any]:
    """What a decoder must make of the next frame."""
    before = {channel: dict(held) for channel, held in decoder.channels.items()}
    out: DecodedFrame = decoder.decode(frame)
    tiles = []
    for key, tile in out.tiles.items():
        low = block_reduce(np.minimum, tile.samples, 16).ravel()
        high = block_reduce(np.maximum, tile.samples, 16).ravel()
        error = np.zeros(16, dtype=np.uint32)
        if key.level:
            r, c = 32 * (key.y & 1), 32 * (key.x & 1)
            parent = before[out.channel][key.parent()].samples[r : r + 33, c : c + 33]
            scale = ratio(out.channel)
            apart = parent_distance(tile.samples * (2 // scale), parent)
            worst = block_reduce(np.maximum, apart, 16).ravel().astype(np.int64)
            error = (-(-worst * scale // 4)).astype(np.uint32)
        tiles.append(
            {
                "x": key.x,
                "y": key.y,
                "version": tile.version,
                "samples": hashlib.sha256(tile.samples.astype("<i4").tobytes()).hexdigest(),
                "corners": [int(tile.samples[r, c]) for r in (0, 64) for c in (0, 64)],
                "sub_min": low.tolist(),
                "sub_max": high.tolist(),
                "sub_error": error.tolist(),
            }
        )
    return {
        "kind": int(out.kind),
        "channel": int(out.channel),
        "level": out.level,
        "clock": out.clock,
        "settled": out.settled,
        "drops": [[d.x, d.y] for d in out.drops],
        "tiles": tiles,
        "held": len(decoder.channels[out.channel]),
    }


def build() -> dict[str, Any]:
    """The whole file."""
    sessions = []
    for made in (session, interrupted, confirmed, extreme, channels, refined, based):
        name, frames = made.__name__, made()
        decoder = FrameDecoder()
        steps = [{"frame": base64.b64encode(f).decode(), "decoded": told(decoder, f)} for f in frames]
        sessions.append({"name": name, "steps": steps})
    return {"sessions": sessions, "malformed": malformed()}


if __name__ == "__main__":
    PATH.write_text(json.dumps(build(), separators=(",", ":")).replace('{"frame"', '\n{"frame"') + "\n")
