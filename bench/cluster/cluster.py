"""Several servers over one database: what they cost, and how long people wait when one of them goes.

Sixty clients append to strokes of their own, hidden ones, so that the solver has nothing to do; each operation is timed
from the moment at which it was due, whatever the answers do. Clients come back as the page does. All servers, the
database and the clients share the machine: on two cores three nodes are not faster than one, and the figures say what
the way through them costs, not what three machines would do. ``--simulate``: a thousand nodes, by arithmetic.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import signal
import sys
import time
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import psutil
import uvloop

from bench.cluster import _appends, _simulation
from bench.cluster._nodes import Server, alone, nodes
from bench.cluster._people import Person, Tally, Terrain, terrain
from bench.cluster._postgres import Postgres
from bench.room import _serving
from esker.version import VERSION

CLIENTS: Final = 60
RATE: Final = 20.0
WARM_UP: Final = 2.0
ROOMS: Final = 6


def _milliseconds(seconds: Sequence[float]) -> dict[str, float]:
    values = np.array(seconds) * 1000
    return {"p50": round(float(np.percentile(values, 50)), 2), "p99": round(float(np.percentile(values, 99)), 2)}


async def _gather(people: list[Person]) -> list[asyncio.Task[None]]:
    staying = []
    for person in people:
        staying.append(asyncio.create_task(person.stay()))
        await person.is_online.wait()
    return staying


async def _load(servers: list[Server], database: psutil.Process | None, rooms: int, doors: Any, seconds: float) -> Any:
    """Acknowledgements and processor time while all draw. ``doors``: of the client of that number."""
    tally = Tally()
    where = [terrain(servers[n % len(servers)].base) for n in range(rooms)]
    people = [Person(f"c{n}", where[n % rooms], doors(n), tally) for n in range(CLIENTS)]
    staying = await _gather(people)
    start = time.perf_counter() + 0.5
    tally.since = start + WARM_UP
    total = seconds + WARM_UP
    drawing = [asyncio.create_task(p.draw(RATE, start, total, n / CLIENTS)) for n, p in enumerate(people)]
    await asyncio.sleep(tally.since - time.perf_counter())
    before, wall = _used(servers, database), time.perf_counter()
    await asyncio.gather(*drawing)
    after, wall = _used(servers, database), time.perf_counter() - wall
    await asyncio.sleep(1.0)
    for person in people:
        await person.stop()
    await asyncio.gather(*staying)
    cores = {name: round((after[name] - before[name]) / wall, 3) for name in after}
    return {
        "ack_ms": _milliseconds(tally.acks),
        "acknowledged": len(tally.acks),
        "due": int(CLIENTS * RATE * seconds),
        "refused": tally.refused,
        "cores": cores,
        "cores_of_servers": round(sum(cores[s.name or "alone"] for s in servers), 3),
    }


def _used(servers: list[Server], database: psutil.Process | None) -> dict[str, float]:
    used = {server.name or "alone": server.cpu() for server in servers}
    if database is not None:
        times = [p.cpu_times() for p in (database, *database.children(recursive=True))]
        used["database"] = sum(t.user + t.system for t in times)
    return used


async def _latency(door: str, where: Terrain, count: int = 300) -> list[float]:
    """Acknowledgements of one client that draws alone and slowly."""
    tally = Tally()
    person = Person(f"l{random.randrange(10**9)}", where, [door], tally)
    staying = await _gather([person])
    await person.draw(50.0, time.perf_counter() + 0.2, count / 50.0, 0.0)
    await asyncio.sleep(0.5)
    await person.stop()
    await asyncio.gather(*staying)
    return tally.acks[10:]


async def _owner(servers: list[Server], where: Terrain) -> tuple[Server, Server]:
    """The server that has a terrain which somebody has just opened, and another one."""
    tally = Tally()
    person = Person("first", where, [servers[0].socket], tally)
    staying = await _gather([person])
    leases = {server.name: _leases(server) for server in servers}
    await person.stop()
    await asyncio.gather(*staying)
    owner = max(servers, key=lambda server: leases[server.name])
    return owner, next(server for server in servers if server is not owner)


async def _openings(server: Server, count: int = 40) -> Any:
    """From a hello to its welcome, in terrains that nobody has open: with the lease, the journal and the room."""
    seconds = []
    for _ in range(count):
        where, tally = terrain(server.base), Tally()
        person = Person("o", where, [server.socket], tally)
        began = time.perf_counter()
        staying = await _gather([person])
        seconds.append(time.perf_counter() - began)
        await person.stop()
        await asyncio.gather(*staying)
    return {"terrains": count, "median_ms": _milliseconds(seconds)["p50"], "p99_ms": _milliseconds(seconds)["p99"]}


def _leases(server: Server) -> int:
    import urllib.request

    with urllib.request.urlopen(f"{server.base}/healthz", timeout=5) as answer:
        return int(json.loads(answer.read())["leases"])


async def _forwarding(servers: list[Server], database: psutil.Process, seconds: float) -> Any:
    """Clients at the server that has the terrain, then as many at the one that passes them on."""
    where = terrain(servers[0].base)
    owner, other = await _owner(servers, where)
    right = await _latency(owner.socket, where)
    wrong = await _latency(other.socket, where)
    loads: dict[str, Any] = {}
    for name, door in (("at_owner", owner), ("passed_on", other)):
        tally = Tally()
        people = [Person(f"{name}{n}", where, [door.socket], tally) for n in range(CLIENTS)]
        staying = await _gather(people)
        start = time.perf_counter() + 0.5
        tally.since = start + WARM_UP
        drawing = [
            asyncio.create_task(p.draw(RATE, start, seconds + WARM_UP, n / CLIENTS)) for n, p in enumerate(people)
        ]
        await asyncio.sleep(tally.since - time.perf_counter())
        before, wall = _used(servers, database), time.perf_counter()
        await asyncio.gather(*drawing)
        after, wall = _used(servers, database), time.perf_counter() - wall
        await asyncio.sleep(0.5)
        for person in people:
            await person.stop()
        await asyncio.gather(*staying)
        cores = {server.name: round((after[server.name] - before[server.name]) / wall, 3) for server in servers}
        loads[name] = {
            "ack_ms": _milliseconds(tally.acks),
            "owner_cores": cores[owner.name],
            "other_cores": cores[other.name],
        }
    added = _milliseconds(wrong)["p50"] - _milliseconds(right)["p50"]
    cost = loads["passed_on"]["other_cores"] - loads["at_owner"]["other_cores"]
    return {
        "alone_ms": {"at_owner": _milliseconds(right), "passed_on": _milliseconds(wrong), "added_p50": round(added, 2)},
        "sixty": loads,
        "cores_for_passing_on": round(cost, 3),
    }


async def _takeover(servers: list[Server], number: signal.Signals) -> Any:
    """Sixty clients draw at the owner; it is killed, or stopped. When does each have its next acknowledgement?"""
    where, tally = terrain(servers[0].base), Tally()
    owner, other = await _owner(servers, where)
    people = [Person(f"k{n}", where, [owner.socket, other.socket], tally) for n in range(CLIENTS)]
    staying = await _gather(people)
    start = time.perf_counter() + 0.5
    drawing = [asyncio.create_task(p.draw(2.0, start, 15.0, n / CLIENTS)) for n, p in enumerate(people)]
    await asyncio.sleep(2.0)
    gone = time.perf_counter()
    owner.end(number)
    await asyncio.gather(*drawing)
    await asyncio.sleep(1.0)
    for person in people:
        await person.stop()
    await asyncio.gather(*staying)
    owner.gone()
    waits = sorted(at - gone for at in tally.back.values())
    clock = _clock(other, where)
    return {
        "clients": CLIENTS,
        "came_back": len(waits),
        "seconds": {"median": round(waits[len(waits) // 2], 2), "last": round(waits[-1], 2)} if waits else None,
        "acknowledged": tally.saved,
        "in_the_journal": clock,
        "lost": tally.saved - clock if clock < tally.saved else 0,
        "unacknowledged": CLIENTS * 31 - tally.saved,
    }


def _clock(server: Server, where: Terrain) -> int:
    import urllib.request

    request = urllib.request.Request(f"{server.base}/api/terrains/{where.id}")
    request.add_header("Authorization", f"Bearer {where.secret}")
    with urllib.request.urlopen(request, timeout=10) as answer:
        return int(json.loads(answer.read())["clock"]) - 1  # the first of ``_owner`` began a stroke


def measure(seconds: float) -> dict[str, Any]:
    """Everything, one after the other."""
    found: dict[str, Any] = {}
    with alone() as servers:
        found["sqlite"] = uvloop.run(_load(servers, None, 1, lambda _: [servers[0].socket], seconds))
    postgres = Postgres(fsync="on")
    try:
        assert postgres._process is not None
        database = psutil.Process(postgres._process.pid)
        for count in (1, 2, 3):
            with nodes(count, postgres.database()) as some:
                doors = [server.socket for server in some]
                rooms = 1 if count == 1 else ROOMS
                found[f"postgres_{count}"] = uvloop.run(
                    _load(some, database, rooms, lambda n, doors=doors: [doors[n // ROOMS % len(doors)]], seconds)
                )
                if count == 1:
                    found["openings"] = uvloop.run(_openings(some[0]))
                if count == 2:
                    found["forwarding"] = uvloop.run(_forwarding(some, database, seconds / 2))
                    found["after_drain"] = uvloop.run(_takeover(some, signal.SIGTERM))
        with nodes(2, postgres.database()) as some:
            found["after_kill"] = uvloop.run(_takeover(some, signal.SIGKILL))
        found["appends"] = _appends.measure(postgres, seconds / 2)
    finally:
        postgres.close()
    return found


def main(argv: list[str]) -> int:
    """``esker bench cluster [--json] [--simulate]``."""
    parser = argparse.ArgumentParser(prog="esker bench cluster", description=__doc__)
    parser.add_argument("--seconds", type=float, default=10, help="of drawing in each part")
    parser.add_argument("--simulate", action="store_true", help="a thousand nodes, by arithmetic, and nothing else")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--note", default="", help="a sentence about the circumstances, kept in the result")
    arguments = parser.parse_args(argv)
    result: dict[str, Any] = {
        "bench": "cluster",
        "version": VERSION,
        "machine": _serving.machine(),
        "note": arguments.note,
    }
    if arguments.simulate:
        result["simulation"] = _simulation.run()
    else:
        result["scene"] = {"clients": CLIENTS, "ops_per_s_each": RATE, "seconds": arguments.seconds}
        result |= measure(arguments.seconds)
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        for name, value in result.items():
            sys.stdout.write(f"{name}: {json.dumps(value)}\n")
    return 0
