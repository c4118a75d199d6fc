"""Loops of rivers are compiled after a server is ready (SPEC H563)."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest

from esker.server import first_build
from esker.server.hydrology import Hydrology
from esker.solve.opencl import prepare
from esker.solve.opencl.pocl import home


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[list[str]]:
    """What children were asked for; none is started. What was compiled is noted in an empty folder."""
    asked: list[list[str]] = []

    def bounded(arguments: list[str], stopped: Any, times: float) -> dict[str, Any]:
        del times
        if stopped is not None and stopped.is_set():
            raise prepare.Stopped
        asked.append(arguments)
        return {"loops": arguments[-1]}

    monkeypatch.setattr(prepare, "bounded", bounded)
    monkeypatch.setattr(home, "root", lambda: tmp_path)
    return asked


def test_they_are_compiled_once_and_those_of_tiles_apart(children: list[list[str]]) -> None:
    begun = threading.Event()
    for _ in range(2):
        first_build.have_river_loops(threading.Event())
    assert children == [["loops", "rivers"]]
    first_build.have_loops(threading.Event(), begun)
    assert children == [["loops", "rivers"], ["loops", "tiles"]]
    assert begun.is_set()


def test_where_no_process_can_be_had_the_thread_goes_on(
    children: list[list[str]], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """SPEC H573: a limit of processes was reached while a server started: it looked for no rivers from then on."""

    def none(arguments: list[str], **more: object) -> dict[str, object]:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    with monkeypatch.context() as limited:
        limited.setattr(prepare, "bounded", none)
        first_build.have_river_loops(threading.Event())
    assert "no process compiles them" in caplog.text
    first_build.have_river_loops(threading.Event())
    assert children == [["loops", "rivers"]], "it is tried again at the next start"


def test_what_was_stopped_is_compiled_the_next_time(children: list[list[str]]) -> None:
    stopped = threading.Event()
    stopped.set()
    first_build.have_river_loops(stopped)
    assert children == []
    first_build.have_river_loops(threading.Event())
    assert children == [["loops", "rivers"]]


def test_the_first_search_waits_for_them_and_a_close_ends_them() -> None:
    begun, ready, ended = threading.Event(), threading.Event(), threading.Event()

    def compile_them(closed: threading.Event) -> None:
        begun.set()
        ready.wait(60)
        assert closed.wait(60)
        ended.set()

    hydrology = Hydrology(compile_them)
    assert begun.wait(60), "nobody has to look for rivers first"
    search = hydrology.lane().submit(lambda: True)
    assert not search.done()
    ready.set()
    hydrology.close()
    assert ended.wait(60)
    assert search.cancelled(), "the search waited, and was dropped"
