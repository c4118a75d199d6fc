"""Conductors' messages, carried out: the state of the lesson into the journal, and to everybody (DESIGN 19).

``session/lesson/rules.py`` has the rules. What is switched is enforced at once and told when it is in the journal;
where it cannot be written it holds as long as the server runs, and whoever switched it is told that.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Iterable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from esker import contract as c
from esker.contract import Role
from esker.document.ops import Refusal
from esker.document.takeback import Deeds, outcome
from esker.fairness.shares import Who, homes
from esker.session.lesson.notices import notice
from esker.session.lesson.rules import REMOVED
from esker.session.lesson.state import Removed, State
from esker.session.room.core import RoomCore
from esker.session.room.entry import Denied
from esker.session.room.members import Member
from esker.session.room.ports import Journal
from esker.store.deeds import read_deeds
from esker.store.journal import DamagedTerrain

log = logging.getLogger("esker.lesson")

GRACE_SECONDS: Final = 10.0
"""A conductor whose view all follow, and whose page reloads, goes on showing if they are back within this."""
MOST_GONE: Final = 200
"""People who left and of whom a room remembers how they came, so that they can be removed."""
TELL_SECONDS: Final = 0.25
"""Everybody is told how the lesson stands at most this often, the first time at once; conductors, who waits to be let
in: a lesson may be switched, and who was removed may knock, hundreds of times a second."""
KEEP_SECONDS: Final = 0.1
"""How a lesson stands is written at most this often, the first time at once: a state of a hundred kilobytes in each
commit would make everybody's strokes wait for it."""


@dataclass(frozen=True)
class Desk:
    """What a room asks of its server. ``read`` runs work in a thread, for an address; ``end_link`` ends a link that a
    join code made for one device; ``now``: seconds since 1970."""

    read: Callable[[Who, Callable[[], Deeds]], Awaitable[Deeds]]
    end_link: Callable[[str], object]
    now: Callable[[], float] = time.time


@dataclass(frozen=True)
class _Gone:
    """How somebody who left had come."""

    name: str
    role: Role
    person: str
    link: str
    address: str


class Conducting:
    """The lesson of one room, towards its members and the journal."""

    def __init__(
        self,
        core: RoomCore,
        journal: Journal,
        loop: asyncio.AbstractEventLoop,
        desk: Desk | None,
        *,
        ordered: Callable[[], None],
        flush: Callable[[], Awaitable[None] | None],
        people_changed: Callable[[], None],
    ) -> None:
        """``ordered``: called when ops were; ``flush``: waits until they are in the journal, None where the room is
        gone; ``people_changed``: the list of members is to be told anew."""
        self._core, self._journal, self._loop, self._desk = core, journal, loop, desk
        self._ordered, self._flush, self._people_changed = ordered, flush, people_changed
        self._gone: OrderedDict[str, _Gone] = OrderedDict()
        self._undoing: asyncio.Task[None] | None = None
        self._grace: asyncio.TimerHandle | None = None
        self._telling: asyncio.TimerHandle | None = None
        self._notified_at = float("-inf")
        self._all = self._some = False
        """Whether everybody is to be told next, or conductors alone."""
        self._keeping = False
        """Whether a state of the lesson is being written, or waits for its time."""
        self._kept_at = float("-inf")
        self._kept_late: list[Member] = []
        """Who switched since that was begun: the newest state is written after it, once."""
        self._is_newer = False
        if core.lesson.state.look is not None:
            self._grace = loop.call_later(GRACE_SECONDS, self._end_look)

    # --- people come and go -------------------------------------------------------------------------------------

    def joined(self, member: Member) -> None:
        """Somebody came in: whose view all followed goes on showing."""
        self._gone.pop(member.person, None)
        lesson = self._core.lesson
        if lesson.state.animals and member.role != "view" and member.person not in lesson.state.named:
            lesson.state = lesson.with_names()  # so that they are called the same after a restart
            self._keep(())
        if self._core.look is None and self._core.lesson.state.look == member.person:
            self._stop_grace()
            self._core.look = member.client
            self.tell()

    def left(self, member: Member) -> None:
        """Somebody left: who showed has a while to come back."""
        self._gone[member.person] = _Gone(member.name, member.role, member.person, member.link, member.address)
        while len(self._gone) > MOST_GONE:
            self._gone.popitem(last=False)
        if self._core.look == member.client and member.client not in self._core.members.by_client:
            self._core.look = next((m.client for m in self._core.members if m.person == member.person), None)
            if self._core.look is None:
                self._stop_grace()
                self._grace = self._loop.call_later(GRACE_SECONDS, self._end_look)
            self.tell()

    def _end_look(self) -> None:
        self._grace = None
        if self._core.look is None and self._core.lesson.state.look is not None:
            self._change(self._core.lesson.state.model_copy(update={"look": None, "held": False}), None)

    def _stop_grace(self) -> None:
        if self._grace is not None:
            self._grace.cancel()
            self._grace = None

    def somebody_waits(self) -> None:
        """Somebody asks to be let in: conductors are told."""
        self._some = True
        self._tell_soon()

    def tell(self) -> None:
        """Tells everybody how the lesson stands."""
        self._all = True
        self._tell_soon()

    def _tell_soon(self) -> None:
        if self._telling is None:
            wait = self._notified_at + TELL_SECONDS - self._loop.time()
            if wait <= 0:
                self._tell_now()
            else:
                self._telling = self._loop.call_later(wait, self._tell_now)

    def _tell_now(self) -> None:
        """Tells whom it concerns; where a state is being written that they do not know, once it is."""
        self._telling = None
        if self._keeping:
            return
        everybody, self._all, self._some, self._notified_at = self._all, False, False, self._loop.time()
        for member in self._core.members:
            if everybody or self._core.lesson.conducts(member):
                member.outbox.message(self._core.lesson_for(member))

    # --- what conductors say ------------------------------------------------------------------------------------

    def receive(self, member: Member, message: c.Conduct | c.People | c.Grouping) -> None:
        """Does what a member asks, if they may."""
        if not self._core.lesson.conducts(member):
            member.outbox.message(notice("not_leading"))
            return
        if isinstance(message, c.Conduct):
            self._switch(member, message)
        elif isinstance(message, c.Grouping):
            self._group(member, message)
        elif message.action == "undo":
            self._undo(member, message.people)
        elif message.action == "remove":
            self._remove(member, message.people)
        elif message.action in ("conductor", "no_conductor") and member.role != "owner":
            member.outbox.message(notice("owners_only"))
        else:
            self._change(self._core.lesson.turned(message), member)

    def _switch(self, member: Member, message: c.Conduct) -> None:
        state = self._core.lesson.switched(message, member)
        if message.look is not None:
            self._stop_grace()
            self._core.look = member.client if message.look else None
        self._change(state, member)
        if state.hands_off:
            self._finish_what_is_in_hand()

    def _group(self, member: Member, message: c.Grouping) -> None:
        """Changes groups. Who is in which is told to conductors alone; everybody hears of it only where pens change."""
        lesson = self._core.lesson
        state = lesson.grouped(message)
        if isinstance(state, str):
            member.outbox.message(notice(state))
        elif state.pens != lesson.state.pens:
            self._change(state, member)
        elif state.groups != lesson.state.groups:
            lesson.state = state
            self._some = True
            self._keep((member,))

    def _change(self, state: State, by: Member | None) -> None:
        """The lesson stands so from now on."""
        lesson = self._core.lesson
        lesson.state = state
        if not state.removed:
            lesson.waiting.clear()  # the door is open to all
        if self._core.look is not None and state.look is None:
            self._core.look = None
        self._core.members.switched()
        self._people_changed()
        self._all = True
        self._keep(() if by is None else (by,))

    def _keep(self, by: Iterable[Member]) -> None:
        """Writes how the lesson stands. However often it is switched, one state is being written and the newest waits:
        people are told when what they switched is written, or something newer."""
        self._kept_late += by
        if self._keeping:
            self._is_newer = True
            return
        self._keeping = True
        wait = self._kept_at + KEEP_SECONDS - self._loop.time()
        if wait > 0:
            self._loop.call_later(wait, self._write)
        else:
            self._write()

    def _write(self) -> None:
        self._is_newer, self._kept_at = False, self._loop.time()
        asked, self._kept_late = self._kept_late, []
        future = self._journal.keep_lesson(self._core.document.id, self._core.lesson.state.model_dump_json())
        future.add_done_callback(lambda done: self._loop.call_soon_threadsafe(self._kept, done, asked))

    def _kept(self, future: Future[None], by: Iterable[Member]) -> None:
        self._keeping = False
        error = future.exception()
        if error is not None:
            log.error("terrain %s: the state of its lesson was not saved: %s", self._core.document.id, error)
            for member in dict.fromkeys(by):
                member.outbox.message(notice("unsaved"))
        if self._is_newer:
            self._keep(())
        elif self._all or self._some:
            self._tell_soon()

    def _finish_what_is_in_hand(self) -> None:
        """Strokes that are being drawn end as they are. They stay their authors', who may undo them."""
        core = self._core
        for client, strokes in core.lesson.in_hand().items():
            author = core.members.by_client.get(client)
            if author is not None and core.lesson.draws(author):
                continue
            alive = [each for each in strokes if each in core.head.strokes]
            for start in range(0, len(alive), c.MAX_OPS_PER_GROUP):
                parts = tuple(c.FinishStroke(stroke=each) for each in alive[start : start + c.MAX_OPS_PER_GROUP])
                with suppress(Refusal):
                    core.perform(c.Group(ops=parts), _agent(), client)
        self._ordered()

    # --- removing -----------------------------------------------------------------------------------------------

    def _remove(self, by: Member, people: Iterable[str]) -> None:
        core, lesson = self._core, self._core.lesson
        out: list[Removed] = []
        links: set[str] = set()
        for person in dict.fromkeys(people):
            here = [m for m in core.members if m.person == person]
            ways: list[Member | _Gone] = [*here, *([self._gone[person]] if person in self._gone else [])]
            if not ways:
                by.outbox.message(notice("nobody"))
                continue
            if any(way.role == "owner" for way in ways) or person == by.person:
                by.outbox.message(notice("not_owners" if person != by.person else "not_yourself"))
                continue
            if by.role != "owner" and person in lesson.state.conductors:
                by.outbox.message(notice("not_leaders"))
                continue
            now = int((self._desk.now() if self._desk is not None else time.time()) * 1000)
            addresses = {homes(way.address)[0] for way in ways}
            out += [Removed(person=person, name=ways[0].name, address=each, at=now) for each in addresses]
            links |= {way.link for way in ways}
        if not out:
            return
        self._change(lesson.sent_out(out), by)
        gone = {each.person for each in out}
        for member in core.members:
            if member.person in gone:
                member.outbox.close("removed", REMOVED)
        if self._desk is not None:
            for link in links:
                self._desk.end_link(link)

    # --- taking back --------------------------------------------------------------------------------------------

    def _undo(self, by: Member, people: tuple[str, ...]) -> None:
        if self._desk is None or (self._undoing is not None and not self._undoing.done()):
            by.outbox.message(notice("undo_busy"))
            return
        self._undoing = asyncio.ensure_future(self._take_back(by, people, self._desk))

    async def _flushed(self) -> None:
        waiting = self._flush()
        if waiting is not None:
            await waiting

    async def _take_back(self, by: Member, people: tuple[str, ...], desk: Desk) -> None:
        core = self._core
        here = {m.client for m in core.members if m.person in people}
        clients = sorted(core.lesson.clients_of(people) | here)
        await self._flushed()
        try:
            who = Who(by.address, by.link)
            deeds = await desk.read(who, lambda: read_deeds(self._journal, core.document.id, clients))
        except (DamagedTerrain, Denied) as error:
            log.error("terrain %s: nothing was taken back: %s", core.document.id, error)
            by.outbox.message(notice("unreadable"))
            return
        result = deeds.plan(core.head)
        said, agent = outcome(result), _agent()
        try:
            for number, op in enumerate(result.ops):
                core.perform(op, agent, by.client, number)
        except Refusal as refusal:
            log.warning("terrain %s: not all was taken back: %s", core.document.id, refusal.message)
            said = "refused"
        self._ordered()
        await self._flushed()
        names = {m.name for m in core.members if m.person in people} | {
            self._gone[each].name for each in people if each in self._gone
        }
        by.outbox.message(notice(said, names))

    def close(self) -> None:
        """Stops the timer, and what is being taken back."""
        self._stop_grace()
        if self._telling is not None:
            self._telling.cancel()
        if self._undoing is not None:
            self._undoing.cancel()


def _agent() -> str:
    """An id under which the server does something for the lesson."""
    return f"lesson-{secrets.token_hex(8)}"
