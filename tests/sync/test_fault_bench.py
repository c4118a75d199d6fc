"""A short form of ``esker bench faults``: servers killed in the midst of everything, a full disk (J396)."""

from __future__ import annotations

import os

import pytest

from bench.strangers import _fault_disk, faults
from esker.api.live import connection as live

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="kill -9 and fork")


@pytest.fixture(autouse=True)
def _patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "BACKOFF_SECONDS", live.BACKOFF_SECONDS)  # which the bench shortens


def test_nothing_is_lost_whatever_a_server_is_killed_in() -> None:
    """SPEC J396."""
    found = faults.killed(len(faults.KINDS), seed=3)
    assert found["lost"] == 0
    assert found["converged"]
    assert found["problems"] == []
    assert found["tracebacks"] == 0, found["log"]
    assert {kind: of["missed"] for kind, of in found["kinds"].items()} == {kind: [] for kind in faults.KINDS}
    assert found["stopped_well"]
    assert found["acknowledged"] > 100
    assert found["folded_ops"] > 0


def test_a_full_disk_is_told_and_drawing_goes_on_after_it() -> None:
    """SPEC J396."""
    found = _fault_disk.filled()
    if "skipped" in found:
        pytest.skip(found["skipped"])
    for name, each in found.items():
        assert each["refused_with"] == ["The server could not save this change (is its disk full?). It was taken back."]
        told = {what: text[:3] for what, text in each["answers"].items()}
        born = told.pop("a new terrain")
        assert born == "507" or name == "without", "where the server leaves nothing free, SQLite's log may have room"
        assert told == {"an import": "507", "an archive": "507", "the document": "200"}
        assert each["saved_again"]
        assert each["refused_after"] == 0
        assert each["lost"] == 0
        assert each["same"]
        assert each["problems"] == []
        assert each["tracebacks"] == 0
