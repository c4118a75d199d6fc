"""Imports without end in processes that are killed: a process that forks one for each line it reads.

``python import_child.py``: for each line ``DATA SEED`` on stdin it forks a server's room, journal and imports over
DATA. It writes ``ready``, then the id of each layer that it was told is done. Forks share what took long to load.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import numpy as np

from esker import contract as c
from esker.contract import ImportStage
from esker.fairness.shares import Who
from esker.jobs import Imports
from esker.patchwork.raster import rasters
from esker.session.ground.worker import Worker
from esker.session.room.hub import Hub
from esker.store.access import Access
from esker.store.grids import GridStore
from esker.store.journal import Journal
from tests.sync.kill_child import _NoSolver, _NoTiles


class Reader:
    """Makes a real raster of what it is given, in this process: the reader of files has tests of its own."""

    async def inspect(self, path: Path, name: str, **_: Any) -> c.ImportReport:
        return c.ImportReport(verdict="good", file=name, rows=path.stat().st_size)

    async def convert(
        self,
        path: Path,
        answers: c.ImportAnswers,
        place: c.Place | None,
        size_m: float,
        out_dir: Path,
        on_progress: Callable[[ImportStage, float], None] | None = None,
        *,
        name: str | None = None,
    ) -> c.Layer:
        assert on_progress is not None
        assert place is None
        rng = np.random.default_rng(list(path.read_bytes()))
        heights = rng.uniform(0, 100, (40, 50)).astype(np.float32)
        raster = rasters.build(heights)
        await asyncio.sleep(0)
        on_progress("errors", 0.5)
        rasters.write(out_dir, raster)
        return c.Layer(
            id="new", content=raster.digest, facts=raster.facts(file=name), anchor=answers.anchor or (0.0, 0.0),
            spacing_m=(size_m / 50, size_m / 50), accuracy_m=1.0,
        )  # fmt: skip

    def suggest_place(self, report: c.ImportReport) -> c.Place | None:
        assert report.verdict == "good"
        return None

    def suggest_size(self, report: c.ImportReport) -> float:
        return 64.0 * report.rows


async def _body(data: bytes) -> AsyncIterator[bytes]:
    yield data


async def life(data: Path, seed: int) -> None:
    """Imports until it is killed."""
    journal, grids = Journal(data), GridStore(data)
    grids.sweep(journal.grids())
    worker = Worker(lambda _: _NoSolver())
    worker.start()
    hub = Hub(journal, Access(journal), worker, _NoTiles(), levels=0)
    if not journal.exists("t"):
        await asyncio.wrap_future(journal.create(c.Document(id="t")))
    link = (await asyncio.wrap_future(hub.access.add("t", "owner", "")))[0]
    imports = Imports(hub, grids, Reader(), quota_bytes=1 << 40)
    os.write(1, b"ready\n")
    for count in range(1000):
        status = await imports.upload(
            "a.tif", "me", _body(f"{seed} {count}".encode()), None, terrain="t", link=link, client="c", who=Who("")
        )
        while status.stage not in ("done", "refused"):
            await asyncio.sleep(0.001)
            status = imports.status("t", status.id)
        os.write(1, f"{status.layer or status.text}\n".encode())
        room = await hub.room("t")
        await room.perform(c.DeleteLayer(layer=str(status.layer)), f"d-{seed}-{count}", "c")


def main() -> None:
    """One fork for each line."""
    rasters.build(np.zeros((40, 50), dtype=np.float32))
    for line in sys.stdin:
        folder, seed = line.split()
        child = os.fork()
        if child == 0:
            asyncio.run(life(Path(folder), int(seed)))
        os.write(2, f"{child}\n".encode())
        os.waitpid(child, 0)
        os.write(1, b"gone\n")


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    main()
