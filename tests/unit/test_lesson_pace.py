"""What a lesson costs its server has a bound, however fast it is switched (SPEC P536 to P538, P542)."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import pytest

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet
from esker.document.takeback import Deeds
from esker.document.undo import UndoPlan
from esker.fairness.shares import Who
from esker.session.lesson.notices import SENTENCES
from esker.session.lesson.rules import Lesson
from esker.session.lesson.state import MOST, Removed, State
from esker.session.room import conducting, protocol
from esker.session.room.conducting import Conducting, Desk
from esker.session.room.core import RoomCore, RoomInfo
from esker.session.room.members import LIST_SECONDS, Members
from esker.session.room.outbox import Outbox
from esker.store.journal import Loaded


class Loop:
    """An event loop whose time a test sets. Timers wait until ``at`` is called."""

    def __init__(self) -> None:
        self.now = 100.0
        self.timers: list[tuple[float, Callable[[], None]]] = []

    def time(self) -> float:
        return self.now

    def call_later(self, wait: float, call: Callable[[], None]) -> asyncio.TimerHandle:
        self.timers.append((self.now + wait, call))
        return None  # type: ignore[return-value]

    def call_soon_threadsafe(self, call: Callable[..., None], *arguments: Any) -> None:
        call(*arguments)

    def at(self, now: float) -> None:
        self.now = now
        due, self.timers = self.timers, []
        for when, call in due:
            if when <= now:
                call()


class Journal:
    """Writes when a test says so."""

    def __init__(self) -> None:
        self.written: list[tuple[str, Future[None]]] = []

    def keep_lesson(self, terrain: str, state: str) -> Future[None]:  # noqa: ARG002
        self.written.append((state, Future()))
        return self.written[-1][1]


class Room:
    """A room with an owner and a viewer, without timers of its own."""

    def __init__(self) -> None:
        self.loop, self.journal = Loop(), Journal()
        self.core = RoomCore(Loaded(StrokeSet("t"), [], {}), lambda *_: None)
        made: Any = Conducting
        self.conducting: Conducting = made(
            self.core, self.journal, self.loop, None,
            ordered=lambda: None, flush=lambda: None, people_changed=lambda: None,
        )  # fmt: skip
        self.owner, self.viewer = self.join("owner"), self.join("view")

    def join(self, role: c.Role) -> Any:
        hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client=f"c-{role}")
        return self.core.join(hello, role, role, Outbox(lambda: None), RoomInfo(1, 1, ""), "192.0.2.7")

    def told(self, member: Any) -> list[dict[str, Any]]:
        texts = iter(member.outbox.pop, None)
        return [said for text in texts if (said := json.loads(str(text)))["type"] == "lesson"]


def test_one_state_is_written_at_a_time_and_the_newest_is_next() -> None:
    """SPEC P536: people are told of what is written, once; the last switch counts."""
    room = Room()
    for k in range(100):
        room.conducting.receive(room.owner, c.Conduct(hands_off=k % 2 == 0, protect=True))
    assert len(room.journal.written) == 1
    assert room.told(room.viewer) == []
    room.journal.written[0][1].set_result(None)
    assert len(room.journal.written) == 1, "ten times a second, whatever others write meanwhile"
    room.conducting.receive(room.owner, c.Conduct(hands_off=False, protect=True))
    room.loop.at(100.0 + conducting.KEEP_SECONDS)
    assert len(room.journal.written) == 2
    assert room.told(room.viewer) == []
    assert json.loads(room.journal.written[1][0])["hands_off"] is False
    room.journal.written[1][1].set_result(None)
    told = room.told(room.viewer)
    assert [(each["hands_off"], each["protect"]) for each in told] == [(False, True)]
    assert len(room.journal.written) == 2


def test_who_switched_is_told_where_it_was_not_saved() -> None:
    """SPEC P536: also where a newer state was to be written after it."""
    room = Room()
    room.conducting.receive(room.owner, c.Conduct(hands_off=True))
    room.conducting.receive(room.owner, c.Conduct(protect=True))
    for written in range(2):
        room.journal.written[written][1].set_exception(OSError("no"))
        room.loop.at(100.0 + conducting.KEEP_SECONDS)
    said = [json.loads(str(text)) for text in iter(room.owner.outbox.pop, None)]
    assert [each["text"] for each in said if each["type"] == "notice"] == [SENTENCES["unsaved"]] * 2
    assert [each["hands_off"] for each in said if each["type"] == "lesson"] == [True]


def test_everybody_is_told_at_a_pace() -> None:
    """SPEC P536: the first time at once."""
    room = Room()
    for k in range(10):
        room.conducting.receive(room.owner, c.Conduct(hands_off=k % 2 == 0))
        if k == 0:
            room.journal.written[-1][1].set_result(None)
    room.loop.at(100.0 + conducting.KEEP_SECONDS)
    room.journal.written[-1][1].set_result(None)
    assert [each["hands_off"] for each in room.told(room.viewer)] == [True]
    room.loop.at(100.0 + conducting.TELL_SECONDS)
    assert [each["hands_off"] for each in room.told(room.viewer)] == [False]
    room.loop.at(200.0)
    assert room.told(room.viewer) == []


def test_only_conductors_hear_of_groups_unless_pens_change() -> None:
    """SPEC L161: once the groups are written down."""
    room = Room()
    orders = (
        (c.Grouping(group="red", name="Red", put=("anne",)), 0),
        (c.Grouping(group="red", put=("anne",)), None),
        (c.Grouping(group="red", pen=True), 1),
        (c.Grouping(group="red", name="Rot"), 0),
    )
    for at, (order, heard) in enumerate(orders):
        written = len(room.journal.written)
        room.conducting.receive(room.owner, order)
        if heard is None:
            assert len(room.journal.written) == written, "nothing is new"
            continue
        assert room.told(room.owner) == []
        room.journal.written[-1][1].set_result(None)
        room.loop.at(101.0 + at)
        assert [len(each["groups"]) for each in room.told(room.owner)] == [1]
        assert [each["groups"] for each in room.told(room.viewer)] == [[]] * heard
    room.conducting.receive(room.viewer, c.Grouping(group="blue", name="Blue"))
    assert [each.id for each in room.core.lesson.state.groups] == ["red"]


def test_only_conductors_hear_who_knocks_and_at_a_pace() -> None:
    """SPEC P537: who was removed may knock hundreds of times."""
    room = Room()
    room.told(room.viewer)
    for k in range(300):
        room.core.lesson.waits(f"p{k}", "x" * c.MAX_NAME_LENGTH)
        room.conducting.somebody_waits()
    assert len(room.told(room.owner)) == 1
    assert room.told(room.viewer) == []
    room.loop.at(101.0)
    assert len(room.told(room.owner)[0]["waiting"]) == 50


def test_a_state_has_a_size() -> None:
    """SPEC P536: whatever is put into every list of it."""
    lesson = Lesson(State())
    for start in range(0, 3 * MOST, c.MAX_PEOPLE):
        people = tuple(f"{k:040}" for k in range(start, start + c.MAX_PEOPLE))
        for action in ("pen", "conductor", "let_in"):
            lesson.state = lesson.turned(c.People(action=action, people=people))
    out = [Removed(person=f"{k:040}", name="\u00e9" * 80, address="2001:db8::/64", at=1) for k in range(3 * MOST)]
    lesson.state = lesson.sent_out(out)
    assert len(lesson.state.removed) == MOST
    assert len(lesson.state.model_dump_json().encode()) < 512 * 1024


def test_names_have_a_rate() -> None:
    """SPEC P538: each is written down and told to all."""
    connection = protocol.Connection(0.0, c.SUBPROTOCOL)
    hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client="c")
    connection.text(hello.model_dump_json(), 0.0)
    events = [event for k in range(60) for event in connection.text(c.Rename(name=f"n{k}").model_dump_json(), 1.0)]
    assert sum(isinstance(event, protocol.Message) for event in events) == protocol.RENAMES_BURST
    assert sum(isinstance(event, protocol.Reply) for event in events) == 1


@pytest.mark.parametrize("hide", [False, True])
def test_a_full_room_is_told_of_its_members_at_a_pace(hide: bool) -> None:
    """SPEC P538: and where names are hidden nobody's list is made of everybody."""
    asked = 0

    class Counting(Lesson):
        def sees(self, who: Any, other: Any) -> bool:
            nonlocal asked
            asked += 1
            return super().sees(who, other)

        def conducts(self, who: Any) -> bool:
            nonlocal asked
            asked += 1
            return super().conducts(who)

    lesson = Counting(State(hide=hide))
    core = RoomCore(Loaded(StrokeSet("t"), [], {}), lambda *_: None, lesson=lesson)
    for k in range(100):
        hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client=f"c{k}")
        core.join(hello, "owner" if k < 2 else "edit", "link", Outbox(lambda: None), RoomInfo(1, 1, ""))
    members: Members = core.members
    for member in members:
        list(iter(member.outbox.pop, None))
        members.moved(member, c.Presence(cursor=(1, 2, 3)))
    asked = 0
    members.tick(1.0)
    assert asked < 10 * len(members)
    last = [json.loads(str(text)) for text in iter(core.members.by_client["c99"].outbox.pop, None)]
    seen = ["c0", "c1", "c99"] if hide else [f"c{k}" for k in range(100)]
    assert [each["client"] for each in last[0]["members"]] == seen
    assert [each["client"] for each in last[1]["members"]] == seen
    members.rename(members.by_client["c0"], "another", None)
    members.tick(1.0 + LIST_SECONDS / 2)
    assert core.members.by_client["c99"].outbox.pop() is None
    assert members.pending
    members.tick(1.0 + LIST_SECONDS)
    assert json.loads(str(core.members.by_client["c99"].outbox.pop()))["members"][0]["name"] == "another"
    assert not members.pending


def conducted(room: Room, read: Any) -> Any:
    """The lesson of a room, in the running loop; ``read`` is how what people did is read."""

    async def flush() -> None:
        pass

    made: Any = Conducting
    return made(
        room.core, room.journal, asyncio.get_running_loop(), Desk(read, lambda _: None),
        ordered=lambda: None, flush=flush, people_changed=lambda: None,
    )  # fmt: skip


def test_who_asked_is_told_where_not_all_could_be_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC L165: nobody is told that everything was taken back where an op was refused on the way."""
    room = Room()

    async def read(who: Who, work: Callable[[], Deeds]) -> Any:
        del who, work
        return SimpleNamespace(plan=lambda _: UndoPlan((c.DeleteStroke(stroke="gone"),), ()))

    async def run() -> None:
        conducting = conducted(room, read)
        conducting.receive(room.owner, c.People(action="undo", people=("somebody",)))
        await asyncio.sleep(0.05)
        conducting.close()

    def refused(*_: object) -> None:
        raise Refusal("unknown_stroke", "There is no such stroke.")

    monkeypatch.setattr(room.core, "perform", refused)
    asyncio.run(run())
    said = [json.loads(str(text)) for text in iter(room.owner.outbox.pop, None)]
    assert [each["code"] for each in said if each["type"] == "notice"] == ["refused"]


def test_what_is_read_to_take_back_counts_for_who_asks() -> None:
    """SPEC P542."""
    asked: list[Who] = []

    async def run() -> None:
        room = Room()

        async def read(who: Who, work: Callable[[], Deeds]) -> Deeds:
            asked.append(who)
            return Deeds(())

        conducting = conducted(room, read)
        conducting.receive(room.owner, c.People(action="undo", people=("somebody",)))
        while not asked:
            await asyncio.sleep(0)
        conducting.close()

    asyncio.run(run())
    assert asked == [Who("192.0.2.7", "owner")]
