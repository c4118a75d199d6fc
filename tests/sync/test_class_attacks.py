"""Classes under attack, by whoever may make them: what a class costs is its teacher's own (SPEC P531 to P535, J452)."""

from __future__ import annotations

import asyncio
import secrets
import threading
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.document.ops import Refusal
from esker.errors import Cannot
from esker.fairness.shares import Full, Rate, Rates, Who
from esker.fairness.turns import SERVER, FairThreads, Turns
from esker.lesson import classes, merge
from esker.session import births
from esker.store.classes import forget_empty
from esker.store.journal import Journal
from tests.sync.harness import LiveServer
from tests.sync.test_classes import Pupil, Teacher

HERE, THERE = Who("192.0.2.1"), Who("192.0.2.2")


@pytest.fixture(name="teacher")
def _teacher(server: LiveServer) -> Teacher:
    state: Any = server._server.config.app.state  # type: ignore[union-attr]
    state.new_terrains, state.code_tries, state.new_links, state.class_asks = Rates(), Rates(), Rates(), Rates()
    return Teacher(server)


def _document(name: str, strokes: int = 0) -> c.Document:
    made = (c.Stroke(id=f"s{k}", kind="profile", first=(0, 0, 0), last=(9, 0, 0), curve=()) for k in range(strokes))
    return c.Document(id=name, strokes=tuple(made))


@pytest.fixture(name="journal")
def _journal(tmp_path: Path) -> Iterator[Journal]:
    journal = Journal(tmp_path)
    yield journal
    journal.close()


def test_new_terrains_of_one_address_have_a_rate_in_bytes(journal: Journal) -> None:
    """SPEC P531: what is refused is not written; another address is not refused for it."""

    async def run() -> None:
        born = births.Births(journal, FairThreads(1, "reading"), now=lambda: 0.0)
        born.rates = Rates(Rate(1.0, 2_000.0))
        await born.write(_document("a"), who=HERE)
        with pytest.raises(Cannot) as refused:
            await born.write(_document("b", 100), who=HERE)
        assert (refused.value.status, refused.value.code) == (429, "rate_limited")
        await born.write(_document("c"), who=THERE)

    asyncio.run(run())
    assert [journal.exists(name) for name in "abc"] == [True, False, True]


def test_new_terrains_are_written_one_after_another(journal: Journal) -> None:
    """SPEC P531: one heavy birth at a time lies before the changes of those who draw, each address in its turn."""
    written: list[str] = []
    more, waiting = threading.Event(), []
    create = journal.create

    def noted(document: c.Document, also: Any = None, by: str | None = None, text: str | None = None) -> Any:
        assert text is not None, "it was encoded before"
        written.append(document.id)
        waiting.append(journal.waiting)
        return create(document, lambda _: more.wait(30), by, text)

    journal.create = noted  # type: ignore[method-assign]

    async def run() -> None:
        born = births.Births(journal, FairThreads(4, "reading"))
        tasks = [asyncio.create_task(born.write(_document(f"h{k}"), who=HERE)) for k in range(3)]
        while len(written) < 1:
            await asyncio.sleep(0)
        tasks.append(asyncio.create_task(born.write(_document("t"), who=THERE)))
        for _ in range(200):
            await asyncio.sleep(0)
        assert len(written) == 1
        more.set()
        await asyncio.gather(*tasks)

    asyncio.run(run())
    assert len(written) == 4
    assert max(waiting) == 0


def test_an_address_waits_with_so_many_new_terrains(journal: Journal) -> None:
    """SPEC P531."""

    async def run() -> None:
        born = births.Births(journal, FairThreads(1, "reading"))
        async with born._turns.turn(THERE):
            tasks = [asyncio.create_task(born.write(_document(f"h{k}"), who=HERE)) for k in range(births.WAITING)]
            while len(born._turns._line) < births.WAITING:
                await asyncio.sleep(0)
            with pytest.raises(Full):
                await born.write(_document("more"), who=HERE)
        await asyncio.gather(*tasks)

    asyncio.run(run())


def test_orders_to_all_copies_have_turns_by_address(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P532: one at a time, so many may wait; rooms that an order opens are counted for who gave it."""
    Pupil(teacher, "Ada")
    made = server._server.config.app.state.classes  # type: ignore[union-attr]
    asked: list[Who] = []
    room = made.hub.room

    async def opened(terrain: str, who: Who = SERVER) -> Any:
        asked.append(who)
        return await room(terrain, who)

    monkeypatch.setattr(made.hub, "room", opened)
    assert teacher.ask("restart")[0] == 200
    assert teacher.ask("push")[0] == 200
    assert {who.address for who in asked} == {"127.0.0.1"}

    turns = Turns(classes.ORDERS, 1, classes.ORDERS_WAITING)
    monkeypatch.setattr(made, "_orders", turns)
    turns._line.join("127.0.0.1", Future())  # type: ignore[arg-type]
    turns._line.next()
    for _ in range(classes.ORDERS_WAITING):
        turns._line.join("127.0.0.1", Future())  # type: ignore[arg-type]
    for what, body in (("restart", {}), ("push", {}), ("together", {"numbers": [1]})):
        status, refused = teacher.ask(what, body)
        assert (status, refused["code"]) == (429, "rate_limited"), what
    assert server.http("POST", f"/api/terrains/{teacher.terrain}/classes", {}, teacher.secret)[0] == 429


def test_copies_are_put_together_one_after_another() -> None:
    """SPEC P533: as soon as they are too many it ends; none is held that is not in it."""
    start = _document("start")
    made = merge.Together(start)
    made.add(_document("a", c.MAX_STROKES).strokes)
    made.add(_document("b", c.MAX_STROKES).strokes)
    assert len(made.document("t").strokes) == c.MAX_STROKES
    looked = 0

    def different() -> Iterator[c.Stroke]:
        nonlocal looked
        for stroke in _document("c", c.MAX_STROKES).strokes:
            looked += 1
            yield stroke.model_copy(update={"last": (8.0, 0.0, 0.0)})

    with pytest.raises(Refusal):
        made.add(different())
    assert looked == 1


def test_deleted_classes_of_a_terrain_have_a_bound(server: LiveServer, teacher: Teacher) -> None:
    """SPEC P534: making and deleting adds up to no more rows than that; deleted at once none stays."""
    path = f"/api/terrains/{teacher.terrain}/classes"
    answers = []
    for _ in range(classes.MOST_KEPT + 1):
        answers.append(server.http("POST", path, {}, teacher.secret))
        if answers[-1][0] == 201:
            assert server.http("DELETE", f"{path}/{answers[-1][1]['id']}", secret=teacher.secret)[0] == 200
    assert [status for status, _ in answers].count(201) == classes.MOST_KEPT - 1, "one was made before"
    assert answers[-1][1]["code"] == "too_many_classes"
    assert len(server.http("GET", path, secret=teacher.secret)[1]) == classes.MOST_KEPT
    made = answers[0][1]["id"]
    assert server.http("DELETE", f"{path}/{made}?at_once=true", secret=teacher.secret)[0] == 200
    assert made not in {each["id"] for each in server.http("GET", path, secret=teacher.secret)[1]}
    assert server.http("POST", path, {}, teacher.secret)[0] == 201


def test_classes_of_one_address_have_a_rate(server: LiveServer, teacher: Teacher) -> None:
    """SPEC P534: each counts as a new terrain, however many terrains they are made from."""
    state: Any = server._server.config.app.state  # type: ignore[union-attr]
    state.new_terrains = Rates(Rate(0.0, 3.0))
    answers = []
    for _ in range(5):
        terrain, secret = server.create()
        answers.append(server.http("POST", f"/api/terrains/{terrain}/classes", {}, secret)[0])
    assert answers == [201, 201, 201, 429, 429]
    refused = Pupil(teacher, "Ada")
    assert (refused.status, refused.got["code"]) == (429, "rate_limited"), "a copy is a new terrain too"


def test_a_class_without_copies_goes_after_its_grace(server: LiveServer, teacher: Teacher) -> None:
    """SPEC J452: not before, and not because another terrain goes."""
    path = f"/api/terrains/{teacher.terrain}/classes/{teacher.made['id']}"
    assert server.http("DELETE", path, secret=teacher.secret)[0] == 200
    other = Teacher(server)
    Pupil(other, "Ada")
    assert server.http("DELETE", f"{other.path}?at_once=true", secret=other.secret)[0] == 200
    store = server._server.config.app.state.classes.store  # type: ignore[union-attr]
    ended = store.find(teacher.made["id"]).ended
    journal = server.assembly.hub.journal
    journal.submit(lambda db: forget_empty(db, ended)).result()
    assert store.find(teacher.made["id"]) is not None
    journal.submit(lambda db: forget_empty(db, ended + 1)).result()
    assert store.find(teacher.made["id"]) is None


def test_a_seat_whose_secret_is_another_link_s(server: LiveServer, teacher: Teacher) -> None:
    """SPEC P535: it is refused with a sentence, and no copy is made."""
    refused = Pupil(teacher, "Ada", seat=teacher.secret)
    assert (refused.status, refused.got["code"]) == (409, "secret_taken")
    assert teacher.told()["copies"] == 0


def test_a_teacher_opens_a_copy_until_it_has_too_many_links(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P535: also to show it."""
    Pupil(teacher, "Ada")
    monkeypatch.setattr("esker.store.access.MAX_LINKS", 3)
    answers = [teacher.ask("open", {"number": 1}) for _ in range(3)]
    assert [status for status, _ in answers] == [201, 201, 409]
    assert answers[-1][1]["code"] == "too_many_links"
    assert teacher.ask("show", {"number": 1})[1]["code"] == "too_many_links"


def test_numbers_of_copies_stay_within_their_bound(server: LiveServer, teacher: Teacher) -> None:
    """SPEC P535: the number of one that is gone for good is given again."""
    pupils = [Pupil(teacher, f"P{n}") for n in range(3)]
    deletion = server.assembly.hub.deletion
    journal = server.assembly.hub.journal

    def gone(db: Any) -> None:
        db.execute("UPDATE terrains SET deleted=0 WHERE id=?", (pupils[1].terrain,))

    journal.submit(gone).result()
    assert deletion.remove_old() == [pupils[1].terrain]
    assert Pupil(teacher, "New", seat=secrets.token_urlsafe(24)).got["number"] == 2
