"""Memory that solvers keep for later goes between modules: a process that runs hundreds of tests stays small."""

from __future__ import annotations

import gc
import math
import sys
from collections.abc import Iterator

import pytest

from esker.process import system

MUCH = 1 << 30
"""Bytes resident from which on it is worth the time to look for what can go."""


@pytest.fixture(scope="module", autouse=True)
def _memory_given_back() -> Iterator[None]:
    """Idle workspaces of all solvers, and what nobody holds any more."""
    yield
    solvers = sys.modules.get("esker.solve.solver")
    if solvers is None or system.resident_bytes() < MUCH:
        return
    gc.collect()
    for found in gc.get_objects():
        if issubclass(type(found), solvers.Solver):  # not isinstance: it asks what dead weak references stand for
            found.tidy(math.inf)
    gc.collect()
    system.give_memory_back()
