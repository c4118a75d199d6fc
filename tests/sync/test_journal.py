"""The journal alone: commits, replay, damage, backups (SPEC J1 to J9, J16, J17)."""

from __future__ import annotations

import shutil
import sqlite3
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.document.wire import op_json
from esker.store.engine import checkpoints
from esker.store.engine.ports import Connection, UsedTwice
from esker.store.engine.sqlite import LOG_BYTES, connect
from esker.store.journal import DamagedTerrain, Journal, Row, Unwritable
from esker.store.upkeep import backup
from esker.store.upkeep.backup import last_backup
from esker.store.upkeep.inspection import DATABASE_NAME, CorruptDatabase
from esker.store.upkeep.restore import restore
from tests.store.engines import Store, copied, sqlite

BIRTH = c.Document(id="t")


def _stroke(stroke_id: str) -> c.Stroke:
    return c.Stroke(id=stroke_id, kind="profile", first=(0, 0, 0), last=(1, 1, 1), curve=((0, 0),))


def _rows(first: int, count: int) -> list[Row]:
    ops = (c.BeginStroke(stroke=_stroke(f"s{i}")) for i in range(first, first + count))
    return [Row(first + i, "c", first + i, "c", op_json(op)) for i, op in enumerate(ops)]


@pytest.fixture
def journal(tmp_path: Path) -> Journal:
    made = Journal(tmp_path)
    made.create(BIRTH).result()
    return made


@pytest.fixture
def either(store: Store) -> Journal:
    """A journal over each engine."""
    made = store.open()
    made.create(BIRTH).result()
    return made


def test_what_was_appended_is_there_after_a_restart(either: Journal, store: Store) -> None:
    either.append("t", _rows(1, 3)).result()
    either.append("t", _rows(4, 2)).result()
    either.close()
    again = store.open()
    loaded = again.load("t")
    assert loaded is not None
    assert loaded.document.clock == 5
    assert list(loaded.document.strokes) == [f"s{i}" for i in range(1, 6)]
    assert loaded.counters == {"c": 5}
    assert [row.clock for row in loaded.recent] == [1, 2, 3, 4, 5]
    assert again.find("t", "c", 4) == 4
    assert again.find("t", "c", 6) is None
    assert again.find("t", "d", 4) is None
    assert again.load("nothing") is None
    again.close()


def test_the_log_has_its_length_from_the_start_and_is_read_as_far_as_it_is_written(
    journal: Journal, tmp_path: Path
) -> None:
    """SPEC J16: also by who finds it after a crash, in the midst of a first and of a later round."""
    log, copies = tmp_path / f"{DATABASE_NAME}-wal", 0
    assert log.stat().st_size == LOG_BYTES
    for clock in range(1, 3000, 10):
        journal.append("t", _rows(clock, 10)).result()
        if clock in (1, 1501, 2991):
            copies += 1
            crashed = tmp_path / f"crashed{copies}"
            crashed.mkdir()
            for name in (DATABASE_NAME, log.name):
                shutil.copy(tmp_path / name, crashed / name)
            found = Journal(crashed)
            assert [row.clock for row in found.rows("t", 0)] == list(range(1, clock + 10))
            assert (crashed / log.name).stat().st_size == LOG_BYTES
            found.append("t", _rows(clock + 10, 1)).result()
            found.close()
    assert log.stat().st_size == LOG_BYTES, "it was begun anew, and never grew"
    assert tmp_path.joinpath(DATABASE_NAME).stat().st_size > 100_000, "its first round went to the database"
    journal.close()


def _at_checkpoints(monkeypatch: pytest.MonkeyPatch, happen: Callable[[], object], every: int) -> None:
    """Has something happen where the thread begins a checkpoint, after so many commits each."""

    class Watched(sqlite3.Connection):
        def execute(self, sql: str, *values: Any) -> sqlite3.Cursor:
            if "wal_checkpoint" in sql:
                happen()
            return super().execute(sql, *values)

    real = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda *a, **k: real(*a, **k, factory=Watched))
    monkeypatch.setattr(checkpoints, "EVERY", every)


def test_commits_go_on_while_a_checkpoint_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J567: whoever's commit began one waited for the disk twice."""
    begun, may_go_on = threading.Event(), threading.Event()

    def stands() -> None:
        begun.set()
        may_go_on.wait(120)

    _at_checkpoints(monkeypatch, stands, every=5)
    journal, file = Journal(tmp_path), tmp_path / DATABASE_NAME
    try:
        journal.create(BIRTH).result()
        before = file.read_bytes()
        for clock in range(1, 30):  # some 1,400 pages
            journal.append("t", [Row(clock, "c", clock, "c", "x" * 200_000)]).result(60)
        assert begun.wait(60)
        assert file.read_bytes() == before, "the writer makes none itself"
        may_go_on.set()
        deadline = time.monotonic() + 60
        while file.read_bytes() == before and time.monotonic() < deadline:
            time.sleep(0.01)
        assert file.read_bytes() != before
    finally:
        may_go_on.set()
        journal.close()


def test_the_writer_makes_a_checkpoint_where_the_log_grows_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """SPEC J567: also where those beside it fail, which stops nobody."""

    def fails() -> None:
        raise sqlite3.OperationalError("disk I/O error")

    _at_checkpoints(monkeypatch, fails, every=1)
    journal = Journal(tmp_path)
    journal.create(BIRTH).result()
    for clock in range(1, 150):
        journal.append("t", [Row(clock, "c", clock, "c", "x" * 200_000)]).result()
    assert tmp_path.joinpath(f"{DATABASE_NAME}-wal").stat().st_size == LOG_BYTES
    assert "a checkpoint failed: disk I/O error" in caplog.text
    assert journal.writable
    journal.close()


def test_a_clock_or_an_id_is_used_once(either: Journal) -> None:
    either.append("t", _rows(1, 1)).result()
    with pytest.raises(UsedTwice):
        either.append("t", _rows(1, 1)).result()
    with pytest.raises(UsedTwice):
        either.append("t", [_rows(1, 1)[0]._replace(clock=2)]).result()
    with pytest.raises(UsedTwice):
        either.create(BIRTH).result()
    either.close()


def test_a_refused_item_does_not_undo_the_rest_of_its_commit(either: Journal) -> None:
    either.append("t", _rows(1, 1)).result()
    gate = threading.Event()
    hold: Future[bool] = either.submit(lambda _: gate.wait(5))  # the next three wait together behind this one
    futures = [either.append("t", rows) for rows in (_rows(2, 1), _rows(1, 1), _rows(3, 1))]
    gate.set()
    wait(futures)
    assert hold.result()
    assert futures[0].exception() is None
    assert isinstance(futures[1].exception(), UsedTwice)
    assert futures[2].exception() is None
    assert [row.clock for row in either.rows("t", 0)] == [1, 2, 3]
    either.close()


def test_a_cancelled_item_is_not_written_and_stops_nobody(either: Journal) -> None:
    gate = threading.Event()
    hold: Future[bool] = either.submit(lambda _: gate.wait(5))
    while not hold.running():
        time.sleep(0.001)
    cancelled, kept = either.append("t", _rows(1, 1)), either.append("t", _rows(2, 1))
    assert cancelled.cancel()
    gate.set()
    assert kept.result(5) is None
    assert [row.clock for row in either.rows("t", 0)] == [2]
    either.close()


def test_many_rooms_share_a_commit(journal: Journal, tmp_path: Path) -> None:
    commits = 0

    def count(statement: str) -> None:
        nonlocal commits
        commits += statement == "COMMIT"

    sqlite(journal).writer_db.set_trace_callback(count)
    gate = threading.Event()
    journal.submit(lambda _: gate.wait(5))
    futures = [journal.append(f"room{i}", _rows(1, 1)) for i in range(50)]
    gate.set()
    wait(futures)
    assert all(f.exception() is None for f in futures)
    assert 1 <= commits <= 2
    journal.close()


def test_a_full_disk_is_reported_and_survived(journal: Journal) -> None:
    sqlite(journal).writer_db.execute("PRAGMA max_page_count=1").fetchone()
    pages = sqlite(journal).writer_db.execute("PRAGMA page_count").fetchone()[0]
    sqlite(journal).writer_db.execute(f"PRAGMA max_page_count={pages}")
    big = c.SetTerrain(fields=c.TerrainFields(title="x" * 80))
    rows = [Row(i, "c", i, "c", op_json(big)) for i in range(1, 5000)]
    with pytest.raises(Unwritable, match="full") as failure:
        journal.append("t", rows).result()
    assert failure.value.full
    sqlite(journal).writer_db.execute("PRAGMA max_page_count=1000000")
    journal.append("t", _rows(1, 1)).result()
    assert [row.clock for row in journal.rows("t", 0)] == [1]
    journal.close()


def test_a_database_that_cannot_be_opened_is_closed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J566."""
    opened: list[sqlite3.Connection] = []
    opens = sqlite3.connect

    def noted(*args: Any, **more: Any) -> sqlite3.Connection:
        opened.append(opens(*args, **more))
        return opened[-1]

    def fails(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("esker.store.engine.sqlite.sqlite3.connect", noted)
    (tmp_path / "none.db").write_bytes(b"no database" * 100)
    with pytest.raises(sqlite3.DatabaseError):
        connect(tmp_path / "none.db")
    monkeypatch.setattr("esker.store.upkeep.migrations.migrate", fails)
    with pytest.raises(ZeroDivisionError):
        Journal(tmp_path)
    assert len(opened) == 2
    for db in opened:
        with pytest.raises(sqlite3.ProgrammingError, match="closed"):
            db.execute("SELECT 1")


@pytest.mark.parametrize("others", [0, 1])
def test_a_failure_that_others_of_the_batch_survive_is_told(journal: Journal, others: int) -> None:
    """SPEC J264. SQLite may end the statement alone that finds the disk full."""

    def fails(db: Connection) -> None:
        db.execute("INSERT INTO nowhere VALUES (1)")

    at_work, gate = threading.Event(), threading.Event()

    def holds(_: Connection) -> bool:
        at_work.set()
        return gate.wait(60)

    held = journal.submit(holds)
    assert at_work.wait(60), "the writer took it alone: what follows is of one batch"
    failed = journal.submit(fails)
    beside = [journal.append("t", _rows(1, 1)) for _ in range(others)]
    gate.set()
    assert held.result(60)
    assert isinstance(failed.exception(60), Unwritable)
    assert [future.exception(60) for future in beside] == [None] * others
    journal.close()
    assert not journal.writable


def test_snapshots_shorten_the_replay_and_change_nothing(either: Journal) -> None:
    document = StrokeSet.from_document(BIRTH)
    for first in range(1, 50, 7):
        rows = _rows(first, 7)
        for row in rows:
            document, _ = document.apply(c.OP.validate_json(row.op))
        either.append("t", rows).result()
        either.keep_snapshot(document.to_document()).result()
    loaded = either.load("t")
    assert loaded is not None
    assert loaded.document == document
    assert loaded.recent == []
    kept = [row[0] for row in either.reader().execute("SELECT clock FROM snapshots ORDER BY clock")]
    assert kept == [0, 42, 49]
    past = either.load("t", upto=20)
    assert past is not None
    assert (past.document.clock, len(past.document.strokes)) == (20, 20)
    assert either.document("t") == document
    assert either.document("t", 20) == past.document
    assert either.document("nothing") is None
    either.close()


def test_a_gap_or_an_op_that_does_not_apply_is_named(either: Journal) -> None:
    either.append("t", [_rows(2, 1)[0]]).result()
    with pytest.raises(DamagedTerrain, match="op 2 follows op 0"):
        either.load("t")
    either.create(c.Document(id="u")).result()
    either.append("u", [_rows(1, 1)[0]._replace(op='{"type":"stroke.finish","stroke":"no"}')]).result()
    for read in (either.load, either.document):
        with pytest.raises(DamagedTerrain, match="op 1 of u"):
            read("u")
    either.close()


@pytest.mark.parametrize("damage", ["header", "middle", "truncated", "text", "newer"])
def test_a_damaged_database_is_refused_and_left_alone(journal: Journal, tmp_path: Path, damage: str) -> None:
    for i in range(40):
        journal.append("t", _rows(1 + 20 * i, 20)).result()
    good = copied(journal)
    journal.close()
    path = tmp_path / "esker.db"
    content = bytearray(path.read_bytes())
    if damage == "header":
        content[:100] = bytes(100)
    elif damage == "middle":
        content[4096 * 3 : 4096 * 6] = b"\xff" * (4096 * 3)
    elif damage == "truncated":
        del content[len(content) // 2 :]
    elif damage == "text":
        content = bytearray(b"this is no database\n" * 500)
    else:
        content[60:64] = (99).to_bytes(4, "big")  # user_version
    path.write_bytes(content)
    with pytest.raises(CorruptDatabase) as caught:
        Journal(tmp_path)
    assert str(path) in str(caught.value)
    assert str(good) in str(caught.value)
    assert path.read_bytes() == bytes(content), "a damaged file must not be touched"
    # The way out that the sentence describes works.
    assert f"esker restore --data {tmp_path}" in str(caught.value)
    restore(tmp_path)
    restored = Journal(tmp_path)
    loaded = restored.load("t")
    assert loaded is not None
    assert loaded.document.clock == 800
    restored.close()


def test_without_a_copy_the_sentence_says_so(tmp_path: Path) -> None:
    (tmp_path / "esker.db").write_bytes(b"nonsense" * 1000)
    with pytest.raises(CorruptDatabase, match="no earlier copy"):
        Journal(tmp_path)


def test_a_date_that_was_set_back_drops_no_newer_copy(journal: Journal, tmp_path: Path) -> None:
    """SPEC J17."""
    dates = [1e9 + 60 * i for i in range(6)] + [1e9 - 3600, 1e9 - 3599]
    for clock, date in enumerate(dates, 1):
        journal._now = lambda date=date: date  # type: ignore[misc]
        journal.append("t", _rows(clock, 1)).result()
        copy = copied(journal)
        assert copy.exists()
        assert copy == last_backup(tmp_path)
    kept = sorted((tmp_path / "backup").glob("*.db"))
    clocks = []
    for copy in kept:
        with closing(sqlite3.connect(copy)) as db:
            clocks.append(db.execute("SELECT max(clock) FROM ops").fetchone()[0])
    assert clocks == [4, 5, 6, 7, 8]
    journal.close()


def test_backups_are_complete_while_the_journal_is_written(journal: Journal, tmp_path: Path) -> None:
    stop = threading.Event()
    appended = [0]

    def write() -> None:
        while not stop.is_set():
            journal.append("t", _rows(appended[0] + 1, 1)).result()
            appended[0] += 1

    thread = threading.Thread(target=write)
    thread.start()
    copies = []
    for i in range(8):
        before = appended[0]
        journal._now = lambda i=i: 1000.0 + i  # type: ignore[misc]
        path = copied(journal)
        with closing(sqlite3.connect(path)) as db:
            assert db.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
            count = db.execute("SELECT count(*), max(clock) FROM ops").fetchone()
        assert count[0] == (count[1] or 0) >= before
        copies.append(path)
    stop.set()
    thread.join()
    assert [p.exists() for p in copies] == [False] * 3 + [True] * backup.KEPT
    assert backup.last_backup(tmp_path) == copies[-1]
    assert not list((tmp_path / "backup").glob("*.part"))
    journal.close()


def test_a_closed_journal_has_committed_everything(store: Store) -> None:
    journal = store.open()
    journal.create(BIRTH)
    futures = [journal.append("t", _rows(i, 1)) for i in range(1, 400)]
    journal.close()
    assert all(f.done() and f.exception() is None for f in futures)
    with pytest.raises(RuntimeError):
        journal.append("t", _rows(400, 1))
