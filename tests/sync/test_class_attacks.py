"""Classes under attack, by whoever may make them: what a class costs is its teacher's own (SPEC P531 to P535, J452)."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.document.ops import Refusal
from esker.fairness.shares import Full, Rate, Rates, Share, Who
from esker.fairness.turns import SERVER, Turns
from esker.lesson import classes, collect, merge, wall
from esker.session.ground.client import Client
from esker.session.ground.jobs import Job
from esker.session.ground.worker import Worker
from esker.store.access import Link
from esker.store.classes import forget_empty
from tests.sync.harness import PATIENCE, LiveServer, stroke
from tests.sync.test_births import document_of
from tests.sync.test_classes import Pupil, Teacher
from tests.sync.test_wall import Wall


@pytest.fixture(name="teacher")
def _teacher(server: LiveServer) -> Teacher:
    state: Any = server.state
    for name in ("new_terrains", "code_tries", "new_links", "class_asks", "exports"):
        setattr(state, name, Rates())
    return Teacher(server)


def test_orders_to_all_copies_have_turns_by_address(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P532: one at a time, so many may wait; rooms that an order opens are counted for who gave it."""
    ada = Pupil(teacher, "Ada")
    made = server.state.classes
    asked: list[Who] = []
    room = made.hub.room

    async def opened(terrain: str, who: Who = SERVER, **more: bool) -> Any:
        asked.append(who)
        return await room(terrain, who, **more)

    monkeypatch.setattr(made.hub, "room", opened)
    own = server.join(teacher.terrain, teacher.secret, "t")
    own.ops(("t:1", stroke("s1")), ("t:2", {"type": "stroke.finish", "stroke": "s1"}))
    own.wait("ack")
    asked.clear()
    assert teacher.ask("push") == (200, {"changed": 1})
    assert [who.address for who in asked] == ["127.0.0.1"]
    assert server.http("GET", f"/api/terrains/{ada.terrain}/document", secret=ada.seat)[1]["strokes"]

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


def test_a_copy_for_which_an_order_has_nothing_is_not_opened(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P669: orders to copies that were as they should be opened twenty rooms a second, in the event loop."""
    ada, ben = Pupil(teacher, "Ada"), Pupil(teacher, "Ben")
    with_ada = ada.join("ada1")
    with_ada.ops(("ada1:1", stroke("s1")))
    with_ada.wait("ack")
    hub = server.state.classes.hub
    opened: list[str] = []
    before = hub._open

    async def opening(terrain: str, who: Who) -> Any:
        opened.append(terrain)
        return await before(terrain, who)

    monkeypatch.setattr(hub, "_open", opening)
    assert teacher.ask("push") == (200, {"changed": 0})
    assert teacher.ask("restart") == (200, {"changed": 1})
    assert opened == [], "Ada's was open, Ben's is as it began"
    with_ben = ben.join("ben1")
    with_ben.ops(("ben1:1", stroke("s2")))
    with_ben.wait("ack")
    with_ben.close()
    deadline = time.monotonic() + PATIENCE
    while not hub.sleep(ben.terrain) and time.monotonic() < deadline:
        time.sleep(0.02)
    opened.clear()
    assert teacher.ask("restart") == (200, {"changed": 1})
    assert opened == [ben.terrain], "who drew and left has theirs opened"


def test_an_order_rests_after_each_copy_beside_people_of_another_address(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P670: what orders read held the interpreter a third of the time, and nothing paced it."""
    for name in ("Ada", "Ben"):
        Pupil(teacher, name)
    made = server.state.classes
    assert not made._is_shared("127.0.0.1"), "nobody of another address is there"
    rested: list[tuple[str, float]] = []
    rest = made._rest

    async def resting(who: Who, took: float) -> None:
        rested.append((who.home, took))
        await rest(who, took)

    monkeypatch.setattr(made, "_rest", resting)
    assert teacher.ask("restart") == (200, {"changed": 0})
    assert teacher.ask("together", {"numbers": [1, 2]})[0] == 201
    assert [home for home, _ in rested] == ["127.0.0.1"] * 4
    assert min(took for _, took in rested) > 0

    def seconds() -> float:
        began = time.monotonic()
        asyncio.run(rest(Who("127.0.0.1"), 0.1))
        return time.monotonic() - began

    monkeypatch.setattr(made, "_is_shared", {"127.0.0.1"}.__contains__)
    assert seconds() >= classes.ORDER_REST * 0.1
    monkeypatch.setattr(made, "_is_shared", lambda _: False)
    assert min(seconds() for _ in range(5)) < classes.ORDER_REST * 0.1


def test_what_is_written_where_nobody_looks_is_solved_when_somebody_does(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P663: an order to sixty copies had each of them solved, for nobody, beside everybody who drew."""
    ada, ben = Pupil(teacher, "Ada"), Pupil(teacher, "Ben")
    asked: list[int] = []
    request = Worker.request

    def noted(worker: Worker, client: Client, job: Job) -> None:
        asked.append(len(job.strokes))
        request(worker, client, job)

    own = server.join(teacher.terrain, teacher.secret, "t")
    own.ops(("t:1", stroke("s1")), ("t:2", {"type": "stroke.finish", "stroke": "s1"}))
    own.wait("ack")
    with_ben = ben.join("ben1")
    with_ben.settled(0)
    monkeypatch.setattr(Worker, "request", noted)
    assert teacher.ask("push") == (200, {"changed": 2})
    with_ben.at_rest(1)
    assert asked == [1], "Ben looks, nobody else does"
    with_ada = ada.join("ada1")
    with_ada.at_rest(1)
    assert asked == [1, 1]


def test_a_room_is_attended_from_the_first_who_comes_to_the_last_who_leaves(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P664: a copy that is collected is nobody's to wait for."""
    told: list[bool] = []
    attend = Worker.attend

    def noted(worker: Worker, client: Client, by_somebody: bool) -> None:
        told.append(by_somebody)
        attend(worker, client, by_somebody)

    ada = Pupil(teacher, "Ada")
    monkeypatch.setattr(Worker, "attend", noted)
    status, begun = teacher.ask("collections")
    assert status == 202
    while server.http("GET", f"{teacher.path}/collections/{begun['id']}", secret=teacher.secret)[1]["stage"] != "done":
        time.sleep(0.02)
    assert set(told) == {False}, "Ada is not there yet"
    told.clear()
    first, second = ada.join("ada1"), ada.join("ada2")
    second.settled(0)
    assert told == [False, True, True]
    first.close()
    second.close()
    deadline = time.monotonic() + PATIENCE
    while told[-1] and time.monotonic() < deadline:
        time.sleep(0.01)
    assert told == [False, True, True, False]
    assert server.http("DELETE", teacher.path, secret=teacher.secret)[0] == 200, "others collect on this server, too"


def test_copies_are_put_together_one_after_another() -> None:
    """SPEC P533: as soon as they are too many it ends; none is held that is not in it."""
    start = document_of("start")
    made = merge.Together(start)
    made.add(document_of("a", c.MAX_STROKES).strokes)
    made.add(document_of("b", c.MAX_STROKES).strokes)
    assert len(made.document("t").strokes) == c.MAX_STROKES
    looked = 0

    def different() -> Iterator[c.Stroke]:
        nonlocal looked
        for each in document_of("c", c.MAX_STROKES).strokes:
            looked += 1
            yield each.model_copy(update={"last": (8.0, 0.0, 0.0)})

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
    state: Any = server.state
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
    store = server.state.classes.store
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


def _wall(teacher: Teacher) -> Wall:
    told = {"terrain": teacher.terrain, "secret": teacher.secret, "lesson": teacher.made["id"]}
    return Wall(teacher.server, **told)


def test_walls_have_a_share_by_address_and_count_as_pages(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P539: one too many is closed, and so is one that comes too fast; who leaves gives its place back."""
    monkeypatch.setattr(wall, "WALLS", Share(4, address=2))
    walls = wall.Walls(server.state.classes)
    who = Who("192.0.2.1", "link")
    with walls.watching("c", who), walls.watching("c", Who("192.0.2.1", "other")):
        with pytest.raises(Full), walls.watching("c", who):
            pass
        walls._heard("c")
        walls._heard("of nobody")
        assert walls.stale == {"c": 1}
    assert (len(walls.places), walls.stale) == (0, {})

    rates = Rates(Rate(0.0, 1.0))
    monkeypatch.setattr(server.assembly.hub.door, "_hellos", rates)
    first = _wall(teacher)
    first.until(lambda: first.state)
    assert _wall(teacher).closed() == c.WS_CLOSE["rate_limited"]
    first.ws.close()


def test_walls_rest_by_what_they_took(server: LiveServer) -> None:
    """SPEC P539: all of one address take a tenth of the event loop, and all of the server a third."""
    walls = wall.Walls(server.state.classes)
    here = [Who("192.0.2.1", f"l{k}") for k in range(5)]
    with ExitStack() as held:
        for who in here:
            held.enter_context(walls.watching("c", who))
        for k in range(20):
            held.enter_context(walls.watching("c", Who(f"192.0.2.{10 + k}")))
        assert walls.rest(here[0], 0.02) == pytest.approx(0.02 * wall.ALL * 25)
        assert len(here) * 0.02 / (0.02 + walls.rest(here[0], 0.02)) <= 1 / wall.MINE
    with walls.watching("c", here[0]):
        assert walls.rest(here[0], 0.0001) == wall.TURN_SECONDS


def test_walls_rest_by_how_long_they_held_the_loop_up(
    server: LiveServer, teacher: Teacher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P539: a question to the database takes little processor time, and long beside threads that compute."""
    rests: list[float] = []
    door, rest = server.assembly.hub.door, wall.Walls.rest
    demand = door.demand

    def slow(link: Link) -> None:
        time.sleep(0.03)
        demand(link)

    def noted(self: wall.Walls, who: Who, held: float) -> float:
        rests.append(held)
        return rest(self, who, held)

    monkeypatch.setattr(door, "demand", slow)
    monkeypatch.setattr(wall.Walls, "rest", noted)
    shown = _wall(teacher)
    deadline = time.monotonic() + PATIENCE
    while not rests:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert min(rests) >= 0.03
    shown.ws.close()


def test_a_copy_that_a_wall_had_opened_sleeps_when_the_wall_goes(server: LiveServer, teacher: Teacher) -> None:
    """SPEC P539: nothing stays open of a wall that is gone in the middle of waking them."""
    copies = [Pupil(teacher, f"P{k}").terrain for k in range(3)]
    hub = server.assembly.hub
    gone = _wall(teacher)
    gone.until(lambda: len(gone.copies) == 3)
    gone.ws.close()
    deadline = time.monotonic() + PATIENCE
    while any(hub.open_room(copy) is not None for copy in copies) or teacher.made["id"] in _walls(server)._watched:
        assert time.monotonic() < deadline
        server.http("GET", "/healthz")


def _walls(server: LiveServer) -> Any:
    heard = server.state.classes.hear
    return next(each.__self__ for each in heard if isinstance(getattr(each, "__self__", None), wall.Walls))


def test_collections_have_a_share_by_address_and_link(server: LiveServer, teacher: Teacher) -> None:
    """SPEC P540: one address leaves some to others; a newer one of a class takes the place of the one before."""
    answers = [teacher.ask("collections") for _ in range(1)]
    for _ in range(collect.KEPT.most("address")):
        other = Teacher(server)
        answers.append(other.ask("collections"))
    assert [status for status, _ in answers] == [202] * collect.KEPT.most("address") + [503]
    assert "for your address" in answers[-1][1]["message"]
    path = f"{teacher.path}/collections/{answers[0][1]['id']}"
    while server.http("GET", path, secret=teacher.secret)[1]["stage"] != "done":
        pass
    again = teacher.ask("collections")
    assert again[0] == 202
    assert server.http("GET", path, secret=teacher.secret)[0] == 404
    assert server.http("DELETE", teacher.path, secret=teacher.secret)[0] == 200
    assert other.ask("collections")[0] == 202, "its place is free again"


def test_a_collection_has_a_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P540: told in a sentence, and nothing is left of it."""
    monkeypatch.setattr(collect, "MOST_BYTES", 100)
    with LiveServer(tmp_path) as server:
        teacher = Teacher(server)
        Pupil(teacher, "Ada")
        _, job = teacher.ask("collections")
        path = f"{teacher.path}/collections/{job['id']}"
        while (told := server.http("GET", path, secret=teacher.secret)[1])["stage"] not in ("done", "failed"):
            pass
        assert (told["stage"], told["text"]) == ("failed", collect.TOO_LARGE)
        assert not list((tmp_path / "collections").iterdir())
