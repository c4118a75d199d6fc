"""What tests leave behind: no thread of a client, and no memory that solvers keep for later.

A client that outlives its test connects again beside others, which then fail for what it does.
"""

from __future__ import annotations

import gc
import math
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from esker.process import system
from tests.store.engines import ENGINES, Database, Store

MUCH = 1 << 30
"""Bytes resident from which on it is worth the time to look for what can go."""
OURS = ("esker-client",)
"""Names of threads that end before their client is closed. They connect again by themselves, beside any test."""
LEAVES_SECONDS = 60.0
"""A thread that was asked to end may still be connecting, on a busy machine."""


def pytest_collection_finish() -> None:
    """Sets aside what importing all tests has made, a million objects that stay: the collector went through them time
    and again, for 150 s of a whole run."""
    gc.collect()
    gc.freeze()


def threads_left(before: set[threading.Thread], seconds: float = LEAVES_SECONDS) -> list[str]:
    """The names of our threads that were not there before and do not end in so many seconds."""
    deadline = time.monotonic() + seconds
    left = [each for each in threading.enumerate() if each not in before and each.name.startswith(OURS)]
    for thread in left:
        thread.join(max(0.0, deadline - time.monotonic()))
    return [thread.name for thread in left if thread.is_alive()]


@pytest.fixture(scope="module", autouse=True)
def _no_thread_stays() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    assert threads_left(before) == [], "a test left a client open"


@pytest.fixture(scope="module", autouse=True)
def _memory_given_back() -> Iterator[None]:
    """Idle workspaces of all solvers, and what nobody holds any more."""
    yield
    solvers = sys.modules.get("esker.solve.solver")
    if solvers is None or system.resident_bytes() < MUCH:
        return
    gc.unfreeze()
    gc.collect()
    for found in gc.get_objects():
        if issubclass(type(found), solvers.Solver):  # not isinstance: it asks what dead weak references stand for
            found.tidy(math.inf)
    gc.collect()
    gc.freeze()
    system.give_memory_back()


@pytest.fixture(scope="session")
def database_server() -> Iterator[Database]:
    """A PostgreSQL server for the whole run. Where none can be had, tests that need it fail with a sentence."""
    with Database() as made:
        yield made


@pytest.fixture
def database(database_server: Database) -> Iterator[Database]:
    """What gives a test databases of its own; those that it took are emptied for the next one."""
    yield database_server
    database_server.take_back()


@pytest.fixture(params=ENGINES)
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Store]:
    """A store that is opened, closed and opened again, over each engine."""
    made = Store(tmp_path, request.getfixturevalue("database") if request.param == "postgres" else None)
    yield made
    made.close()
