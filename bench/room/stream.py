"""Streaming: from a pen's segment to tiles on the socket, and how many bytes that takes (DESIGN 15).

Latencies are measured from outside, over a real websocket on loopback, against a server process with its journal: from
sending an append to the arrival of the first tile frame that shows it, and of the last tile of level 4. ``at_rest``:
one append at a time on settled ground; ``drawing``: 20 appends a second without a pause, where a frame counts for every
append that it contains. Bytes and selection times are measured in this process with the same solver and tiles.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as open_socket

from bench.room import _phases, _serving
from esker import contract as c
from esker import grid, templates
from esker.document.strokes import profile_curve
from esker.events import Level
from esker.grid import TileKey
from esker.solve.solver import Solver
from esker.tiles.codec.frame import read_frame
from esker.tiles.codec.rivers import is_rivers
from esker.tiles.decoder import FrameDecoder
from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.quadtree import select
from esker.version import VERSION

SIZE: Final = 4096.0
LEVEL: Final = c.DEFAULT_LEVEL
HOME: Final = c.View(eye=(2048, -2300, 2100), target=(2048, 1900, 0), width=1280, height=800)
NEAR: Final = c.View(eye=(1500, 1000, 620), target=(2300, 2100, 150), width=1280, height=800)
"""View of the place where the pen draws; level 4 is wanted there."""
RAW_TILE: Final = 2 * c.TILE_SAMPLES**2
PERIOD: Final = 0.05
POINTS: Final = 4


def fifty(seed: int = 50) -> c.Document:
    """Fifty strokes of all kinds, sizes and directions: ridges, crevices and plateaux, seeded."""
    rng = np.random.default_rng(seed)
    strokes = []
    for i in range(50):
        start = rng.uniform(0.05, 0.95, 2) * SIZE
        angle, length = rng.uniform(0, 2 * math.pi), rng.uniform(200, 1200)
        end = start + length * np.array([math.cos(angle), math.sin(angle)])
        u = np.linspace(0, 1, 24)
        height = rng.uniform(60, 420) * (-1 if i % 5 == 4 else 1)
        z = height * np.sin(math.pi * u) ** 0.7 * (1 + 0.08 * rng.normal(size=24))
        points = np.column_stack([start[0] + u * (end - start)[0], start[1] + u * (end - start)[1], z])
        flank = c.Flank(slope_deg=float(rng.uniform(25, 50)), extent_m=float(rng.uniform(150, 500)))
        strokes.append(_stroke(f"s{i}", points, flank))
    return c.Document(id="bench", strokes=tuple(strokes))


def _stroke(name: str, points: np.ndarray[Any, Any], flank: c.Flank) -> c.Stroke:
    first, last = ((float(points[i, 0]), float(points[i, 1]), 0.0) for i in (0, -1))
    curve = profile_curve(points, first, last)
    return c.Stroke(id=name, kind="profile", first=first, last=last, curve=curve, left=flank, right=flank)


PEN: Final = c.Stroke(
    id="pen", kind="profile", first=(1900, 1700, 0), last=(2900, 2300, 0), curve=(), left=c.Flank(), right=c.Flank()
)


def segment(n: int) -> c.AppendPoints:
    """The n-th segment of the pen: 4 points, about 47 metres, of a ridge of 200 metres with a lively crest."""
    points = tuple((0.01 * (n * POINTS + i), 200 + 20 * math.sin(n * POINTS + i)) for i in range(POINTS))
    return c.AppendPoints(stroke="pen", start=n * POINTS, points=points, last=PEN.last)


def percentiles(seconds: list[float]) -> dict[str, float]:
    """p50, p99 and the largest, in milliseconds."""
    ms = np.array(seconds) * 1000
    p50, p99 = (round(float(np.percentile(ms, q)), 2) for q in (50, 99))
    return {"p50": p50, "p99": p99, "max": round(float(ms.max()), 2), "n": len(seconds)}


# --- bytes and selection, in this process ---------------------------------------------------------------------------


def _drain(client: ClientTiles, *, shown: bool = False) -> dict[str, int]:
    """Sends all that a client is owed, or (``shown``) until it has what its view shows as it is; counts tiles, drops
    and bytes."""
    total = {"tiles": 0, "drops": 0, "bytes": 0}
    while not (shown and _complete(client)) and (plan := client.plan()) is not None:
        total["bytes"] += len(plan.encode())
        total["tiles"] += len(plan.keys)
        total["drops"] += len(plan.drops)
        client.commit(plan)
    return total


def _complete(client: ClientTiles) -> bool:
    """Returns whether a client has all tiles that its view shows."""
    held = client.held()
    masks = enumerate(client.shown())
    return all(TileKey(level, int(x), int(y)) in held for level, mask in masks for y, x in np.argwhere(mask))


def _put(server: TileServer, solver: Solver, document: c.Document, clock: int, *, settle: bool = True) -> None:
    """As the worker does where the finest preview comes within ``schedule.HOLD`` of the coarse ones."""
    for result in solver.steps(document.strokes, document.settings, LEVEL):
        if not isinstance(result, Level):
            continue
        if result.settled or result.level in (0, LEVEL):
            server.put_level(clock, result.level, result.heights, result.settled, result.channel)
        else:
            server.note(clock, result.level, result.heights)
        if result.level == LEVEL and not settle:
            return


def measure_bytes(solver: Solver, document: c.Document, segments: int) -> dict[str, Any]:
    """First views, the whole pyramid, appended segments while drawing, and what settling adds."""
    server = TileServer(SIZE, LEVEL)
    _put(server, solver, document, 1)
    out: dict[str, Any] = {}
    for name, view in (("first_view_home", HOME), ("first_view_near", NEAR)):
        client = ClientTiles(server, rest_level=-1)
        client.set_view(view)
        shown = _drain(client, shown=True)
        out[name] = {key: count + shown[key] for key, count in _drain(client).items()} | {"shown": shown}
        out[name]["raw_uint16_bytes"] = out[name]["tiles"] * RAW_TILE
    out["whole_pyramid"] = _drain(ClientTiles(server))
    out["whole_pyramid"]["raw_uint16_bytes"] = out["whole_pyramid"]["tiles"] * RAW_TILE
    client = ClientTiles(server, rest_level=-1)
    client.set_view(NEAR)
    _drain(client)
    sent = []
    for n, grown in enumerate(_drawn(document, segments)):
        _put(server, solver, grown, 2 + n, settle=False)
        sent.append(_drain(client))
    _put(server, solver, grown, 2 + segments)
    tail = sent[1:]
    out["first_segment"] = sent[0]
    out["segment_mean"] = {k: round(sum(s[k] for s in tail) / len(tail), 1) for k in ("tiles", "drops", "bytes")}
    out["segment_mean"]["raw_uint16_bytes"] = round(out["segment_mean"]["tiles"] * RAW_TILE)
    out["settling"] = _drain(client)
    out["selection_ms"] = _selection(server)
    return out


def _selection(server: TileServer) -> dict[str, Any]:
    bounds = server.pyramid.bounds()
    out: dict[str, Any] = {}
    for name, view in (("home", HOME), ("near", NEAR), ("near_fine", NEAR.model_copy(update={"tau_px": 0.5}))):
        took = []
        for _ in range(400):
            start = time.perf_counter()
            masks, _errors = select(bounds, view)
            took.append(time.perf_counter() - start)
        out[name] = {"tiles": int(sum(m.sum() for m in masks)), **percentiles(took)}
    return out


def measure_phases(solver: Solver, document: c.Document, segments: int) -> dict[str, Any]:
    """Returns where the time of one segment goes."""
    server = TileServer(SIZE, LEVEL)
    _put(server, solver, document, 1)
    client = ClientTiles(server, rest_level=-1)
    client.set_view(NEAR)
    _drain(client)
    return _phases.measure(solver, list(_drawn(document, segments)), server, client)


def _drawn(document: c.Document, segments: int) -> Iterator[c.Document]:
    """The document with one segment of the pen more each time."""
    curve: tuple[c.CurvePoint, ...] = ()
    for n in range(segments):
        curve += segment(n).points
        pen = PEN.model_copy(update={"curve": curve})
        yield document.model_copy(update={"strokes": (*document.strokes, pen), "clock": 2 + n})


# --- latencies, over a real socket ----------------------------------------------------------------------------------


@dataclass
class _Pen:
    """A person who draws, and the clocks at which their appends were accepted."""

    ws: ClientConnection
    decoder: FrameDecoder = field(default_factory=FrameDecoder)
    sent: dict[str, float] = field(default_factory=dict)
    clocks: dict[str, int] = field(default_factory=dict)
    acks: list[float] = field(default_factory=list)
    frames: list[tuple[float, int, int, bool, int]] = field(default_factory=list)
    """Arrival, level, clock, settled, tiles; LEVEL frames only."""
    bytes: int = 0
    clock: int = 0
    settled_clock: int = -1
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    async def listen(self) -> None:
        """Applies frames as the page does, in another thread, and gives credit."""
        arrived: asyncio.Queue[Any] = asyncio.Queue()
        with ThreadPoolExecutor(1) as worker:
            applier = asyncio.create_task(self._apply(arrived, worker))
            try:
                async for message in self.ws:
                    self._take(message, arrived, time.perf_counter())
            finally:
                applier.cancel()

    def _take(self, message: Any, arrived: asyncio.Queue[Any], now: float) -> None:
        if isinstance(message, bytes) and is_rivers(message):
            return
        if isinstance(message, bytes):
            head, _, tiles = read_frame(message)
            arrived.put_nowait(message)
            self.bytes += len(message)
            if head.kind == c.FrameKind.LEVEL:
                self.frames.append((now, head.level, head.clock, head.settled, len(tiles)))
        else:
            self._control(json.loads(message), now)
        self.changed.set()

    async def _apply(self, arrived: asyncio.Queue[Any], worker: ThreadPoolExecutor) -> None:
        while True:
            message = await arrived.get()
            await asyncio.get_running_loop().run_in_executor(worker, self.decoder.decode, message)
            await self.ws.send(f'{{"type":"credit","bytes":{len(message)}}}')

    def _control(self, message: dict[str, Any], now: float) -> None:
        kind = message["type"]
        if kind == "ack":
            for op, clock in zip(message["ids"], message["clocks"], strict=True):
                self._accepted(op, clock, now)
        elif kind == "ordered":
            for op in message["ops"]:
                self._accepted(op["id"], op["clock"], now)
        elif kind == "progress" and message["settled"]:
            self.settled_clock = message["clock"]
        elif kind in ("reject", "error"):
            raise RuntimeError(message["message"])

    def _accepted(self, op: str, clock: int, now: float) -> None:
        self.clock = max(self.clock, clock)
        if op in self.sent and op not in self.clocks:
            self.clocks[op] = clock
            self.acks.append(now - self.sent[op])

    async def send(self, number: int, op: c.Wire) -> None:
        """Sends one op and remembers when."""
        name = f"bench:{number}"
        text = json.dumps({"type": "ops", "ops": [{"id": name, "op": json.loads(op.model_dump_json())}]})
        self.sent[name] = time.perf_counter()
        await self.ws.send(text)

    async def settled(self, quiet: float = 0.15) -> None:
        """Waits until the newest clock is settled and nothing more has come for a while."""
        async with asyncio.timeout(30):
            while True:
                self.changed.clear()
                try:
                    await asyncio.wait_for(self.changed.wait(), quiet)
                except TimeoutError:
                    if self.settled_clock >= self.clock and len(self.clocks) == len(self.sent):
                        return

    def delays(self, level: int, since: int, *, settled: bool = False) -> list[float]:
        """For each append after the ``since``-th: until the first frame of a level whose clock contains it."""
        found = []
        for op, at in list(self.sent.items())[since:]:
            clock = self.clocks[op]
            arrival = next(
                (t for t, lv, ck, done, _ in self.frames if t > at and lv == level and ck >= clock and done >= settled),
                None,
            )
            if arrival is not None:
                found.append(arrival - at)
        return found


async def _draw(base: str, terrain: str, secret: str, appends: int) -> dict[str, Any]:
    url = base.replace("http", "ws", 1) + "/ws"
    async with open_socket(url, subprotocols=[c.SUBPROTOCOL], compression=None, max_size=None, proxy=None) as ws:  # type: ignore[list-item]
        hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client="bench", name="Bench")
        start = time.perf_counter()
        await ws.send(hello.model_dump_json())
        await ws.send(NEAR.model_dump_json())
        pen = _Pen(ws)
        listener = asyncio.create_task(pen.listen())
        await pen.settled(1.0)
        join = pen.frames[0][0] - start
        await pen.send(0, c.BeginStroke(stroke=PEN))
        await pen.settled()
        rest = await _at_rest(pen, appends)
        drawing = await _without_pause(pen, appends)
        listener.cancel()
        return {"join_to_first_tile_ms": round(join * 1000, 1), "at_rest": rest, "drawing": drawing}


async def _at_rest(pen: _Pen, appends: int) -> dict[str, Any]:
    since, start = len(pen.sent), pen.bytes
    for n in range(appends):
        await pen.send(len(pen.sent), segment(n % 24))
        await pen.settled()
    return _latencies(pen, since) | {"bytes_per_append_with_settling": round((pen.bytes - start) / appends)}


async def _without_pause(pen: _Pen, appends: int) -> dict[str, Any]:
    since, start, began = len(pen.sent), pen.bytes, time.perf_counter()
    for n in range(appends):
        await asyncio.sleep(max(0, began + n * PERIOD - time.perf_counter()))
        await pen.send(len(pen.sent), segment(n % 24))
    used = pen.bytes - start
    await pen.settled()
    return _latencies(pen, since) | {"bytes_per_append": round(used / appends)}


def _latencies(pen: _Pen, since: int) -> dict[str, Any]:
    return {
        "acknowledged_ms": percentiles(pen.acks[since:]),
        "first_coarse_tile_ms": percentiles(pen.delays(0, since)),
        "level_4_preview_ms": percentiles(pen.delays(LEVEL, since)),
        "level_4_settled_ms": percentiles(pen.delays(LEVEL, since, settled=True)),
    }


def measure_socket(document: c.Document, appends: int) -> dict[str, Any]:
    """Latencies against a server process."""
    with _serving.server() as base:
        terrain, secret = _serving.upload(base, document)
        return asyncio.run(_draw(base, terrain, secret, appends))


def main(argv: list[str]) -> int:
    """``esker bench stream [--json] [--appends N] [--scene NAME ...]``."""
    parser = argparse.ArgumentParser(prog="esker bench stream", description=__doc__)
    names = ["fifty", *templates.ORDER]
    parser.add_argument("--scene", action="append", choices=names, help="default: fifty, alpine-ridge, canyon")
    parser.add_argument("--appends", type=int, default=60)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    arguments = parser.parse_args(argv)
    solver = Solver(max_level=LEVEL)
    result: dict[str, Any] = {
        "bench": "stream",
        "version": VERSION,
        "machine": _serving.machine(solver.device_name),
        "grid": f"{grid.samples(LEVEL)}x{grid.samples(LEVEL)}",
        "scenes": {},
    }
    for name in arguments.scene or ("fifty", "alpine-ridge", "canyon"):
        document = fifty() if name == "fifty" else templates.load(name).document
        scene: dict[str, Any] = {"strokes": len(document.strokes)}
        scene |= measure_bytes(solver, document, 12)
        scene["phases_ms"] = measure_phases(solver, document, 24)
        scene["socket"] = measure_socket(document, arguments.appends)
        result["scenes"][name] = scene
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        for name, scene in result["scenes"].items():
            for key, value in scene.items():
                sys.stdout.write(f"{name}.{key}: {value}\n")
    return 0
