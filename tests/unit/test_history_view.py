"""How the past is read: what is replayed, what is kept, when the journal's snapshots are asked (HI8, HI9, HI12)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.document.wire import op_json
from esker.session.room import history_view
from esker.store import activity
from esker.store.activity import ActivityLogs
from esker.store.journal import Journal, Row

PROFILE = {"kind": "profile", "first": (0, 0, 0), "last": (1, 1, 1), "curve": ((0, 1),), "finished": True}


def rows(first: int, count: int, author: str = "c") -> list[Row]:
    clocks = range(first, first + count)
    drawn = [c.Stroke.model_validate({"id": f"s{k}", **PROFILE}) for k in clocks]
    begin = [c.BeginStroke(stroke=stroke) for stroke in drawn]
    return [Row(k, author, k, author, op_json(op)) for k, op in zip(clocks, begin, strict=True)]


class Watched(Journal):
    """A journal that remembers which clocks it was asked for."""

    asked: list[tuple[int, int]]
    loads: list[int | None]

    def rows(self, terrain: str, after: int, upto: int | None = None) -> list[Row]:
        self.asked.append((after, 2**62 if upto is None else upto))
        return super().rows(terrain, after, upto)

    def document(self, terrain: str, upto: int | None = None) -> StrokeSet | None:
        self.loads.append(upto)
        return super().document(terrain, upto)


@pytest.fixture
def journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Watched]:
    monkeypatch.setattr(history_view, "FAR_OPS", 7)
    monkeypatch.setattr(history_view, "WAYPOINT_OPS", 3)
    monkeypatch.setattr(history_view, "WAYPOINTS", 4)
    made = Watched(tmp_path)
    made.asked, made.loads = [], []
    made.create(c.Document(id="t")).result()
    made.append("t", rows(1, 60)).result()
    yield made
    made.close()


def test_steps_lead_on_from_the_present_document_only(journal: Watched) -> None:
    reader = history_view.HistoryReader(journal, StrokeSet("t"))
    _, steps = reader.go(6)
    assert steps is not None
    assert [row.clock for row in steps] == [1, 2, 3, 4, 5, 6]
    assert reader.go(6)[1] == []  # there already: nothing is replayed
    assert journal.asked[-1] == (6, 6)
    assert reader.go(12)[1] is not None
    _, steps = reader.go(8)  # from the waypoint at 6, which nobody shows any more
    assert (journal.asked[-1], steps) == ((6, 8), None)


def test_far_from_all_that_is_kept_the_snapshots_are_asked(journal: Watched) -> None:
    reader = history_view.HistoryReader(journal, StrokeSet("t"))
    assert reader.go(7)[1] is not None
    assert journal.loads == []
    document, steps = reader.go(15)
    assert (document.clock, steps, journal.loads) == (15, None, [15])


def test_of_many_documents_few_are_kept(journal: Watched) -> None:
    reader = history_view.HistoryReader(journal, StrokeSet("t"))
    for clock in range(0, 61, 3):
        reader.go(clock)
    reader.go(0)
    journal.asked.clear()
    journal.loads.clear()
    for clock in range(59, 0, -3):
        reader.go(clock)
    # Were all of them kept, no step back would take more than two ops.
    assert journal.loads or max(upto - after for after, upto in journal.asked) > 2


def test_histories_of_few_terrains_are_kept(journal: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(activity, "OPEN_TERRAINS", 2)
    for terrain in ("a", "b"):
        journal.create(c.Document(id=terrain)).result()
    read = ActivityLogs(journal)
    for terrain in ("t", "a", "b"):
        read.page(terrain, None, 5)
    journal.asked.clear()
    assert len(read.page("t", None, 5).entries) > 0
    assert (0, 60) in journal.asked  # read anew, from the beginning


def test_each_entry_has_the_time_of_its_own_ops(tmp_path: Path) -> None:
    now = [1000.0]
    journal = Journal(tmp_path, now=lambda: now[0])
    journal.create(c.Document(id="t")).result()
    for clock, author in ((1, "a"), (2, "b"), (3, "a")):
        journal.append("t", rows(clock, 1, author)).result()
        now[0] += 500.0
    entries = ActivityLogs(journal).page("t", None, 10).entries
    assert [(e.author, e.at) for e in entries] == [("a", 2000.0), ("b", 1500.0), ("a", 1000.0)]
    journal.close()
