"""A maker of exported files whose work stands in the title of the terrain, for the tests of who may export."""

from __future__ import annotations

import asyncio
import threading
from pathlib import Path

from esker.exporting import wire
from esker.exporting.run import ExportFailed, Progress

WANTED = {"format": "npy", "samples": 257, "detail": False}
CONTENT = b"x" * 1000


class Maker:
    """In the place of the process that exports: what it is to do stands in the title of the terrain."""

    def __init__(self) -> None:
        self.gate = threading.Event()
        self.tasks: list[wire.Task] = []
        self.at_once = self.most = self.stopped = 0

    async def make(self, task: wire.Task, on_progress: Progress) -> wire.Made:
        self.tasks.append(task)
        self.at_once += 1
        self.most = max(self.most, self.at_once)
        words = task.document.settings.title
        try:
            (Path(task.folder) / "half").write_bytes(b"x")
            on_progress("detail", 0.5)
            while "slow" in words and not self.gate.is_set():
                await asyncio.sleep(0.005)
            if "fail" in words:
                raise ExportFailed("The ground is lava.")
            if "crash" in words:
                raise RuntimeError("of the maker")
            (Path(task.folder) / "half").rename(Path(task.folder) / "a.npy")
            (Path(task.folder) / "a.npy").write_bytes(CONTENT)
            return wire.Made(file="a.npy", bytes=len(CONTENT), low_m=-1.0, high_m=2.0, spacing_m=16.0)
        except asyncio.CancelledError:
            self.stopped += 1
            raise
        finally:
            self.at_once -= 1
