"""What tests leave behind is found (SPEC H515)."""

from __future__ import annotations

import threading
from pathlib import Path

from tests.conftest import OURS, threads_left

BACKEND = Path(__file__).resolve().parents[2] / "backend"


def test_a_client_that_stays_is_named() -> None:
    """SPEC H515."""
    name = "esker-client"
    before, ends = set(threading.enumerate()), threading.Event()
    thread = threading.Thread(target=ends.wait, name=name, daemon=True)
    thread.start()
    assert threads_left(before, 0.0) == [name]
    assert threads_left({*before, thread}, 0.0) == []
    ends.set()
    assert threads_left(before) == []


def test_threads_of_others_may_stay() -> None:
    before, ends = set(threading.enumerate()), threading.Event()
    thread = threading.Thread(target=ends.wait, name="hypothesis", daemon=True)
    thread.start()
    assert threads_left(before, 0.0) == []
    ends.set()
    thread.join()


def test_ours_are_those_that_the_code_starts() -> None:
    code = "\n".join(path.read_text(encoding="utf-8") for path in BACKEND.rglob("*.py"))
    assert [name for name in OURS if f'"{name}"' not in code] == []
