"""What both ends of a child process share: strangers' files are read in one, exports are made, kernels compiled."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import threading
from collections.abc import AsyncGenerator
from typing import Any, Final

from esker.process import system

KEPT_ERRORS: Final = 4096
"""Bytes of what a child complained of that reach the log."""
ORPHANED: Final = 9
"""Exit status of a child whose parent has ended."""


class Ended(Exception):
    """A child ended without saying its result; the message has its exit status and what it complained of."""


async def start(module: str, *arguments: str, **more: Any) -> asyncio.subprocess.Process:
    """Starts ``python -m module`` with pipes to it and from it, out of reach of a terminal's Ctrl-C. ``more``: further
    arguments of ``asyncio.create_subprocess_exec``. Raises OSError."""
    pipe = asyncio.subprocess.PIPE
    options: dict[str, Any] = {} if hasattr(os, "setpgid") else system.apart()
    return await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "esker.process.apart",
        module,
        *arguments,
        stdin=pipe,
        stdout=pipe,
        stderr=pipe,
        **options,
        **more,
    )


async def lines(process: asyncio.subprocess.Process, task: str) -> AsyncGenerator[bytes, None]:
    """Hands a child its task, a line of JSON, and yields the lines that it says. Close it when the result has come.

    Raises Ended where the child's lines come to an end, ValueError for a line that is longer than the process was
    started for.
    """
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    complaints = asyncio.create_task(_tail(process.stderr))
    try:
        with contextlib.suppress(ConnectionError, RuntimeError):  # uvloop raises the latter for a pipe that is closed
            process.stdin.write(task.encode() + b"\n")
            await process.stdin.drain()
        while text := await process.stdout.readline():
            yield text
        raise Ended(f"{await process.wait()}: {(await complaints).strip()}")
    finally:
        complaints.cancel()
        await asyncio.gather(complaints, return_exceptions=True)


async def _tail(stream: asyncio.StreamReader) -> str:
    """The end of what a process complained of. Everything is read, so that the process never waits for us."""
    kept = b""
    while chunk := await stream.read(65536):
        kept = (kept + chunk)[-KEPT_ERRORS:]
    return kept.decode("utf-8", "replace")


async def put_down(process: asyncio.subprocess.Process) -> None:
    """Kills a child that still runs and waits until it is gone."""
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
    if process.stdin is not None:
        process.stdin.close()
    await process.wait()


def end_with_parent() -> None:
    """Ends this process, a child, when its parent is gone, which holds the other end of its stdin."""
    threading.Thread(target=_wait_for_the_end, name="parent", daemon=True).start()


def _wait_for_the_end() -> None:
    # The stream itself is locked while it is read from, and a process that ends by itself would wait for it.
    while os.read(sys.stdin.fileno(), 4096):
        pass
    os._exit(ORPHANED)
