"""Looking at a terrain as it was (DESIGN 4 "History"): a room for one person, where nothing can be changed.

It is a ``Room`` whose document is that of an earlier clock; solver, tiles and protocol are those of any other. ``seek``
goes to another clock, forward by the journal's ops, backward by a document; the live room never hears of it.
"""

from __future__ import annotations

import asyncio
import logging
from bisect import bisect_right
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Any, Final

from esker import contract as c
from esker.contract import Role
from esker.document.ops import StrokeSet
from esker.fairness.shares import Place, Places, Share, Who
from esker.session.lesson.rules import Lesson
from esker.session.lesson.state import State
from esker.session.progress import GroundProgress
from esker.session.room import protocol
from esker.session.room.core import Denied, RoomCore, RoomInfo
from esker.session.room.members import Member
from esker.session.room.outbox import Long, Outbox
from esker.session.room.ports import Journal
from esker.session.room.replicas import viewing
from esker.session.room.replicas.earlier import EarlierReplica
from esker.session.room.room import Guest, Room
from esker.store.claims import Claims
from esker.store.journal import DamagedTerrain, Loaded, Row, replay

log = logging.getLogger("esker.history")

STEP_CHARACTERS: Final = 128 * 1024
"""A step forward is sent as ops if they have at most so many characters as text, else as a document."""
WAYPOINT_OPS: Final = 200
WAYPOINTS: Final = 64
"""A room keeps so many documents of the clocks it was at, WAYPOINT_OPS apart at least."""
FAR_OPS: Final = 2_000
"""A clock farther than this from any kept document is read from the journal's snapshots."""
BEHIND_SECONDS: Final = 0.05
"""A client that has not taken the last step gets the next one after so many seconds."""
IDLE_CHECKS: Final = 20
IDLE: Final = "You have not looked around here for a while, so the server made room for others."
YIELDED: Final = "Somebody else wants to look at the past, and several do from your address. Try again in a minute."
CROWDED: Final = "As many people as this server allows look at the past just now. Try again in a minute."


class HistoryCore(RoomCore):
    """The document of an earlier clock and the one person who looks at it.

    ``document`` has the clock of the journal. ``head`` is the same under a clock that only ever rises, as solver and
    tiles expect.
    """

    def __init__(
        self,
        loaded: Loaded,
        claims: Claims | None = None,
        still: frozenset[viewing.Key] | None = None,
        hide: bool = False,
    ) -> None:
        """``still``: the things that are there now, where nothing else may be shown; None: everything is;
        ``hide``: without the names of who drew what."""
        lesson = Lesson(State(hide=hide))
        self._then = EarlierReplica(loaded, lesson, still)
        super().__init__(loaded, lambda *_: None, max_members=1, claims=claims, lesson=lesson, replicas=self._then)

    def join(
        self,
        hello: c.Hello,
        role: Role,  # noqa: ARG002
        link: str,
        outbox: Outbox,
        info: RoomInfo,
        address: str = "",  # noqa: ARG002
        asked: int | None = None,  # noqa: ARG002
    ) -> Member:
        """Lets the person in as ``RoomCore.join`` does, but only to look, and always with the whole document."""
        return super().join(hello.model_copy(update={"clock": None}), "view", link, outbox, info)

    @property
    def still(self) -> frozenset[viewing.Key] | None:
        """The things that are there now, where nothing else may be shown."""
        return self._then.still

    @still.setter
    def still(self, still: frozenset[viewing.Key] | None) -> None:
        self._then.turn(still)

    def steps(self, rows: list[Row]) -> list[str] | None:
        """Returns the ops of a step forward as they may be shown; None where only the document will do."""
        if self._then.still is None:
            texts = [row.ordered_json() for row in rows]
            return [viewing.nameless(text) for text in texts] if self.lesson.state.hide else texts
        if not all(viewing.concerns(row.op, self._then.still) for row in rows):
            return None
        return [viewing.nameless(row.ordered_json()) for row in rows]

    def turn_to(self, document: StrokeSet) -> None:
        """Shows the terrain at another clock."""
        before = self.head
        self.document = document
        self.head = replace(document, clock=max(before.clock, document.clock) + 1)
        self.geometry_clock = self.head.clock
        if document.layers_rev != before.layers_rev:
            self.base_clock = self.head.clock

    def welcome(self, member: Member, info: RoomInfo) -> str | Long:
        """Returns the document as a ``welcome``."""
        return self._welcome(member, None, info, exact=True)[0]


class HistoryReader:
    """Documents of one terrain at any clock, out of the journal. For one thread at a time."""

    def __init__(self, journal: Journal, document: StrokeSet) -> None:
        self._journal, self.document = journal, document
        self._waypoints = [document]

    def go(self, clock: int) -> tuple[StrokeSet, list[Row] | None]:
        """The document at ``clock`` (or the newest before), and the ops from the present one, where it is later.

        Raises DamagedTerrain.
        """
        start = self._nearest(clock)
        if start is None:
            found, rows = self._journal.document(self.document.id, clock), None
            if found is None:
                raise DamagedTerrain(f"the journal of {self.document.id} has no beginning")
        else:
            steps = self._journal.steps(start.id, start.clock, clock)
            found, rows = replay(start, steps), steps if start is self.document else None
        self.document = found
        self._keep(found)
        return found, rows

    def _nearest(self, clock: int) -> StrokeSet | None:
        """Returns the document to replay from; None where a snapshot of the journal may be nearer."""
        known = [self.document, *self._waypoints]  # of equal clocks the first: steps go on from the present document
        best = max((d for d in known if d.clock <= clock), key=lambda d: d.clock, default=None)
        return best if best is not None and clock - best.clock <= FAR_OPS else None

    def _keep(self, document: StrokeSet) -> None:
        at = bisect_right(self._waypoints, document.clock, key=lambda d: d.clock)
        around = self._waypoints[max(0, at - 1) : at + 1]
        if all(abs(d.clock - document.clock) >= WAYPOINT_OPS for d in around):
            self._waypoints.insert(at, document)
        if len(self._waypoints) > WAYPOINTS:
            del self._waypoints[1::2]


class HistoryProgress(GroundProgress):
    """The progress of an earlier clock: by the journal's clock, not by the one that only rises."""

    def note(self, progress: c.Progress) -> None:
        super().note(progress.model_copy(update={"clock": self._core.document.clock}))

    def newest(self) -> c.Progress:
        return self._newest


class HistoryRoom(Room):
    """The room of one person who looks at an earlier clock."""

    progress_kind = HistoryProgress

    def __init__(
        self,
        core: HistoryCore,
        *,
        journal: Journal,
        idle_seconds: float,
        present: Present | None = None,
        **room: Any,
    ) -> None:
        """``present``: what the terrain is now, where only what is still there may be shown; ``room``: what any room
        needs."""
        super().__init__(core, journal=journal, **room)
        self._history_core = core
        self._reader, self._present, self._present_clock = HistoryReader(journal, core.document), present, -1
        self._guest: Guest | None = None
        self._wanted: int | None = None
        self._seeking: asyncio.Task[None] | None = None
        self._idle_seconds = idle_seconds
        self._touched = self._loop.time()
        self.read: Read = _in_a_thread
        """Reads the journal, in a thread of those that addresses have shares of."""
        self.place: Place | None = None
        """Place of this room among the history rooms that the server keeps."""
        self._idle_timer = self._loop.call_later(idle_seconds / IDLE_CHECKS, self._idle)

    def join(
        self, hello: c.Hello, role: Role, link: str, outbox: Outbox, address: str = "", asked: int | None = None
    ) -> Guest:
        """Lets the one person in. Raises Denied."""
        self._guest = super().join(hello, role, link, outbox, address, asked)
        return self._guest

    def receive(self, guest: Guest, event: protocol.Event) -> None:
        """Takes a seek, a view or a credit. Ops are refused, and nobody else hears of presence."""
        match event:
            case protocol.Message(c.Seek() as seek):
                self._touch()
                self._wanted = seek.clock
                if self._seeking is None:
                    self._seeking = asyncio.create_task(self._seek(guest))
            case protocol.Message(c.Presence() | c.Rename()):
                pass
            case _:
                if isinstance(event, protocol.Message) and isinstance(event.body, c.View):
                    self._touch()
                super().receive(guest, event)

    def _touch(self) -> None:
        self._touched = self._loop.time()
        if self.place is not None:
            self.place.touch()

    async def _seek(self, guest: Guest) -> None:
        """Goes to the clock that was asked for last, until the room is there."""
        try:
            while self._wanted is not None and not self.closed:
                if guest.member.outbox.waits:
                    await asyncio.sleep(BEHIND_SECONDS)
                    continue
                clock, self._wanted = self._wanted, None
                document, rows = await self.read(self._reader.go, clock)
                await self._look_again()
                if not self.closed:
                    self._show(guest, document, rows)
        except Denied as denied:
            guest.member.outbox.close(denied.code, denied.message)
        except Exception as error:
            log.error("terrain %s could not be opened at an earlier clock: %s", self.id, error)
            guest.member.outbox.close("server_error", "The server failed to read the history of this terrain.")
        finally:
            self._seeking = None

    async def _look_again(self) -> None:
        """Shows the document again where only the things that are there now may be shown: they may have changed."""
        if self._present is None:
            return
        newest = await self.read(self._journal.newest, self.id)
        if newest != self._present_clock:
            present = await self._present()
            self._history_core.still, self._present_clock = viewing.things(present), present.clock

    def _show(self, guest: Guest, document: StrokeSet, rows: list[Row] | None) -> None:
        outbox = guest.member.outbox
        texts = None if rows is None else self._history_core.steps(rows)
        self._history_core.turn_to(document)
        if texts is not None and sum(map(len, texts)) <= STEP_CHARACTERS:
            outbox.push(f'{{"type":"ordered","ops":[{",".join(texts)}]}}')
        else:
            outbox.push(self._history_core.welcome(guest.member, self.info), counted=False)
        self._progress.unsettled()
        self._ordered()

    def _level_taken(self, clock: int, level: int, settled: bool) -> None:
        super()._level_taken(clock, level, settled and clock >= self.core.geometry_clock)

    def _idle(self) -> None:
        if self._guest is not None and self._loop.time() - self._touched >= self._idle_seconds:
            self._guest.member.outbox.close("room_full", IDLE)
            return
        self._idle_timer = self._loop.call_later(self._idle_seconds / IDLE_CHECKS, self._idle)

    def shut(self) -> None:
        """Stops timers and solver as ``Room.shut`` does. A thread that is reading the journal is not waited for."""
        super().shut()
        self._idle_timer.cancel()
        if self._seeking is not None:
            self._seeking.cancel()


Present = Callable[[], Awaitable[StrokeSet]]
Read = Callable[..., Awaitable[Any]]
"""Calls a function that blocks, with its arguments, where it does no harm."""


async def _in_a_thread(work: Callable[..., Any], *arguments: Any) -> Any:
    return await asyncio.to_thread(work, *arguments)


MakeRoom = Callable[[HistoryCore, Callable[[Room], None], Present | None, str], HistoryRoom]
"""Makes the room over a core; the second is to be called with it when nobody is left in it, the third says what is
there now, where only that may be shown, the last is the address for which its work is done."""


class HistoryRooms:
    """The history rooms of one server, at most ``most`` at a time. They live in the event loop."""

    def __init__(
        self, journal: Journal, make: MakeRoom, most: int = c.MAX_HISTORY_ROOMS, claims: Claims | None = None
    ) -> None:
        self._journal, self._make = journal, make
        self._claims = claims or Claims()
        self._rooms: dict[Room, Place] = {}
        """History rooms, each with the place that it holds."""
        self._places = Places(Share(most))

    def __len__(self) -> int:
        return len(self._places)

    async def enter(
        self,
        hello: c.Hello,
        who: Who,
        outbox: Outbox,
        demand: Callable[[], object] = lambda: None,
        read: Read | None = None,
        present: Present | None = None,
        hide: bool = False,
    ) -> tuple[HistoryRoom, Guest]:
        """Opens a room at ``hello.at``. ``demand`` asks once more whether the link opens it, and raises Denied;
        ``read`` runs the reading of the journal; ``present``: what the terrain is now, for who is shown no more;
        ``hide``: names are not shown. When
        all rooms are taken, whose address has the most gives one up.

        Raises Denied (room_full, no_terrain, server_error)."""
        same = self._claims.since(hello.token, hello.terrain, hello.client, who.link) is not None
        mine = [r for r in self._rooms if r.id == hello.terrain and hello.client in r.core.members.by_client]
        for room in mine if same else ():
            for member in room.core.members:  # the page came back before its older connection was seen to end
                member.outbox.close("bad_hello", "This page connected again; the older connection is closed.")
            self._close(room)
        place = self._place(who)
        try:
            loaded = await (read or _in_a_thread)(self._journal.load, hello.terrain, hello.at)
            if loaded is None:
                raise Denied("no_terrain", "There is no such terrain on this server.")
            still = None if present is None else viewing.things(await present())
            demand()
            room = self._make(HistoryCore(loaded, self._claims, still, hide), self._close, present, who.site)
        except DamagedTerrain as error:
            place.release()
            raise Denied("server_error", "The journal of this terrain is damaged; nothing was changed.") from error
        except BaseException:
            place.release()
            raise
        self._rooms[room] = room.place = place
        room.read = read or room.read
        return room, room.join(hello, "view", who.link, outbox)

    def _place(self, who: Who) -> Place:
        """Raises Denied (room_full)."""
        if self._places.refusal(who) is not None:
            victim = self._places.yielding(who)
            room = next((r for r, place in self._rooms.items() if place is victim), None)
            if room is None:
                raise Denied("room_full", CROWDED)
            for member in room.core.members:
                member.outbox.close("room_full", YIELDED)
            self._close(room)
        return self._places.take(who)

    def revoke(self, terrain: str, link: str, code: c.CloseCode, sentence: str) -> None:
        """Closes everybody who came in by this link."""
        for room, place in list(self._rooms.items()):
            if room.id == terrain and place.who.link == link:
                for member in room.core.members:
                    member.outbox.close(code, sentence)

    def has(self, terrain: str) -> bool:
        """Returns whether a history room of this terrain is open."""
        return any(room.id == terrain for room in self._rooms)

    def close_terrain(self, terrain: str, code: c.CloseCode, sentence: str) -> None:
        """Closes every history room of this terrain."""
        for room in [each for each in self._rooms if each.id == terrain]:
            for member in room.core.members:
                member.outbox.close(code, sentence)
            self._close(room)

    def _close(self, room: Room) -> None:
        place = self._rooms.pop(room, None)
        if place is not None:
            place.release()
            room.shut()

    def close(self, code: c.CloseCode, sentence: str) -> None:
        """Ends all history rooms."""
        for room in list(self._rooms):
            for member in room.core.members:
                member.outbox.close(code, sentence)
            self._close(room)
