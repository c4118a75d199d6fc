"""Siege: what four people who draw notice of attacks by a stranger and by a viewer, one after another and all at once.

A server process of its own. Four people draw on one terrain, ``--seconds`` with each attack and as long without any;
attacks come from a process of their own. Measured for the people: from an append to its acknowledgement, from an append
to the first tile that shows it, and from their last append to settled ground; for the server: memory, disk,
descriptors, while the attack goes on and some seconds after it. Ratios are to the same without an attack in this run,
and to the same beside a process that takes as much of the processors as the attack's did and sends nothing: that much
the machine does by itself, whose processors attackers share here. What misses an aim, or does by the first of these
ratios alone, is measured twice more, and of the three the middle counts; what the disk took meanwhile for writes of the
bench's own stands beside each.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import multiprocessing
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as open_socket
from websockets.exceptions import ConnectionClosed

from bench.room import _serving, stream
from bench.strangers._attacks import ATTACKS as FIRST_ATTACKS
from bench.strangers._attacks import BY_LINK, Target
from bench.strangers._lesson_attacks import BY_PUPIL, LESSON_ATTACKS
from bench.strangers._siege_disk import Disk
from bench.strangers._siege_judged import MOST_MEMORY_MB, TIMES, floor, judged, merged, middle, unsure
from esker import contract as c
from esker.tiles.codec.frame import read_frame
from esker.tiles.codec.rivers import is_rivers
from esker.version import VERSION

PEOPLE: Final = 4
PERIOD: Final = 0.2
SETTLED_SECONDS: Final = 20.0
"""Longer than this nobody waits for settled ground: then it counts as this."""
SECONDS, RECOVERY_SECONDS = 15.0, 3.0
"""In six seconds four people had a hundred acknowledgements: their 99th percentile was the second worst of them, and a
single wait for a disk that others use decided a row."""
MINUTES: Final = 35.0
"""Within which it ends unless ``--minutes`` says otherwise; what there was no time for is listed."""
ALL_SECONDS: Final = 45.0
"""About what an attack takes with its recovery where settling takes long: so much is kept for all of them at once."""
SOURCES: Final = (f"127.0.{100 + n // 250}.{1 + n % 250}" for n in count())
"""Addresses of attackers, a new one each time: what an address may begin (terrains, links, exports) is used up by one
attack, and the next would do nothing."""
SHORT: Final = (3.0, 1.0)
"""Seconds of drawing and of recovery in the short form."""
ALONE_EVERY: Final = 5
"""Before every so manyth attack the people draw without one, so that the machine's own noise is known."""
AGAIN: Final = 2
"""A row that misses an aim is measured so many times more: in fifteen seconds three syncs of a disk that others use
make a 99th percentile."""
BUSY_SECONDS: Final = 0.01
"""A process that sends nothing is busy for a part of each so many seconds."""
ATTACKS: Final = FIRST_ATTACKS | LESSON_ATTACKS


@dataclass
class _Person:
    """Somebody who draws. Times are ``time.perf_counter()``."""

    name: str
    ws: ClientConnection
    sent: dict[int, float] = field(default_factory=dict)
    """Times of sending by the counter of an op, then by its clock once it is acknowledged."""
    clocks: dict[int, float] = field(default_factory=dict)
    acks: list[float] = field(default_factory=list)
    tiles: list[float] = field(default_factory=list)
    settled_clock: int = -1
    newest: int = -1
    """Clock of the last of its changes that was acknowledged."""
    closed: bool = False
    lost: int = 0
    count: int = 0

    async def listen(self) -> None:
        """Notes what comes."""
        with suppress(ConnectionClosed):
            async for message in self.ws:
                now = time.perf_counter()
                if isinstance(message, bytes):
                    await self.ws.send(f'{{"type":"credit","bytes":{len(message)}}}')
                    if is_rivers(message):
                        continue
                    shown = int(read_frame(message)[0].clock)
                    done = [k for k in self.clocks if k <= shown]
                    self.tiles += [now - self.clocks.pop(k) for k in done]
                else:
                    self._heard(json.loads(message), now)
        self.closed = True

    def _heard(self, message: dict[str, Any], now: float) -> None:
        if message["type"] == "ack":
            for op_id, clock in zip(message["ids"], message["clocks"], strict=True):
                at = self.sent.pop(int(op_id.partition(":")[2]), None)
                if at is not None:
                    self.acks.append(now - at)
                    self.clocks[clock] = at
                    self.newest = max(self.newest, clock)
        elif message["type"] == "progress" and message["settled"]:
            self.settled_clock = max(self.settled_clock, message["clock"])
        elif message["type"] == "reject":
            self.lost += 1
            self.sent.pop(int(message["id"].partition(":")[2]), None)
        elif message["type"] == "error":
            self.lost += 1

    async def draw(self) -> None:
        """One more segment."""
        self.count += 1
        n = (self.count - 1) % 24
        op: dict[str, Any] = {
            "type": "stroke.append", "stroke": self.name, "start": n * 4,
            "points": [[(n * 4 + k) / 96, 40.0 + (n * 7 + k) % 60] for k in range(4)], "last": [2600, 2000, 20],
        }  # fmt: skip
        await self._send(op)

    async def begin(self, index: int) -> None:
        """A stroke of one's own."""
        ends = {"first": [900 + 300 * index, 900, 0], "last": [2600, 2000, 20]}
        stroke = {"id": self.name, "kind": "profile", "curve": [[0, 0]], **ends}
        await self._send({"type": "stroke.begin", "stroke": stroke})

    async def _send(self, op: dict[str, Any]) -> None:
        self.sent[self.count] = time.perf_counter()
        await self.ws.send(json.dumps({"type": "ops", "ops": [{"id": f"{self.name}:{self.count}", "op": op}]}))


@dataclass(frozen=True)
class Server:
    """The server that is attacked."""

    base: str
    process: psutil.Process
    folder: Path

    def state(self) -> dict[str, float]:
        """Memory of the server and its children, disk, descriptors."""
        family = [self.process, *self.process.children(recursive=True)]
        own, memory = self.process.memory_info().rss, 0
        for each in family:
            with suppress(psutil.Error):
                memory += each.memory_info().rss
        disk = sum(path.stat().st_size for path in self.folder.rglob("*") if path.is_file())
        return {
            "memory_mb": round(memory / 1e6),
            "children_mb": round((memory - own) / 1e6),
            "disk_mb": round(disk / 1e6, 1),
            "descriptors": self.process.num_fds(),
        }


@contextmanager
def serve(log: Path) -> Iterator[Server]:
    """Runs ``esker serve`` over an empty folder, what it logs in a file."""
    with tempfile.TemporaryDirectory(prefix="esker-siege-") as folder, log.open("wb") as out:
        port = _serving.free_port()
        command = [sys.executable, "-m", "esker", "serve", "--port", str(port), "--data", folder]
        with subprocess.Popen([*command, "--log-level", "info"], stdout=subprocess.DEVNULL, stderr=out) as process:
            try:
                _serving.wait(f"http://127.0.0.1:{port}", process)
                yield Server(f"http://127.0.0.1:{port}", psutil.Process(process.pid), Path(folder))
            finally:
                process.terminate()


def _nothing(share: float, until: float) -> None:
    """A process that takes so much of a processor and sends nothing."""
    while time.monotonic() < until:
        busy = time.perf_counter() + share * BUSY_SECONDS
        while time.perf_counter() < busy:
            json.dumps(list(range(100)))
        time.sleep((1 - share) * BUSY_SECONDS)


def _attack(names: Sequence[str], at: Target) -> None:
    """The process that attacks."""

    async def run() -> None:
        await asyncio.gather(*(ATTACKS[name](at) for name in names), return_exceptions=True)

    asyncio.run(run())


async def _people(base: str, terrain: str, secret: str) -> list[_Person]:
    people = []
    url = base.replace("http", "ws") + "/ws"
    for index in range(PEOPLE):
        ws = await open_socket(url, subprotocols=[c.SUBPROTOCOL], compression=None, max_size=None, proxy=None)  # type: ignore[list-item]
        person = _Person(f"p{index}", ws)
        hello = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": terrain, "secret": secret}
        await ws.send(json.dumps(hello | {"client": person.name, "name": person.name}))
        await ws.send(stream.NEAR.model_dump_json())
        person.listening = asyncio.create_task(person.listen())  # type: ignore[attr-defined]
        await person.begin(index)
        people.append(person)
    return people


async def _drawn(people: list[_Person], seconds: float) -> dict[str, Any]:
    """Draws for so long, then waits for settled ground; the figures."""
    for person in people:
        person.acks, person.tiles, person.lost = [], [], 0
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        for person in people:
            with suppress(ConnectionClosed):
                await person.draw()
            await asyncio.sleep(PERIOD / PEOPLE)
    rested = time.perf_counter()
    while time.perf_counter() < rested + SETTLED_SECONDS:
        here = [person for person in people if not person.closed]
        newest = max((person.newest for person in people), default=-1)
        if not here or (not any(person.sent for person in here) and here[0].settled_clock >= newest):
            break
        await asyncio.sleep(0.01)
    settled = time.perf_counter() - rested
    acks = np.array([t for person in people for t in person.acks] or [np.nan]) * 1000
    tiles = np.array([t for person in people for t in person.tiles] or [np.nan]) * 1000
    return {
        "acks": len(acks),
        "ack_p50_ms": round(float(np.percentile(acks, 50)), 1),
        "ack_p99_ms": round(float(np.percentile(acks, 99)), 1),
        "tile_p50_ms": round(float(np.percentile(tiles, 50)), 1),
        "settling_s": round(settled, 2),
        "refused": sum(person.lost for person in people),
        "unanswered": sum(len(person.sent) for person in people),
        "closed": sum(person.closed for person in people),
    }


@dataclass(frozen=True)
class Plan:
    """How long people draw beside an attack, how long the server is left alone after it, and when to end."""

    seconds: float
    recovery: float
    until: float = math.inf
    """``time.monotonic()`` after which no further attack is begun."""
    kept: float = 0.0
    """Seconds before that from which on only all attacks at once are begun."""
    apart: bool = False
    """Whether no attacks are made at once."""


async def _besieged(
    server: Server, names: Sequence[str], plan: Plan, known: tuple[str, str], people: list[_Person], disk: Disk
) -> Any:
    """The people's figures while these attacks go on, and the server's and the disk's during and after."""
    target = Target(server.base, *known, time.monotonic() + plan.seconds + 2, next(SOURCES))
    attacker = multiprocessing.get_context("spawn").Process(target=_attack, args=(list(names), target), daemon=True)
    attacker.start()
    await asyncio.sleep(1.5)
    began, before = time.perf_counter(), _processor(attacker.pid)
    disk.figures()
    figures = await _drawn(people, plan.seconds - 1)
    figures |= {"disk": disk.figures(), "server": server.state()}
    share = min(1.0, (_processor(attacker.pid) - before) / (time.perf_counter() - began))
    figures["attacker"] = round(share, 2)
    await asyncio.to_thread(attacker.join, 10)
    attacker.kill()
    await asyncio.sleep(plan.recovery)
    disk.figures()
    after = await _drawn(people, 2.0)
    figures["after"] = {key: after[key] for key in TIMES} | server.state() | {"disk": disk.figures()}
    figures["nothing"] = await _beside_nothing(people, share, plan)
    return figures


async def _beside_nothing(people: list[_Person], share: float, plan: Plan) -> dict[str, Any]:
    """The people's figures beside a process that takes as much of a processor as an attacker did."""
    until = time.monotonic() + plan.seconds + 2
    idler = multiprocessing.get_context("spawn").Process(target=_nothing, args=(share, until), daemon=True)
    idler.start()
    await asyncio.sleep(1.5)
    found = await _drawn(people, plan.seconds - 1)
    await asyncio.to_thread(idler.join, 10)
    idler.kill()
    return {key: found[key] for key in TIMES}


def _processor(pid: int | None) -> float:
    """Seconds of processor time that a process has used; 0 where it has ended."""
    try:
        used = psutil.Process(pid).cpu_times()
    except psutil.Error:
        return 0.0
    return float(used.user + used.system)


async def _run(server: Server, names: Sequence[str], plan: Plan) -> tuple[dict[str, Any], list[str]]:
    """Figures by attack and role, and what was left out for want of time."""
    made, own = (_serving.post(f"{server.base}/api/terrains", {}) for _ in range(2))
    viewer = _serving.post(f"{server.base}/api/terrains/{made['id']}/links", {"role": "view"}, made["secret"])
    pupil = _serving.post(f"{server.base}/api/terrains/{made['id']}/links", {"role": "edit"}, made["secret"])
    known = {
        "stranger": (own["id"], own["secret"]),
        "viewer": (made["id"], viewer["secret"]),
        "pupil": (made["id"], pupil["secret"]),
    }
    people = await _people(server.base, made["id"], made["secret"])
    await people[0].ws.send('{"type":"conduct","hands_off":true}')  # all who draw are owners, who lead
    await _drawn(people, 2.0)
    attacks = {f"{name} by a {role}": ([name], role) for name in names for role in roles(name)}
    if len(names) > 1 and not plan.apart:
        attacks |= {f"all by a {role}": (list(names), role) for role in ("stranger", "viewer")}
    with Disk(server.folder.with_name(f"{server.folder.name}.disk")) as disk:

        async def besieged(name: str) -> dict[str, Any]:
            group, role = attacks[name]
            found: dict[str, Any] = await _besieged(server, group, plan, known[role], people, disk)
            return found

        alone = [await _drawn(people, plan.seconds)]
        out: dict[str, Any] = {"alone": alone[0] | {"disk": disk.figures(), "server": server.state()}}
        left: list[str] = []
        for name, (group, _) in attacks.items():
            if time.monotonic() > plan.until - (plan.kept if len(group) == 1 else 0.0):
                left.append(name)
                continue
            if len(out) % ALONE_EVERY == 0:
                alone.append(await _drawn(people, plan.seconds))
            out[name] = await besieged(name)
        out["alone"] |= floor(alone)
        for name in unsure(out):
            measured = [out[name]]
            while len(measured) <= AGAIN and time.monotonic() < plan.until:
                measured.append(await besieged(name))
            if len(measured) > AGAIN:
                out[name] = middle(measured)
    for name, figures in out.items():
        if name != "alone":
            figures["alone"] = {key: out["alone"][key] for key in TIMES}
    for person in people:
        await person.ws.close()
    return out, left


def roles(name: str) -> tuple[str, ...]:
    """Returns by whom an attack is made."""
    if name in BY_PUPIL:
        return ("pupil",)
    return ("stranger", "viewer") if name in BY_LINK else ("stranger",)


def main(argv: list[str]) -> int:
    """Runs ``esker bench siege`` (--help says with what)."""
    parser = argparse.ArgumentParser(prog="esker bench siege", description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of drawing beside each attack")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="for all of it")
    parser.add_argument("--short", action="store_true", help="a few seconds for each, to see whether it works")
    parser.add_argument(
        "--attack", action="append", choices=sorted(ATTACKS), help="only these (default: each, then all)"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--log", type=Path, help="keep here what the server logs")
    parser.add_argument("--apart", action="store_true", help="one after another only, not all at once")
    parser.add_argument("--into", type=Path, help="a result whose other rows are kept: so it is measured in pieces")
    parser.add_argument("--note", default="", help="a sentence about the circumstances, kept in the result")
    arguments = parser.parse_args(argv)
    machine, began = _serving.machine(), time.monotonic()
    seconds, recovery = SHORT if arguments.short else (arguments.seconds, RECOVERY_SECONDS)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "server.log"
        with serve(log) as server:
            plan = Plan(seconds, recovery, began + 60 * arguments.minutes - ALL_SECONDS, ALL_SECONDS, arguments.apart)
            runs, left = asyncio.run(_run(server, arguments.attack or list(ATTACKS), plan))
            alive = server.process.is_running()
        text = log.read_text(encoding="utf-8", errors="replace")
        if arguments.log is not None:
            arguments.log.write_text(text, encoding="utf-8")
    missed = judged(runs)
    if arguments.into is not None and arguments.into.exists():
        runs, missed = merged(json.loads(arguments.into.read_text(encoding="utf-8")), runs, missed)
    result = {
        "bench": "siege", "version": VERSION, "machine": machine, "note": arguments.note,
        "scene": {"people": PEOPLE, "appends_per_s_each": 1 / PERIOD, "seconds": seconds},
        "aims": TIMES | {"memory_mb": MOST_MEMORY_MB}, "alive": alive, "tracebacks": text.count("Traceback"),
        "errors": text.count(" E "), "held": alive and "Traceback" not in text and not missed, "missed": missed,
        "left_out": left, "minutes": round((time.monotonic() - began) / 60, 1), "runs": runs,
    }  # fmt: skip
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        for name, run in runs.items():
            sys.stdout.write(f"{name}: {run}\n")
        for name, said in missed.items():
            sys.stdout.write(f"not held, {name}: {'; '.join(said)}\n")
        sys.stdout.write(f"every aim held: {result['held']}\n")
    return 0
