"""The wall: every copy of a class, live, through one socket (docs/teaching.md).

Ground comes as the coarsest tiles of each copy, when they change and at most every ``WALL_PACE_MS``: what lies between
is skipped, as for any slow client. What is told of the copies goes the same way. A copy that nobody has open is opened
once, until its ground was sent, and closed again. While nobody draws nothing is sent.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from pydantic import ValidationError

from esker import contract as c
from esker.contract import CloseCode
from esker.errors import Cannot, EskerError
from esker.fairness.buckets import TokenBucket
from esker.fairness.shares import Full, Places, Share, Who
from esker.fairness.spending import Accounts
from esker.lesson.classes import Classes
from esker.session.ground.frames.stream import Stream
from esker.session.room.core import Denied
from esker.session.room.protocol import HELLO_SECONDS
from esker.session.room.room import Room
from esker.session.room.socket import GOODBYE_SECONDS, REASON_BYTES, Transport
from esker.store.access import Link
from esker.store.classes import Class, changed_at

log = logging.getLogger("esker.lesson")

WALLS: Final = Share(64, address=12, network=24)
"""Walls of one server at a time."""
TURN_SECONDS: Final = 0.1
LOOK_SECONDS: Final = 2.0
"""The database is asked what the copies and the pupils are at least so often."""
WAKING: Final = 2
"""Copies that are open at a time for the wall alone."""
WAKE_AGAIN_SECONDS: Final = 5.0
QUIET_SECONDS: Final = 1.0
"""A copy that was opened for the wall is closed once no frame of it came for so long."""
LEFT_OUT: Final = {"task": None, "task_pictures": ()}
"""What a wall does not need of the settings of a copy."""
FOCUS_PER_SECOND: Final = 4.0
MINE, ALL = 10, 3
"""Walls of one address take at most one part of so many of the event loop's time, and all walls together."""


@dataclass
class _Outlet:
    """Where frames of one copy wait (``session.ground.ports.FrameOutlet``)."""

    home: str
    closing: object = None

    def notify(self) -> None:
        """The wall comes by anyway."""

    def close(self, code: CloseCode, reason: str) -> None:
        """The ground could not be prepared."""
        self.closing = (code, reason)


@dataclass
class _Copy:
    """One copy as this wall knows it."""

    number: int
    terrain: str
    names: tuple[str, ...]
    frozen: bool
    settings: c.TerrainSettings
    outlet: _Outlet
    seen: c.TerrainSettings | None = None
    """The settings that ``settings`` was made of last."""
    room: Room | None = None
    stream: Stream | None = None
    top: int = c.WALL_LEVEL
    fresh: bool = True
    next_at: float = 0.0
    drawn: bool = False
    """Whether its ground was sent whole since nobody has had it open."""
    waking: bool = False
    wake_at: float = 0.0
    quiet_since: float = 0.0
    clock: int = -1
    last: float | None = None
    strokes: int = 0
    online: int = 0
    score: c.Score | None = None
    notified: tuple[object, ...] = ()
    """What pages were told of it last."""

    def known(self) -> tuple[object, ...]:
        """Returns what ``facts`` follow from."""
        return (self.names, self.online, self.last, self.strokes, self.frozen, self.settings, self.score)

    def facts(self) -> c.WallCopy:
        """Returns the facts that pages are told of the copy now."""
        return c.WallCopy(
            number=self.number,
            terrain=self.terrain,
            names=self.names,
            online=self.online,
            last=self.last,
            strokes=self.strokes,
            frozen=self.frozen,
            settings=self.settings,
            score=self.score,
        )


class WallRefused(EskerError):
    """This wall cannot be shown: the close code and a sentence."""

    def __init__(self, code: CloseCode, message: str) -> None:
        super().__init__(code, message)
        self.code: CloseCode = code


class Walls:
    """The walls of one server."""

    def __init__(self, classes: Classes) -> None:
        self.classes = classes
        self.places = Places(WALLS)
        self.stale: dict[str, int] = {}
        """How often something of a class changed while it has walls: a wall that has seen less asks again."""
        self._watched: Counter[str] = Counter()
        classes.hear.append(self._heard)

    def _heard(self, lesson: str) -> None:
        if lesson in self._watched:
            self.stale[lesson] = self.stale.get(lesson, 0) + 1

    @contextmanager
    def watching(self, lesson: str, who: Who) -> Iterator[None]:
        """Holds the place of a wall of a class. Raises Full."""
        with self.places.take(who):
            self._watched[lesson] += 1
            try:
                yield
            finally:
                self._watched[lesson] -= 1
                if not self._watched[lesson]:
                    del self._watched[lesson]
                    self.stale.pop(lesson, None)

    def rest(self, who: Who, held: float) -> float:
        """Seconds that a wall rests for after it held up the event loop for ``held`` seconds."""
        mine = self.places.of("address", who.home)
        return max(TURN_SECONDS, held * max(MINE * mine, ALL * len(self.places)))


class WallSession:
    """One wall from its handshake to its end."""

    def __init__(
        self, walls: Walls, transport: Transport, address: str, subprotocol: str | None, accounts: Accounts
    ) -> None:
        """``accounts``: what the walls of an address may take by what they send."""
        self._accounts = accounts
        transport.charge(accounts.stranger(address), transport.abort)
        self._walls, self._classes, self._hub = walls, walls.classes, walls.classes.hub
        self._transport, self._address, self._subprotocol = transport, address, subprotocol
        self._copies: dict[int, _Copy] = {}
        self._focus: tuple[int, ...] = ()
        self._focusing = TokenBucket(FOCUS_PER_SECOND, 4 * FOCUS_PER_SECOND)
        self._notified: c.Wall | None = None
        self._seen, self._looked = -1, float("-inf")
        self._start: c.TerrainSettings | None = None
        self._who = Who(address)
        self._rousing: set[asyncio.Task[None]] = set()
        self._over = False

    async def run(self, messages: AsyncIterator[str | bytes]) -> None:
        """Serves the wall until either side ends it."""
        try:
            link, lesson = await self._open(messages)
            self._who = Who(self._address, link.id)
            with self._walls.watching(lesson.id, self._who):
                self._start = (await self._classes.beginning(lesson, self._who)).settings
                self._hub.door.demand(link)
                await self._serve(link, lesson, messages)
        except (WallRefused, Denied) as error:
            await self._farewell(error.code, error.message)
        except Full:
            await self._farewell("rate_limited", "Many walls are open from your address. Close some pages.")
        except Cannot as error:
            await self._farewell("no_terrain", error.message)
        except (ConnectionError, TimeoutError):
            self._transport.abort()
        finally:
            self._over = True
            for copy in self._copies.values():
                self._leave(copy)
                if copy.waking:
                    self._hub.sleep(copy.terrain)  # nobody else has it open

    async def _open(self, messages: AsyncIterator[str | bytes]) -> tuple[Link, Class]:
        if self._subprotocol != c.SUBPROTOCOL:
            raise WallRefused("bad_protocol", f"This server speaks {c.SUBPROTOCOL}. Reload the page.")
        try:
            hello = _read(await asyncio.wait_for(anext(messages), HELLO_SECONDS))
        except (TimeoutError, StopAsyncIteration):
            raise WallRefused("bad_hello", f"No hello came within {HELLO_SECONDS:.0f} seconds.") from None
        if not isinstance(hello, c.WallHello):
            raise WallRefused("bad_hello", "The first message must be wall.")
        if hello.protocol != c.PROTOCOL_VERSION:
            raise WallRefused("bad_protocol", f"This server speaks protocol {c.PROTOCOL_VERSION}. Reload the page.")
        link = self._hub.door.authorise(hello.terrain, hello.secret, self._address)
        if link.role != "owner":
            raise WallRefused("bad_secret", "Only an owner of the terrain sees the wall.")
        try:
            lesson = self._classes.owned(link, hello.lesson)
        except EskerError as error:
            raise WallRefused("no_terrain", error.message) from None
        self._hub.door.count(Who(self._address, link.id), history=False)
        self._transport.charge(self._accounts.member(self._address), self._transport.abort)
        return link, lesson

    async def _serve(self, link: Link, lesson: Class, messages: AsyncIterator[str | bytes]) -> None:
        reader = asyncio.create_task(self._read_all(messages))
        try:
            while not reader.done():
                now = time.monotonic()
                self._hub.door.demand(link)
                self._look(lesson.id, now)
                for copy in list(self._copies.values()):
                    self._follow(copy, now)
                self._wake(now)
                wall = self._news(lesson.id)
                held = time.monotonic() - now  # beside threads that compute, questions to the database take most of it
                await asyncio.wait_for(self._send(wall, now), c.STALL_SECONDS)
                await asyncio.wait({reader}, timeout=self._walls.rest(self._who, held))
            await reader
        finally:
            reader.cancel()
            await asyncio.gather(reader, return_exceptions=True)

    async def _read_all(self, messages: AsyncIterator[str | bytes]) -> None:
        async for text in messages:
            message = _read(text)
            if not isinstance(message, c.WallFocus):
                raise WallRefused("malformed", "A wall says hello once.")
            if not self._focusing.take(time.monotonic()):
                raise WallRefused("rate_limited", "This wall asked for too much at once.")
            self._focus = message.numbers

    # --- what the copies are ------------------------------------------------------------------------------------

    def _look(self, lesson: str, now: float) -> None:
        """Asks the database for copies and pupils where something changed, or some time has passed."""
        stale = self._walls.stale.get(lesson, 0)
        if stale == self._seen and now - self._looked < LOOK_SECONDS:
            return
        self._seen, self._looked = stale, now
        store = self._classes.store
        names: dict[int, list[str]] = {}
        for pupil in store.pupils(lesson):
            names.setdefault(pupil.number, []).append(pupil.name)
        for found in store.copies(lesson):
            copy = self._copies.get(found.number)
            if copy is None:
                settings = (self._start or c.TerrainSettings()).model_copy(update=LEFT_OUT)
                copy = _Copy(found.number, found.terrain, (), found.frozen, settings, _Outlet(self._who.home))
                self._copies[found.number] = copy
            copy.names, copy.frozen = tuple(names.get(found.number, ())), found.frozen
            if copy.clock < 0:
                copy.clock = self._hub.journal.newest(copy.terrain)
                copy.last = changed_at(self._hub.journal, copy.terrain) if copy.clock else None

    def _follow(self, copy: _Copy, now: float) -> None:
        """Watches the room of a copy while it is open."""
        room = self._hub.open_room(copy.terrain)
        if room is not None and room.closed:
            room = None
        top = c.WALL_CLOSE_LEVEL if copy.number in self._focus else c.WALL_LEVEL
        if room is not copy.room or top != copy.top or copy.outlet.closing is not None:
            if copy.room is not None and room is None and not copy.waking:
                copy.drawn = copy.room.settled and copy.stream is not None and not copy.stream.frames
            if top > copy.top:
                copy.drawn = False  # it is looked at closely: if nobody has it open, it is opened for that
            self._leave(copy)
            copy.top, copy.outlet = top, _Outlet(self._who.home)
            if room is not None:
                copy.room, copy.stream, copy.fresh = room, room.watch(copy.outlet, top), True
                copy.quiet_since = now
        if room is None:
            copy.online = 0
            return
        document = room.core.document
        copy.online = sum(member.role != "owner" for member in room.core.members)
        copy.strokes, copy.score = len(document.strokes), room.scoring.newest
        if copy.seen is not document.settings:
            copy.seen = document.settings
            copy.settings = document.settings.model_copy(update=LEFT_OUT)
        if document.clock != copy.clock:
            copy.clock = document.clock
            copy.last = changed_at(self._hub.journal, copy.terrain)

    def _leave(self, copy: _Copy) -> None:
        if copy.room is not None and copy.stream is not None:
            copy.room.unwatch(copy.stream)
        copy.room = copy.stream = None

    def _wake(self, now: float) -> None:
        """Opens copies whose ground was not sent yet, a few at a time, and closes those of which it was."""
        for copy in self._copies.values():
            if copy.waking and copy.room is not None:
                quiet = now - copy.quiet_since > QUIET_SECONDS and copy.room.settled and not copy.room.scoring.busy
                if quiet or len(copy.room.core.members):
                    copy.waking, copy.drawn = False, quiet
                    self._hub.sleep(copy.terrain)
        busy = sum(copy.waking for copy in self._copies.values())
        for copy in self._copies.values():
            if busy >= WAKING:
                return
            if copy.room is None and not copy.drawn and not copy.waking and now >= copy.wake_at:
                copy.waking, copy.wake_at = True, now + WAKE_AGAIN_SECONDS
                busy += 1
                task = asyncio.create_task(self._rouse(copy))
                self._rousing.add(task)
                task.add_done_callback(self._rousing.discard)

    async def _rouse(self, copy: _Copy) -> None:
        try:
            await self._hub.room(copy.terrain, Who(self._address))
            if self._over:
                self._hub.sleep(copy.terrain)
        except EskerError as error:
            log.info("copy %d was not opened for a wall: %s", copy.number, error)
            copy.waking = False

    # --- what is sent -------------------------------------------------------------------------------------------

    async def _send(self, wall: c.Wall | None, now: float) -> None:
        if wall is not None:
            await self._transport.send_text(wall.model_dump_json(), lambda: None)
        for copy in list(self._copies.values()):
            if copy.room is None or copy.stream is None:
                continue
            room, stream = copy.room, copy.stream
            if now >= copy.next_at:
                room.look_again(stream)
            while (frame := room.watched(stream)) is not None:
                header = bytes((copy.number & 255, copy.number >> 8, copy.fresh, 0))
                copy.fresh, copy.quiet_since, copy.next_at = False, now, now + c.WALL_PACE_MS / 1000
                await self._transport.send_bytes(header + frame)

    def _news(self, lesson: str) -> c.Wall | None:
        """What changed of the class and its copies since the last message."""
        found = self._classes.store.find(lesson)
        if found is None or found.ended is not None:
            raise WallRefused("no_terrain", "This class was deleted.")
        left = max(0.0, found.code_until - self._classes.store.now())
        changed = []
        for copy in self._copies.values():
            if (known := copy.known()) != copy.notified:
                copy.notified = known
                changed.append(copy.facts())
        wall = c.Wall(
            lesson=lesson,
            title=found.title,
            code=found.code if left else None,
            expires_s=left,
            together=found.together,
            places=found.places,
            pupils=sum(len(copy.names) for copy in self._copies.values()),
            show=self._classes.shown(lesson),
            copies=tuple(changed),
        )
        still = (
            self._notified is not None and wall.model_copy(update={"expires_s": 0.0, "copies": ()}) == self._notified
        )
        if still and not changed:
            return None
        self._notified = wall.model_copy(update={"expires_s": 0.0, "copies": ()})
        return wall

    async def _farewell(self, code: CloseCode, reason: str) -> None:
        log.info("closed a wall from %s: %s (%s)", self._address, code, reason)
        text = c.ErrorMessage(code=code, message=reason, fatal=True).model_dump_json()
        try:
            async with asyncio.timeout(GOODBYE_SECONDS):
                await self._transport.send_text(text, lambda: None)
                await self._transport.close(c.WS_CLOSE[code], reason.encode()[:REASON_BYTES].decode(errors="ignore"))
        except (ConnectionError, TimeoutError):
            self._transport.abort()


def _read(text: str | bytes) -> c.WallHello | c.WallFocus:
    if isinstance(text, bytes) or len(text) > c.MAX_MESSAGE_BYTES // 4:
        raise WallRefused("malformed", "A wall sends short texts only.")
    try:
        message: c.WallHello | c.WallFocus = c.WALL_MESSAGE.validate_json(text)
    except ValidationError:
        raise WallRefused("malformed", "The message cannot be read.") from None
    return message
