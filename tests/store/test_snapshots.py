"""Documents in a database: compressed, and snapshots in a thread of their own (SPEC J568 to J570)."""

from __future__ import annotations

import sqlite3
import threading
from concurrent.futures import Future
from contextlib import closing
from pathlib import Path
from typing import Any

import psycopg
import pytest
from hypothesis import given
from hypothesis import strategies as some

from esker import contract as c
from esker.document.wire import Compressed, compressed, decompressed, document_json, op_json
from esker.store import writing
from esker.store.classes import ClassStore
from esker.store.engine.ports import Moved, UsedTwice
from esker.store.engine.postgres import migrations as shared
from esker.store.journal import DamagedTerrain, Journal, Row
from esker.store.kept import kept_one
from esker.store.upkeep.inspection import DATABASE_NAME
from tests.store.engines import Database, Store
from tests.store.test_postgres import opened
from tests.sync.harness import LiveServer, set_op, stroke

BIRTH = c.Document(id="t")
FORMAT_9 = Path(__file__).parents[1] / "databases" / "format-9.sql"


def _row(clock: int, title: str = "x") -> Row:
    return Row(clock, "c", clock, "c", op_json(c.SetTerrain(fields=c.TerrainFields(title=title))))


def _at(clock: int, title: str = "x") -> c.Document:
    return BIRTH.model_copy(update={"clock": clock, "settings": c.TerrainSettings(title=title)})


def _clocks(journal: Journal) -> list[int]:
    return [row[0] for row in journal.reader().execute("SELECT clock FROM snapshots WHERE terrain='t' ORDER BY clock")]


@pytest.fixture
def journal(store: Store) -> Journal:
    """A journal over each engine."""
    made = store.open()
    made.create(BIRTH).result()
    return made


class Gate:
    """Stands in for what compresses: it waits until the test opens it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.begun, self.open, self.clocks = threading.Semaphore(0), threading.Event(), [0]
        monkeypatch.setattr(writing, "Compressed", self)

    def of(self, document: c.Document) -> Compressed:
        self.clocks.append(document.clock)
        self.begun.release()
        assert self.open.wait(60)
        return Compressed.of(document)


@given(some.lists(some.text(), max_size=4))
def test_a_text_is_what_its_streams_hold(parts: list[str]) -> None:
    """SPEC J568."""
    assert decompressed(b"".join(compressed(part) for part in parts)) == "".join(parts)


@pytest.mark.parametrize("damage", ["cut", "changed", "text"])
def test_a_damaged_document_is_named(journal: Journal, damage: str) -> None:
    """SPEC J568: the server goes on with other terrains."""
    whole = Compressed.of(BIRTH).data
    data = {"cut": whole[:-3], "changed": whole[:40] + b"\xff" * 9 + whole[49:], "text": b'{"id":"t"}'}[damage]
    journal.submit(lambda db: db.execute("UPDATE snapshots SET document=?", (data,))).result()
    with pytest.raises(DamagedTerrain, match="the journal of t at op 0: a compressed document is"):
        journal.load("t")


def test_commits_go_on_while_a_snapshot_is_compressed(journal: Journal, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J569: of two that wait the newer one is made, and closing waits for it."""
    gate = Gate(monkeypatch)
    journal.append("t", [_row(1)]).result()
    first = journal.keep_snapshot(_at(1))
    assert gate.begun.acquire(timeout=60)
    later = []
    for clock in (2, 3):
        journal.append("t", [_row(clock)]).result(60)
        later.append(journal.keep_snapshot(_at(clock)))
    assert later[0].done(), "the third took its place"
    assert not first.done()
    gate.open.set()
    later[1].result(60)
    assert gate.clocks == [0, 1, 3]
    assert _clocks(journal) == [0, 1, 3]
    loaded = journal.load("t")
    assert loaded is not None
    assert (loaded.document.clock, loaded.recent) == (3, [])


def test_what_waits_is_written_before_a_journal_closes(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J569."""
    journal = store.open()
    journal.create(BIRTH).result()
    journal.append("t", [_row(1)]).result()
    gate = Gate(monkeypatch)
    journal.keep_snapshot(_at(1))
    assert gate.begun.acquire(timeout=60)
    closing = threading.Thread(target=journal.close)
    closing.start()
    closing.join(0.2)
    assert closing.is_alive()
    gate.open.set()
    closing.join(60)
    again = store.open()
    assert _clocks(again) == [0, 1]


def test_a_terrain_that_is_gone_gets_no_snapshot(journal: Journal, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J569."""
    gate = Gate(monkeypatch)
    kept = journal.keep_snapshot(_at(1))
    assert gate.begun.acquire(timeout=60)
    journal.submit(lambda db: [db.execute(f"DELETE FROM {table}") for table in ("snapshots", "terrains")]).result()
    gate.open.set()
    assert isinstance(kept.exception(60), (Moved, type(None)))
    assert _clocks(journal) == []


def test_one_that_fails_takes_nothing_with_it(journal: Journal, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J569: the thread goes on with the next one."""
    with monkeypatch.context() as broken:
        broken.setattr(Compressed, "of", classmethod(lambda *_: 1 // 0))
        assert isinstance(journal.keep_snapshot(_at(1)).exception(60), ZeroDivisionError)
    journal.append("t", [_row(1)]).result()
    journal.keep_snapshot(_at(1)).result(60)
    assert _clocks(journal) == [0, 1]


def test_a_room_keeps_no_snapshot_of_what_was_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J569: a commit that fails leaves no snapshot that holds what was taken back."""
    from esker.session.room import core

    monkeypatch.setattr(core, "SNAPSHOT_EVERY", 1)
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        journal = server.assembly.hub.journal
        kept: list[int] = []
        keep, append = journal.keep_snapshot, journal.append

        def noted(document: c.Document) -> Future[None]:
            kept.append(document.clock)
            return keep(document)

        monkeypatch.setattr(journal, "keep_snapshot", noted)
        peer = server.join(terrain, secret)
        peer.ops(("c1:1", stroke("s1")))
        peer.wait("ack")
        peer.ops(("c1:2", set_op("s1", label="a")))
        peer.wait("ack")
        assert kept == [1, 2]

        def refused(*_: Any) -> Any:
            return journal.submit(lambda _: (_ for _ in ()).throw(UsedTwice("x")))

        monkeypatch.setattr(journal, "append", refused)
        peer.ops(("c1:3", set_op("s1", label="b")))
        peer.wait("reject", "error")
        monkeypatch.setattr(journal, "append", append)
        peer.ops(("c1:4", set_op("s1", label="c")))
        peer.wait("ack")
        assert kept == [1, 2, 3]
        peer.close()


def test_documents_of_the_format_before_are_compressed(tmp_path: Path) -> None:
    """SPEC J570: of terrains and of classes, and titles are listed without reading one."""
    with closing(sqlite3.connect(tmp_path / DATABASE_NAME)) as db:
        db.executescript(FORMAT_9.read_text(encoding="utf-8"))
        before = [row[0] for row in db.execute("SELECT document FROM snapshots ORDER BY clock")]
    journal = Journal(tmp_path)
    rows = journal.reader().execute("SELECT document FROM snapshots ORDER BY clock").fetchall()
    assert [decompressed(row[0]) for row in rows] == before
    found = ClassStore(journal).document("k")
    assert found is not None
    assert [stroke.id for stroke in found[0].strokes] == ["s0"]
    assert found[1] == len(document_json(found[0]))
    assert journal.reader().execute("SELECT title FROM terrains").fetchall() == [("Untitled terrain",)]
    kept = kept_one(journal, "t")
    assert kept is not None
    assert kept.title == "An old one"
    journal.close()


def test_shared_documents_of_the_format_before_are_compressed(database: Database, tmp_path: Path) -> None:
    """SPEC J570."""
    url = database.server.database()
    titled = c.Document(id="t", settings=c.TerrainSettings(title="Tor"))
    with psycopg.connect(url, autocommit=True) as db:
        db.execute("CREATE SCHEMA esker")
        first = shared.STEPS[shared.FIRST]
        assert isinstance(first, str)
        db.execute(first.encode())
        db.execute("INSERT INTO esker.server VALUES ('format', '9')")
        db.execute("INSERT INTO esker.terrains VALUES ('t', 1e9), ('u', 1e9)")
        for name in "tu":
            text = document_json(titled.model_copy(update={"id": name}))
            db.execute("INSERT INTO esker.snapshots VALUES (%s, 0, %s)", (name, text))
        plain = "INSERT INTO esker.classes VALUES ('k', 't', 'Class', 1e9, 0, %s, 1, 30, NULL, 0, NULL)"
        db.execute(plain, (document_json(titled),))
    journal = opened(url, tmp_path)
    for name in "tu":
        loaded, kept = journal.load(name), kept_one(journal, name)
        assert loaded is not None
        assert kept is not None
        assert loaded.document.settings.title == kept.title == titled.settings.title
    found = ClassStore(journal).document("k")
    assert found is not None
    assert found[0] == titled
    journal.close()
