"""What both ends of a child process share: importing reads files in one, exports are made in one."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from typing import Final

KEPT_ERRORS: Final = 4096
"""Bytes of what a child complained of that reach the log."""


async def tail(stream: asyncio.StreamReader) -> str:
    """The end of what a process complained of; everything is read, so that it never waits for us."""
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
    """In the child, on a thread of its own: ends this process when whoever started it is gone."""
    while sys.stdin.buffer.read(4096):
        pass
    os._exit(9)
