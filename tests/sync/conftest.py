"""One server for the tests of a module that do not restart it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.sync.harness import LiveServer


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    """A server that runs for the whole module."""
    data: Path = tmp_path_factory.mktemp("server")
    with LiveServer(data) as running:
        yield running
