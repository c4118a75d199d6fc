"""Levels before frames in the tile thread (SPEC P59)."""

from __future__ import annotations

import threading
from concurrent.futures import CancelledError

import pytest

from esker.session.ground.tilethread import TileThread


def test_what_is_first_runs_before_what_waits_and_each_in_its_order() -> None:
    thread, gate, log = TileThread(), threading.Event(), list[str]()
    thread.submit(gate.wait)
    for name in ("a", "b"):
        thread.submit(log.append, name)
    for name in ("1", "2"):
        thread.first(log.append, name)
    gate.set()
    thread.shutdown()
    assert log == ["1", "2", "a", "b"]


def test_results_and_errors_arrive_and_a_stopped_thread_takes_nothing() -> None:
    thread = TileThread()
    assert thread.submit(lambda x, y: x + y, 1, y=2).result(60) == 3
    with pytest.raises(ZeroDivisionError):
        thread.first(lambda: 1 // 0).result(60)
    thread.shutdown()
    with pytest.raises(RuntimeError):
        thread.submit(print)


def test_shutting_down_may_drop_what_waits() -> None:
    thread, gate, started = TileThread(), threading.Event(), threading.Event()

    def hold() -> None:
        started.set()
        gate.wait()

    running = thread.submit(hold)
    assert started.wait(60)
    waiting = thread.submit(print)
    thread.shutdown(wait=False, cancel_futures=True)
    gate.set()
    running.result(60)
    with pytest.raises(CancelledError):
        waiting.result(60)
