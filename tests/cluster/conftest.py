"""Two nodes for all tests of this folder, and tests that are coroutines: each runs in an event loop of its own, the one
that servers have."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

import pytest
import uvloop

from tests.cluster.pair import Pair
from tests.cluster.processes import Artist, running


@pytest.fixture(scope="package")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    """Two nodes that take people. Whoever ends one starts it again."""
    both = Pair(tmp_path_factory.mktemp("pair"))
    try:
        with running(both.nodes):
            yield both
    finally:
        both.close()


@pytest.fixture(autouse=True)
def nobody_draws_on() -> Iterator[None]:
    """Ends whoever still draws when a test has ended, as after one that failed."""
    yield
    while Artist.everybody:
        Artist.everybody.pop().close()


def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Runs a coroutine function."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    wanted = pyfuncitem._fixtureinfo.argnames
    uvloop.run(pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in wanted}))
    return True
