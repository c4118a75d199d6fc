"""``esker move``: a whole server from one database to another and back (SPEC J483 to J485)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cluster._objects import ObjectServer
from esker import contract as c
from esker.cli.main import main
from esker.document.wire import Compressed, op_json
from esker.patchwork.raster import rasters
from esker.server.starting import CannotServe
from esker.store.access import Access
from esker.store.engine.ports import UsedTwice
from esker.store.grids import GridStore
from esker.store.journal import Journal, Row
from esker.store.lessons import read_makers
from esker.store.previews import PreviewTokens
from esker.store.timestamps import Person
from esker.store.upkeep import move as moving
from esker.store.upkeep.compaction import Compaction
from esker.store.upkeep.deletion import Deletion
from esker.store.upkeep.migrations import fact
from esker.store.upkeep.place import Place
from tests.gestures import session
from tests.store.engines import Database
from tests.sync.harness import LiveServer

NAMES = ("Ähre", "zebra", "Ångström", "a", "B")
"""Which engines order differently."""


def filled(data: Path) -> dict[str, Any]:
    """A data folder with all that a store keeps, and what to find again."""
    now = [1e9]
    journal = Journal(data, lambda: now[0])
    birth = c.Document(id="drawn")
    journal.create(birth).result()
    done = session(1, 300, birth)
    for start in range(0, len(done), 3):
        tick = done[start : start + 3]
        now[0] = tick[-1].at
        journal.append("drawn", [each.row for each in tick], (Person("ada", "Ada", "#000000"),)).result()
        if start % 60 == 0:
            journal.keep_snapshot(tick[-1].after.to_document()).result()
    assert Compaction(journal, lambda: 2e9, pause=lambda _: None).terrain("drawn") > 0
    access = Access(journal)
    links = {name: access.add("drawn", "edit", name).result()[1] for name in NAMES}
    token = PreviewTokens(journal).of("drawn").result().token
    journal.keep_lesson("drawn", "{}").result()
    for k in range(5):
        journal.create(c.Document(id=f"t{k}")).result()
        fields = c.TerrainFields(title=f"Terrain {k}")
        journal.append(f"t{k}", [Row(1, "c", 1, "c", op_json(c.SetTerrain(fields=fields)))]).result()
    Deletion(journal, lambda: 5e8).delete("t4").result()
    grid = rasters.build(np.full((40, 40), 9.0, np.float32))
    GridStore(data).put(grid)
    document = Compressed.of(c.Document(id="class")).data
    journal.submit(
        lambda db: [
            db.execute("INSERT INTO grids VALUES (?,?)", ("drawn", grid.digest)),
            db.execute(
                "INSERT INTO classes VALUES (?,?,?,?,?,?,?,?,?,?,?)",
                ("k", "drawn", "Class", 1e9, 3, document, 1, 30, "ABCDEF", 2e9, None),
            ),
            db.execute("INSERT INTO copies VALUES (?,?,?,?)", ("k", 1, "t0", 0)),
            db.execute("INSERT INTO pupils VALUES (?,?,?,?,?)", ("link", "k", 1, "Bob", 1e9)),
        ]
    ).result()
    loaded = journal.load("drawn")
    assert loaded is not None
    found = {
        "digests": {name: moving.digest_of(journal, name) for name in ("drawn", "t0", "t4", None)},
        "document": loaded.document.to_document(),
        "links": links,
        "token": token,
        "grid": grid.digest,
        "folded": next(d.row for d in done if d.row.clock not in {row.clock for row in journal.rows("drawn", 0)}),
    }
    journal.close()
    return found


def check(journal: Journal, found: dict[str, Any]) -> None:
    """Whether a store keeps what was kept."""
    assert {name: moving.digest_of(journal, name) for name in found["digests"]} == found["digests"]
    loaded = journal.load("drawn")
    assert loaded is not None
    assert loaded.document.to_document() == found["document"]
    for name, secret in found["links"].items():
        link = Access(journal).check("drawn", secret)
        assert link is not None
        assert link.name == name
    assert PreviewTokens(journal).terrain(found["token"]) == "drawn"
    assert read_makers(journal.reader(), "drawn")
    assert fact(journal.reader(), moving.MOVING) is None
    with pytest.raises(UsedTwice):
        journal.append("drawn", [found["folded"]]).result()


def test_there_and_back(database: Database, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """SPEC J483: all of it, compared by digest; the source stays."""
    url, first, second = database.server.database(), tmp_path / "first", tmp_path / "second"
    found = filled(first)
    before = (first / "esker.db").read_bytes()
    assert main(["move", "--from", str(first), "--to", url]) == 0
    assert "6 terrains are in postgresql://" in capsys.readouterr().out
    with Place(url, is_there=True) as place:
        check(place.journal, found)
    assert main(["move", "--from", url, "--to", str(second), "--grids", str(first)]) == 0
    said = capsys.readouterr()
    assert "1 elevation grids were copied and verified." in said.out
    assert "6 of 6 terrains" in said.err
    journal = Journal(second)
    check(journal, found)
    journal.close()
    assert GridStore(second).verified(found["grid"]).heights[0, 0] == 9.0
    assert (first / "esker.db").read_bytes() == before
    assert main(["move", "--from", str(first), "--to", url]) == 1
    assert "keeps 6 terrains already" in capsys.readouterr().err


def test_a_move_goes_on_where_it_was_cut_off(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """SPEC J484: in the middle of a terrain; no server starts on the half, and nobody else moves into it."""
    url, data = database.server.database(), tmp_path / "data"
    found = filled(data)
    copied = moving._copy
    left = [3]

    def cut(source: Journal, target: Journal, terrain: str | None) -> int:
        count = copied(source, target, terrain)
        left[0] -= 1
        if not left[0]:
            raise KeyboardInterrupt
        return count

    monkeypatch.setattr(moving, "_copy", cut)
    with pytest.raises(KeyboardInterrupt):
        main(["move", "--from", str(data), "--to", url])
    monkeypatch.undo()
    with pytest.raises(CannotServe, match="has not come to its end"):
        LiveServer(tmp_path / "cache", database=url)
    Journal(tmp_path / "other").close()
    assert main(["move", "--from", str(tmp_path / "other"), "--to", url]) == 1
    assert "Go on with that one" in capsys.readouterr().err
    assert main(["move", "--from", str(data), "--to", url]) == 0
    assert "2 of them were there before." in capsys.readouterr().out
    with Place(url, is_there=True) as place:
        check(place.journal, found)
    with LiveServer(tmp_path / "cache", database=url) as server:
        assert server.http("GET", "/api/terrains/drawn", secret=found["links"]["zebra"])[0] == 200


def test_what_is_not_the_same_is_told(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """SPEC J483: a row that is lost on the way."""
    url, data = database.server.database(), tmp_path / "data"
    filled(data)
    put = moving._put

    def loses(target: Journal, table: moving.Table, rows: list[Any]) -> int:
        return put(target, table, rows[1:] if table.name == "moments" else rows)

    monkeypatch.setattr(moving, "_put", loses)
    assert main(["move", "--from", str(data), "--to", url]) == 1
    assert "Terrain drawn is not in the target as it is in the source." in capsys.readouterr().err


def test_grids_go_into_a_store_of_objects(
    database: Database, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """SPEC J485: and back from there, verified; one that is nowhere is told."""
    url, first, second = database.server.database(), tmp_path / "first", tmp_path / "second"
    found = filled(first)
    objects = ObjectServer()
    try:
        with objects.environment():
            assert main(["move", "--from", str(first), "--to", url, "--grids", objects.url]) == 0
            assert "1 elevation grids were copied and verified." in capsys.readouterr().out
            assert main(["move", "--from", url, "--to", str(second), "--grids", objects.url]) == 0
            assert GridStore(second).verified(found["grid"]).digest == found["grid"]
            assert (
                main(["move", "--from", url, "--to", str(tmp_path / "third"), "--grids", str(tmp_path / "none")]) == 0
            )
            assert f"1 elevation grids are nowhere: {found['grid']}." in capsys.readouterr().out
    finally:
        objects.close()


def test_places_that_are_none_get_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """SPEC J483."""
    assert main(["move", "--from", str(tmp_path / "none"), "--to", str(tmp_path / "to")]) == 1
    assert "no server has kept anything there." in capsys.readouterr().err
    Journal(tmp_path / "from").close()
    url = f"postgresql://ann:hush-hush@/x?host={tmp_path}"
    assert main(["move", "--from", str(tmp_path / "from"), "--to", url]) == 1
    said = capsys.readouterr().err
    assert "does not answer" in said
    assert "hush-hush" not in said
    with Place(str(tmp_path / "from"), is_there=True):
        assert main(["move", "--from", str(tmp_path / "from"), "--to", str(tmp_path / "to")]) == 1
    assert "uses the data folder" in capsys.readouterr().err
