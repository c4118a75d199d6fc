"""Rooms with their journals in processes that are killed: a process that forks one for each line it reads.

``python -m tests.sync.kill_child``: for each line ``DATA FIRST`` on stdin a fork's client c submits ops c:FIRST,
c:FIRST+1 … as fast as the room takes them, and writes the id of each that is acknowledged to stdout; ``gone`` follows
when it has ended. Forks share what took long to load.
"""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path
from typing import Any

from esker import contract as c
from esker.session.ground.frames.tilethread import TileThread
from esker.session.ground.worker import Worker
from esker.session.room import protocol
from esker.session.room.core import RoomCore, RoomInfo
from esker.session.room.outbox import Outbox
from esker.session.room.room import Guest, Room
from esker.store.claims import Claims
from esker.store.journal import Journal


class _NoSolver:
    device_name = "none"

    def steps(self, *_: Any, **__: Any) -> Any:
        return iter(())

    def channels(self, *_: Any, **__: Any) -> Any:
        return iter(())

    def base_levels(self, *_: Any) -> Any:
        return iter(())

    def refiner(self, _: Any) -> Any:
        raise AssertionError("nothing is ever solved")


class _NoTiles:
    def server(self, *_: Any) -> Any:
        return self

    def client(self, *_: Any) -> Any:
        return self

    watcher = client

    def plan(self, *_: Any) -> None:
        return None


async def life(data: Path, first: int) -> None:
    """Runs until it is killed."""
    journal = Journal(data)
    if not journal.exists("t"):
        await asyncio.wrap_future(journal.create(c.Document(id="t")))
    loaded = journal.load("t")
    assert loaded is not None
    worker = Worker(lambda _: _NoSolver())
    worker.start()
    core = RoomCore(loaded, lambda client, counter: journal.find("t", client, counter), claims=CLAIMS)
    room = Room(
        core,
        journal=journal,
        worker=worker,
        tiles=_NoTiles(),
        executor=TileThread(),
        info=RoomInfo(0, 0, "none"),
        on_empty=lambda _: None,
    )
    wake = asyncio.Event()
    outbox = Outbox(wake.set)
    guest: Guest = room.join(
        c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client="c", token=TOKEN), "edit", "link", outbox
    )
    counter = first
    while True:
        ops = []
        for _ in range(3):
            fields = c.StrokeFields(label=str(counter))
            begin = c.BeginStroke(stroke=_stroke("s")) if counter == 0 else c.SetStroke(stroke="s", fields=fields)
            ops.append(c.OpEnvelope(id=f"c:{counter}", op=begin))
            counter += 1
        room.receive(guest, protocol.Accepted(tuple(ops)))
        await asyncio.sleep(0.002)
        while (text := outbox.pop()) is not None:
            message = c.SERVER_MESSAGE.validate_json(str(text))
            if isinstance(message, c.Ack):
                os.write(1, ("".join(f"{i} {k}\n" for i, k in zip(message.ids, message.clocks, strict=True))).encode())
            assert not isinstance(message, c.Reject), message


CLAIMS = Claims(bytes(32))
TOKEN = CLAIMS.token("t", "c", "link", 1)


def _stroke(stroke_id: str) -> c.Stroke:
    return c.Stroke(id=stroke_id, kind="profile", first=(0, 0, 0), last=(1, 1, 1), curve=((0, 0),))


def main() -> None:
    """One fork for each line."""
    for line in sys.stdin:
        folder, first = line.rsplit(" ", 1)
        child = os.fork()
        if child == 0:
            asyncio.run(life(Path(folder), int(first)))
        os.write(2, f"{child}\n".encode())
        os.waitpid(child, 0)
        os.write(1, b"gone\n")


if __name__ == "__main__":
    main()
