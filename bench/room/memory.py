"""Memory of a server: at rest, for each open empty room, for each drawn one, and after everybody left.

The server is a process of its own; this one opens a room, waits until its ground is settled, and goes on to the next.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any, Final

import psutil
from websockets.sync.client import ClientConnection, connect

from bench.room import _serving
from esker import contract as c
from esker import templates
from esker.version import VERSION

ROOMS: Final = 8
DRAWN: Final = "alpine-ridge"
SETTLE_SECONDS: Final = 40.0
"""After this long without a change a room is at rest, and what was solved with is given back."""
LEAVE_SECONDS: Final = 60.0


def resident(process: psutil.Process) -> float:
    """Resident memory of a process in MiB, without its children."""
    return process.memory_info().rss / 2**20


def _join(base: str, terrain: str, secret: str, stack: ExitStack) -> ClientConnection:
    options: dict[str, Any] = {"subprotocols": [c.SUBPROTOCOL], "max_size": None, "compression": None, "proxy": None}
    socket: ClientConnection = stack.enter_context(connect(base.replace("http", "ws") + "/ws", **options))
    hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client="bench")
    socket.send(hello.model_dump_json())
    view = c.View(eye=(2048, -2000, 2000), target=(2048, 2048, 0), width=1600, height=900)
    socket.send(view.model_dump_json())
    for message in _heard(socket):
        if message["type"] == "progress" and message["settled"]:
            return socket
    raise RuntimeError("the ground did not settle")


def _heard(socket: ClientConnection) -> Iterator[dict[str, Any]]:
    for data in socket:
        if isinstance(data, bytes):
            socket.send(c.Credit(bytes=len(data)).model_dump_json())
        else:
            yield json.loads(data)


def measure(rooms: int, settle: float = SETTLE_SECONDS, leave: float = LEAVE_SECONDS) -> dict[str, Any]:
    """Figures in MiB."""
    found: dict[str, Any] = {}
    with _serving.running() as (base, process):
        server = psutil.Process(process.pid)
        time.sleep(2.0)
        found["at_rest"] = resident(server)
        for kind in ("empty", "drawn"):
            before = resident(server)
            with ExitStack() as stack:
                for _ in range(rooms):
                    document = c.Document(id="x") if kind == "empty" else templates.load(DRAWN).document
                    _join(base, *_serving.upload(base, document), stack)
                found[f"{kind}_busy"] = (resident(server) - before) / rooms
                time.sleep(settle)
                found[f"{kind}_room"] = (resident(server) - before) / rooms
            time.sleep(leave)
            found[f"{kind}_left"] = resident(server)
    return {name: round(value, 1) for name, value in found.items()}


def main(argv: list[str]) -> int:
    """``esker bench memory [--json] [--rooms N]``."""
    parser = argparse.ArgumentParser(prog="esker bench memory", description=__doc__)
    parser.add_argument("--rooms", type=int, default=ROOMS, help="rooms of each kind (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    arguments = parser.parse_args(argv)
    machine = _serving.machine()
    result = {"bench": "memory", "version": VERSION, "machine": machine, "rooms": arguments.rooms}
    result["mib"] = measure(arguments.rooms)
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        sys.stdout.writelines(f"{name:12} {value:8.1f} MiB\n" for name, value in result["mib"].items())
    return 0
