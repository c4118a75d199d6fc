"""Fan-out: many people drawing at once, validated and durable (DESIGN 15).

A server process of its own; this process plays the clients: each sends ops at fixed times, round the clock of the
schedule and not of the answers, and notes when each op of another reaches it. What is timed is from the *scheduled*
moment of sending to the receipt at each of the others, so a client that falls behind counts against the result.

Ops are appends of four points to the client's own stroke, which is hidden, so that the solver has nothing to do and
the figure is that of the room alone; ``--solve`` shows the strokes and lets it work. ``--floor`` measures a bare relay
in the same way: same messages, no validation, no order, nothing on disk.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import subprocess
import sys
import time
import urllib.request
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil
import uvloop
from numpy.typing import NDArray
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as open_socket
from websockets.asyncio.server import ServerConnection
from websockets.asyncio.server import serve as serve_sockets
from websockets.exceptions import ConnectionClosed

from bench.room import _serving
from esker import contract as c
from esker.version import VERSION

POINTS: Final = 4
STROKE_POINTS: Final = 64
"""The stroke starts again after so many points, as a drawn line has about that many."""
WARM_UP: Final = 2.0


@dataclass(frozen=True)
class _Parsed:
    """A message that was read once for all clients to whom the same text came: what it costs is the players' affair,
    not the room's, and the players share the machine with the server."""

    text: str
    kind: str
    ids: tuple[str, ...]
    authors: NDArray[np.int64]
    at: NDArray[np.float64]


@dataclass
class _Run:
    """What one run measures."""

    clients: int
    rate: float
    seconds: float
    show: bool
    sent: dict[str, float] = field(default_factory=dict)
    delays: list[NDArray[np.float64]] = field(default_factory=list)
    parsed: _Parsed | None = None
    acks: list[float] = field(default_factory=list)
    refused: int = 0
    received_bytes: int = 0


def _begin(client: str, show: bool) -> dict[str, Any]:
    stroke = {
        "id": client,
        "kind": "profile",
        "first": [100, 100, 0],
        "last": [900, 100, 0],
        "curve": [],
        "hidden": not show,
    }
    return {"type": "stroke.begin", "stroke": stroke}


def _append(client: str, n: int) -> dict[str, Any]:
    start = n * POINTS % STROKE_POINTS
    points = [[(start + i) / STROKE_POINTS, 10.0 + i + n % 7] for i in range(POINTS)]
    return {"type": "stroke.append", "stroke": client, "start": start, "points": points, "last": [900, 100, 0]}


class _Client:
    """One person who draws."""

    def __init__(self, index: int, run: _Run, ws: ClientConnection) -> None:
        self.name, self.run, self.ws, self.index = f"c{index}", run, ws, index

    async def draw(self, start: float) -> None:
        """Sends one op each period, spread over the period by client."""
        period = 1 / self.run.rate
        total = int((self.run.seconds + WARM_UP) * self.run.rate)
        for n in range(total):
            at = start + (n + self.index / self.run.clients) * period
            delay = at - time.perf_counter()
            if delay > 0:
                await asyncio.sleep(delay)
            op_id = f"{self.name}:{n + 1}"
            if at >= start + WARM_UP:
                self.run.sent[op_id] = at
            await self.ws.send(_message(op_id, _append(self.name, n)))

    async def listen(self) -> None:
        """Notes the arrival of every op of another."""
        with suppress(ConnectionClosed):
            async for message in self.ws:
                self.run.received_bytes += len(message)
                if isinstance(message, bytes):
                    await self.ws.send(f'{{"type":"credit","bytes":{len(message)}}}')
                else:
                    self._note(message, time.perf_counter())

    def _note(self, text: str, now: float) -> None:
        run = self.run
        message = run.parsed
        if message is None or message.text != text:
            message = run.parsed = _parse(text, run.sent)
        if message.kind in ("ordered", "ops"):
            others = message.at[(message.authors != self.index) & (message.at > 0)]
            if len(others):
                run.delays.append(now - others)
        elif message.kind == "ack":
            run.acks += [now - run.sent[op_id] for op_id in message.ids if op_id in run.sent]
        elif message.kind == "reject":
            run.refused += 1


def _parse(text: str, sent: dict[str, float]) -> _Parsed:
    message = json.loads(text)
    ops = message["ops"] if message["type"] in ("ordered", "ops") else ()
    ids = tuple(message["ids"]) if message["type"] == "ack" else tuple(op["id"] for op in ops)
    authors = np.array([int(op_id[1 : op_id.index(":")]) for op_id in ids], dtype=np.int64)
    return _Parsed(text, message["type"], ids, authors, np.array([sent.get(op_id, -1.0) for op_id in ids]))


def _message(op_id: str, op: dict[str, Any]) -> str:
    return json.dumps({"type": "ops", "ops": [{"id": op_id, "op": op}]}, separators=(",", ":"))


async def _play(run: _Run, url: str, hello: dict[str, Any] | None, process: psutil.Process) -> dict[str, Any]:
    clients: list[_Client] = []
    for i in range(run.clients):
        ws = await open_socket(url, subprotocols=[c.SUBPROTOCOL], compression=None, max_size=None, proxy=None)  # type: ignore[list-item]
        clients.append(_Client(i, run, ws))
        if hello is not None:
            await ws.send(json.dumps(hello | {"client": f"c{i}", "name": f"Client {i}"}))
            await ws.send(_message(f"c{i}:0", _begin(f"c{i}", run.show)))
    listeners = [asyncio.create_task(client.listen()) for client in clients]
    await asyncio.sleep(1.0)
    start = time.perf_counter() + 0.1
    drawing = [asyncio.create_task(client.draw(start)) for client in clients]
    await asyncio.sleep(start + WARM_UP - time.perf_counter())
    before, own, wall = _cpu(process), _cpu(psutil.Process()), time.perf_counter()
    await asyncio.gather(*drawing)
    used, own_used, wall = _cpu(process) - before, _cpu(psutil.Process()) - own, time.perf_counter() - wall
    rss = process.memory_info().rss
    await asyncio.sleep(1.0)
    for client in clients:
        await client.ws.close()
    await asyncio.gather(*listeners)
    return _figures(run, used / wall, own_used / wall, rss, wall)


def _cpu(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _figures(run: _Run, cores: float, own_cores: float, rss: int, wall: float) -> dict[str, Any]:
    delays = np.concatenate(run.delays) * 1000
    expected = len(run.sent) * (run.clients - 1)
    out: dict[str, Any] = {
        "ops": len(run.sent),
        "deliveries": len(delays),
        "deliveries_expected": expected,
        "deliveries_per_s": round(len(delays) / wall),
        "delay_ms": {f"p{q}": round(float(np.percentile(delays, q)), 2) for q in (50, 90, 99, 99.9)},
        "delay_max_ms": round(float(delays.max()), 2),
        "server_cores": round(cores, 3),
        "server_rss_mb": round(rss / 1e6, 1),
        "clients_cores": round(own_cores, 3),
        "received_mb_per_s": round(run.received_bytes / wall / 1e6, 2),
        "refused": run.refused,
    }
    if run.acks:
        acks = np.array(run.acks) * 1000
        out["ack_ms"] = {f"p{q}": round(float(np.percentile(acks, q)), 2) for q in (50, 99)}
    return out


def _measure(arguments: argparse.Namespace, *, show: bool) -> dict[str, Any]:
    run = _Run(arguments.clients, arguments.rate, arguments.seconds, show)
    with _serving.running(arguments.data) as (base, server):
        made = _serving.post(f"{base}/api/terrains", {})
        hello = {
            "type": "hello",
            "protocol": c.PROTOCOL_VERSION,
            "terrain": made["id"],
            "secret": made["secret"],
        }
        url = f"ws{base.removeprefix('http')}/ws"
        figures = uvloop.run(_play(run, url, hello, psutil.Process(server.pid)))
        figures["clock_after"] = _get(f"{base}/api/terrains/{made['id']}", made["secret"])["clock"]
    return figures


def _measure_floor(arguments: argparse.Namespace) -> dict[str, Any]:
    run = _Run(arguments.clients, arguments.rate, arguments.seconds, False)
    port = _serving.free_port()
    command = [sys.executable, "-m", "esker", "bench", "fanout", "--relay", str(port)]
    with subprocess.Popen(command) as relay:
        try:
            time.sleep(1.5)
            return uvloop.run(_play(run, f"ws://127.0.0.1:{port}/ws", None, psutil.Process(relay.pid)))
        finally:
            relay.terminate()


async def _relay(port: int) -> None:
    """The floor: every text goes to everybody else as it is."""
    sockets: set[ServerConnection] = set()

    async def handle(ws: ServerConnection) -> None:
        sockets.add(ws)
        with suppress(ConnectionClosed):
            async for message in ws:
                await asyncio.gather(*(other.send(message) for other in sockets if other is not ws))
        sockets.discard(ws)

    async with serve_sockets(handle, "127.0.0.1", port, compression=None, subprotocols=[c.SUBPROTOCOL]):  # type: ignore[list-item]
        await asyncio.get_running_loop().create_future()


def _get(url: str, secret: str) -> Any:
    request = urllib.request.Request(url, headers={"Authorization": f"Bearer {secret}"})
    with urllib.request.urlopen(request, timeout=10) as answer:
        return json.loads(answer.read())


def main(argv: list[str]) -> int:
    """``esker bench fanout [--json] [--solve] [--floor]``."""
    parser = argparse.ArgumentParser(prog="esker bench fanout", description=__doc__)
    parser.add_argument("--clients", type=int, default=60)
    parser.add_argument("--rate", type=float, default=20, help="ops a second of each client")
    parser.add_argument("--seconds", type=float, default=15)
    parser.add_argument("--data", type=Path, help="where the database is made (default: the temporary folder)")
    parser.add_argument("--solve", action="store_true", help="measure again with the solver at work")
    parser.add_argument("--floor", action="store_true", help="measure a bare relay too")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--note", default="", help="a sentence about the circumstances, kept in the result")
    parser.add_argument("--relay", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.relay is not None:
        with suppress(KeyboardInterrupt):
            uvloop.run(_relay(arguments.relay))
        return 0
    result: dict[str, Any] = {
        "bench": "fanout",
        "version": VERSION,
        "machine": _serving.machine(),
        "note": arguments.note,
        "scene": {"clients": arguments.clients, "ops_per_s_each": arguments.rate, "seconds": arguments.seconds},
        "esker": _measure(arguments, show=False),
    }
    if arguments.solve:
        result["esker_while_solving"] = _measure(arguments, show=True)
    if arguments.floor:
        result["bare_relay"] = _measure_floor(arguments)
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        for name in ("esker", "esker_while_solving", "bare_relay"):
            for key, value in result.get(name, {}).items():
                sys.stdout.write(f"{name}.{key}: {value}\n")
    return 0
