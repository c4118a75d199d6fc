"""Children that a terminal's Ctrl-C does not reach, and that step back within their parent's session (SPEC H567)."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest
import uvloop

from esker.process import child_process, system

SAYS = """
import json, os, sys
print(json.dumps([__name__, sys.argv[1:], os.getpid() == os.getpgid(0), os.getsid(0)]))
"""
WANTED = ["__main__", ["a", "b c"], True, os.getsid(0)]


@pytest.mark.parametrize("run", [asyncio.run, uvloop.run])
def test_a_child_has_a_group_of_its_own_in_the_session_of_its_parent(
    run: Callable[[Coroutine[Any, Any, bytes]], bytes], tmp_path: Path
) -> None:
    """Were its session its own, Linux would give it as much of the processors as the whole server (autogroups)."""
    (tmp_path / "says.py").write_text(SAYS)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])

    async def answer() -> bytes:
        process = await child_process.start("says", "a", "b c", env=os.environ | {"PYTHONPATH": path})
        return (await process.communicate())[0]

    assert json.loads(run(answer())) == WANTED


@pytest.mark.parametrize("run", [asyncio.run, uvloop.run])
def test_a_child_that_has_ended_before_it_gets_its_task_has_ended_and_nothing_else(
    run: Callable[[Coroutine[Any, Any, None]], None], tmp_path: Path
) -> None:
    """uvloop says of its pipe what asyncio does not, and the log had a traceback of an export."""
    (tmp_path / "ends.py").write_text("raise SystemExit('enough')")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])

    async def ask() -> None:
        process = await child_process.start("ends", env=os.environ | {"PYTHONPATH": path})
        await process.wait()
        with pytest.raises(child_process.Ended, match="1: enough"):
            await anext(child_process.lines(process, "task"))

    run(ask())


def test_so_has_one_that_a_thread_starts() -> None:
    told = subprocess.run([sys.executable, "-c", SAYS, "a", "b c"], capture_output=True, check=True, **system.apart())
    assert json.loads(told.stdout) == WANTED
