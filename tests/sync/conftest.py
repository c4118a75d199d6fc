"""A server for the tests of a module that do not restart it, and stand-ins for its child processes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.sync.harness import LiveServer
from tests.sync.scripted_maker import Maker
from tests.sync.scripted_reader import Reader


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    """A server that runs for the whole module."""
    data: Path = tmp_path_factory.mktemp("server")
    with LiveServer(data) as running:
        yield running


@pytest.fixture
def reader(monkeypatch: pytest.MonkeyPatch) -> Reader:
    """In the place of the process that reads files, which has tests of its own (tests/importing)."""
    made = Reader()
    monkeypatch.setattr("esker.server.run.importing", made)
    return made


@pytest.fixture
def maker(monkeypatch: pytest.MonkeyPatch) -> Maker:
    """In the place of the process that exports."""
    made = Maker()
    monkeypatch.setattr("esker.server.run.exporting", made)
    return made
