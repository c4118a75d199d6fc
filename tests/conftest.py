"""Memory that solvers keep for later goes between modules: a process that runs hundreds of tests stays small."""

from __future__ import annotations

import gc
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

MUCH = 1 << 30
"""Bytes resident from which on it is worth the time to look for what can go."""


@pytest.fixture(scope="module", autouse=True)
def _memory_given_back() -> Iterator[None]:
    """Idle workspaces of all solvers, and what nobody holds any more."""
    yield
    solvers, workspaces = (sys.modules.get(f"esker.solve.{name}") for name in ("solver", "workspaces"))
    if solvers is None or workspaces is None or resident() < MUCH:
        return
    gc.collect()
    for found in gc.get_objects():
        if isinstance(found, solvers.Solver):
            found.tidy(math.inf)
    gc.collect()
    workspaces.give_back()


def resident() -> int:
    """Bytes of memory that this process takes; 0 where the system does not say."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0
