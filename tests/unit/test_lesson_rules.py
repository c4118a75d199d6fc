"""The rules of a lesson by themselves (SPEC L7, L9, L10, L16, L19)."""

from __future__ import annotations

import json

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.session.lesson import names
from esker.session.lesson.rules import REMOVED, WAIT, Hand, Lesson
from esker.session.lesson.state import MOST, Removed, State, read, with_people, without
from esker.session.room import protocol
from esker.session.room.core import MOST_AGAINST, RoomCore, RoomInfo
from esker.session.room.entry import Caller
from esker.session.room.outbox import Outbox
from esker.store.journal import Loaded


def pupil(person: str, role: c.Role = "edit") -> Caller:
    return Caller(role, person, "", None)


def test_everybody_has_another_animal() -> None:
    """SPEC L19: more people than animals, too; who it is says which."""
    for language in ("en", "de"):
        numbers: list[int] = []
        for k in range(3 * names.COUNT):
            numbers.append(names.choose(f"p{k}", set(numbers)))
        called = [names.animal(each, language) for each in numbers]
        assert len(set(called)) == len(called)
        assert all(len(each) <= c.MAX_NAME_LENGTH for each in called)
    assert names.choose("p1", ()) == names.choose("p1", {names.choose("p1", ()) + 1})


def test_the_door() -> None:
    """SPEC L9, L10."""
    lesson = Lesson(State(removed=(Removed(person="ben", name="Ben", address="192.0.2.7", at=1_000),)))
    assert lesson.door(pupil("ben"), 500, "198.51.100.1") == REMOVED
    assert lesson.door(pupil("new"), None, "192.0.2.7") == WAIT
    assert lesson.door(pupil("young"), 1_000, "192.0.2.7") == WAIT
    assert lesson.door(pupil("old"), 999, "192.0.2.7") is None
    assert lesson.door(pupil("new"), None, "198.51.100.1") is None
    assert lesson.door(pupil("ben", "owner"), 500, "192.0.2.7") is None
    for k in range(200):
        lesson.waits(f"w{k}", "")
    assert len(lesson.waiting) == 50
    lesson.state = lesson.turned(c.People(action="let_in", people=("new", "ben")))
    assert lesson.door(pupil("new"), None, "192.0.2.7") is None
    assert lesson.door(pupil("ben"), 500, "192.0.2.7") is None


class Compared(str):
    """An id that counts with how many others it is compared."""

    compared = 0

    def __eq__(self, other: object) -> bool:
        Compared.compared += 1
        return str.__eq__(self, other)

    __hash__ = str.__hash__


def test_switches_about_people_compare_nobody_with_everybody() -> None:
    """SPEC P640: two hundred people and a thousand who are known were 200,000 comparisons in the event loop."""
    known = tuple(Compared(f"k{n}") for n in range(MOST))
    people = tuple(Compared(f"k{n}") for n in range(900, 1_100))
    Compared.compared = 0
    assert len(with_people(known, people)) == MOST
    assert without(known, people) == known[:900]
    lesson = Lesson(State(removed=tuple(Removed(person=each, name="", address="", at=0) for each in known)))
    lesson.state = lesson.turned(c.People.model_construct(action="let_in", people=people))
    assert len(lesson.state.removed) == 900
    assert Compared.compared < 5 * MOST


def test_what_nobody_is_known_to_have_brought_is_protected() -> None:
    """SPEC L16."""
    hands = {"a": Hand("anne", False), "t": Hand("ray", True)}
    lesson = Lesson(State(protect=True), {"s-anne": "a", "s-ray": "t", "s-lost": "x"}, hands)
    assert [lesson.protected(each) for each in ("s-anne", "s-ray", "s-lost", "s-old")] == [False, True, True, True]


def test_a_state_that_cannot_be_read_switches_nothing() -> None:
    """SPEC L8."""
    whole = State(hands_off=True, pens=("anne",), named={"anne": 3})
    assert read(whole.model_dump_json(), "t") == whole
    for broken in ("", "{", '{"hands_off": 1}', json.dumps({"pens": ["x"] * (MOST + 1)}), None):
        assert read(broken, "t") == State()


def test_lists_of_people_have_a_bound() -> None:
    """SPEC L2: the first are forgotten."""
    known: tuple[str, ...] = ()
    for start in range(0, 2 * MOST, 200):
        known = with_people(known, tuple(f"p{k}" for k in range(start, start + 200)))
    assert len(known) == MOST
    assert known[-1] == f"p{2 * MOST - 1}"
    assert with_people(("a", "b"), ("a",)) == ("b", "a")


def test_switches_have_a_rate() -> None:
    """SPEC L7: the surplus is dropped, with one notice a second."""
    connection = protocol.Connection(0.0, c.SUBPROTOCOL)
    hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client="c")
    connection.text(hello.model_dump_json(), 0.0)
    text = c.Conduct(hands_off=True).model_dump_json()
    events = [event for _ in range(60) for event in connection.text(text, 1.0)]
    assert sum(isinstance(event, protocol.Message) for event in events) == protocol.CONDUCTS_BURST
    assert sum(isinstance(event, protocol.Reply) for event in events) == 1


def test_who_goes_on_in_spite_of_it_is_closed() -> None:
    """SPEC L7: however slowly; one op that is allowed begins the count anew."""
    core = RoomCore(Loaded(StrokeSet("t"), [], {}), lambda *_: None)
    hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client="c")
    outbox = Outbox(lambda: None, now=lambda _: True)
    member = core.join(hello, "edit", "link", outbox, RoomInfo(1, 1, ""))

    def try_(count: int, start: int) -> None:
        for k in range(start, start + count):
            op = c.SetTerrain(fields=c.TerrainFields(title=f"{k}"))
            core.submit(member, [c.OpEnvelope(id=f"c:{k}", op=op)])

    core.lesson.state = State(hands_off=True)
    try_(MOST_AGAINST, 0)
    core.lesson.state = State()
    try_(1, MOST_AGAINST)
    core.lesson.state = State(hands_off=True)
    try_(MOST_AGAINST, MOST_AGAINST + 1)
    assert outbox.closing is None
    assert core.head.clock == 1
    try_(1, 2 * MOST_AGAINST + 1)
    assert outbox.closing is not None
    assert outbox.closing[0] == "rate_limited"
