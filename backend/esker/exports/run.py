"""Making an export in a process of its own (``python -m esker.exports``): it may be left at any moment."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import sys
from collections.abc import Callable
from typing import Final

from pydantic import ValidationError

from esker import contract as c
from esker.child_process import put_down, tail
from esker.exports import wire

log = logging.getLogger("esker.exports")

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
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "esker.exports",
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        return await asyncio.wait_for(_talk(process, task, on_progress), WALL_SECONDS)
    except TimeoutError:
        raise ExportFailed(TOO_LONG) from None
    finally:
        await put_down(process)


async def _talk(process: asyncio.subprocess.Process, task: wire.Task, on_progress: Progress) -> wire.Made:
    """Hands the task over and listens until the process says how it ended."""
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    errors = asyncio.create_task(tail(process.stderr))
    try:
        with contextlib.suppress(ConnectionError):
            process.stdin.write(task.model_dump_json().encode() + b"\n")
            await process.stdin.drain()
        while text := await process.stdout.readline():
            match wire.LINE.validate_json(text):
                case wire.Step(stage=stage, share=share):
                    on_progress(stage, share)
                case wire.Failed(sentence=sentence):
                    raise ExportFailed(sentence)
                case wire.Made() as made:
                    return made
        status = await process.wait()
        log.error("the export of %s ended with %s: %s", task.document.id, status, (await errors).strip())
    except (ValidationError, ValueError) as error:  # a line that is cut off
        log.error("the export of %s said something odd: %s", task.document.id, error)
    finally:
        errors.cancel()
        await asyncio.gather(errors, return_exceptions=True)
    raise ExportFailed(KILLED if process.returncode == -signal.SIGKILL else FAILED)
