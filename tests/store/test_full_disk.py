"""The disk of a shared database is really full (SPEC J564). It needs a small file system, so only long runs have it."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psycopg
import pytest

from bench.cluster._postgres import Postgres as Server
from esker import contract as c
from esker.store.engine.ports import Unwritable
from esker.store.engine.postgres.engine import Postgres
from esker.store.journal import Journal, Row
from tests.store.engines import Holding

pytestmark = pytest.mark.skipif("not os.environ.get('ESKER_LONG')", reason="long runs mount a small file system")
SIZE = 4
"""Megabytes of the disk."""


@contextmanager
def small_disk(place: Path, server: Server) -> Iterator[Path]:
    """A file system of few megabytes, which the database may write to."""
    place.mkdir()
    root = [] if os.geteuid() == 0 else ["sudo", "-n"]
    owner = (server.folder / "data").stat()
    size = f"size={SIZE}m,uid={owner.st_uid},gid={owner.st_gid},mode=700"
    done = subprocess.run([*root, "mount", "-t", "tmpfs", "-o", size, "esker", place], capture_output=True, text=True)
    assert done.returncode == 0, f"long runs need the right to mount a file system: {done.stderr}"
    try:
        yield place
    finally:
        subprocess.run([*root, "umount", "--lazy", place], check=True)


def row(clock: int) -> Row:
    """An op that fills a page of the database by itself."""
    return Row(clock, "ada", clock, "ada", '{"x":"' + os.urandom(3000).hex() + '"}')


def test_a_database_whose_disk_is_full_refuses_and_goes_on(tmp_path: Path) -> None:
    """SPEC J564: what it cannot write is refused for want of room and not there; with room again writing goes on."""
    server = Server()
    try:
        with small_disk(server.folder / "small", server) as place:
            url = server.database()
            journal = Journal(tmp_path, engine=Postgres(url, Holding()))
            journal.create(c.Document(id="t")).result()
            with psycopg.connect(url, autocommit=True) as db:
                db.execute(f"CREATE TABLESPACE small LOCATION '{place}'".encode())
                db.execute("ALTER TABLE esker.ops SET TABLESPACE small")
            saved: list[int] = []
            failure: BaseException | None = None
            for clock in range(1, 4 * SIZE * 1024 // 6):
                failure = journal.append("t", (row(clock),)).exception()
                if failure is not None:
                    break
                saved.append(clock)
            assert isinstance(failure, Unwritable), failure
            assert failure.full
            assert not journal.writable
            assert [each.clock for each in journal.rows("t", 0)] == saved
            with psycopg.connect(url, autocommit=True) as db:
                db.execute("ALTER TABLE esker.ops SET TABLESPACE pg_default")  # somebody made room
            journal.append("t", (row(len(saved) + 1),)).result()
            assert journal.writable
            assert [each.clock for each in journal.rows("t", 0)] == [*saved, len(saved) + 1]
            journal.close()
    finally:
        server.close()
