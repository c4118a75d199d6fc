"""Deleting a terrain, and what becomes of terrains that nobody drew on (SPEC J261, J262)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from esker import contract as c
from esker.document.wire import op_json
from esker.store.access import Access
from esker.store.engine.postgres import dialect
from esker.store.journal import Journal, Row
from esker.store.timestamps import Person
from esker.store.upkeep.deletion import GRACE_SECONDS, TABLES, UNTOUCHED_SECONDS, Deletion
from tests.store.engines import Store
from tests.sync.harness import LiveServer, Peer, stroke

CLASSES = ("classes", "copies", "pupils")
"""Emptied by ``store.classes.forget``: SPEC L78."""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[LiveServer]:
    with LiveServer(tmp_path) as running:
        yield running


def _knock(server: LiveServer, terrain: str, secret: str) -> Peer:
    """A client that says hello and waits for nothing."""
    peer = Peer(server.socket())
    peer.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client="c9")
    return peer


def test_an_owner_deletes_and_brings_back(server: LiveServer) -> None:
    """SPEC J261: it opens for nobody meanwhile, and comes back as it was."""
    terrain, owner = server.create()
    _, made = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "e"}, owner)
    editor = server.join(terrain, made["secret"], "c1")
    editor.ops(("c1:1", stroke("s1")))
    editor.wait("ack")
    past = server.join(terrain, owner, "c2", at=0)
    assert server.http("DELETE", f"/api/terrains/{terrain}", secret=made["secret"])[0] == 403
    status, answer = server.http("DELETE", f"/api/terrains/{terrain}", secret=owner)
    assert status == 200
    assert answer["until"] > 0
    for peer in (editor, past):
        number, error = peer.closed()
        assert (number, error["code"] if error else None) == (c.WS_CLOSE["no_terrain"], "no_terrain")
    for secret, restorable in ((owner, True), (made["secret"], False)):
        status, problem = server.http("GET", f"/api/terrains/{terrain}", secret=secret)
        assert (status, problem["code"], problem["restorable"]) == (410, "deleted", restorable)
    assert server.http("GET", f"/api/terrains/{terrain}/archive", secret=owner)[0] == 410
    number, error = _knock(server, terrain, owner).closed()
    assert number == c.WS_CLOSE["no_terrain"]
    assert server.http("POST", f"/api/terrains/{terrain}/restore", secret=made["secret"])[0] == 403
    assert server.http("POST", f"/api/terrains/{terrain}/restore", secret="x" * 32)[0] == 403
    assert server.http("POST", f"/api/terrains/{terrain}/restore", secret=owner)[0] == 200
    assert server.http("POST", f"/api/terrains/{terrain}/restore", secret=owner)[0] == 409
    status, about = server.http("GET", f"/api/terrains/{terrain}", secret=made["secret"])
    assert (status, about["clock"], about["strokes"]) == (200, 1, 1)


def _counted(journal: Journal, terrain: str) -> list[int]:
    db = journal.reader()
    return [db.execute(f"SELECT count(*) FROM {t} WHERE terrain=?", (terrain,)).fetchone()[0] for t in TABLES]


def test_what_was_deleted_is_gone_after_the_grace(store: Store) -> None:
    """SPEC J261: every row of it, and no row of another terrain."""
    journal, now = store.open(), [1e9]
    deletion, access = Deletion(journal, lambda: now[0]), Access(journal)
    for terrain in ("t", "u"):
        journal.create(c.Document(id=terrain)).result()
        op = op_json(c.SetTerrain(fields=c.TerrainFields(title="x")))
        rows = [Row(k, "c", k, "c", op) for k in range(1, 1201)]
        journal.append(terrain, rows, (Person("c", "Ann", "#000000"),)).result()
        access.add(terrain, "owner", "o").result()
        journal.submit(
            lambda db, terrain=terrain: [  # type: ignore[misc]
                db.execute("INSERT INTO previews VALUES (?,?,1)", (terrain, terrain)),
                db.execute("INSERT INTO grids VALUES (?,?)", (terrain, "0" * 64)),
                db.execute("INSERT INTO folds VALUES (?,?,?,?)", (terrain, 500, 1, 500)),
                db.execute("INSERT INTO lessons VALUES (?,?)", (terrain, "{}")),
                db.execute("INSERT INTO makers VALUES (?,?,?)", (terrain, "s", "c")),
                db.execute("INSERT INTO folded_ids VALUES (?,?,?,?,?)", (terrain, "c", 1, 2, 2)),
            ]
        ).result()
    before = _counted(journal, "u")
    assert all(before)
    deletion.delete("t").result()
    assert deletion.deleted("t") == 1e9
    now[0] += GRACE_SECONDS
    assert deletion.remove_old() == []
    now[0] += 1
    assert deletion.remove_old() == ["t"]
    assert _counted(journal, "t") == [0] * len(TABLES)
    assert _counted(journal, "u") == before
    assert not journal.exists("t")
    assert journal.exists("u")
    journal.close()


def test_a_table_that_is_new_is_removed_from_too(tmp_path: Path) -> None:
    """SPEC J261. PostgreSQL knows the same tables."""
    journal = Journal(tmp_path)
    tables = {row[0] for row in journal.reader().execute("SELECT name FROM sqlite_master WHERE type='table'")}
    assert tables - {"terrains", "server", *CLASSES} == set(TABLES)
    assert tables == set(dialect.TABLES) - {"codes"}, "a server that is alone has join codes in memory"
    journal.close()


def test_terrains_that_nobody_drew_on_expire(store: Store) -> None:
    """SPEC J262."""
    now = [1e9]
    journal = store.open(now=lambda: now[0])
    deletion = Deletion(journal, lambda: now[0])
    for terrain in ("empty", "drawn", "laid"):
        journal.create(c.Document(id=terrain)).result()
    op = op_json(c.SetTerrain(fields=c.TerrainFields(title="x")))
    journal.append("drawn", [Row(1, "c", 1, "c", op)]).result()
    journal.submit(lambda db: db.execute("INSERT INTO grids VALUES ('laid','0')")).result()
    now[0] += UNTOUCHED_SECONDS
    assert deletion.expire().result() == 0
    now[0] += 1
    journal.create(c.Document(id="young")).result()
    assert deletion.expire().result() == 1
    assert [t for t in ("empty", "drawn", "laid", "young") if deletion.deleted(t) is not None] == ["empty"]
    assert deletion.bring_back("empty").result()
    journal.close()


def test_a_room_that_opens_while_its_terrain_is_deleted_does_not_open(server: LiveServer) -> None:
    """SPEC J261."""
    terrain, owner = server.create()
    hub = server.assembly.hub
    journal = server.assembly._journal
    assert journal is not None
    load = journal.load

    def late(*arguments: object) -> object:
        found = load(*arguments)  # type: ignore[arg-type]
        hub.deletion.delete(terrain).result()
        return found

    journal.load = late  # type: ignore[method-assign, assignment]
    number, _ = _knock(server, terrain, owner).closed()
    assert number == c.WS_CLOSE["no_terrain"]
