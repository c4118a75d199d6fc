"""What strangers and viewers do to a server in ``esker bench siege``: each attack goes on until its time is over.

Everything goes to the address that the benchmark gives, which is its own server's on the loopback interface, and comes
from other loopback addresses than those of the people who draw, as a stranger's would.
"""

from __future__ import annotations

import asyncio
import base64
import json
import os
import secrets
import struct
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import urlsplit

from esker import contract as c
from esker.document import archive

STROKES: Final = 3_000
"""Strokes of the heavy terrain: as many as one file may hold."""


@dataclass(frozen=True)
class Target:
    """The target of attacks: the server, the terrain where people draw, and the secret of a link to look at it."""

    base: str
    terrain: str
    viewer: str
    until: float
    """Time of ``time.monotonic()`` at which the attack is over."""
    source: str = "127.0.0.7"
    """The address that the attack comes from."""

    @property
    def place(self) -> tuple[str, int]:
        """Host and port."""
        parts = urlsplit(self.base)
        return parts.hostname or "127.0.0.1", parts.port or 80

    @property
    def over(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() >= self.until


Pipe = tuple[asyncio.StreamReader, asyncio.StreamWriter]
Attack = Callable[[Target], Awaitable[int]]
"""Returns how often it did what it does."""


async def _connect(at: Target) -> Pipe:
    return await asyncio.wait_for(asyncio.open_connection(*at.place, local_addr=(at.source, 0)), 5)


async def _http(
    at: Target, method: str, path: str, body: bytes = b"", secret: str = "", more: str = ""
) -> tuple[int, Any]:
    """Status and JSON of one request."""
    reader, writer = await _connect(at)
    try:
        key = f"Authorization: Bearer {secret}\r\n" if secret else ""
        head = f"{method} {path} HTTP/1.1\r\nHost: {at.place[0]}:{at.place[1]}\r\nConnection: close\r\n{key}{more}"
        kind = "Content-Type: application/json\r\n" if body[:1] == b"{" else ""
        writer.write(f"{head}{kind}Content-Length: {len(body)}\r\n\r\n".encode() + body)
        answer = await asyncio.wait_for(reader.read(), 20)
        text, _, content = answer.partition(b"\r\n\r\n")
        with suppress(ValueError):
            return int(text.split(b" ", 2)[1]), json.loads(content)
        return int(text.split(b" ", 2)[1]), None
    finally:
        writer.close()


def frame(payload: bytes, opcode: int = 1, fin: bool = True) -> bytes:
    """A masked frame of a client (RFC 6455, 5.2). The mask is zero, so the payload travels as it is."""
    size = len(payload)
    if size < 126:
        head = struct.pack("!BB", (fin << 7) | opcode, 0x80 | size)
    elif size < 1 << 16:
        head = struct.pack("!BBH", (fin << 7) | opcode, 0x80 | 126, size)
    else:
        head = struct.pack("!BBQ", (fin << 7) | opcode, 0x80 | 127, size)
    return head + bytes(4) + payload


async def _socket(at: Target, path: str = "/ws") -> Pipe:
    reader, writer = await _connect(at)
    key = base64.b64encode(os.urandom(16)).decode()
    writer.write(
        f"GET {path} HTTP/1.1\r\nHost: {at.place[0]}:{at.place[1]}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Protocol: {c.SUBPROTOCOL}\r\n\r\n".encode()
    )
    await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), 10)
    return reader, writer


def _hello(terrain: str, secret: str, more: dict[str, Any] | None = None) -> bytes:
    client = secrets.token_hex(8)
    message = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": terrain, "secret": secret, "client": client}
    return frame(json.dumps(message | (more or {})).encode())


async def _member(at: Target, terrain: str, secret: str, more: dict[str, Any] | None = None) -> Pipe:
    reader, writer = await _socket(at)
    writer.write(_hello(terrain, secret, more))
    return reader, writer


async def _drain(reader: asyncio.StreamReader, at: Target) -> None:
    with suppress(OSError):
        while not at.over and len(await reader.read(1 << 16)):
            pass


async def _pump(at: Target, opening: bytes, payload: bytes) -> int:
    """Sends ``payload`` for ever, on a new connection whenever the server closes the old one."""
    count = 0
    while not at.over:
        with suppress(OSError, TimeoutError, asyncio.IncompleteReadError):
            reader, writer = await _socket(at)
            reading = asyncio.create_task(_drain(reader, at))
            try:
                writer.write(opening)
                while not at.over and not reading.done():
                    writer.write(payload)
                    count += 1
                    await asyncio.wait_for(writer.drain(), 5)
                    await asyncio.sleep(0)
            finally:
                reading.cancel()
                writer.close()
        await asyncio.sleep(0.01)
    return count


async def _many(at: Target, each: Callable[[], Awaitable[None]], most: int, at_once: int = 8) -> int:
    """Does something as often as it can, ``at_once`` at a time, at most ``most`` times; what opens stays open."""
    count = 0

    async def one() -> None:
        nonlocal count
        while not at.over and count < most:
            count += 1
            with suppress(OSError, TimeoutError, ValueError, IndexError, asyncio.IncompleteReadError):
                await each()
            await asyncio.sleep(0)

    await asyncio.gather(*(one() for _ in range(at_once)))
    await asyncio.sleep(max(0.0, at.until - time.monotonic()))
    return count


async def bad_operations(at: Target) -> int:
    """256 operations in a message, each refused one by one."""
    bad = [{"id": f"x:{k}", "op": {"type": "stroke.set", "stroke": "s", "fields": {"nothing": k}}} for k in range(256)]
    return await _pump(at, _hello(at.terrain, at.viewer), frame(json.dumps({"type": "ops", "ops": bad}).encode()))


async def continuations(at: Target) -> int:
    """A message whose empty frames never end."""
    return await _pump(at, frame(b"{", fin=False), frame(b"", 0, fin=False) * 1000)


async def pings(at: Target) -> int:
    """Pings, a thousand at a time."""
    return await _pump(at, _hello(at.terrain, at.viewer), frame(b"x" * 100, 9) * 1000)


async def garbage(at: Target) -> int:
    """Random bytes in text frames, and whole messages of 64 KiB, from who never said hello."""
    return await _pump(at, b"", frame(os.urandom(200)) + frame(b'{"type":"ops","ops":[' + b"1," * 30_000))


async def silent_connections(at: Target) -> int:
    """Hundreds of connections that never say anything."""
    held: list[asyncio.StreamWriter] = []
    try:
        return await _many(at, lambda: _hold(held, _connect(at)), 2_000)
    finally:
        _close(held)


async def connections(at: Target) -> int:
    """Connections that are opened and closed again, as fast as they are accepted."""

    async def pass_by() -> None:
        (await _connect(at))[1].transport.abort()

    return await _many(at, pass_by, 1_000_000)


async def _hold(held: list[asyncio.StreamWriter], opening: Awaitable[Pipe]) -> None:
    held.append((await opening)[1])


def _close(held: list[asyncio.StreamWriter]) -> None:
    for writer in held:
        writer.transport.abort()


async def seats(at: Target) -> int:
    """Every seat of the room, through a link to look; nobody reads."""
    held: list[asyncio.StreamWriter] = []
    try:
        return await _many(at, lambda: _hold(held, _member(at, at.terrain, at.viewer)), 400)
    finally:
        _close(held)


async def history_rooms(at: Target) -> int:
    """History rooms, each with a solver's work."""
    held: list[asyncio.StreamWriter] = []
    try:
        return await _many(at, lambda: _hold(held, _member(at, at.terrain, at.viewer, {"at": 1})), 400)
    finally:
        _close(held)


async def new_rooms(at: Target) -> int:
    """New terrains, each opened and kept open."""
    held: list[asyncio.StreamWriter] = []

    async def one() -> None:
        status, made = await _http(at, "POST", "/api/terrains", b"{}")
        if status == 201:
            held.append((await _member(at, made["id"], made["secret"]))[1])
        else:
            await asyncio.sleep(0.05)

    try:
        return await _many(at, one, 2_000)
    finally:
        _close(held)


def _heavy(strokes: int, points: int) -> bytes:
    """A terrain file with many strokes."""
    made = [
        c.Stroke(
            id=f"s{k}", kind="profile", first=(100.0 + 37 * k % 3800, 100.0 + 91 * k % 3800, 0.0),
            last=(300.0 + 53 * k % 3600, 200.0 + 29 * k % 3700, 10.0),
            curve=tuple((n / points, 50.0 + (n * k) % 97) for n in range(points + 1)), finished=True,
        )
        for k in range(strokes)
    ]  # fmt: skip
    return archive.dumps(c.Document(id="x", strokes=tuple(made)))


async def _made(at: Target, data: bytes) -> tuple[str, str] | None:
    with suppress(OSError, TimeoutError, ValueError, IndexError):
        status, made = await _http(at, "POST", "/api/terrains/import", data)
        if status == 201:
            return made["id"], made["secret"]
    return None


async def heavy_room(at: Target) -> int:
    """A terrain of thousands of strokes whose reach changes thirty times a second."""
    made = await _made(at, await asyncio.to_thread(_heavy, STROKES, 8))
    if made is None:
        return 0
    reader, writer = await _member(at, *made)
    text = (await asyncio.wait_for(reader.read(1 << 20), 20)).decode("utf-8", "ignore")
    client = text.partition('"client":"')[2].partition('"')[0]
    reading, count = asyncio.create_task(_drain(reader, at)), 0
    with suppress(OSError):
        while not at.over and not reading.done():
            count += 1
            op = {"type": "terrain.set", "fields": {"reach_m": 60.0 + count % 60}}
            writer.write(frame(json.dumps({"type": "ops", "ops": [{"id": f"{client}:{count}", "op": op}]}).encode()))
            await writer.drain()
            await asyncio.sleep(1 / 30)
    reading.cancel()
    writer.close()
    return count


async def impossible_numbers(at: Target) -> int:
    """A terrain of one's own with every number at its end, in messages that are well formed."""
    ends = ["1e-300", "5e-324", "1e308", "-1e308", "0", "-0.0", "NaN", "1e999"]
    fields = ("reach_m", "sea_level_m", "lakes_m", "rivers", "wetness", "seed")
    ops = ",".join(
        f'{{"id":"y:{k}","op":{{"type":"terrain.set","fields":{{"{name}":{end}}}}}}}'
        for k, (name, end) in enumerate((name, end) for name in fields for end in ends)
    )
    status, made = await _http(at, "POST", "/api/terrains", b"{}")
    if status != 201:
        return 0
    opening = _hello(made["id"], made["secret"])
    return await _pump(at, opening, frame(b'{"type":"ops","ops":[' + ops.encode() + b"]}"))


async def journal(at: Target) -> int:
    """Operations of 60 KB, as fast as they are taken, to a terrain of one's own."""
    status, made = await _http(at, "POST", "/api/terrains", b"{}")
    if status != 201:
        return 0
    reader, writer = await _member(at, made["id"], made["secret"])
    reading, count = asyncio.create_task(_drain(reader, at)), 0
    points = [[n / 4000, float(n % 90)] for n in range(4000)]
    with suppress(OSError, TimeoutError):
        while not at.over and not reading.done():
            count += 1
            stroke = {"id": f"s{count}", "kind": "profile", "first": [9, 9, 0], "last": [999, 9, 0], "curve": points}
            op = {"id": f"z:{count}", "op": {"type": "stroke.begin", "stroke": stroke}}
            writer.write(frame(json.dumps({"type": "ops", "ops": [op]}).encode()))
            await asyncio.wait_for(writer.drain(), 5)
            await asyncio.sleep(0.002)
    reading.cancel()
    writer.close()
    return count


async def deaf_readers(at: Target) -> int:
    """A heavy document, welcomed by many who do not read."""
    made = await _made(at, await asyncio.to_thread(_heavy, 1_500, 60))
    if made is None:
        return 0
    held: list[asyncio.StreamWriter] = []
    try:
        return await _many(at, lambda: _hold(held, _member(at, *made)), 200)
    finally:
        _close(held)


async def uploads(at: Target) -> int:
    """Elevation files: small ones that grow, and bodies that never end."""
    grid = b"ncols 1400\nnrows 1400\nxllcorner 0\nyllcorner 0\ncellsize 1\n" + b"1 " * 1400 * 1400
    held: list[asyncio.StreamWriter] = []

    async def slow() -> None:
        _, writer = await _connect(at)
        head = f"POST /api/terrains/from-grid?name=a.asc HTTP/1.1\r\nHost: {at.place[0]}:{at.place[1]}\r\n"
        writer.write(f"{head}Content-Length: 200000000\r\n\r\n".encode() + b"n")
        held.append(writer)
        await _http(at, "POST", "/api/terrains/from-grid?name=b.asc", grid)

    try:
        return await _many(at, slow, 300, 6)
    finally:
        _close(held)


async def codes(at: Target) -> int:
    """Guesses of join codes."""

    async def guess() -> None:
        code = "".join(secrets.choice("ABCDEFGHJKMNPQRSTUVWXYZ23456789") for _ in range(6))
        await _http(at, "POST", "/api/join", json.dumps({"code": code}).encode())

    return await _many(at, guess, 100_000)


async def requests(at: Target) -> int:
    """Pages, pictures, archives and wrong addresses, as fast as they are answered."""
    paths = ["/", "/healthz", f"/api/terrains/{at.terrain}/archive", f"/api/terrains/{at.terrain}/history", "/nope"]

    async def ask() -> None:
        await _http(at, "GET", secrets.choice(paths), secret=at.viewer, more="Range: bytes=zz\r\n")

    return await _many(at, ask, 100_000, 16)


ATTACKS: Final[dict[str, Attack]] = {
    attack.__name__: attack
    for attack in (
        bad_operations, continuations, pings, garbage, silent_connections, connections, seats, history_rooms, new_rooms,
        heavy_room, impossible_numbers, journal, deaf_readers, uploads, codes, requests,
    )
}  # fmt: skip
BY_LINK: Final = frozenset({"bad_operations", "pings", "seats", "history_rooms", "requests", "exports"})
"""Those that need a link: a viewer has one to the terrain where people draw, a stranger one to another terrain."""
