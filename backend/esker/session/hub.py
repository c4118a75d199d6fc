"""All open rooms of one server, and who may enter them (DESIGN 8, 13)."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from esker import contract as c
from esker.document.ops import Limits, StrokeSet
from esker.session.core import Denied, RoomCore, RoomInfo
from esker.session.limits import RateByKey
from esker.session.outbox import Outbox
from esker.session.past import PastCore, PastRoom, Pasts
from esker.session.ports import Elevation, Tiles
from esker.session.room import Guest, Room
from esker.session.tilethread import TileThread
from esker.session.worker import Worker
from esker.store.access import Access, Link
from esker.store.journal import DamagedTerrain, Journal

log = logging.getLogger("esker.hub")

IDLE_SECONDS: Final = 30.0
"""A room without members stays open this long, so that a reload finds it warm."""
WRONG_SECRETS_PER_MINUTE: Final = 30


class Hub:
    """Opens rooms, closes idle ones, checks secrets. Lives in one event loop."""

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
    ) -> None:
        """``levels``: the finest level solved as a whole; ``finest``: the finest refined (default: none is);
        ``elevation``: makes the base of elevation layers (default: none is laid)."""
        self.journal, self.access = journal, access
        self._worker, self._tiles = worker, tiles
        self._levels, self._finest = levels, levels if finest is None else max(levels, finest)
        self._limits, self._max_members = limits or Limits(), max_members
        self._idle_seconds, self._now = idle_seconds, now
        self._rooms: dict[str, asyncio.Task[Room | None]] = {}
        self._tile_thread = TileThread()
        self._elevation = elevation
        self._laying = ThreadPoolExecutor(1, thread_name_prefix="elevation")
        self._wrong = RateByKey(WRONG_SECRETS_PER_MINUTE / 60, WRONG_SECRETS_PER_MINUTE)
        self._closing = False
        self._pasts = Pasts(journal, self._past_room)

    @property
    def device(self) -> str:
        """The solver's device, in words."""
        return self._worker.device_name

    # --- entering -----------------------------------------------------------------------------------------------

    def authorise(self, terrain: str, secret: str, address: str) -> Link:
        """The live link behind a secret. Raises Denied (no_terrain, bad_secret, revoked, rate_limited)."""
        link = self.access.check(terrain, secret)
        if link is None:
            if not self._wrong.take(address, self._now()):
                raise Denied("rate_limited", "Too many wrong links came from your address. Wait a minute.")
            if not self.journal.exists(terrain):
                raise Denied("no_terrain", "There is no such terrain on this server.")
            raise Denied("bad_secret", "This link does not open this terrain. Ask for a new one.")
        if link.revoked is not None:
            raise Denied("revoked", "This link was revoked by the owner of the terrain.")
        return link

    async def enter(self, hello: c.Hello, outbox: Outbox, address: str) -> tuple[Room, Guest]:
        """Lets a client into its room, opening it if need be. Raises Denied."""
        if self._closing:
            raise Denied("shutting_down", "The server is stopping. Your page will come back by itself.")
        link = self.authorise(hello.terrain, hello.secret, address)
        if hello.at is not None:
            return await self._pasts.enter(hello, link.id, outbox)
        room = await self.room(hello.terrain)
        while room.closed:  # it was idle and closed in this very moment
            room = await self.room(hello.terrain)
        if self.access.check(hello.terrain, hello.secret) is None:  # rotated while the room was being opened
            raise Denied("bad_secret", "This link does not open this terrain. Ask for a new one.")
        return room, room.join(hello, link.role, link.id, outbox)

    # --- rooms --------------------------------------------------------------------------------------------------

    async def room(self, terrain: str) -> Room:
        """The open room of a terrain. Raises Denied (no_terrain, server_error)."""
        task = self._rooms.get(terrain)
        if task is None:
            task = self._rooms[terrain] = asyncio.create_task(self._open(terrain))
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

    async def _open(self, terrain: str) -> Room | None:
        loaded = await asyncio.to_thread(self.journal.load, terrain)
        if loaded is None:
            return None
        core = RoomCore(
            loaded,
            lambda client, counter: self.journal.find(terrain, client, counter),
            self._limits,
            self._max_members,
        )
        return Room(core, journal=self.journal, on_empty=lambda: self._empty(terrain), **self._needs())

    def _past_room(self, core: PastCore, on_empty: Callable[[], None]) -> PastRoom:
        idle = c.PAST_IDLE_SECONDS
        return PastRoom(core, journal=self.journal, on_empty=on_empty, idle_seconds=idle, **self._needs())

    def _needs(self) -> dict[str, Any]:
        """What every room is made with."""
        return {
            "worker": self._worker,
            "tiles": self._tiles,
            "executor": self._tile_thread,
            "info": RoomInfo(self._levels, self._finest, self._worker.device_name),
            "elevation": self._elevation,
            "laying": self._laying,
        }

    def open_room(self, terrain: str) -> Room | None:
        """The room if it is open already."""
        task = self._rooms.get(terrain)
        if task is None or not task.done() or task.cancelled() or task.exception() is not None:
            return None
        return task.result()

    def _empty(self, terrain: str) -> None:
        asyncio.get_running_loop().call_later(self._idle_seconds, self._close_idle, terrain)

    def _close_idle(self, terrain: str) -> None:
        room = self.open_room(terrain)
        if room is not None and not len(room.core.members) and not room.core.busy:
            del self._rooms[terrain]
            room.shut()

    # --- terrains -----------------------------------------------------------------------------------------------

    async def create(self, document: c.Document) -> tuple[c.Document, Link, str]:
        """A new terrain born as ``document`` under a fresh id, with its owner link and that link's secret.

        Raises store.journal.Unwritable; then there is neither.
        """
        born = document.model_copy(update={"id": secrets.token_urlsafe(9), "clock": 0})
        link, secret, insert = self.access.make(born.id, "owner", "Owner")
        await asyncio.wrap_future(self.journal.create(born, insert))
        return born, link, secret

    async def document(self, terrain: str, at: int | None = None) -> c.Document:
        """The committed document, or that of an earlier clock. Raises Denied (no_terrain, server_error)."""
        return (await self.strokes(terrain, at)).to_document()

    async def strokes(self, terrain: str, at: int | None = None) -> StrokeSet:
        """The same as the room holds it."""
        room = self.open_room(terrain)
        if room is not None and (at is None or at >= room.core.document.clock):
            return room.core.document
        try:
            loaded = await asyncio.to_thread(self.journal.load, terrain, at)
        except DamagedTerrain as error:
            raise Denied("server_error", "The journal of this terrain is damaged; nothing was changed.") from error
        if loaded is None:
            raise Denied("no_terrain", "There is no such terrain on this server.")
        return loaded.document

    def revoke_members(self, terrain: str, link: str) -> None:
        """Closes everybody who came in by a link that no longer works."""
        self._revoke(terrain, link, "revoked", "The link that you opened was revoked by the owner.")

    def renew_members(self, terrain: str, link: str) -> None:
        """Lets everybody who came in by a link show its new secret: they are closed and may come back."""
        sentence = "The link was renewed. Your page comes back if it has the new one."
        self._revoke(terrain, link, "shutting_down", sentence)

    def _revoke(self, terrain: str, link: str, code: c.CloseCode, sentence: str) -> None:
        room = self.open_room(terrain)
        if room is not None:
            room.core.revoke(link, code, sentence)
        self._pasts.revoke(terrain, link, code, sentence)

    async def close(self) -> None:
        """Tells everybody, commits what was ordered, stops the rooms. The journal stays open."""
        self._closing = True
        rooms = [room for room in (self.open_room(t) for t in list(self._rooms)) if room is not None]
        for room in rooms:
            await room.flush()
            for member in room.core.members:
                member.outbox.close("shutting_down", "The server is stopping. Your page will come back by itself.")
        self._pasts.close("shutting_down", "The server is stopping. Your page will come back by itself.")
        for room in rooms:
            room.shut()
        self._rooms.clear()
        self._tile_thread.shutdown(wait=False, cancel_futures=True)
        self._laying.shutdown(wait=False, cancel_futures=True)
