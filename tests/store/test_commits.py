"""What a commit of one op costs: its statement is the commit (SPEC J571)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from esker import contract as c
from esker.document.wire import op_json
from esker.store.engine.ports import UsedTwice
from esker.store.journal import HistoryFull, Journal, Row, Unwritable
from esker.store.timestamps import Person
from tests.store.engines import sqlite

TIMES = [1000.0]


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    """A journal whose clock stands still, with a first op that notes the moment."""
    TIMES[0] = 1000.0
    made = Journal(tmp_path, lambda: TIMES[0], quota=30_000)
    made.create(c.Document(id="t")).result()
    made.append("t", [row(1)]).result()
    yield made
    made.close()


def row(clock: int) -> Row:
    return Row(clock, "c", clock, "c", op_json(c.SetTerrain(fields=c.TerrainFields(title="x"))))


def statements(journal: Journal) -> list[str]:
    """The first words of what is run from now on."""
    found: list[str] = []
    sqlite(journal).writer_db.set_trace_callback(lambda sql: found.append(" ".join(sql.split()[:3])))
    return found


def test_an_op_that_is_alone_is_one_statement_and_durable(journal: Journal) -> None:
    """SPEC J571: between statements the interpreter's lock went to whoever computed, six times for each op."""
    run = statements(journal)
    journal.append("t", [row(2)]).result()
    assert set(run) == {"INSERT INTO ops"}, "its trigger is told under the same name"
    assert [each.clock for each in journal.rows("t", 0)] == [1, 2], "another connection sees it"


@pytest.mark.parametrize("more", ["a moment", "a name", "two ops"])
def test_what_is_more_than_a_statement_is_one_transaction(journal: Journal, more: str) -> None:
    """SPEC J571: an op and what is written with it are there together or not at all."""
    run = statements(journal)
    if more == "a moment":
        TIMES[0] += 1.5
    people = [Person("c", "Ada", "red")] if more == "a name" else []
    journal.append("t", [row(2), row(3)] if more == "two ops" else [row(2)], people).result()
    assert (run[0], run[-1]) == ("BEGIN IMMEDIATE", "COMMIT")
    assert len(set(run)) == (3 if more == "two ops" else 4)


def test_one_that_is_refused_changes_nothing_and_the_next_is_taken(journal: Journal) -> None:
    """SPEC J571: by the database, by the quota, by a disk without room."""
    with pytest.raises(UsedTwice):
        journal.append("t", [row(1)]).result()
    with pytest.raises(HistoryFull):
        journal.append("t", [row(2)._replace(op=" " * 40_000)]).result()
    db = sqlite(journal).writer_db
    pages = db.execute("PRAGMA page_count").fetchone()[0]
    db.execute(f"PRAGMA max_page_count={pages}")
    with pytest.raises(Unwritable, match="full") as failure:
        journal.append("t", [row(2)._replace(op=" " * 20_000)]).result()
    assert failure.value.full
    assert not journal.writable
    db.execute("PRAGMA max_page_count=1000000")
    journal.append("t", [row(2)]).result()
    assert journal.writable
    assert not db.in_transaction
    assert [each.clock for each in journal.rows("t", 0)] == [1, 2]
