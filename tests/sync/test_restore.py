"""What survives a lost or damaged database: restore, grids, migrations (SPEC J250 to J255)."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from esker import contract as c
from esker.document.wire import op_json
from esker.patchwork.raster import rasters
from esker.store.access import Access
from esker.store.engine.lock import DataLock, InUse
from esker.store.grids import TRASH_SECONDS, GridStore
from esker.store.journal import Journal, Row
from esker.store.upkeep import backup, migrations
from esker.store.upkeep.inspection import DATABASE_NAME, CorruptDatabase, MissingDatabase
from esker.store.upkeep.restore import CannotRestore, restore
from tests.sync.test_layers import _layer


def _rows(first: int, count: int) -> list[Row]:
    title = c.SetTerrain(fields=c.TerrainFields(title="a title"))
    return [Row(first + i, "c", first + i, "c", op_json(title)) for i in range(count)]


def _clock(data: Path) -> int:
    journal = Journal(data)
    try:
        return journal.newest("t")
    finally:
        journal.close()


def _with_grid(data: Path) -> str:
    """A database with terrain "t", which names one stored grid; its digest."""
    raster = rasters.build(np.full((8, 8), 5.0))
    layer = _layer("a", content=raster.digest)
    journal = Journal(data)
    GridStore(data).put(raster)
    journal.create(c.Document(id="t", layers=(layer,))).result()
    journal.append("t", _rows(1, 20)).result()
    journal.backup()
    journal.reader().execute("PRAGMA wal_checkpoint").fetchall()
    journal.append("t", _rows(21, 20)).result()
    # The files are what kill -9 leaves: the newest ops are in the log alone.
    killed = data.with_name(data.name + "-killed")
    shutil.copytree(data, killed)
    journal.close()
    shutil.rmtree(data)
    killed.rename(data)
    return raster.digest


@pytest.mark.parametrize("lost", ["damaged", "gone"])
def test_restore_after_a_kill_never_meets_the_old_log(tmp_path: Path, lost: str) -> None:
    """SPEC J250. The copy alone in the place of the database had the old log played over it: malformed, 9 of 9."""
    data = tmp_path / "data"
    digest = _with_grid(data)
    path = data / DATABASE_NAME
    assert (data / f"{DATABASE_NAME}-wal").read_bytes().strip(b"\0"), "there is a log to be met"
    if lost == "gone":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:4096] + b"\xff" * (path.stat().st_size - 4096))
    shutil.rmtree(data / "grids" / digest)
    with pytest.raises(CorruptDatabase, match="esker restore"):
        Journal(data)
    done = restore(data, now=1e9)
    assert (done.terrains, done.ops, done.missing_grids) == (1, 20, ())
    assert done.aside is not None
    assert {p.name for p in done.aside.iterdir()} >= {f"{DATABASE_NAME}-wal"}
    assert _clock(data) == 20
    assert GridStore(data).read(digest).digest == digest, "the grid came back from the backup"


def test_a_second_restore_keeps_what_the_first_left(tmp_path: Path) -> None:
    data = tmp_path / "data"
    _with_grid(data)
    first, second = restore(data, now=1e9), restore(data, now=1e9)
    assert first.aside != second.aside
    assert _clock(data) == 20


def test_restore_refuses_what_cannot_be_read_and_changes_nothing(tmp_path: Path) -> None:
    """SPEC J250: also a folder that a server uses."""
    data = tmp_path / "data"
    _with_grid(data)
    copy = backup.last_backup(data)
    assert copy is not None
    before = copy.read_bytes()
    copy.write_bytes(b"nothing" * 999)
    with pytest.raises(CannotRestore, match="no copy"):
        restore(data)
    with pytest.raises(CannotRestore, match="cannot be used"):
        restore(data, copy)
    with pytest.raises(CannotRestore, match="no file"):
        restore(data, tmp_path / "else.db")
    assert _clock(data) == 40
    copy.write_bytes(before)
    lock = DataLock(data)
    with pytest.raises(InUse):
        restore(data)
    lock.release()


def test_no_new_database_beside_what_an_old_one_left(tmp_path: Path) -> None:
    """SPEC J251. A start without its database took every stored grid for forgotten."""
    data = tmp_path / "data"
    digest = _with_grid(data)
    for suffix in ("", "-wal", "-shm"):
        (data / (DATABASE_NAME + suffix)).unlink(missing_ok=True)
    with pytest.raises(MissingDatabase, match=r"1 copy of one.*1 elevation grid"):
        Journal(data)
    assert not (data / DATABASE_NAME).exists()
    shutil.rmtree(data / "backup")
    with pytest.raises(MissingDatabase, match="1 elevation grid") as caught:
        Journal(data)
    assert "restore" not in str(caught.value), "there is no copy to be restored"
    assert GridStore(data).has(digest)


def test_grids_go_to_a_trash_first(tmp_path: Path) -> None:
    """SPEC J252."""
    store, raster = GridStore(tmp_path), rasters.build(np.zeros((8, 8)))
    store.put(raster)
    store.sweep(set(), now=1000.0, forgotten=False)
    assert store.has(raster.digest)
    store.sweep(set(), now=1000.0)
    assert not store.has(raster.digest)
    store.sweep({raster.digest}, now=1000.0 + TRASH_SECONDS)
    assert store.read(raster.digest).digest == raster.digest
    store.sweep(set(), now=2000.0)
    store.sweep(set(), now=2000.0 + TRASH_SECONDS - 1)
    assert len(list((store.folder / ".trash").iterdir())) == 1
    store.sweep(set(), now=2000.0 + TRASH_SECONDS + 1)
    assert not list((store.folder / ".trash").iterdir())


def test_a_new_or_restored_database_sweeps_nothing(tmp_path: Path) -> None:
    """SPEC J252."""
    now = [1e9]
    journal = Journal(tmp_path, now=lambda: now[0])
    assert not journal.may_sweep()
    now[0] += migrations.SWEEP_AFTER + 1
    assert journal.may_sweep()
    journal.create(c.Document(id="t")).result()
    journal.backup()
    journal.close()
    restore(tmp_path, now=now[0])
    journal = Journal(tmp_path, now=lambda: now[0])
    assert not journal.may_sweep()
    journal.close()


def test_a_copy_that_cannot_be_read_is_no_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J253: it drops no older one."""
    journal = Journal(tmp_path)
    good = journal.backup()
    copy = backup._copy

    def damaged(source: Path, part: Path) -> None:
        copy(source, part)
        part.write_bytes(part.read_bytes()[:4096] + b"\xff" * 4096)

    monkeypatch.setattr(backup, "_copy", damaged)
    with pytest.raises(backup.BadCopy):
        journal.backup()
    assert backup.copies_of(tmp_path) == [good]
    journal.close()


def test_parts_of_killed_backups_are_removed(tmp_path: Path) -> None:
    """SPEC J253."""
    journal = Journal(tmp_path)
    left = tmp_path / "backup" / "esker-20200101-000000.part"
    left.parent.mkdir()
    left.write_bytes(b"x")
    journal.backup()
    assert not left.exists()
    journal.close()


def test_the_backup_keeps_the_grids_of_its_copies_and_no_others(tmp_path: Path) -> None:
    """SPEC J254."""
    data = tmp_path / "data"
    digest = _with_grid(data)
    kept = data / "backup" / "grids"
    assert [path.name for path in kept.iterdir()] == [digest]
    stored = data / "grids" / digest
    assert {path.name for path in (kept / digest).iterdir()} == {path.name for path in stored.iterdir()}
    with closing(sqlite3.connect(data / DATABASE_NAME)) as db:
        db.execute("DELETE FROM grids")
        db.commit()
    for second in range(backup.KEPT):
        backup.write_backup(data / DATABASE_NAME, data, 2e9 + second)
    assert not list(kept.iterdir())


FORMATS = sorted((Path(__file__).parents[1] / "databases").glob("format-*.sql"))


def test_every_released_format_is_here() -> None:
    assert [path.stem for path in FORMATS] == [f"format-{k}" for k in (1, 2, 5, 6, 7, 8, 9)]


@pytest.mark.parametrize("path", FORMATS, ids=lambda path: str(path.stem))
def test_a_database_of_every_released_format_opens(path: Path, tmp_path: Path) -> None:
    """SPEC J255: its terrains, its links, its history; and a copy of it as it was is kept."""
    text = path.read_text(encoding="utf-8")
    secrets = text.splitlines()[0].removeprefix("-- secrets: ").split()
    with closing(sqlite3.connect(tmp_path / DATABASE_NAME)) as db:
        db.executescript(text)
    for _ in range(2):
        journal = Journal(tmp_path)
        loaded, access = journal.load("t"), Access(journal)
        assert loaded is not None
        assert loaded.document.clock == 7
        assert loaded.document.settings.title == "An old one"
        assert list(loaded.document.strokes) == ["s0", "s1", "s2", "s4"]
        roles = [link.role if (link := access.check("t", secret)) else None for secret in secrets]
        assert roles == ["owner", "edit", "view"]
        assert journal.load("t", 3) is not None
        journal.close()
    assert len(list((tmp_path / "backup").glob(f"before-{path.stem}-*.db"))) == 1


def test_a_kill_during_a_migration_leaves_one_format_or_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC J255."""
    with closing(sqlite3.connect(tmp_path / DATABASE_NAME)) as db:
        db.executescript(FORMATS[0].read_text(encoding="utf-8"))

    steps = migrations.STEPS

    def fails(db: sqlite3.Connection) -> None:
        steps[2](db)
        raise ZeroDivisionError

    monkeypatch.setattr(migrations, "STEPS", (*steps[:2], fails, *steps[3:]))
    with pytest.raises(ZeroDivisionError):
        Journal(tmp_path)
    with closing(sqlite3.connect(tmp_path / DATABASE_NAME)) as db:
        assert migrations.format_of(db) == 2
        assert not db.execute("SELECT 1 FROM sqlite_master WHERE name='server'").fetchall()
    monkeypatch.undo()
    assert _clock(tmp_path) == 7


def test_what_a_killed_restore_left_does_not_spoil_the_next(tmp_path: Path) -> None:
    """SPEC J250: SQLite's journal beside the half-made database was played over the next copy."""
    _with_grid(tmp_path)
    part = tmp_path / f"{DATABASE_NAME}.part"
    shutil.copyfile(backup.copies_of(tmp_path)[-1], part)
    db = sqlite3.connect(part, isolation_level=None)
    db.execute("PRAGMA cache_size=1")
    db.execute("BEGIN")
    db.execute("DELETE FROM ops")
    count = "WITH RECURSIVE k(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM k WHERE n < 500)"
    db.execute(
        f"INSERT INTO people (terrain, client, name, colour) {count} SELECT 't', n, hex(randomblob(2000)), '' FROM k"
    )
    killed = {path.name: path.read_bytes() for path in tmp_path.glob(f"{DATABASE_NAME}.part*")}
    db.close()
    assert f"{part.name}-journal" in killed
    journal = Journal(tmp_path)
    journal.append("t", _rows(41, 2_000)).result()
    journal.backup()
    journal.close()
    for name, content in killed.items():
        (tmp_path / name).write_bytes(content)
    assert restore(tmp_path).ops == 2_040
    assert not list(tmp_path.glob("*.part*"))


def test_what_sqlite_left_beside_a_killed_backup_goes(tmp_path: Path) -> None:
    """SPEC J253."""
    _with_grid(tmp_path)
    left = tmp_path / "backup" / "esker-20200101-000000.part-journal"
    left.write_bytes(b"half")
    backup.write_backup(tmp_path / DATABASE_NAME, tmp_path, 2e9)
    assert not left.exists()
