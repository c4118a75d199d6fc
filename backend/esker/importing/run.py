"""Inspecting and converting elevation files, each in a process of its own with bounds (``python -m esker.importing``).

Whatever is in a file, the caller gets a report, a layer, or a sentence; never a crash and never a half-made grid.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from esker import contract as c
from esker.importing import limits, warm, wire
from esker.importing.refusal import ImportCancelled, ImportRefused
from esker.process import child_process

log = logging.getLogger("esker.importing")

__all__ = ["ImportCancelled", "ImportRefused", "convert", "inspect", "suggest_place", "suggest_size"]

Progress = Callable[[c.ImportStage, float], None]
MAX_LINE_BYTES: Final = 256 * 1024
HEIGHT_GROWTH: Final = 2.0
ROOM_BYTES: Final = 16 << 20
"""A reader that ends with less than this left on the disk ended for want of it: mapped files return no error."""
FULL: Final = "The server's disk has no room for it."
STOPPED: Final = "Reading it took too much memory or time, or its data are broken in a way that stops the reader."


async def inspect(
    path: Path,
    name: str,
    *,
    answers: c.ImportAnswers | None = None,
    place: c.Place | None = None,
    size_m: float | None = None,
    on_progress: Progress | None = None,
    cancel: asyncio.Event | None = None,
    folder: Path | None = None,
) -> c.ImportReport:
    """What the file at ``path`` (called ``name`` by its owner) is and what would happen.

    Never raises for bad files: the verdict is then "refused" with a sentence. ``place`` and ``size_m``: of the terrain
    that it is meant for, so that a file from elsewhere is asked about; ``answers`` take their questions away;
    ``folder``: where archives are unpacked meanwhile (default: that for temporary files). Raises ImportCancelled once
    ``cancel`` is set.
    """
    given = answers or c.ImportAnswers()
    try:
        with tempfile.TemporaryDirectory(prefix="esker-inspect-", dir=folder) as workdir:
            task = wire.Task(
                task="inspect",
                path=str(path.resolve()),
                name=name,
                workdir=workdir,
                answers=given,
                place=place,
                size_m=size_m,
            )
            done = await _run(task, on_progress, cancel)
    except ImportRefused as refusal:
        return c.ImportReport(verdict="refused", file=name[: c.MAX_NAME_LENGTH], refusal=str(refusal)[:240])
    assert isinstance(done, wire.Inspected)
    return done.report


async def convert(
    path: Path,
    answers: c.ImportAnswers,
    place: c.Place | None,
    size_m: float,
    out_dir: Path,
    on_progress: Progress | None = None,
    cancel: asyncio.Event | None = None,
    *,
    name: str | None = None,
) -> c.Layer:
    """Writes the file's raster to ``out_dir`` and returns its layer; id "new", author and priority are not set.

    ``on_progress(stage, share)``: reading, mipmaps, errors, saving, with the share of the whole conversion. ``place``
    None: the middle of a file from Earth becomes the middle of the terrain (``suggest_place`` of its report). Raises
    ImportRefused with a sentence, ImportCancelled; ``out_dir`` is removed then, as it is when the task is cancelled.
    """
    workdir = out_dir.with_name(out_dir.name + ".work")
    workdir.mkdir(parents=True)
    complete = False
    try:
        task = wire.Task(
            task="convert", path=str(path.resolve()), name=name or path.name, workdir=str(workdir.resolve()),
            out_dir=str(out_dir.resolve()), answers=answers, place=place, size_m=size_m,
        )  # fmt: skip
        done = await _run(task, on_progress, cancel)
        assert isinstance(done, wire.Converted)
        complete = True
        return done.layer
    finally:
        shutil.rmtree(workdir, ignore_errors=True)
        if not complete:
            shutil.rmtree(out_dir, ignore_errors=True)


def suggest_place(report: c.ImportReport) -> c.Place | None:
    """The place of a terrain made from a file: the file's middle; None when it has no place on Earth."""
    if report.at is None:
        return None
    return c.Place(lat_deg=round(report.at[0], 6), lon_deg=round(report.at[1], 6))


def suggest_size(report: c.ImportReport) -> float:
    """Size in metres of a terrain made from a file: it holds the whole grid where the largest terrain can, rounded up
    to three digits; the default where the file does not say how large it is. A little larger where that lets it hold
    the heights as they are; where it would have to be more than ``HEIGHT_GROWTH`` times, they are asked about."""
    if report.width_m is None or report.height_m is None:
        return c.DEFAULT_SIZE_M
    angle = math.radians(report.rotation_deg)
    across, up = abs(math.cos(angle)), abs(math.sin(angle))
    side = max(report.width_m * across + report.height_m * up, report.width_m * up + report.height_m * across)
    farthest = max(abs(report.low_m or 0.0), abs(report.high_m or 0.0)) / c.LAYER_HEIGHT_MARGIN
    if side < farthest <= HEIGHT_GROWTH * side:
        side = farthest
    side = min(max(side, c.MIN_SIZE_M), c.MAX_SIZE_M)
    if report.format == wire.OWN_FORMAT:  # as it was
        return side
    unit = 10.0 ** (math.floor(math.log10(side)) - 2)
    return float(min(math.ceil(round(side / unit, 6)) * unit, c.MAX_SIZE_M))


async def _run(
    task: wire.Task, on_progress: Progress | None, cancel: asyncio.Event | None
) -> wire.Inspected | wire.Converted:
    """Runs one task to its end. Raises ImportRefused, ImportCancelled; the process is gone in any case."""
    await warm.loops()
    process = await child_process.start("esker.importing", env=limits.environment(), limit=MAX_LINE_BYTES)
    waiting = asyncio.create_task(_talk(process, task, on_progress))
    stop = asyncio.create_task(cancel.wait()) if cancel is not None else None
    try:
        waited = {waiting} if stop is None else {waiting, stop}
        await asyncio.wait(waited, timeout=limits.WALL_SECONDS[task.task], return_when=asyncio.FIRST_COMPLETED)
        if waiting.done():
            return waiting.result()
        if stop is not None and stop.done():
            raise ImportCancelled("The import was cancelled.")
        raise ImportRefused("Reading it took too long.")
    finally:
        for left in (waiting, stop):
            if left is not None and not left.done():
                left.cancel()
        await child_process.put_down(process)
        await asyncio.gather(*(left for left in (waiting, stop) if left is not None), return_exceptions=True)


async def _talk(
    process: asyncio.subprocess.Process, task: wire.Task, on_progress: Progress | None
) -> wire.Inspected | wire.Converted:
    """Hands the task over and listens until the process says how it ended. Raises ImportRefused."""
    try:
        async with contextlib.aclosing(child_process.lines(process, task.model_dump_json())) as said:
            async for text in said:
                match wire.LINE.validate_json(text):
                    case wire.Step(stage=stage, share=share):
                        if on_progress is not None:
                            on_progress(stage, share)
                    case wire.Refused(sentence=sentence):
                        raise ImportRefused(sentence)
                    case wire.Inspected() | wire.Converted() as done:
                        return done
    except child_process.Ended as end:
        log.warning("the reader of %r ended with %s", task.name, end)
    except (ValidationError, ValueError) as error:  # a line that is cut off or too long
        log.warning("the reader of %r said something odd: %s", task.name, error)
    full = await asyncio.to_thread(lambda: shutil.disk_usage(task.workdir).free < ROOM_BYTES)
    raise ImportRefused(FULL if full else STOPPED)
