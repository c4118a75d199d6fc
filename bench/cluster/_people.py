"""Clients of a benchmark that draw at fixed times and come back by themselves, as the page does."""

from __future__ import annotations

import asyncio
import json
import random
import time
from dataclasses import dataclass, field
from typing import Any, Final

from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as open_socket
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidMessage

from bench.room._serving import post
from esker import contract as c

LOST: Final = (OSError, ConnectionClosed, InvalidHandshake, InvalidMessage, TimeoutError)
FIRST_SECONDS, MOST_SECONDS = 0.4, 15.0
"""Delays of the page before it comes back (``frontend/src/net/connection.ts``)."""
POINTS, STROKE_POINTS = 4, 64
OTHERS: Final = ('{"type":"ordered"', '{"type":"presences"')
"""What others do is received and not read: sixty clients in one process would read it sixty times."""


@dataclass
class Terrain:
    """A terrain on which a benchmark draws."""

    id: str
    secret: str


def terrain(base: str) -> Terrain:
    """A new terrain, made at a server."""
    made = post(f"{base}/api/terrains", {})
    return Terrain(made["id"], made["secret"])


@dataclass
class Tally:
    """What all clients have seen. Times are of ``time.perf_counter``."""

    acks: list[float] = field(default_factory=list)
    """Seconds from the moment at which an operation was due to its acknowledgement."""
    back: dict[str, float] = field(default_factory=dict)
    """When each client that was cut off had its next acknowledgement."""
    since: float = 0.0
    """Acknowledgements of operations that were due before are not counted."""
    refused: int = 0
    saved: int = 0


class Person:
    """Somebody who draws."""

    def __init__(self, name: str, where: Terrain, doors: list[str], tally: Tally) -> None:
        """``doors``: addresses of sockets; the first is taken as long as it answers, as a balancer would have it."""
        self.name, self.where, self.doors, self.tally = name, where, doors, tally
        self._due: dict[str, float] = {}
        self._unsent: dict[str, str] = {}
        self._socket: ClientConnection | None = None
        self._token: str | None = None
        self._ticket: str | None = None
        self._counter, self._attempt = 0, 0
        self.is_online, self.was_cut = asyncio.Event(), False
        self._stopping = False

    async def stay(self) -> None:
        """Stays connected until it is stopped."""
        while not self._stopping:
            moved = False
            try:
                await self._connection()
            except LOST as error:
                received = error.rcvd if isinstance(error, ConnectionClosed) else None
                moved = received is not None and received.code == c.WS_CLOSE["moved"]
            if self._stopping:
                return
            self.was_cut = self.is_online.is_set() or self.was_cut
            self.is_online.clear()
            self.doors.append(self.doors.pop(0))
            delay = min(MOST_SECONDS, FIRST_SECONDS * 2**self._attempt)
            self._attempt += 1
            spread = c.MOVED_WITHIN_MS / 1000 * random.random()
            await asyncio.sleep(spread if moved and self._attempt == 1 else delay * random.uniform(0.5, 1.0))

    async def _connection(self) -> None:
        opening = open_socket(
            self.doors[0], subprotocols=[c.SUBPROTOCOL], compression=None, max_size=None, proxy=None, open_timeout=10,  # type: ignore[list-item]
            ping_interval=None,
        )  # fmt: skip
        async with opening as socket:
            self._socket = socket
            hello = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": self.where.id,
                     "secret": self.where.secret, "client": self.name, "name": self.name}  # fmt: skip
            more = {"token": self._token, "ticket": self._ticket}
            await socket.send(json.dumps(hello | {key: value for key, value in more.items() if value}))
            async for message in socket:
                if isinstance(message, str) and message.startswith(OTHERS):
                    continue
                if isinstance(message, bytes):
                    await socket.send(f'{{"type":"credit","bytes":{len(message)}}}')
                else:
                    await self._take(json.loads(message), socket)

    async def _take(self, message: dict[str, Any], socket: ClientConnection) -> None:
        now = time.perf_counter()
        if message["type"] == "welcome":
            self._token, self._ticket, self._attempt = message["token"], message.get("ticket"), 0
            if not self._counter:
                stroke = {"id": self.name, "kind": "profile", "first": [100, 100, 0], "last": [900, 100, 0],
                          "curve": [], "hidden": True}  # fmt: skip
                await self.say({"type": "stroke.begin", "stroke": stroke}, now)
            else:
                for text in list(self._unsent.values()):
                    await socket.send(text)
            self.is_online.set()
        elif message["type"] == "ack":
            for op_id in message["ids"]:
                due = self._due.pop(op_id, None)
                self._unsent.pop(op_id, None)
                if due is not None:
                    self.tally.saved += 1
                    if due >= self.tally.since:
                        self.tally.acks.append(now - due)
            if self.was_cut and self.name not in self.tally.back:
                self.tally.back[self.name] = now
        elif message["type"] == "reject":
            self.tally.refused += 1
            self._unsent.pop(message["id"], None)

    async def say(self, op: dict[str, Any], due: float) -> None:
        """Sends an operation, now or when there is a connection again."""
        op_id = f"{self.name}:{self._counter}"
        self._counter += 1
        self._due[op_id] = due
        text = json.dumps({"type": "ops", "ops": [{"id": op_id, "op": op}]}, separators=(",", ":"))
        self._unsent[op_id] = text
        if self.is_online.is_set() or op_id.endswith(":0"):
            try:
                assert self._socket is not None
                await self._socket.send(text)
            except LOST:
                return

    async def draw(self, rate: float, start: float, seconds: float, offset: float) -> None:
        """Appends to its own stroke at fixed times."""
        for n in range(int(rate * seconds)):
            due = start + (n + offset) / rate
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            first = n * POINTS % STROKE_POINTS
            points = [[(first + i) / STROKE_POINTS, 10.0 + i + n % 7] for i in range(POINTS)]
            op = {"type": "stroke.append", "stroke": self.name, "start": first, "points": points, "last": [900, 100, 0]}
            await self.say(op, due)

    async def stop(self) -> None:
        """Leaves."""
        self._stopping = True
        if self._socket is not None:
            await self._socket.close()
