"""What a server does for its data beside serving, and what it leaves on its disk (SPEC J392, J394)."""

from __future__ import annotations

import asyncio
import os
import sqlite3
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from esker import contract as c
from esker.importing import run as importing
from esker.patchwork.raster import rasters
from esker.store.engine.sqlite import LOG_BYTES
from esker.store.grids import NAMED_WITHIN, TRASH_SECONDS, GridStore
from esker.store.journal import HistoryFull, Journal, Row
from esker.store.upkeep import backup, compaction, migrations
from esker.store.upkeep.care import Care, sweep_parts
from esker.store.upkeep.deletion import Deletion
from esker.store.upkeep.inspection import DATABASE_NAME
from tests.gestures import session
from tests.sync.harness import LiveServer


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    made = Journal(tmp_path)
    made.create(c.Document(id="t")).result()
    yield made
    made.close()


def _grid(store: GridStore, value: float) -> Path:
    raster = rasters.build(np.full((8, 8), value))
    store.put(raster)
    return store.path(raster.digest)


def test_forgotten_grids_go_while_the_server_runs(journal: Journal, tmp_path: Path) -> None:
    """SPEC J394: to the trash, from there after two weeks; not one that somebody may be about to name."""
    store, now = GridStore(tmp_path), time.time()
    old, again, young = _grid(store, 1.0), _grid(store, 2.0), _grid(store, 3.0)
    for path in (old, again):
        os.utime(path, (now - NAMED_WITHIN - 10,) * 2)
    _grid(store, 2.0)  # the same file was brought again a moment ago
    care = Care(journal, Deletion(journal), store)
    care.round()
    assert old.exists(), "a new database does not know all that people brought"
    journal.submit(lambda db: migrations.state(db, "swept_from", "0")).result()
    care.round()
    assert [path.exists() for path in (old, again, young)] == [False, True, True]
    (trashed,) = (store.folder / ".trash").iterdir()
    trashed.rename(trashed.with_name(f"{old.name}-{int(now - TRASH_SECONDS - 10)}"))
    care.round()
    assert not list((store.folder / ".trash").iterdir())


def test_half_written_files_go_at_the_start(tmp_path: Path) -> None:
    """SPEC J394: what a killed restore, preview or backup left."""
    left = [tmp_path / f"{DATABASE_NAME}.part-journal", tmp_path / "private.new", tmp_path / "previews" / "t-4.part"]
    left.append(tmp_path / "backup" / "esker-20200101-000000.part")
    for path in left:
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"half")
    kept = tmp_path / "previews" / "t-3.jpg"
    kept.write_bytes(b"a picture")
    with LiveServer(tmp_path):
        deadline = time.monotonic() + 60
        while not backup.copies_of(tmp_path):  # it copies the database at its start
            assert time.monotonic() < deadline
            time.sleep(0.01)
        assert [path.exists() for path in left] == [False] * 4
        assert kept.exists()
    sweep_parts(tmp_path)


def test_a_migration_that_fails_at_every_start_does_not_fill_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC J394."""
    former = len(migrations.STEPS) - 1
    written = Path(__file__).parents[1] / "databases" / f"format-{former}.sql"
    with closing(sqlite3.connect(tmp_path / DATABASE_NAME)) as db:
        db.executescript(written.read_text(encoding="utf-8"))

    def fails(_: sqlite3.Connection) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(migrations, "STEPS", (*migrations.STEPS[:-1], fails))
    for second in range(5):
        with pytest.raises(ZeroDivisionError):
            Journal(tmp_path, lambda at=1e9 + second: at)  # type: ignore[misc]
    copies = sorted((tmp_path / "backup").glob("before-*.db"))
    assert len(copies) == backup.KEPT_BEFORE
    with closing(sqlite3.connect(copies[-1])) as db:
        assert migrations.format_of(db) == former


def test_a_long_log_is_cut_when_it_is_begun_anew(journal: Journal, tmp_path: Path) -> None:
    """SPEC J394: one large commit does not leave the disk as full as it was."""
    log = tmp_path / f"{DATABASE_NAME}-wal"
    big = "x" * 1_000_000
    rows = [Row(k, "c", k, "c", big) for k in range(1, 21)]
    journal.append("u", rows).result()
    assert log.stat().st_size > 2 * LOG_BYTES
    for k in range(21, 24):
        journal.append("u", [Row(k, "c", k, "c", "x")]).result()
    assert log.stat().st_size <= LOG_BYTES


def test_archives_are_unpacked_where_leftovers_are_swept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J394: a kill left them in the system's folder for temporary files."""
    seen: list[str] = []

    async def look(task: object, *_: object) -> object:
        seen.append(task.workdir)  # type: ignore[attr-defined]
        raise importing.ImportRefused("no")

    monkeypatch.setattr(importing, "_run", look)
    asyncio.run(importing.inspect(tmp_path / "a.zip", "a.zip", folder=tmp_path))
    assert Path(seen[0]).parent == tmp_path
    assert list(tmp_path.iterdir()) == []


def test_a_full_history_is_folded_soon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J392."""
    monkeypatch.setattr(compaction, "CROWDED_AFTER", 0.0)
    journal = Journal(tmp_path, lambda: 1e9)
    journal.create(c.Document(id="t")).result()
    done = session(3, 200, c.Document(id="t"))
    journal.append("t", [each.row for each in done]).result()
    journal.keep_snapshot(done[-1].after.to_document()).result()
    care = Care(journal, Deletion(journal), GridStore(tmp_path), full_seconds=0.01)
    heard = threading.Event()
    care._compaction = compaction.Compaction(journal, lambda: 1e9 + 10, crowded_after=0.0)
    folds = care._compaction.terrain

    def fold(terrain: str) -> int:
        gone = folds(terrain)
        heard.set()
        return gone

    monkeypatch.setattr(care._compaction, "terrain", fold)
    care.start()
    try:
        journal._quota = sum(len(each.row.op) for each in done) + 10
        following = Row(len(done) + 1, "new", 1, "new", "x" * 200)
        assert isinstance(journal.append("t", [following]).exception(), HistoryFull)
        assert heard.wait(60)
        journal.append("t", [following]).result()
    finally:
        care.stop()
        journal.close()
