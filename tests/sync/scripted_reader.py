"""A reader of elevation files that does what their words say, and how tests bring such files in."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from esker import contract as c
from esker.contract import ImportStage
from esker.importing.refusal import ImportRefused
from esker.patchwork.raster import rasters
from tests.sync.harness import PATIENCE, LiveServer

QUESTION = c.ImportQuestion(id="size", text="How wide is it?", default="fit")
GRID = np.add.outer(np.arange(40.0), np.arange(50.0))


def _words(path: Path) -> str:
    return path.read_bytes().decode("utf-8", "replace")


class Reader:
    """Reads files whose text says what to do: words of "ask", "refuse", "long", "slow", "crash"."""

    def __init__(self) -> None:
        self.gate = threading.Event()
        self.stopped = 0
        self.at_once = 0
        self.most = 0

    async def inspect(
        self,
        path: Path,
        name: str,
        *,
        answers: c.ImportAnswers | None = None,
        on_progress: Callable[[ImportStage, float], None] | None = None,
        **_: Any,
    ) -> c.ImportReport:
        words = _words(path)
        while "long" in words and not self.gate.is_set():
            assert on_progress is not None
            on_progress("reading", 0.5)
            await asyncio.sleep(0.01)
        given = {} if answers is None else answers.answers
        if given.get("size") == "no":
            return c.ImportReport(verdict="refused", file=name, refusal="That is no size.")
        if given.get("size") == "twice":
            questions = () if "shape" in given else (QUESTION.model_copy(update={"id": "shape"}),)
            return c.ImportReport(verdict="ask" if questions else "good", file=name, questions=questions)
        if "refuse" in words:
            return c.ImportReport(verdict="refused", file=name, refusal="It is a picture of a cat.")
        questions = (QUESTION,) if "ask" in words and not given else ()
        return c.ImportReport(verdict="ask" if questions else "good", file=name, questions=questions)

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
        assert place is None
        assert on_progress is not None
        words = _words(path)
        self.at_once += 1
        self.most = max(self.most, self.at_once)
        try:
            if "crash" in words:
                raise RuntimeError("the reader fell over")
            if answers.answers.get("size") == "late":
                raise ImportRefused("That is no size after all.")
            while "slow" in words and not self.gate.is_set():
                on_progress("errors", 0.5)
                await asyncio.sleep(0.01)
            raster = rasters.build(GRID + len(words))
            rasters.write(out_dir, raster)
        except asyncio.CancelledError:
            self.stopped += 1
            raise
        finally:
            self.at_once -= 1
        return c.Layer(
            id="new", content=raster.digest, facts=raster.facts(file=name), name=answers.name or "grid",
            anchor=answers.anchor or (10.0, 20.0), spacing_m=answers.spacing_m or (size_m / 50, size_m / 50),
            accuracy_m=1.0,
        )  # fmt: skip

    def suggest_place(self, report: c.ImportReport) -> c.Place | None:
        assert report.verdict != "refused"
        return None

    def suggest_size(self, report: c.ImportReport) -> float:
        assert report.verdict != "refused"
        return 1234.0


def send(server: LiveServer, terrain: str, secret: str, words: str, query: str = "name=a.tif") -> tuple[int, Any]:
    """Brings a file of these words in; status and answer."""
    return server.http("POST", f"/api/terrains/{terrain}/imports?{query}", words.encode(), secret)


def wait(server: LiveServer, terrain: str, secret: str, job: str, *stages: str) -> dict[str, Any]:
    """The status of an import once it is in one of these stages."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        _, status = server.http("GET", f"/api/terrains/{terrain}/imports/{job}", secret=secret)
        if status["stage"] in stages:
            return dict(status)
        time.sleep(0.01)
    raise TimeoutError(f"{stages}: {status}")


def layers(server: LiveServer, terrain: str) -> tuple[c.Layer, ...]:
    """The layers of a terrain."""
    return asyncio.run(server.assembly.hub.document(terrain)).layers


def works(server: LiveServer) -> list[str]:
    """Names of the work folders that are there."""
    return [p.name for p in (server.assembly.settings.data / "grids").iterdir() if p.name.startswith(".work")]


def nothing_left(grids: Path, start: str = "") -> bool:
    """Whether nothing (whose name starts so) is left in the folder of grids, soon: a thread removes it."""
    deadline = time.monotonic() + PATIENCE
    while any(p.name.startswith(start) for p in grids.iterdir()):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def no_works(server: LiveServer) -> bool:
    """Whether no work folder is left, soon."""
    return nothing_left(server.assembly.settings.data / "grids", ".work")
