"""Looking at a terrain as it was (DESIGN 4 "History"): a room for one person, where nothing can be changed.

It is a ``Room`` whose document is that of an earlier clock; solver, tiles and protocol are those of any other. ``seek``
goes to another clock, forward by the journal's ops, backward by a document; the live room never hears of it.
"""

from __future__ import annotations

import asyncio
import logging
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from esker import contract as c
from esker.contract import Role
from esker.document.ops import StrokeSet
from esker.session import protocol
from esker.session.core import Denied, RoomCore, RoomInfo
from esker.session.members import Member
from esker.session.outbox import Outbox
from esker.session.ports import Journal
from esker.session.room import PROGRESS_TICK, Guest, Room
from esker.store.journal import DamagedTerrain, Loaded, Row, replay

log = logging.getLogger("esker.past")

STEP_CHARACTERS: Final = 128 * 1024
"""Ops of a step forward are sent if they have at most so many characters as text, else the document is."""
WAYPOINT_OPS: Final = 200
WAYPOINTS: Final = 64
"""Documents that a room keeps of the clocks it was at, so many ops apart at least."""
FAR_OPS: Final = 2_000
"""Farther than this from any of them, the journal's snapshots are asked."""
BEHIND_SECONDS: Final = 0.05
"""Who has not taken the last step yet gets the next one later."""
IDLE_CHECKS: Final = 20
IDLE: Final = "You have not looked around here for a while, so the server made room for others."
CROWDED: Final = "As many people as this server allows look at the past just now. Try again in a minute."


class PastCore(RoomCore):
    """The document of an earlier clock and the one person who looks at it.

    ``document`` has the clock of the journal. ``head`` is the same under a clock that only ever rises, as solver and
    tiles expect.
    """

    def __init__(self, loaded: Loaded) -> None:
        super().__init__(loaded, lambda *_: None, max_members=1)

    def join(self, hello: c.Hello, role: Role, link: str, outbox: Outbox, info: RoomInfo) -> Member:  # noqa: ARG002
        """As in any room, but only to look, and always with the document."""
        return super().join(hello.model_copy(update={"clock": None}), "view", link, outbox, info)

    def turn_to(self, document: StrokeSet) -> None:
        """Shows the terrain at another clock."""
        ground, before = document.ground, self.head
        self.document = document
        self.head = replace(document, clock=max(before.clock, document.clock) + 1)
        self.geometry_clock = self.head.clock
        if ground is not before.ground:
            self.base_clock = self.head.clock

    def welcome(self, member: Member, info: RoomInfo) -> str:
        """The document as a ``welcome``."""
        return self._welcome(member, None, info)


class Past:
    """Documents of one terrain at any clock, out of the journal. For one thread at a time."""

    def __init__(self, journal: Journal, document: StrokeSet) -> None:
        self._journal, self.document = journal, document
        self._waypoints = [document]

    def go(self, clock: int) -> tuple[StrokeSet, list[Row] | None]:
        """The document at ``clock`` (or the newest before), and the ops from the present one, where it is later.

        Raises DamagedTerrain, sqlite3.Error.
        """
        start = self._nearest(clock)
        if start is None:
            loaded = self._journal.load(self.document.id, clock)
            if loaded is None:
                raise DamagedTerrain(f"the journal of {self.document.id} has no beginning")
            found, rows = loaded.document, None
        else:
            steps = self._journal.rows(start.id, start.clock, clock)
            found, rows = replay(start, steps), steps if start is self.document else None
        self.document = found
        self._keep(found)
        return found, rows

    def _nearest(self, clock: int) -> StrokeSet | None:
        """The document to replay from; None where a snapshot of the journal may be nearer."""
        known = [self.document, *self._waypoints]  # of equal ones the first: steps go on from the present document
        best = max((d for d in known if d.clock <= clock), key=lambda d: d.clock, default=None)
        return best if best is not None and clock - best.clock <= FAR_OPS else None

    def _keep(self, document: StrokeSet) -> None:
        at = bisect_right(self._waypoints, document.clock, key=lambda d: d.clock)
        around = self._waypoints[max(0, at - 1) : at + 1]
        if all(abs(d.clock - document.clock) >= WAYPOINT_OPS for d in around):
            self._waypoints.insert(at, document)
        if len(self._waypoints) > WAYPOINTS:
            del self._waypoints[1::2]


class PastRoom(Room):
    """One person's view of the past."""

    def __init__(self, core: PastCore, *, journal: Journal, idle_seconds: float, **room: Any) -> None:
        """``room``: what any room needs."""
        super().__init__(core, journal=journal, **room)
        self._past_core = core
        self._past = Past(journal, core.document)
        self._guest: Guest | None = None
        self._wanted: int | None = None
        self._seeking: asyncio.Task[None] | None = None
        self._idle_seconds = idle_seconds
        self._touched = self._loop.time()
        self._idle_timer = self._loop.call_later(idle_seconds / IDLE_CHECKS, self._idle)

    def join(self, hello: c.Hello, role: Role, link: str, outbox: Outbox) -> Guest:
        """Lets the one person in. Raises Denied."""
        self._guest = super().join(hello, role, link, outbox)
        return self._guest

    def receive(self, guest: Guest, event: protocol.Event) -> None:
        """A seek, a view, a credit; ops are refused; of people nobody else hears."""
        match event:
            case protocol.Message(c.Seek() as seek):
                self._touched = self._loop.time()
                self._wanted = seek.clock
                if self._seeking is None:
                    self._seeking = asyncio.create_task(self._seek(guest))
            case protocol.Message(c.Presence() | c.Rename()):
                pass
            case _:
                if isinstance(event, protocol.Message) and isinstance(event.body, c.View):
                    self._touched = self._loop.time()
                super().receive(guest, event)

    async def _seek(self, guest: Guest) -> None:
        """Goes where was asked last, until that is where we are."""
        try:
            while self._wanted is not None and not self.closed:
                if guest.member.outbox.waits:
                    await asyncio.sleep(BEHIND_SECONDS)
                    continue
                clock, self._wanted = self._wanted, None
                document, rows = await asyncio.to_thread(self._past.go, clock)
                if not self.closed:
                    self._show(guest, document, rows)
        except Exception as error:
            log.error("terrain %s could not be opened at an earlier clock: %s", self.id, error)
            guest.member.outbox.close("server_error", "The server failed to read the history of this terrain.")
        finally:
            self._seeking = None

    def _show(self, guest: Guest, document: StrokeSet, rows: list[Row] | None) -> None:
        outbox = guest.member.outbox
        texts = None if rows is None else [row.ordered_json() for row in rows]
        self._past_core.turn_to(document)
        if texts is not None and sum(map(len, texts)) <= STEP_CHARACTERS:
            outbox.push(f'{{"type":"ordered","ops":[{",".join(texts)}]}}')
        else:
            outbox.push(self._past_core.welcome(guest.member, self.info), counted=False)
        self._note_progress(self._progress.model_copy(update={"settled": False}))
        self._ordered()

    def _note_progress(self, progress: c.Progress, delay: float = PROGRESS_TICK) -> None:
        """Told by the journal's clock, not by the one that only rises."""
        super()._note_progress(progress.model_copy(update={"clock": self.core.document.clock}), delay)

    def _newest_progress(self) -> c.Progress:
        return self._progress

    def _level_taken(self, clock: int, level: int, settled: bool) -> None:
        super()._level_taken(clock, level, settled and clock >= self.core.geometry_clock)

    def _idle(self) -> None:
        if self._guest is not None and self._loop.time() - self._touched >= self._idle_seconds:
            self._guest.member.outbox.close("room_full", IDLE)
            return
        self._idle_timer = self._loop.call_later(self._idle_seconds / IDLE_CHECKS, self._idle)

    def shut(self) -> None:
        """As in any room; a journal that is being read is left to its thread."""
        super().shut()
        self._idle_timer.cancel()
        if self._seeking is not None:
            self._seeking.cancel()


MakeRoom = Callable[[PastCore, Callable[[], None]], PastRoom]
"""Makes the room over a core; the second is to be called when nobody is left in it."""


class Pasts:
    """The rooms of all who look at the past, of one server: a bounded number. Lives in the event loop."""

    def __init__(self, journal: Journal, make: MakeRoom, most: int = c.MAX_PAST_ROOMS) -> None:
        self._journal, self._make, self._most = journal, make, most
        self._rooms: dict[PastRoom, str] = {}
        """With the link by which each came in."""
        self._opening = 0

    def __len__(self) -> int:
        return len(self._rooms) + self._opening

    async def enter(self, hello: c.Hello, link: str, outbox: Outbox) -> tuple[PastRoom, Guest]:
        """Opens a room at ``hello.at``. Raises Denied (room_full, no_terrain, server_error)."""
        for room in [r for r in self._rooms if r.id == hello.terrain and hello.client in r.core.members.by_client]:
            for member in room.core.members:  # the page came back before its older connection was seen to end
                member.outbox.close("bad_hello", "This page connected again; the older connection is closed.")
            self._close(room)
        if len(self) >= self._most:
            raise Denied("room_full", CROWDED)
        self._opening += 1
        try:
            loaded = await asyncio.to_thread(self._journal.load, hello.terrain, hello.at)
        except DamagedTerrain as error:
            raise Denied("server_error", "The journal of this terrain is damaged; nothing was changed.") from error
        finally:
            self._opening -= 1
        if loaded is None:
            raise Denied("no_terrain", "There is no such terrain on this server.")
        room = self._make(PastCore(loaded), lambda: self._close(room))
        self._rooms[room] = link
        return room, room.join(hello, "view", link, outbox)

    def revoke(self, terrain: str, link: str, code: c.CloseCode, sentence: str) -> None:
        """Closes everybody who came in by this link."""
        for room, by in list(self._rooms.items()):
            if room.id == terrain and by == link:
                for member in room.core.members:
                    member.outbox.close(code, sentence)

    def _close(self, room: PastRoom) -> None:
        if self._rooms.pop(room, None) is not None:
            room.shut()

    def close(self, code: c.CloseCode, sentence: str) -> None:
        """Ends them all."""
        for room in list(self._rooms):
            for member in room.core.members:
                member.outbox.close(code, sentence)
            self._close(room)
