"""A class: thirty pupils draw on a copy each, one wall shows all of them, on this machine (docs/teaching.md).

A server process of its own; this process plays the pupils and the wall. Thirty devices come in by one code at once.
Then each draws ``--strokes`` strokes a minute as a pen does, its appends ten times a second, out of step with the
others. An acknowledgement is timed from the sending of an op, a coarse tile from the sending of an append to the first
frame of level 0 that has its clock, the wall from the sending to its first frame with that clock: a frame of level 0
moves the finer tiles of a picture along, so the teacher sees it. ``wall_fine_s`` is the time to the first such frame of
the wall's finest level. The end of a stroke changes no ground, so no frame need follow it: it is timed for its
acknowledgement alone. In the end the class is
collected. The server's processor time and memory are those of its process and its children.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import secrets
import sys
import time
import urllib.request
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import psutil
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as open_socket

from bench.room import _serving
from esker import contract as c
from esker.version import VERSION

APPEND_SECONDS: Final = 0.1
APPENDS: Final = 20
COLLECT_SECONDS: Final = 120.0
LIMITS: Final = {
    "ack_ms_p99": 100.0,
    "coarse_ms_p50": 60.0,
    "wall_s_max": 2.0,
    "server_cores": 1.2,
    "server_gib": 1.5,
    "joins_s": 5.0,
    "collect_s": 20.0,
}
"""What issue 20 asks of two cores."""


@dataclass
class _Times:
    """Seconds, of everybody together."""

    ack: list[float] = field(default_factory=list)
    coarse: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)
    wall_fine: list[float] = field(default_factory=list)
    wall_bytes: int = 0
    wall_texts: int = 0


@dataclass
class _Pupil:
    """One device: its copy, and the ops whose effects are still waited for."""

    number: int
    terrain: str
    secret: str
    times: _Times
    sent: dict[str, tuple[float, bool]] = field(default_factory=dict)
    """By op, when it was sent, and whether it changes the ground."""
    appended: dict[int, float] = field(default_factory=dict)
    unseen: dict[int, float] = field(default_factory=dict)
    """By clock, when an append was sent: until the wall has shown it."""
    unseen_fine: dict[int, float] = field(default_factory=dict)
    """By clock, when an append was sent: until the wall has shown it in its finest level."""
    count: int = 0
    ready: asyncio.Event = field(default_factory=asyncio.Event)

    @property
    def client(self) -> str:
        return f"pupil{self.number}"

    async def listen(self, ws: ClientConnection) -> None:
        """Reads what the server sends, and gives credit for frames."""
        async for message in ws:
            now = time.perf_counter()
            if isinstance(message, bytes):
                head = np.frombuffer(message, dtype=c.FRAME_HEADER, count=1)[0]
                await ws.send(json.dumps({"type": "credit", "bytes": len(message)}))
                if head["level"] == 0 and head["channel"] == c.Channel.HEIGHT:
                    self.ready.set()
                    self._seen(self.appended, int(head["clock"]), self.times.coarse, now)
                continue
            answer = json.loads(message)
            if answer["type"] == "reject":
                raise RuntimeError(f"{self.client}: {answer['message']}")
            if answer["type"] == "ack":
                for op_id, clock in zip(answer["ids"], answer["clocks"], strict=True):
                    at, draws = self.sent.pop(op_id)
                    self.times.ack.append(now - at)
                    if draws:
                        self.appended[clock] = self.unseen[clock] = self.unseen_fine[clock] = at

    def _seen(self, waiting: dict[int, float], clock: int, into: list[float], now: float) -> None:
        into.extend(max(0.0, now - waiting.pop(k)) for k in [k for k in waiting if k <= clock])

    def on_wall(self, clock: int, level: int, now: float) -> None:
        """The wall has a frame of the heights of this copy."""
        self._seen(self.unseen, clock, self.times.wall, now)
        if level == c.WALL_LEVEL:
            self._seen(self.unseen_fine, clock, self.times.wall_fine, now)

    async def draw(self, ws: ClientConnection, stroke: int) -> None:
        """One stroke, as a pen sends it."""
        rng = np.random.default_rng(100 * self.number + stroke)
        x, y = rng.uniform(600, 2000, 2)
        key = f"{self.client}-{stroke}"
        begin = {
            "id": key, "kind": "profile", "first": [x, y, 0], "last": [x + 40, y, 0], "curve": [[0, 0], [1, 20]],
            "left": {"slope_deg": 35, "extent_m": 900}, "right": {"slope_deg": 35, "extent_m": 900},
        }  # fmt: skip
        await self._send(ws, {"type": "stroke.begin", "stroke": begin})
        for n in range(1, APPENDS + 1):
            await asyncio.sleep(APPEND_SECONDS)
            far = x + 70 * n
            points = [[k / n, 260 * np.sin(np.pi * k / APPENDS)] for k in range(n + 1)]
            append = {
                "type": "stroke.append",
                "stroke": key,
                "start": 0,
                "points": points,
                "last": [far, y + 20 * n, 0],
            }
            await self._send(ws, append)
        await self._send(ws, {"type": "stroke.finish", "stroke": key})

    async def _send(self, ws: ClientConnection, op: dict[str, Any]) -> None:
        self.count += 1
        op_id = f"{self.client}:{self.count}"
        self.sent[op_id] = time.perf_counter(), op["type"] != "stroke.finish"
        await ws.send(json.dumps({"type": "ops", "ops": [{"id": op_id, "op": op}]}))


def _get(url: str, secret: str) -> Any:
    request = urllib.request.Request(url, headers={"Authorization": f"Bearer {secret}"})
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.loads(answer.read())


async def _come_in(base: str, made: dict[str, Any], n: int, times: _Times) -> tuple[_Pupil, ClientConnection]:
    """By the code, to the first ground of one's own copy."""
    seat = secrets.token_urlsafe(24)
    await asyncio.to_thread(_serving.post, f"{base}/api/join", {"code": made["code"]})
    body = {"code": made["code"], "seat": seat, "name": f"Pupil {n}"}
    got = await asyncio.to_thread(_serving.post, f"{base}/api/classes/{made['id']}/seats", body)
    pupil = _Pupil(got["number"], got["id"], seat, times)
    ws = await open_socket(base.replace("http", "ws") + "/ws", subprotocols=[c.SUBPROTOCOL], compression=None)  # type: ignore[list-item]
    hello = c.Hello(
        protocol=c.PROTOCOL_VERSION, terrain=pupil.terrain, secret=seat, client=pupil.client, name=f"Pupil {n}"
    )
    await ws.send(hello.model_dump_json(exclude_none=True))
    view = c.View(eye=(2048.0, -2500.0, 2200.0), target=(2048.0, 2048.0, 100.0))
    await ws.send(view.model_dump_json())
    return pupil, ws


async def _wall(base: str, made: dict[str, Any], secret: str, pupils: dict[int, _Pupil], times: _Times) -> None:
    """Looks at the wall until it is cancelled."""
    async with open_socket(
        base.replace("http", "ws") + "/ws/wall",
        subprotocols=[c.SUBPROTOCOL],  # type: ignore[list-item]
        compression=None,
    ) as ws:
        hello = c.WallHello(protocol=c.PROTOCOL_VERSION, terrain=made["terrain"], secret=secret, lesson=made["id"])
        await ws.send(hello.model_dump_json())
        async for message in ws:
            if isinstance(message, str):
                times.wall_texts += len(message)
                continue
            times.wall_bytes += len(message)
            number = int(np.frombuffer(message, dtype=c.WALL_HEADER, count=1)[0]["number"])
            head = np.frombuffer(message, dtype=c.FRAME_HEADER, count=1, offset=c.WALL_HEADER.itemsize)[0]
            if number in pupils and head["channel"] == c.Channel.HEIGHT:
                pupils[number].on_wall(int(head["clock"]), int(head["level"]), time.perf_counter())


async def _play(base: str, process: psutil.Process, options: argparse.Namespace) -> dict[str, Any]:
    terrain = await asyncio.to_thread(_serving.post, f"{base}/api/terrains", {"title": "A class"})
    path = f"{base}/api/terrains/{terrain['id']}/classes"
    made = await asyncio.to_thread(_serving.post, path, {"places": options.pupils}, terrain["secret"])
    times = _Times()
    pupils: dict[int, _Pupil] = {}
    wall = asyncio.create_task(_wall(base, made, terrain["secret"], pupils, times))
    began = time.perf_counter()
    came = await asyncio.gather(*(_come_in(base, made, n, times) for n in range(options.pupils)))
    pupils |= {pupil.number: pupil for pupil, _ in came}
    listening = [asyncio.create_task(pupil.listen(ws)) for pupil, ws in came]
    await asyncio.gather(*(pupil.ready.wait() for pupil, _ in came))
    joins = time.perf_counter() - began
    cpu, start, sent = _cpu(process), time.perf_counter(), times.wall_bytes
    memory = [_memory(process)]
    drawing = [asyncio.create_task(_pupil(pupil, ws, k, options)) for k, (pupil, ws) in enumerate(came)]
    while not all(task.done() for task in drawing):
        await asyncio.sleep(1.0)
        memory.append(_memory(process))
    await asyncio.gather(*drawing)
    wall_s = time.perf_counter() - start
    cores = (_cpu(process) - cpu) / wall_s
    wall_bytes = times.wall_bytes - sent
    await asyncio.sleep(2.5)
    behind = sum(len(pupil.unseen) for pupil, _ in came)
    collect = await _collect(f"{path}/{made['id']}", terrain["secret"])
    for task in (*listening, wall):
        failed = task.exception() if task.done() and not task.cancelled() else None
        if failed is not None:
            raise failed
        task.cancel()
    ack, coarse, shown, fine = (
        np.array(found or [np.nan]) for found in (times.ack, times.coarse, times.wall, times.wall_fine)
    )
    return {
        "ops": len(times.ack),
        "joins_s": round(joins, 2),
        "ack_ms": _spread(ack),
        "coarse_ms": _spread(coarse),
        "wall_s": _lag(shown),
        "wall_fine_s": _lag(fine),
        "never_on_the_wall": behind,
        "wall_bytes_a_second_and_copy": round(wall_bytes / wall_s / options.pupils),
        "server_cores": round(cores, 2),
        "server_gib": round(max(memory) / 2**30, 2),
        "collect_s": round(collect, 2),
        "seconds": round(wall_s, 1),
    }


async def _pupil(pupil: _Pupil, ws: ClientConnection, k: int, options: argparse.Namespace) -> None:
    """Draws as often as is asked, out of step with the others."""
    period = 60.0 / options.strokes
    await asyncio.sleep(period * k / options.pupils)
    for stroke in range(max(1, round(options.seconds / period))):
        began = time.perf_counter()
        await pupil.draw(ws, stroke)
        await asyncio.sleep(max(0.0, period - (time.perf_counter() - began)))


async def _collect(path: str, secret: str) -> float:
    began = time.perf_counter()
    job = await asyncio.to_thread(_serving.post, f"{path}/collections", {}, secret)
    while job["stage"] not in ("done", "failed", "cancelled"):
        if time.perf_counter() - began > COLLECT_SECONDS:
            raise RuntimeError("collecting takes too long")
        await asyncio.sleep(0.1)
        job = await asyncio.to_thread(_get, f"{path}/collections/{job['id']}", secret)
    if job["stage"] != "done":
        raise RuntimeError(f"collecting failed: {job['text']}")
    return time.perf_counter() - began


def _family(process: psutil.Process) -> list[psutil.Process]:
    return [process, *process.children(recursive=True)]


def _cpu(process: psutil.Process) -> float:
    return sum(sum(each.cpu_times()[:2]) for each in _family(process))


def _memory(process: psutil.Process) -> int:
    return sum(each.memory_info().rss for each in _family(process))


def _spread(seconds: Any) -> dict[str, float]:
    p50, p99 = (round(1000 * float(np.percentile(seconds, q)), 1) for q in (50, 99))
    return {"p50": p50, "p99": p99, "max": round(1000 * float(seconds.max()), 1), "n": len(seconds)}


def _lag(seconds: Any) -> dict[str, float]:
    p50, p99 = (round(float(np.percentile(seconds, q)), 2) for q in (50, 99))
    return {"p50": p50, "p99": p99, "max": round(float(seconds.max()), 2)}


def _within(found: dict[str, Any]) -> dict[str, bool]:
    """Which of the limits were kept."""
    flat = {
        "ack_ms_p99": found["ack_ms"]["p99"],
        "coarse_ms_p50": found["coarse_ms"]["p50"],
        "wall_s_max": found["wall_s"]["max"],
    } | found
    return {key: bool(flat[key] <= most) for key, most in LIMITS.items()}


def main(argv: list[str]) -> int:
    """``esker bench class [--json] [--pupils N] [--seconds S] [--strokes N]``."""
    parser = argparse.ArgumentParser(prog="esker bench class", description=__doc__)
    parser.add_argument("--pupils", type=int, default=30)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--strokes", type=float, default=3.0, help="of each pupil in a minute")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--note", default="", help="a sentence about the circumstances, kept in the result")
    options = parser.parse_args(argv)
    machine = _serving.machine()
    with _serving.running() as (base, process):
        found = asyncio.run(_play(base, psutil.Process(process.pid), options))
    result = {"bench": "class", "version": VERSION, "machine": machine, "pupils": options.pupils,
              "strokes_a_minute": options.strokes, "limits": LIMITS, **found, "within": _within(found)}  # fmt: skip
    if options.note:
        result["note"] = options.note
    if options.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        sys.stdout.write("".join(f"{key}: {value}\n" for key, value in result.items()))
    return 0
