"""Hostile frames: how a server, and a room beside it, take a million frames that know the protocol (SPEC P403).

A server process of its own; connections come from many addresses and by many links, as no share and no purse is to end
the attack. Each says hello, most of them well, and sends frames made from the contract's models until one breaks the
connection. Beside them somebody draws in another room. Counted are frames that the server had to read (those up to the
one upon which it hangs up, as the protocol's own state machine tells), deaths, tracebacks, and what the bystander lost.
"""

from __future__ import annotations

import argparse
import asyncio
import base64
import json
import math
import random
import sys
import tempfile
import time
import urllib.request
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from bench.room import _serving
from bench.strangers._attacks import frame
from bench.strangers._hostile_frames import Frames, before_hello
from bench.strangers.siege import Server, serve
from esker import contract as c
from esker.session.room import protocol
from esker.version import VERSION

TERRAINS: Final = 12
LINKS: Final = ("edit", "edit", "edit", "view", "view")
AT_ONCE: Final = 24
FRAMES_EACH: Final = 120
"""Frames of a connection, at most."""
STRANGERS: Final = 0.1
"""Share of the connections that are not let in."""
ANSWER_SECONDS: Final = 60.0
TELL_SECONDS: Final = 30.0
DRAW_EVERY: Final = 0.25
PING: Final = b'{"type":"ping","t":4711}'
PONG: Final = b"4711"
Pipe = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@dataclass
class Count:
    """What was sent and what became of it."""

    frames: int = 0
    connections: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    """How connections ended: "answered" to the last, "closed" by the server, "silent": neither."""


async def _open(server: Server, source: str) -> Pipe:
    parts = urlsplit(server.base)
    host, port = parts.hostname or "127.0.0.1", parts.port or 80
    reader, writer = await asyncio.wait_for(asyncio.open_connection(host, port, local_addr=(source, 0)), ANSWER_SECONDS)
    key = base64.b64encode(random.randbytes(16)).decode()
    writer.write(
        f"GET /ws HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Protocol: {c.SUBPROTOCOL}\r\n\r\n".encode()
    )
    await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), ANSWER_SECONDS)
    return reader, writer


def hello(terrain: str, secret: str, client: str) -> str:
    """A hello that is let in."""
    message = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": terrain, "secret": secret, "client": client}
    return json.dumps(message)


def until_closed(first: str, frames: list[bytes]) -> int:
    """How many of the frames a server reads before one ends the connection, that one included."""
    twin = protocol.Connection(0.0, c.SUBPROTOCOL)
    twin.text(first, 0.0)
    for n, data in enumerate(frames):
        text = _payload(data)
        if text is None or any(isinstance(event, protocol.Close) for event in twin.text(text, 0.0)):
            return n + 1
    return len(frames)


def _payload(data: bytes) -> str | None:
    """The text of one whole text frame; None for anything else."""
    size, at = data[1] & 0x7F, 2
    if data[0] != 0x81 or not data[1] & 0x80:
        return None
    if size == 126:
        size, at = int.from_bytes(data[2:4], "big"), 4
    elif size == 127:
        size, at = int.from_bytes(data[2:10], "big"), 10
    try:
        return data[at + 4 :].decode() if len(data) == at + 4 + size else None
    except UnicodeDecodeError:
        return None


async def _attack(server: Server, rng: random.Random, known: tuple[str, str], count: Count) -> None:
    """One connection from an address of its own."""
    client = f"h{rng.getrandbits(48):x}"
    if rng.random() < STRANGERS:
        opening, frames = b"", [before_hello(rng)]
        read = 1
    else:
        first, source = hello(*known, client), iter(Frames(rng, client))
        opening, frames = frame(first.encode()), [next(source) for _ in range(rng.randint(1, FRAMES_EACH))]
        read = until_closed(first, frames)
    address = f"127.{rng.randint(1, 250)}.{rng.randint(0, 255)}.{rng.randint(1, 254)}"
    end = "silent"
    with suppress(ConnectionError, asyncio.IncompleteReadError):
        reader, writer = await _open(server, address)
        try:
            writer.write(opening + b"".join(frames[:read]) + frame(PING))
            end = await asyncio.wait_for(_answered(reader), ANSWER_SECONDS)
        except TimeoutError:
            end = "silent"
        except ConnectionError:
            end = "closed"
        finally:
            writer.transport.abort()
    count.frames += read
    count.connections += 1
    count.ends[end] += 1


async def _answered(reader: asyncio.StreamReader) -> str:
    tail = b""
    while data := await reader.read(1 << 16):
        tail = tail[-64:] + data
        if PONG in tail:
            return "answered"
    return "closed"


class Bystander:
    """Somebody who draws in another room, and what was lost of it."""

    def __init__(self, server: Server, terrain: str, secret: str) -> None:
        self._server, self._terrain, self._secret = server, terrain, secret
        self.sent, self.acked, self.waits, self.closed = 0, 0, [0.0], False
        self._times: dict[int, float] = {}

    async def draw(self, until: asyncio.Event) -> None:
        """Begins a stroke, and adds to it until told to stop; then waits for what was not acknowledged."""
        reader, writer = await _open(self._server, "127.0.0.1")
        writer.write(frame(hello(self._terrain, self._secret, "by").encode()))
        listening = asyncio.create_task(self._listen(reader, writer))
        stroke = {"id": "s", "kind": "profile", "first": [900, 900, 0], "last": [2600, 2000, 20], "curve": [[0, 0]]}
        self._say(writer, {"type": "stroke.begin", "stroke": stroke})
        while not until.is_set() and not self.closed:
            await asyncio.sleep(DRAW_EVERY)
            points = [[(self.sent % 1000) / 1000, 40.0 + self.sent % 60]]
            start = min(self.sent, 900)
            self._say(
                writer,
                {"type": "stroke.append", "stroke": "s", "start": start, "points": points, "last": [2600, 2000, 20]},
            )
        end = time.monotonic() + ANSWER_SECONDS
        while self.acked < self.sent and time.monotonic() < end and not self.closed:
            await asyncio.sleep(0.1)
        listening.cancel()
        writer.close()

    def _say(self, writer: asyncio.StreamWriter, op: dict[str, Any]) -> None:
        self._times[self.sent] = time.monotonic()
        writer.write(frame(json.dumps({"type": "ops", "ops": [{"id": f"by:{self.sent}", "op": op}]}).encode()))
        self.sent += 1

    async def _listen(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError, asyncio.IncompleteReadError):
            while True:
                head = await reader.readexactly(2)
                size = head[1]
                if size >= 126:
                    size = int.from_bytes(await reader.readexactly(2 if size == 126 else 8), "big")
                data = await reader.readexactly(size)
                if head[0] & 15 == 9:  # who does not answer a ping is taken for gone
                    writer.write(frame(data, 10))
                if head[0] & 15 == 1 and data.startswith(b'{"type":"ack"'):
                    for op_id in json.loads(data)["ids"]:
                        self.waits.append(time.monotonic() - self._times.pop(int(op_id.partition(":")[2])))
                        self.acked += 1
        self.closed = True

    @property
    def hurt(self) -> int:
        """Operations that were not acknowledged; all of them if the connection was closed."""
        return self.sent if self.closed else self.sent - self.acked


async def run(server: Server, frames: int, seed: int, seconds: float = math.inf) -> dict[str, Any]:
    """Attacks until so many frames were read, or so much time has passed."""
    made = [_serving.post(f"{server.base}/api/terrains", {}) for _ in range(TERRAINS + 1)]
    known = [
        (terrain["id"], _link(server, terrain, role)) for terrain in made[1:] for role in LINKS
    ]  # fmt: skip
    count, over, rng = Count(), asyncio.Event(), random.Random(seed)
    bystander = Bystander(server, made[0]["id"], made[0]["secret"])
    drawing = asyncio.create_task(bystander.draw(over))
    began = time.monotonic()

    async def attacker() -> None:
        while count.frames < frames and time.monotonic() < began + seconds and server.process.is_running():
            await _attack(server, random.Random(rng.getrandbits(64)), rng.choice(known), count)

    async def tell() -> None:
        while True:
            await asyncio.sleep(TELL_SECONDS)
            drawn = f"bystander: {bystander.acked} of {bystander.sent} acknowledged"
            sys.stderr.write(f"{count.frames} frames, {dict(count.ends)}, {drawn}\n")
            sys.stderr.flush()

    telling = asyncio.create_task(tell())
    await asyncio.gather(*(attacker() for _ in range(AT_ONCE)))
    telling.cancel()
    took = time.monotonic() - began
    over.set()
    await drawing
    with urllib.request.urlopen(f"{server.base}/healthz", timeout=ANSWER_SECONDS) as answer:
        healthy = answer.status == 200
    return {
        "frames": count.frames, "connections": count.connections, "ends": dict(count.ends),
        "seconds": round(took, 1),
        "healthy_after": healthy, "bystander": {
            "operations": bystander.sent, "hurt": bystander.hurt, "longest_wait_s": round(max(bystander.waits), 2),
        },
    }  # fmt: skip


def _link(server: Server, terrain: dict[str, str], role: str) -> str:
    made = _serving.post(f"{server.base}/api/terrains/{terrain['id']}/links", {"role": role}, terrain["secret"])
    return str(made["secret"])


def besiege(frames: int, seed: int, seconds: float = math.inf) -> dict[str, Any]:
    """The whole result: a server of its own, and what it logged."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "server.log"
        with serve(log) as server:
            found = asyncio.run(run(server, frames, seed, seconds))
            alive = server.process.is_running()
        text = log.read_text(encoding="utf-8", errors="replace")
    errors = [line for line in text.splitlines() if " E " in line or "Traceback" in line or "Error" in line]
    return found | {"deaths": int(not alive), "tracebacks": text.count("Traceback"), "errors": errors[:20]}


def main(argv: list[str]) -> int:
    """``esker bench frames [--json] [--frames N] [--seconds S] [--seed S]``."""
    parser = argparse.ArgumentParser(prog="esker bench frames", description=__doc__)
    parser.add_argument("--frames", type=int, default=1_000_000, help="that the server reads")
    parser.add_argument("--seconds", type=float, default=math.inf, help="after which it ends, however many were read")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--note", default="", help="a sentence about the circumstances, kept in the result")
    arguments = parser.parse_args(argv)
    machine = _serving.machine()
    found = besiege(arguments.frames, arguments.seed, arguments.seconds)
    head = {"bench": "frames", "version": VERSION, "machine": machine, "note": arguments.note, "seed": arguments.seed}
    held = not (found["deaths"] or found["tracebacks"] or found["bystander"]["hurt"] or found["ends"].get("silent"))
    result = head | found | {"held": held}
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        sys.stdout.write("".join(f"{key}: {value}\n" for key, value in result.items()))
    return 0 if held else 1
