"""All open rooms of one server: how people come in, and what closes them (DESIGN 8)."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import Any, Final, ParamSpec, TypeVar

from esker import contract as c
from esker.document.ops import Limits, StrokeSet
from esker.errors import EskerError
from esker.fairness.shares import Full, Share, Who
from esker.fairness.turns import SERVER, FairThreads, Turnstile
from esker.process import memory
from esker.session.births import Births, born_as
from esker.session.ground.frames.tilethread import TileThread
from esker.session.ground.ports import Elevation, Tiles
from esker.session.ground.worker import Worker
from esker.session.room.conducting import Desk
from esker.session.room.core import Denied, RoomCore, RoomInfo, history_rates
from esker.session.room.door import Door
from esker.session.room.history_view import HistoryCore, HistoryRoom, HistoryRooms, Present
from esker.session.room.lessons import Lessons
from esker.session.room.openrooms import ClosedRooms, OpenRooms
from esker.session.room.outbox import Outbox, Waiting
from esker.session.room.ports import Meter, Tenancy
from esker.session.room.room import Guest, Room
from esker.store.access import JOINED_BY_CODE, Access, Link
from esker.store.claims import Claims
from esker.store.engine.ports import Unreachable
from esker.store.journal import DamagedTerrain, Journal
from esker.store.upkeep.deletion import Deletion

log = logging.getLogger("esker.hub")

IDLE_SECONDS: Final = 30.0
"""A room without members stays open this long, so that a reload finds it warm."""
REST_SECONDS: Final = 600.0
"""Where the server has no place left, a room in which nobody did anything for so long is closed for a newcomer."""
RESTED: Final = "Nobody did anything here for a while, so the server made room for others. Reload the page to go on."
WAITING_BYTES: Final = 256 << 20
READERS, READS_WAITING = 6, 100
PACKERS, PACKS_WAITING = 2, 20
"""Threads, and the share of them for which one address may wait."""
P = ParamSpec("P")
T = TypeVar("T")


DELETED: Final = "The owner deleted this terrain."
MOVING: Final = "This terrain moves to another server. Your page goes with it by itself."


class Hub:
    """Opens rooms and closes idle ones. Lives in one event loop."""

    def __init__(
        self,
        journal: Journal,
        access: Access,
        worker: Worker,
        tiles: Tiles,
        *,
        levels: int = c.DEFAULT_LEVEL,
        finest: int | None = None,
        limits: Limits | None = None,
        max_members: int = c.MAX_MEMBERS,
        idle_seconds: float = IDLE_SECONDS,
        now: Callable[[], float] = time.monotonic,
        elevation: Elevation | None = None,
        claims: Claims | None = None,
        rooms: Share | None = None,
        tenancy: Tenancy | None = None,
        meter: Meter | None = None,
    ) -> None:
        """``levels``: the finest level solved as a whole; ``finest``: the finest refined (default: none is);
        ``elevation``: makes the base of elevation layers (default: none is laid); ``rooms``: how many may be open;
        ``tenancy``: where several servers share the database; ``meter``: where somebody reads figures."""
        self.journal, self.access, self.deletion = journal, access, Deletion(journal)
        self._worker, self._tiles = worker, tiles
        self._levels, self._finest = levels, levels if finest is None else max(levels, finest)
        self._limits, self._max_members = limits or Limits(), max_members
        self._idle_seconds = idle_seconds
        self.door = Door(journal, access, self.deletion, now)
        self._rooms: dict[str, asyncio.Task[Room | None]] = {}
        self._places, self._memory = OpenRooms(self.sleep, rooms, self._rest), ClosedRooms()
        self._turnstile = Turnstile()
        self._tile_thread = TileThread()
        self._elevation, self._tenancy, self._meter = elevation, tenancy, meter
        self._base_threads = ThreadPoolExecutor(1, thread_name_prefix="elevation")
        self.reading = FairThreads(READERS, "reading", READS_WAITING)
        """Threads that read the journal. One address has at most half of them."""
        self.births = Births(journal, self.reading)
        self.packing = FairThreads(PACKERS, "packing", PACKS_WAITING)
        """Threads that make files of stored data."""
        self._history_rates = history_rates()
        self.waiting = Waiting(min(WAITING_BYTES, memory.available_bytes() // 16))
        """Bytes that wait to be sent to everybody."""
        self._closing = False
        self.hear_of_ended: list[Callable[[str, Collection[str]], object]] = []
        """Listeners for links that were revoked: terrain, ids."""
        self.class_of: Callable[[str], c.InClass | None] = lambda _: None
        """Returns what members of a terrain are told of the class whose copy it is."""
        self._claims = claims or Claims()
        self.lessons = Lessons(journal, self._claims, self.open_room)
        self._history_rooms = HistoryRooms(journal, self._history_room, claims=self._claims)

    @property
    def device(self) -> str:
        """The solver's device, in words."""
        return self._worker.device_name

    # --- entering -----------------------------------------------------------------------------------------------

    async def enter(self, hello: c.Hello, outbox: Outbox, address: str) -> tuple[Room, Guest]:
        """Lets a client into its room, opening it if need be. Raises Denied."""
        if self._closing:
            raise Denied("shutting_down", "The server is stopping. Your page will come back by itself.")
        link = await self._turnstile.run(Who(address), self.door.called, hello, address)
        who = Who(address, link.id)
        if hello.at is not None:
            present = partial(self.strokes, hello.terrain, None, who) if link.role == "view" else None
            read = partial(self.read, who)
            self.lessons.caller(link, hello.ticket, address)
            hide = link.role != "owner" and self.lessons.of(hello.terrain).state.hide
            return await self._history_rooms.enter(
                hello, who, outbox, lambda: self.door.demand(link), read, present, hide
            )
        while True:
            room = await self.room(hello.terrain, who)
            asked = await room.prepare(hello.clock, partial(self.read, who), link.role == "view")
            guest = await self._turnstile.run(who, self._joined, room, hello, link, outbox, address, asked)
            if guest is not None:
                return room, guest

    def _joined(
        self, room: Room, hello: c.Hello, link: Link, outbox: Outbox, address: str, asked: int | None
    ) -> Guest | None:
        """Lets somebody into an open room; None where it was closed, as its last member had left. Raises Denied."""
        if room.closed:
            return None
        self.door.demand(link)  # the link may have been revoked while the room was being opened
        return room.join(hello, link.role, link.id, outbox, address, asked)

    # --- rooms --------------------------------------------------------------------------------------------------

    async def read(self, who: Who, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Runs what reads the journal, in a thread. Raises Denied (rate_limited) where too much waits already."""
        try:
            return await self.reading.run(who, work, *args, **kwargs)
        except Full:
            raise Denied("rate_limited", "Too much was asked for from your address at once. Wait a moment.") from None

    async def room(self, terrain: str, who: Who = SERVER, *, shown: bool = True) -> Room:
        """Returns the open room of a terrain. ``shown``: whether somebody is to see its ground, or only to write there.

        Raises Denied (no_terrain, server_error, rate_limited)."""
        room = await self._room(terrain, who)
        while room.closed:  # the room was idle and closed in this very moment
            room = await self._room(terrain, who)
        if shown:  # whoever comes waits for it, so it begins before they are let in
            room.show()
        return room

    async def _room(self, terrain: str, who: Who) -> Room:
        task = self._rooms.get(terrain)
        if task is None:
            self._places.take(terrain, who)
            task = self._rooms[terrain] = asyncio.create_task(self._open(terrain, who))
        self._places.used(terrain)
        try:
            room = await asyncio.shield(task)
        except DamagedTerrain as error:
            self._forget(terrain, task)
            log.error("terrain %s cannot be opened: %s", terrain, error)
            raise Denied("server_error", "The journal of this terrain is damaged; nothing was changed.") from error
        except BaseException:
            if task.done():
                self._forget(terrain, task)
            raise
        if room is None:
            self._forget(terrain, task)
            raise Denied("no_terrain", "There is no such terrain on this server.")
        return room

    def _forget(self, terrain: str, task: asyncio.Task[Room | None]) -> None:
        if self._rooms.get(terrain) is task:
            del self._rooms[terrain]
            self._places.release(terrain)

    async def _open(self, terrain: str, who: Who) -> Room | None:
        if self._tenancy is not None:
            try:
                await self._tenancy.hold(terrain)
            except EskerError as error:
                raise Denied("moved", error.message) from None
        loaded, lesson = await self.read(who, lambda: (self.journal.load(terrain), self.lessons.load(terrain)))
        if loaded is None or self.deletion.deleted(terrain) is not None:
            return None
        if self._tenancy is not None and not self._tenancy.may_acknowledge(terrain):
            raise Denied("moved", MOVING)
        core = RoomCore(
            loaded,
            lambda client, counter: self.journal.find(terrain, client, counter),
            self._limits,
            self._max_members,
            rates=self._history_rates,
            claims=self._claims,
            lesson=lesson,
        )
        desk = Desk(self.read, partial(self._end_code_link, terrain))
        more = {"tenancy": self._tenancy, "on_lost": lambda: self.lose(terrain)}
        needs = self._needs() | {"desk": desk, "home": who.site} | more
        room = Room(core, journal=self.journal, on_empty=lambda _: self._empty(terrain), **needs)
        room.in_class = self.class_of(terrain)
        return room

    def _end_code_link(self, terrain: str, link: str) -> None:
        """Ends a link that a join code made: it is one device's alone."""
        found = next((each for each in self.access.links(terrain) if each.id == link), None)
        if found is None or found.name != JOINED_BY_CODE or found.revoked is not None:
            return
        loop = asyncio.get_running_loop()
        ended = self.access.revoke(terrain, link)
        ended.add_done_callback(
            lambda done: done.exception() or loop.call_soon_threadsafe(self.end_links, terrain, done.result())
        )

    def _history_room(
        self, core: HistoryCore, on_empty: Callable[[Room], None], present: Present | None = None, home: str = ""
    ) -> HistoryRoom:
        more = {"idle_seconds": c.HISTORY_IDLE_SECONDS, "present": present, "home": home} | self._needs()
        return HistoryRoom(core, journal=self.journal, on_empty=on_empty, **more)

    def _needs(self) -> dict[str, Any]:
        """Returns what every room is made with."""
        return {
            "worker": self._worker,
            "tiles": self._tiles,
            "executor": self._tile_thread,
            "info": RoomInfo(self._levels, self._finest, self._worker.device_name),
            "elevation": self._elevation,
            "base_threads": self._base_threads,
            "meter": self._meter,
        }

    @property
    def open_rooms(self) -> int:
        """Rooms that are open or opening, history rooms not counted."""
        return len(self._rooms)

    @property
    def members(self) -> int:
        """People who are in open rooms, history rooms not counted."""
        rooms = (self.open_room(terrain) for terrain in self._rooms)
        return sum(len(room.core.members) for room in rooms if room is not None)

    def open_room(self, terrain: str) -> Room | None:
        """Returns the room if it is open already."""
        task = self._rooms.get(terrain)
        if task is None or not task.done() or task.cancelled() or task.exception() is not None:
            return None
        return task.result()

    def _empty(self, terrain: str) -> None:
        asyncio.get_running_loop().call_later(self._idle_seconds, self._close_idle, terrain)

    def _close_idle(self, terrain: str) -> None:
        self.sleep(terrain)

    def sleep(self, terrain: str) -> bool:
        """Closes a room that nobody is in. Returns whether it is closed now."""
        room = self.open_room(terrain)
        if room is None or len(room.core.members) or room.core.busy:
            return False
        del self._rooms[terrain]
        self._places.release(terrain)
        room.shut()
        self._memory.give_back_soon()
        return True

    def _rest(self, terrain: str) -> bool:
        """Closes a room in which nobody has done anything for long, and says so to whoever is in it.

        Returns whether it did.
        """
        room = self.open_room(terrain)
        if room is None or room.core.busy or not room.idle_for(REST_SECONDS):
            return False
        for member in room.core.members:
            member.outbox.close("room_full", RESTED)
            room.core.leave(member)
        log.info("terrain %s was closed for others: nobody did anything in it for %.0f s", terrain, REST_SECONDS)
        return self.sleep(terrain)

    # --- terrains -----------------------------------------------------------------------------------------------

    async def create(self, document: c.Document, who: Who = SERVER) -> tuple[c.Document, Link, str]:
        """A new terrain born as ``document`` under a fresh id, with its owner link and that link's secret.

        Raises Cannot (429), shares.Full, store.journal.Unwritable; then there is neither.
        """
        born = born_as(document)
        link, secret, insert = self.access.make(born.id, "owner", "Owner")
        await self.births.write(born, insert, who)
        return born, link, secret

    async def document(self, terrain: str, at: int | None = None, who: Who = SERVER) -> c.Document:
        """The committed document, or that of an earlier clock, for ``who``.

        Raises Denied (no_terrain, server_error, rate_limited)."""
        return (await self.strokes(terrain, at, who)).to_document()

    async def strokes(self, terrain: str, at: int | None = None, who: Who = SERVER) -> StrokeSet:
        """Returns the document of ``document`` as a stroke set, which is what a room holds."""
        room = self.open_room(terrain)
        if room is not None and (at is None or at >= room.core.document.clock):
            return room.core.document
        try:
            found = await self.read(who, self.journal.document, terrain, at)
        except DamagedTerrain as error:
            raise Denied("server_error", "The journal of this terrain is damaged; nothing was changed.") from error
        if found is None:
            raise Denied("no_terrain", "There is no such terrain on this server.")
        return found

    async def delete(self, link: Link) -> float:
        """Deletes the terrain of an owner's link: closes everybody in it. Returns when it will be gone for good.

        Raises store.journal.Unwritable.
        """
        until = await asyncio.wrap_future(self.deletion.delete(link.terrain))
        await self.close_deleted(link.terrain)
        return until

    async def close_deleted(self, terrain: str) -> None:
        """A terrain was deleted: closes everybody in it, and ends what was under way for its links."""
        await self._take_out(terrain, "no_terrain", DELETED)
        for hears in self.hear_of_ended:
            hears(terrain, [each.id for each in self.access.links(terrain)])

    async def _take_out(self, terrain: str, code: c.CloseCode, sentence: str) -> None:
        """Commits what was ordered, and closes everybody in a terrain."""
        task = self._rooms.pop(terrain, None)
        self._places.release(terrain)
        room = None if task is None else await task
        self._history_rooms.close_terrain(terrain, code, sentence)
        if room is not None:
            await room.flush()
            if not room.closed:
                for member in room.core.members:
                    member.outbox.close(code, sentence)
                room.shut()

    # --- where several servers share the database -----------------------------------------------------------------

    async def keep(self, terrain: str) -> None:
        """Has a terrain that this server has just made stay here, for what goes on with it. Raises EskerError."""
        if self._tenancy is not None:
            await self._tenancy.hold(terrain)

    def is_here(self, terrain: str) -> bool:
        """Returns whether this server has a terrain, as one that is alone has all."""
        return self._tenancy is None or self._tenancy.may_acknowledge(terrain)

    def in_use(self, terrain: str) -> bool:
        """Returns whether a room of a terrain is open, of its history too."""
        return terrain in self._rooms or self._history_rooms.has(terrain)

    async def hand_over(self, terrain: str) -> None:
        """Commits what was ordered, and sends everybody in a terrain on to whichever server has it then."""
        with suppress(EskerError):  # a room that could not be opened has nobody in it
            await self._take_out(terrain, "moved", MOVING)

    def lose(self, terrain: str) -> None:
        """Closes everybody in a terrain without a word to the journal."""
        room, _ = self.open_room(terrain), self._rooms.pop(terrain, None)
        self._places.release(terrain)
        self._history_rooms.close_terrain(terrain, "moved", MOVING)
        if room is not None:
            for member in room.core.members:
                member.outbox.close("moved", MOVING)
            room.abandon()

    # --- links ------------------------------------------------------------------------------------------------------

    def end_links(self, terrain: str, links: Collection[str]) -> None:
        """Links were revoked: closes everybody who came in by them, ends their join codes and what they have going.

        Some may open other terrains: a teacher's to the copies of a class.
        """
        try:
            others = self.access.elsewhere(terrain, links)
        except Unreachable:  # they are revoked: who came in by them here goes at once, elsewhere when they ask again
            others = {}
        for where in {terrain, *others.values()}:
            ended = [link for link in links if others.get(link, terrain) == where]
            for link in ended:
                self.access.drop_codes(link)
                self.revoke_members(where, link)
            for hears in self.hear_of_ended:
                hears(where, ended)

    def revoke_members(self, terrain: str, link: str) -> None:
        """Closes everybody who came in by a link that no longer works."""
        self._revoke(terrain, link, "revoked", "The link that you opened was revoked by the owner.")

    def renew_members(self, terrain: str, link: str, who: str = "") -> None:
        """Lets everybody who came in by a link show its new secret: they are closed and may come back.

        ``who``: the name of whoever replaced the link.
        """
        by = f" by {who}" if who else ""
        sentence = f"The link was replaced{by}. Your page comes back if it has the new one; else ask for it."
        self._revoke(terrain, link, "shutting_down", sentence)

    def tell_owners(self, terrain: str, sentence: str, besides: str) -> None:
        """Tells a sentence to the owners who are here and did not come in by the link ``besides``."""
        room = self.open_room(terrain)
        if room is not None:
            room.core.tell_owners(sentence, besides)

    def name_of(self, terrain: str, client: str, link: str) -> str:
        """Returns what the member is called who came in by this link as this client; empty when nobody did."""
        room = self.open_room(terrain)
        member = room.core.members.by_client.get(client) if room is not None else None
        return member.name if member is not None and member.link == link else ""

    def _revoke(self, terrain: str, link: str, code: c.CloseCode, sentence: str) -> None:
        room = self.open_room(terrain)
        if room is not None:
            room.core.revoke(link, code, sentence)
        self._history_rooms.revoke(terrain, link, code, sentence)

    async def close(self) -> None:
        """Tells everybody, commits the ordered ops, stops the rooms. The journal stays open."""
        self._closing = True
        rooms = [room for room in (self.open_room(t) for t in list(self._rooms)) if room is not None]
        for room in rooms:
            await room.flush()
            for member in room.core.members:
                member.outbox.close("shutting_down", "The server is stopping. Your page will come back by itself.")
        self._history_rooms.close("shutting_down", "The server is stopping. Your page will come back by itself.")
        for room in rooms:
            room.shut()
        self._rooms.clear()
        self._memory.end()
        self._tile_thread.shutdown(wait=False, cancel_futures=True)
        self._base_threads.shutdown(wait=False, cancel_futures=True)
        self.reading.shutdown()
        self.packing.shutdown()
