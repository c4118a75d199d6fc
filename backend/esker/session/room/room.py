"""The room: one open terrain, the only owner of its document, members and tiles (DESIGN 8).

Everything here runs in the event loop's thread; the journal's writer, the solver and the tile thread call back into
it. ``core.py`` holds the rules, ``committing.py`` the way into the journal. A room holds its parts and they know it
weakly, so that its ground is freed the moment that nobody holds the room.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from concurrent.futures import Executor
from functools import partial
from typing import Final

from esker import contract as c
from esker.contract import Role
from esker.document.ops import Refusal
from esker.document.revisions import revision
from esker.fairness.shares import Who
from esker.process.garbage import weakly
from esker.session.ground.base_builder import Layers
from esker.session.ground.client import Client
from esker.session.ground.frames.feed import TileFeed
from esker.session.ground.frames.stream import Stream
from esker.session.ground.frames.tilethread import TileThread
from esker.session.ground.ports import Elevation, ScoredTiles, Tiles, WateredTiles
from esker.session.ground.worker import Job, Worker
from esker.session.lesson.classroom import FROZEN, ClassRoom
from esker.session.progress import GroundProgress
from esker.session.rivers import Rivers
from esker.session.room import protocol
from esker.session.room.committing import Commits
from esker.session.room.conducting import Conducting, Desk
from esker.session.room.core import UNSAVED, RoomCore, RoomInfo
from esker.session.room.entry import Denied
from esker.session.room.members import QUIET_BACKLOG_BYTES, Member
from esker.session.room.outbox import Outbox
from esker.session.room.ports import Journal, Meter, Tenancy
from esker.session.room.replicas.recent import Encoder
from esker.session.scoring import Scorer, Scoring

PRESENCE_TICK: Final = 1 / c.PRESENCE_HZ


class Guest:
    """A member together with its tiles, for a connection to hold on to."""

    def __init__(self, member: Member, stream: Stream) -> None:
        self.member, self.stream = member, stream


class Room(ClassRoom):
    """Wires one ``RoomCore`` to the journal, the solver and the clock."""

    progress_kind = GroundProgress

    def __init__(
        self,
        core: RoomCore,
        *,
        journal: Journal,
        worker: Worker,
        tiles: Tiles,
        executor: TileThread,
        info: RoomInfo,
        on_empty: Callable[[Room], None],
        elevation: Elevation | None = None,
        base_threads: Executor | None = None,
        desk: Desk | None = None,
        home: str = "",
        tenancy: Tenancy | None = None,
        meter: Meter | None = None,
        on_lost: Callable[[], None] = lambda: None,
    ) -> None:
        """``elevation`` makes the base of the layers, in a thread of ``base_threads``; without them nothing is laid.
        ``desk``: what a lesson asks of the server; ``home``: the address of who opened it, for whom its work is done
        until somebody comes who draws. ``on_lost``: what is in the journal is known no longer. Nothing is solved until
        somebody is to see its ground (``show``)."""
        self.core, self.info = core, info
        self.id = core.document.id
        self._journal, self._worker, self._on_empty = journal, worker, on_empty
        self._loop = asyncio.get_running_loop()
        self._home, self._lane = home, executor.lane()
        self._lane.home = home or None
        self._feed = self._fed_by(tiles)
        self._solve_client = self._solved_by(worker)
        self._rivers = Rivers(tiles.hydrology if isinstance(tiles, WateredTiles) else None, self._feed, self._loop)
        self._rivers.works_for(home)
        self.scoring = self._scored_by(tiles.scorer if isinstance(tiles, ScoredTiles) else None)
        self.scoring.works_for(home)
        listeners = weakly(self._laid), weakly(self._tell), weakly(self._slow_changed)
        self._layers = Layers(elevation, base_threads, self._loop, *listeners)
        self._progress = self.progress_kind(core, self._layers, info.levels, self._loop)
        self._job: Job | None = None
        """The job that was asked for last."""
        self._presence_timer: asyncio.TimerHandle | None = None
        self._solve_due = False
        self._shown = False
        self._requested_clock = -1
        self._encoder, self._meter = Encoder(core), meter
        self._commits = Commits(
            core,
            journal,
            self._loop,
            tenancy=tenancy,
            meter=meter,
            taken=weakly(self._taken),
            taken_back=weakly(self._request_solve),
            lost=on_lost,
        )
        self.conducting = Conducting(
            core,
            journal,
            self._loop,
            desk,
            ordered=weakly(self._ordered),
            flush=weakly(self.flush),
            people_changed=weakly(self._presence_soon),
        )
        self.closed = False
        self._active_at = self._loop.time()
        """The time at which somebody came, or did more than to answer by itself."""
        self._rivers.follow(core.head)
        self.scoring.follow(core.head)

    def _fed_by(self, tiles: Tiles) -> TileFeed:
        """Returns what makes tiles of finished levels, in this room's lane."""
        return TileFeed(
            tiles,
            self.core.document.settings.size_m,
            self.info.levels,
            self.info.finest,
            self._lane,
            self._loop,
            weakly(self._level_taken),
            weakly(self._requests_changed),
        )

    def _solved_by(self, worker: Worker) -> Client:
        """Returns this room as the solver's thread knows it: nobody is there to see its ground yet."""
        client = worker.add(
            self.info.levels,
            self._feed.put,
            weakly(self._solve_failed),
            self._feed if self.info.finest > self.info.levels else None,
            limit=self._feed.limit,
            confirm=self._feed.confirm,
            note=self._feed.note,
            home=self._home or None,
        )
        worker.attend(client, False)
        return client

    def _scored_by(self, scorer: Scorer | None) -> Scoring:
        """Returns what compares the ground with a task, on the level that tasks have."""
        heights = partial(self._feed.heights, min(c.TASK_LEVEL, self.info.levels))
        return Scoring(scorer, heights, self._loop, weakly(self._tell_score))

    # --- people -------------------------------------------------------------------------------------------------

    async def prepare(
        self, clock: int | None, run: Callable[[Callable[[], bytes]], Awaitable[bytes]], view: bool = False
    ) -> int:
        """Has a heavy document encoded by ``run``, in another thread, once for all who come meanwhile.

        ``view``: as a link to look is shown it. Returns the clock when it was asked for.
        """
        return await self._encoder.prepare(clock, run, view, lambda: self.closed)

    def join(
        self, hello: c.Hello, role: Role, link: str, outbox: Outbox, address: str = "", asked: int | None = None
    ) -> Guest:
        """Lets a client in; ``asked`` is what ``prepare`` returned. Raises Denied."""
        try:
            member = self.core.join(hello, role, link, outbox, self.info, address, asked)
        except Denied as denied:
            if denied.code == "removed":
                self.conducting.somebody_waits()
            raise
        outbox.message(self._progress.newest())
        if self.in_class is not None:
            outbox.message(self.in_class)
        if self.scoring.newest is not None:
            outbox.message(self.scoring.newest)
        self._works_for(member)
        self._worker.attend(self._solve_client, True)
        self.show()
        guest = Guest(member, self._feed.add(outbox))
        self.conducting.joined(member)
        self._active_at = self._loop.time()
        self._presence_soon()
        return guest

    def _works_for(self, member: Member) -> None:
        """The room's work is done for the address of who came last to draw, or drew: many rooms of one share turns."""
        home = Who(member.address).site
        if home and home != self._home and member.role != "view":
            self._home = self._lane.home = home
            self._worker.move(self._solve_client, home)
            self._rivers.works_for(home)
            self.scoring.works_for(home)

    def leave(self, guest: Guest) -> None:
        """Lets a client go whose connection ended."""
        self._feed.remove(guest.stream)
        self.core.leave(guest.member)
        self.conducting.left(guest.member)
        self._presence_soon()
        if not len(self.core.members):
            self._worker.attend(self._solve_client, False)
            self._on_empty(self)

    def idle_for(self, seconds: float) -> bool:
        """Returns whether nobody came or did anything for so long."""
        return self._loop.time() - self._active_at >= seconds

    def receive(self, guest: Guest, event: protocol.Event) -> None:
        """Does what a member's message asks, after the protocol has checked it."""
        self.core.heard(guest.member)
        if not isinstance(event, protocol.Reply) and not (
            isinstance(event, protocol.Message) and isinstance(event.body, c.Credit)
        ):
            self._active_at = self._loop.time()
        match event:
            case protocol.Accepted(ops):
                if self.frozen and guest.member.role == "edit":
                    for envelope in ops:
                        self.core.refuse(guest.member, envelope.id, "frozen", FROZEN)
                elif self.core.submit(guest.member, ops):
                    self._works_for(guest.member)
                    self._ordered()
            case protocol.Refused(op_id, code, message):
                self.core.refuse(guest.member, op_id, code, message)
            case protocol.Message(c.View() as view):
                self._feed.view(guest.stream, view)
            case protocol.Message(c.Credit() as credit):
                self._feed.credit(guest.stream, credit.bytes)
            case protocol.Message(c.Presence() as presence):
                self.core.members.moved(guest.member, presence)
                self._presence_soon()
            case protocol.Message(c.Rename() as rename):
                self.core.members.rename(guest.member, rename.name, rename.colour)
                self._presence_soon()
                self._commits.renamed(guest.member)
            case protocol.Message((c.Conduct() | c.People() | c.Grouping()) as message):
                self.conducting.receive(guest.member, message)
            case protocol.Reply(message):
                guest.member.outbox.message(message)

    def frame(self, guest: Guest) -> bytes | None:
        """Returns the binary frame that waits for this member's socket, if there is one."""
        frame = self._feed.sent(guest.stream)
        if frame is not None and self._meter is not None:
            self._meter.framed(len(frame))
        return frame

    def _presence_soon(self) -> None:
        if self._presence_timer is None and not self.closed:
            self._presence_timer = self._loop.call_later(PRESENCE_TICK, self._presence_tick)

    def _presence_tick(self) -> None:
        self._presence_timer = None
        if self.core.members.pending:
            self.core.members.tick(self._loop.time())
            if self.core.members.pending:
                self._presence_soon()

    # --- imports ------------------------------------------------------------------------------------------------

    async def perform(self, op: c.Op, agent: str, author: str, *, teacher: bool = False) -> int:
        """Does an op of the server's own in the name of client ``author``; returns its clock once it is in the journal.

        ``agent``: the id under which it is done, once; ``teacher``: for whom a copy is not frozen. Raises Refusal (also
        when it could not be saved).
        """
        if self.frozen and not teacher:
            raise Refusal("frozen", FROZEN)
        clock = self.core.perform(op, agent, author)
        self._ordered()
        await self.flush()
        if not len(self.core.members):
            self._on_empty(self)
        if self._journal.find(self.id, agent, 0) != clock:
            raise Refusal("unavailable", UNSAVED)
        return clock

    def importing(self, message: c.Importing) -> None:
        """Tells everybody how far somebody's import is."""
        text = message.model_dump_json()
        here = next((member for member in self.core.members if member.name == message.author), None)
        nameless = message.model_copy(update={"author": ""}).model_dump_json()
        for member in self.core.members:
            if member.outbox.backlog < QUIET_BACKLOG_BYTES or message.status.stage in c.ENDED_IMPORT:
                known = member.role != "view" if here is None else self.core.lesson.sees(member, here)
                member.outbox.push(text if known else nameless)

    # --- ops ----------------------------------------------------------------------------------------------------

    def _ordered(self) -> None:
        """Has ordered ops committed with the next tick, and solved at once."""
        if self.core.geometry_clock > self._requested_clock:
            if not self._solve_due:
                self._solve_due = True
                self._loop.call_soon(self._solve)
        elif self._progress.settled:
            self._progress.clock_changed()
        self._commits.ordered()

    def _taken(self) -> None:
        self._rivers.follow(self.core.head)
        self.scoring.follow(self.core.head)

    # --- the ground ---------------------------------------------------------------------------------------------

    def show(self) -> None:
        """Somebody is to see the ground, which is solved from now on."""
        if not self._shown:
            self._shown = True
            self._request_solve()

    def _solve(self) -> None:
        self._solve_due = False
        if self.core.geometry_clock > self._requested_clock:
            self._request_solve()

    def _request_solve(self) -> None:
        if not self._shown:
            return
        head = self.core.head
        self._requested_clock = head.clock
        fresh = self._layers.want(head)
        if self._layers.empty:
            return  # the first look at a terrain with real ground shows that ground, and no plane before
        base = self._layers.base
        last = self._job
        if last is not None and last.base is base:
            layers_rev = last.layers_rev
            if not fresh and (last.heights_rev, last.channels_rev) == (head.heights_rev, head.channels_rev):
                return  # nothing better can be solved until the new base is there
        else:
            layers_rev = 0 if base is None else revision()
        # The base is still an older one, so this is not the ground of any clock since the layers changed.
        clock = head.clock if fresh else self.core.base_clock - 1
        self._job = Job(
            clock,
            tuple(head.strokes.values()),
            head.settings,
            head.heights_rev,
            head.channels_rev,
            head.paint_rev,
            layers_rev,
            base,
        )
        self._worker.request(self._solve_client, self._job)

    def _laid(self) -> None:
        """Goes on with another base."""
        if not self.closed:
            self._request_solve()

    def _slow_changed(self) -> None:
        """Tells people that a base takes long, or takes no longer."""
        self._progress.again()

    def _level_taken(self, clock: int, level: int, settled: bool) -> None:
        """Takes a level that became tiles."""
        self._rivers.level_taken(level, settled)
        self.scoring.level_taken(settled)
        self._progress.level_taken(clock, level, settled)

    def _tell_score(self, score: c.Score) -> None:
        for member in self.core.members:
            member.outbox.message(score)

    def _requests_changed(self, count: int, more: bool) -> None:
        """Takes the number of refined tiles that are wanted. ``more``: the solver does not know of all of them yet."""
        if more and not self.closed:
            self._worker.nudge(self._solve_client)
        self._progress.refining(count)

    def _solve_failed(self, note: str) -> None:
        """Takes a sentence about the solver, that something went wrong, or right again.

        Called in the solver's thread.
        """
        self._loop.call_soon_threadsafe(self._tell, note)

    def _tell(self, note: str) -> None:
        self._progress.tell(note)

    # --- the end ------------------------------------------------------------------------------------------------

    async def flush(self) -> None:
        """Returns when every op that was ordered so far is committed or refused."""
        await self._commits.flush()

    def abandon(self) -> None:
        """Ends without a word to the journal: another server may have the terrain, or nobody knows what was written."""
        self.core.abandon()
        self.shut()
        self._commits.abandon()

    def shut(self) -> None:
        """Stops the timers and the solver's work for this room. Call ``flush`` first."""
        self.closed = True
        self._commits.close()
        self._layers.close()
        self._rivers.close()
        self.scoring.close()
        self.conducting.close()
        self._progress.close()
        self._worker.remove(self._solve_client)
        if self._presence_timer is not None:
            self._presence_timer.cancel()
