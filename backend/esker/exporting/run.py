"""Making an export in a process of its own (``python -m esker.api.export_child``): it may be left at any moment."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from typing import Final

from pydantic import ValidationError

from esker import contract as c
from esker.exporting import wire
from esker.process import child_process, system

log = logging.getLogger("esker.exporting")

Progress = Callable[[c.ExportStage, float], None]
WALL_SECONDS: Final = 3600.0
"""Against a driver that hangs; without any device the largest export takes many minutes."""
FAILED: Final = "The server failed to make this export. It is in its log."
KILLED: Final = "The system ended this export, most likely for want of memory. Take fewer samples."
TOO_LONG: Final = "This export took too long. Take fewer samples."


class ExportFailed(Exception):
    """There is no export; the message is a sentence."""


async def make(task: wire.Task, on_progress: Progress) -> wire.Made:
    """Runs one task to its end. ``on_progress``: stage, and the share of all the work. Raises ExportFailed; the process
    is gone in any case, also when this is cancelled. What it had written stays, for the caller to remove."""
    process = await child_process.start("esker.api.export_child")
    try:
        return await asyncio.wait_for(_talk(process, task, on_progress), WALL_SECONDS)
    except TimeoutError:
        raise ExportFailed(TOO_LONG) from None
    finally:
        await child_process.put_down(process)


async def _talk(process: asyncio.subprocess.Process, task: wire.Task, on_progress: Progress) -> wire.Made:
    """Hands the task over and listens until the process says how it ended."""
    try:
        line = await asyncio.to_thread(wire.task_line, task)
        async with contextlib.aclosing(child_process.lines(process, line)) as said:
            async for text in said:
                match wire.LINE.validate_json(text):
                    case wire.Step(stage=stage, share=share):
                        on_progress(stage, share)
                    case wire.Failed(sentence=sentence):
                        raise ExportFailed(sentence)
                    case wire.Made() as made:
                        return made
    except child_process.Ended as end:
        log.error("the export of %s ended with %s", task.document.id, end)
    except (ValidationError, ValueError) as error:  # a line that is cut off
        log.error("the export of %s said something odd: %s", task.document.id, error)
    raise ExportFailed(KILLED if system.was_killed(process.returncode) else FAILED)
