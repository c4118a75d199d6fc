"""A server whose terrains lie in PostgreSQL, as people and programs see it (SPEC J475 to J478)."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import psycopg
import pytest

from bench.cluster._postgres import Postgres as DatabaseServer
from esker import Stroke, connect
from esker.server.starting import CannotServe
from esker.store.engine.leases import Lease, Node
from esker.store.engine.postgres import alone, engine
from esker.store.engine.postgres.alone import WHOLE
from esker.store.engine.postgres.leases import PostgresLeases
from esker.store.journal import Journal
from tests import zygote
from tests.store.engines import Database, postgres
from tests.sync.harness import LiveServer

ROOT = Path(__file__).parents[2]


def titled(title: str) -> dict[str, Any]:
    """The op that gives a terrain its title."""
    return {"type": "terrain.set", "fields": {"title": title}}


class Served:
    """``esker serve`` in a process of its own."""

    def __init__(self, url: str, data: Path, port: int) -> None:
        self.base = f"http://127.0.0.1:{port}"
        self._url, self._data, self._port = url, data, port
        self.start()

    def start(self) -> None:
        """Starts it, and returns when it serves."""
        arguments = ["serve", "--port", str(self._port), "--level", "1", "--device", "numpy", "--data", str(self._data)]
        self.process = zygote.start("esker", arguments, {"ESKER_DATABASE": self._url}, Path(os.devnull))
        end = time.monotonic() + 120
        while time.monotonic() < end and self.process.poll() is None:
            with suppress(OSError), urllib.request.urlopen(f"{self.base}/healthz", timeout=5) as answer:
                if answer.status == 200:
                    return
            time.sleep(0.05)
        raise AssertionError(f"the server did not start: {self.process.poll()}")

    def post(self, path: str, body: Any) -> Any:
        request = urllib.request.Request(
            self.base + path, json.dumps(body).encode(), {"Content-Type": "application/json"}, method="POST"
        )
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.loads(answer.read())

    def close(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture
def served(database: Database, tmp_path: Path) -> Iterator[Served]:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
    made = Served(database.new(), tmp_path, port)
    yield made
    made.close()


def test_a_program_draws_and_a_kill_loses_nothing(served: Served, tmp_path: Path) -> None:
    """SPEC J475: the server is killed, started again at once, and the program goes on by itself."""
    made = served.post("/api/terrains", {})
    link = f"{served.base}/t/{made['id']}#{made['secret']}"
    with connect(link, "Ada") as terrain:
        for k in range(20):
            terrain.add(Stroke.level([(1000, 1000, 100 + k), (2000, 1200, 120)], id=f"s{k}"))
        before = terrain.wait()
        os.kill(served.process.pid, signal.SIGKILL)
        served.process.wait()
        terrain.add(Stroke.level([(1000, 3000, 50), (2000, 3200, 50)], id="meanwhile"))
        served.start()
        assert terrain.wait(60) > before
    with connect(link, "Bob") as terrain:
        assert [stroke.id for stroke in terrain.strokes] == [*(f"s{k}" for k in range(20)), "meanwhile"]
    assert not (tmp_path / "esker.db").exists()


# --- in this process --------------------------------------------------------------------------------------------


def test_a_server_is_alone_on_its_database(database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J476: a second one is refused with a sentence, and one beside nodes as well; both when the other is gone."""
    monkeypatch.setattr(alone, "PATIENCE_SECONDS", 0.1)
    url = database.new()
    with LiveServer(tmp_path / "a", database=url), pytest.raises(CannotServe, match=r"uses the database .* --node"):
        LiveServer(tmp_path / "b", database=url)
    leases = PostgresLeases(url)
    leases.register(Node("hill", "http://10.0.0.1", 1.0), 60.0)
    with pytest.raises(CannotServe, match="The nodes hill use the database"):
        LiveServer(tmp_path / "b", database=url)
    assert leases.owner(WHOLE) is None
    leases.withdraw("hill")
    with LiveServer(tmp_path / "b", database=url) as server:
        assert server.http("GET", "/readyz")[0] == 200
    leases.close()


def test_who_lost_the_database_stops(database: Database, tmp_path: Path) -> None:
    """SPEC J476: everybody is sent away, nothing more is acknowledged."""
    url = database.new()
    with LiveServer(tmp_path, database=url) as server:
        terrain, secret = server.create()
        ada = server.join(terrain, secret, "ada")
        leases = PostgresLeases(url)
        with psycopg.connect(url, autocommit=True) as db:
            taken: Lease | Node | None = None
            while not isinstance(taken, Lease):  # the server may renew its own in between
                db.execute("UPDATE esker.leases SET until = clock_timestamp() WHERE terrain = '*'")
                taken = leases.take(WHOLE, "another", 60.0)
        ada.ops(("ada:1", titled("late")))
        code, _ = ada.closed()
        assert code == 4502
        server._thread.join(30)
        assert not server._thread.is_alive()
        with psycopg.connect(url, autocommit=True) as db:
            assert db.execute("SELECT count(*) FROM esker.ops").fetchone() == (0,)
        leases.close()


def test_an_unknown_outcome_closes_the_room_and_refuses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC J469: the database went away for good while it committed. The page comes back to what is there."""
    monkeypatch.setattr(engine, "PATIENCE_SECONDS", 0.3)
    own = DatabaseServer()
    try:
        with LiveServer(tmp_path, database=own.database()) as server:
            terrain, secret = server.create()
            ada = server.join(terrain, secret, "ada")
            ada.ops(("ada:1", titled("one")))
            ada.wait("ack")
            journal = server.assembly.hub.journal
            cut = postgres(journal)

            class Cut(engine.Attempt):
                """Loses the connection in the moment in which it commits."""

                def run(self, db: Any) -> Any:
                    super().run(db)
                    own.kill()
                    raise psycopg.OperationalError("server closed the connection unexpectedly")

            monkeypatch.setattr(engine, "Attempt", Cut)
            ada.ops(("ada:2", titled("two")))
            code, _ = ada.closed()
            assert code == 4502
            monkeypatch.undo()
            own.start()
            assert cut is journal.engine
            again = server.join(terrain, secret, "ada")
            assert again.welcome["document"]["settings"]["title"] == "two"
            again.ops(("ada:2", titled("two")))
            assert again.wait("ack")["clocks"] == [2]
    finally:
        own.close()


def test_what_people_do_is_the_same(database: Database, tmp_path: Path) -> None:
    """SPEC J477: links, roles, history, previews' tokens, deletion, over HTTP."""
    with LiveServer(tmp_path, database=database.new()) as server:
        terrain, secret = server.create()
        base = f"/api/terrains/{terrain}"
        status, made = server.http("POST", f"{base}/links", {"role": "edit", "name": "class"}, secret)
        assert status == 201
        ada = server.join(terrain, made["secret"], "ada", name="Ada\0Lovelace")
        ada.ops(("ada:1", titled("Hills\0")))
        ada.wait("ack")
        assert [link["name"] for link in server.http("GET", f"{base}/links", secret=secret)[1]] == [
            "Owner",
            "class",
        ]
        history = server.http("GET", f"{base}/history", secret=secret)[1]
        assert "Ada" in json.dumps(history)
        assert server.http("DELETE", base, secret=secret)[0] == 200
        assert server.http("GET", base, secret=secret)[0] == 410


def test_without_its_driver_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J478: a plain installation brings no psycopg."""
    for name in [each for each in sys.modules if each.split(".")[0] in ("psycopg", "psycopg_pool")]:
        monkeypatch.setitem(sys.modules, name, None)
    for name in [each for each in sys.modules if each.startswith("esker.store.engine.postgres")]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(CannotServe, match="pip install 'esker\\[cluster\\]'"):
        LiveServer(tmp_path, database="postgresql://nobody@nowhere/none")
    journal = Journal(tmp_path)
    journal.close()
