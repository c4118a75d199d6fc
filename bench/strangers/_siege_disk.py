"""What the disk takes by itself for a synced write, beside what people notice of an attack.

An operation is acknowledged when the disk has it. Where others use the same disk, a sync that takes a fifth of a second
is the worst that a row has, whatever was attacked.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np

PERIOD: Final = 0.05
"""Seconds between two writes: as many as four people have acknowledged."""
PAGE: Final = bytes(4096)


class Disk:
    """A process that writes a page into a file and syncs it, over and over. A context manager."""

    def __init__(self, path: Path) -> None:
        """``path``: the file, on the disk that is looked at; it is removed at the end."""
        self._path = path
        spawned = multiprocessing.get_context("spawn")
        self._ours, theirs = spawned.Pipe()
        self._process = spawned.Process(target=_write, args=(str(path), theirs), daemon=True)

    def __enter__(self) -> Self:
        self._process.start()
        self.figures()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.join()
        self._path.unlink(missing_ok=True)

    def figures(self) -> dict[str, float]:
        """Returns what writes took since this was last asked, milliseconds."""
        self._ours.send(None)
        return summary(self._ours.recv())


def summary(seconds: list[float]) -> dict[str, float]:
    """Returns the 99th percentile and the worst of these, milliseconds; nothing where there are none."""
    if not seconds:
        return {}
    return {"p99_ms": round(1000 * float(np.percentile(seconds, 99)), 1), "worst_ms": round(1000 * max(seconds), 1)}


def _write(path: str, asked: Connection[list[float], Any]) -> None:
    """The process: writes until nobody asks any more."""
    sync, took = getattr(os, "fdatasync", os.fsync), list[float]()
    with open(path, "wb", buffering=0) as file:
        while True:
            began = time.perf_counter()
            file.seek(0)
            file.write(PAGE)
            sync(file.fileno())
            took.append(time.perf_counter() - began)
            if asked.poll(PERIOD):
                asked.recv()
                asked.send(took)
                took = []
