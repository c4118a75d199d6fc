"""A CPU device's threads yield to the server's (SPEC P94)."""

from __future__ import annotations

import os
import sys
import threading

import pytest

from esker.process import priority
from esker.solve.opencl import device


@pytest.mark.skipif(sys.platform != "linux", reason="threads have no priorities of their own")
def test_threads_that_a_library_starts_have_a_lower_priority() -> None:
    leave = threading.Event()
    mine = threading.Thread(target=leave.wait)
    before = priority._tasks()
    with priority.yielding():
        mine.start()
    assert mine.native_id is not None
    own = os.getpriority(os.PRIO_PROCESS, 0)
    try:
        assert os.getpriority(os.PRIO_PROCESS, mine.native_id) == own, "Python's own are left alone"
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(threading, "enumerate", list)
            patched.setattr(priority, "_tasks", iter([before, priority._tasks()]).__next__)
            with priority.yielding():
                pass
        assert os.getpriority(os.PRIO_PROCESS, mine.native_id) == min(19, own + priority.NICE)
        assert os.getpriority(os.PRIO_PROCESS, 0) == own
    finally:
        leave.set()
        mine.join()


def test_all_cores_compute_where_their_threads_yield(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    for yields, threads in ((True, 4), (False, 3)):
        monkeypatch.setattr(priority, "can_yield", lambda yields=yields: yields)
        assert device.default_threads() == threads
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert device.default_threads() == 1
