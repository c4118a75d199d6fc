"""Classes of one server: making them, coming in, and what a teacher does to all copies (docs/teaching.md).

A class belongs to the terrain that it was made from: every owner of that terrain is its teacher. A copy is a terrain
like any other, in a room of its own, so everything that a room promises holds for it. Lives in the event loop.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Final, NamedTuple, TypeVar
from weakref import WeakValueDictionary

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet
from esker.errors import Cannot
from esker.fairness.shares import Who
from esker.fairness.turns import SERVER, Turns
from esker.lesson import beginnings, merge
from esker.lesson.beginnings import Beginning, Beginnings
from esker.session.births import born_as
from esker.session.room.core import Denied
from esker.session.room.hub import Hub
from esker.session.room.room import Room
from esker.store.access import Ended, Link, SecretTaken, TooManyLinks
from esker.store.classes import Class, ClassStore, Copy, NoPlace, Pupil, TooManyClasses
from esker.store.grids import GridStore
from esker.store.timestamps import Person
from esker.store.upkeep.deletion import GRACE_SECONDS

log = logging.getLogger("esker.lesson")
T = TypeVar("T")

SHOWN: Final = "Shown to all"
"""Name of the links by which a class looks at one copy."""
OPENED: Final = "Teacher"
TEACHER_COLOUR: Final = "#6a63e0"
FULL: Final = "This class is full. Ask your teacher for a place."
TAKEN: Final = "This group has all the people it may have. Choose another one."
OVER: Final = "This class is over. Ask your teacher."
NO_COPY: Final = "There is no such copy in this class."
MANY: Final = f"A terrain has at most {c.MAX_CLASSES} classes. Delete one."
MANY_DELETED: Final = (
    "Many classes of this terrain were deleted within a week. Make this one from a copy of the terrain."
)
MOST_KEPT: Final = 40
"""Classes of one terrain, with those that were deleted and can be brought back."""
ORDERS, ORDERS_WAITING = 4, 8
"""What teachers do to all copies of their classes: so much at a time on the server, of which one address has one; and
what may wait of one address."""
ORDER_REST, LONGEST_ORDER_REST = 3.0, 1.0
"""Beside people of another address an order rests after each copy for so many times as long as that took, and for so
many seconds at most: what it reads is neither a request nor a message, and holds the interpreter."""
PLANS: Final = 3
"""What is to be done to a copy is planned in a thread so often, while somebody draws in it; then in the event loop."""


class Seat(NamedTuple):
    """Where a device sits: the class, its copy, and what it is called."""

    lesson: Class
    copy: Copy
    pupil: Pupil


class Classes:
    """All classes of one server."""

    def __init__(self, hub: Hub, grids: GridStore, is_shared: Callable[[str], bool] = lambda _: False) -> None:
        """``is_shared``: whether people of another address than this one, as ``Who.home`` names it, are there."""
        self.hub, self.grids, self._is_shared = hub, grids, is_shared
        self.store = ClassStore(hub.journal)
        self._shown: dict[str, tuple[int, c.Shown]] = {}
        """What each class is shown, by class: the number of the copy, and how it is reached."""
        self._locks: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        self._orders = Turns(ORDERS, 1, ORDERS_WAITING)
        self._beginnings = Beginnings()
        self.hear: list[Callable[[str], object]] = []
        """Who is told that something of a class changed."""
        hub.class_of = self.facts_of

    # --- a class ------------------------------------------------------------------------------------------------

    async def make(self, link: Link, title: str, together: int, places: int, at: int | None, who: Who) -> Class:
        """A class from the terrain of an owner's link as it is, or as it was at a clock. Raises Cannot, Denied."""
        async with self._orders.turn(who):
            document = await self._source(link.terrain, at, who)
            kept = await self.hub.births.compressed(document, who)
            self.hub.door.demand(link)
            lesson, now = secrets.token_urlsafe(9), self.store.now()
            title = title.strip() or document.settings.title
            made = Class(lesson, link.terrain, title, now, document.clock, together, places, None, 0.0, None)
            try:
                await _done(self.store.make(made, kept, c.MAX_CLASSES, MOST_KEPT))
            except TooManyClasses as error:
                raise Cannot(409, "too_many_classes", MANY_DELETED if error.deleted else MANY) from None
            await _done(self.store.open_door(lesson))
            return self._found(lesson)

    async def _source(self, terrain: str, at: int | None, who: Who) -> c.Document:
        document = await self.hub.document(terrain, at, who)
        if not await asyncio.to_thread(self.grids.has_all, document):
            raise Cannot(409, "no_grid", "An elevation grid of that time is not on this server any more.")
        return document.model_copy(update={"deleted": (), "deleted_layers": ()})

    def owned(self, link: Link, lesson: str, *, ended: bool = False) -> Class:
        """The class, where it was made from the terrain that an owner's link opens. ``ended``: also a deleted one.

        Raises Cannot."""
        found = self.store.find(lesson)
        if found is None or found.terrain != link.terrain or (found.ended is not None and not ended):
            raise Cannot(404, "no_class", "There is no such class of this terrain.")
        return found

    async def door(self, lesson: Class, opened: bool) -> Class:
        """Opens the class by a new code, or closes it: who is in stays in."""
        if opened:
            await _done(self.store.open_door(lesson.id))
        else:
            await _done(self.store.close_door(lesson.id))
        self._changed(lesson.id)
        return self._found(lesson.id)

    def _found(self, lesson: str) -> Class:
        found = self.store.find(lesson)
        if found is None:
            raise Cannot(404, "no_class", OVER)
        return found

    # --- coming in ----------------------------------------------------------------------------------------------

    def by_code(self, code: str) -> Class | None:
        """The class that a code opens; None too where the terrain that it was made from is deleted."""
        found = self.store.by_code(code)
        return None if found is None or self.hub.deletion.deleted(found.terrain) is not None else found

    def seat_of(self, secret: str) -> Seat:
        """Where the device with this secret sits. Raises Cannot."""
        pupil = self.store.seated(secret)
        lesson = None if pupil is None else self.store.find(pupil.lesson)
        if pupil is None or lesson is None or lesson.ended is not None:
            raise Cannot(404, "no_seat", OVER)
        copy = next((each for each in self.store.copies(lesson.id) if each.number == pupil.number), None)
        if copy is None or self.hub.deletion.deleted(copy.terrain) is not None:
            raise Cannot(404, "no_seat", OVER)
        return Seat(lesson, copy, pupil)

    async def sit(self, lesson: Class, secret: str, name: str, chosen: int | None, who: Who) -> Seat:
        """A seat for a device: the same one again where it has one. ``chosen``: the number of the copy that it wants to
        share, 0 for one of its own, None for whichever has room. Raises Cannot, shares.Full, store.journal.Unwritable.
        """
        lock = self._locks.setdefault(lesson.id, asyncio.Lock())
        async with lock:
            known = self.store.seated(secret)
            if known is not None:
                if known.lesson != lesson.id:
                    raise Cannot(409, "secret_taken", "This seat belongs to another class. Reload the page.")
                return self.seat_of(secret)
            pupils, copies = self.store.pupils(lesson.id), self.store.copies(lesson.id)
            if len(pupils) >= lesson.places:
                raise Cannot(409, "class_full", FULL)
            try:
                await self._take(lesson, secret, name, self._number(lesson, copies, pupils, chosen), who)
            except NoPlace:
                raise Cannot(409, "class_full", FULL) from None
            except SecretTaken:
                raise Cannot(409, "secret_taken", "This seat is not free any more. Reload the page.") from None
        seat = self.seat_of(secret)
        self._tell(lesson.id, [seat.copy])
        self._changed(lesson.id)
        return seat

    async def rename(self, seat: Seat, name: str) -> None:
        """Another name for a device."""
        await _done(self.store.rename(seat.pupil.link, name))
        self._tell(seat.lesson.id, [seat.copy])
        self._changed(seat.lesson.id)

    def _number(self, lesson: Class, copies: Sequence[Copy], pupils: Sequence[Pupil], chosen: int | None) -> int:
        """The number of the copy for somebody who comes: of one that is there, or the next one."""
        following = min(set(range(1, len(copies) + 2)) - {copy.number for copy in copies})
        if lesson.together == 1 or chosen == 0:
            return following
        free = [k.number for k in copies if sum(p.number == k.number for p in pupils) < lesson.together]
        if chosen is None:
            return free[0] if free else following
        if chosen not in free:
            raise Cannot(409, "group_full", TAKEN)
        return chosen

    async def _take(self, lesson: Class, secret: str, name: str, number: int, who: Who) -> None:
        """Writes the seat, and the copy where it is a new one, in one commit."""
        copy = next((each for each in self.store.copies(lesson.id) if each.number == number), None)
        if copy is not None:
            link, _, insert = self.hub.access.make(copy.terrain, "edit", name, None, secret)
            pupil = Pupil(link.id, lesson.id, number, name, self.store.now())
            await _done(self.hub.journal.submit(self.store.seating(insert, pupil), lesson.terrain))
            return
        start = await self._beginning(lesson, who)
        settings = start.document.settings.model_copy(update={"title": lesson.title})
        born = born_as(start.document.model_copy(update={"settings": settings}))
        kept = start.find(born)
        if kept is None:
            kept = await self.hub.read(who, start.compress, born)
        link, _, insert = self.hub.access.make(born.id, "edit", name, None, secret)
        pupil = Pupil(link.id, lesson.id, number, name, self.store.now())
        seated = self.store.seating(insert, pupil, born.id)
        await self.hub.births.write(born, seated, who, lesson.terrain, kept)

    # --- what pages are told ------------------------------------------------------------------------------------

    def facts_of(self, terrain: str) -> c.InClass | None:
        """What members of a terrain are told of the class whose copy it is; None where it is no copy."""
        found = self.store.copy_of(terrain)
        lesson = None if found is None else self.store.find(found[0])
        if found is None or lesson is None or lesson.ended is not None:
            return None
        copy = found[1]
        names = tuple(p.name for p in self.store.pupils(lesson.id) if p.number == copy.number)
        show = self._shown.get(lesson.id)
        return c.InClass(
            lesson=lesson.id,
            title=lesson.title,
            number=copy.number,
            names=names,
            frozen=copy.frozen,
            show=None if show is None else show[1],
        )

    def shown(self, lesson: str) -> int | None:
        """The number of the copy that a class is shown."""
        found = self._shown.get(lesson)
        return None if found is None else found[0]

    def _tell(self, lesson: str, copies: Iterable[Copy] | None = None) -> None:
        for copy in self.store.copies(lesson) if copies is None else copies:
            room = self.hub.open_room(copy.terrain)
            if room is not None:
                room.tell_class(self.facts_of(copy.terrain))

    def _changed(self, lesson: str) -> None:
        for hears in self.hear:
            hears(lesson)

    # --- for the teacher ----------------------------------------------------------------------------------------

    def chosen(self, lesson: Class, numbers: Sequence[int] | None) -> list[Copy]:
        """These copies of a class, None: all of them. Raises Cannot where one is not there."""
        copies = self.store.copies(lesson.id)
        if numbers is None:
            return copies
        if not set(numbers) <= {copy.number for copy in copies}:
            raise Cannot(404, "no_copy", NO_COPY)
        return [copy for copy in copies if copy.number in numbers]

    async def open(self, lesson: Class, number: int, link: Link) -> tuple[str, str]:
        """A link of an owner to a copy, made through the teacher's own: terrain and secret. It ends with that. Raises
        Cannot."""
        (copy,) = self.chosen(lesson, [number])
        return copy.terrain, await self._link(copy.terrain, "owner", OPENED, link)

    async def _link(self, terrain: str, role: c.Role, name: str, by: Link | None = None) -> str:
        try:
            _, secret = await _done(self.hub.access.add(terrain, role, name, by))
        except TooManyLinks:
            raise Cannot(409, "too_many_links", "This copy has too many links. Revoke some.") from None
        except Ended:
            raise Cannot(403, "revoked", "Your own link was revoked or renewed meanwhile.") from None
        return secret

    async def freeze(self, lesson: Class, numbers: Sequence[int] | None, frozen: bool) -> None:
        """Nobody but owners changes these copies any more, or everybody may again."""
        copies = self.chosen(lesson, numbers)
        await _done(self.store.freeze(lesson.id, [copy.number for copy in copies], frozen))
        self._tell(lesson.id)
        self._changed(lesson.id)

    async def restart(self, lesson: Class, numbers: Sequence[int] | None, who: Who) -> int:
        """Brings copies back to their beginning; what was drawn stays in their history. Returns how many changed."""
        async with self._orders.turn(who):
            start = await self.beginning(lesson, who)
            return await self._each(self.chosen(lesson, numbers), partial(merge.beginning, start), who)

    async def push(self, lesson: Class, who: Who) -> int:
        """Brings what changed in the terrain of the class since into all copies. Returns how many copies changed.

        The class notes it last: cut off half way, it is done again, and nothing of it twice.
        """
        async with self._orders.turn(who):
            before, now = await self.beginning(lesson, who), await self._source(lesson.terrain, None, who)
            known = {stroke.id for stroke in before.strokes}
            drawn = tuple(stroke for stroke in now.strokes if stroke.finished or stroke.id in known)
            now = now.model_copy(update={"strokes": drawn})
            kept = await self.hub.births.compressed(now, who)
            changed = await self._each(self.store.copies(lesson.id), partial(merge.additions, before, now), who)
            await _done(self.store.set_document(lesson.id, now.clock, kept))
            return changed

    async def beginning(self, lesson: Class, who: Who) -> c.Document:
        """What copies of a class begin as, read for ``who``. Raises Cannot, Denied."""
        return (await self._beginning(lesson, who)).document

    async def _beginning(self, lesson: Class, who: Who) -> Beginning:
        held = self._beginnings.find(lesson.id, lesson.clock)
        if held is None:
            read = await self.hub.read(who, self.store.document, lesson.id)
            if read is None:
                raise Cannot(404, "no_class", OVER)
            held = Beginning(*read)
            self._beginnings.hold(lesson.id, lesson.clock, held)
            asyncio.get_running_loop().call_later(beginnings.SECONDS + 1.0, self._beginnings.forget_old)
        return held

    async def _each(self, copies: Sequence[Copy], plan: Callable[[StrokeSet], list[c.SimpleOp]], who: Who) -> int:
        """Does in each copy what ``plan`` says of it, one copy after another, for ``who``. Raises Cannot once all were
        tried."""
        changed, refused = 0, ""
        for copy in copies:
            if self.hub.deletion.deleted(copy.terrain) is not None:
                continue
            began = time.monotonic()
            try:
                if not await self._differs(copy, plan, who):
                    continue
                room = await self.hub.room(copy.terrain, who, shown=False)
                ops = await self._planned(room, plan, who)
                for op in merge.groups(ops):
                    agent = f"class-{secrets.token_urlsafe(9)}"
                    self.hub.journal.append(copy.terrain, (), (Person(agent, OPENED, TEACHER_COLOUR),))
                    await room.perform(op, agent, agent, teacher=True)
                changed += bool(ops)
            except (Refusal, Denied) as error:
                refused = f"Copy {copy.number} could not take it: {error.message}"
            finally:
                self.hub.sleep(copy.terrain)
                await self._rest(who, time.monotonic() - began)
        if refused:
            raise Cannot(409, "refused", refused)
        return changed

    async def _rest(self, who: Who, took: float) -> None:
        """Rests after one copy, for those of other addresses."""
        if self._is_shared(who.home):
            await asyncio.sleep(min(ORDER_REST * took, LONGEST_ORDER_REST))

    async def _differs(self, copy: Copy, plan: Callable[[StrokeSet], list[c.SimpleOp]], who: Who) -> bool:
        """Whether ``plan`` may have something for a copy. One that nobody has open is not opened to find out."""
        if self.hub.open_room(copy.terrain) is not None:
            return True
        return bool(await self.hub.read(who, plan, await self.hub.strokes(copy.terrain, None, who)))

    async def _planned(self, room: Room, plan: Callable[[StrokeSet], list[c.SimpleOp]], who: Who) -> list[c.SimpleOp]:
        """What ``plan`` says of a room as it is: a heavy one is compared in a thread."""
        for _ in range(PLANS):
            head = room.core.head
            ops = await self.hub.read(who, plan, head)
            if room.core.head is head:
                return ops
        return plan(room.core.head)

    async def together(self, lesson: Class, numbers: Sequence[int], title: str, who: Who) -> tuple[c.Document, str]:
        """A new terrain with the strokes of these copies: its document, and the secret of its owner's link."""
        async with self._orders.turn(who):
            copies = self.chosen(lesson, numbers)
            made = merge.Together(await self.beginning(lesson, who))
            try:
                for copy in copies:
                    began = time.monotonic()
                    found = await self.hub.strokes(copy.terrain, None, who)
                    await self.hub.read(who, made.add, found.strokes.values())
                    await self._rest(who, time.monotonic() - began)
                document = await self.hub.read(who, made.document, title.strip() or lesson.title)
            except Refusal as refusal:
                message = f"Together they are too much for one terrain. {refusal.message}"
                raise Cannot(409, "refused", message) from None
            born, _, secret = await self.hub.create(document, who)
            return born, secret

    async def show(self, lesson: Class, number: int | None) -> None:
        """Sends the pages of the class to look at one copy; None: back to their own. Raises Cannot."""
        copies = self.store.copies(lesson.id)
        if number is not None:
            (copy,) = self.chosen(lesson, [number])
            secret = await self._link(copy.terrain, "view", SHOWN)
            names = ", ".join(p.name for p in self.store.pupils(lesson.id) if p.number == number and p.name)
            line = (names or f"Copy {number}")[:240]
            self._shown[lesson.id] = (number, c.Shown(terrain=copy.terrain, secret=secret, name=line))
        else:
            self._shown.pop(lesson.id, None)
        self._tell(lesson.id, copies)
        self._changed(lesson.id)
        keep = self._shown.get(lesson.id)
        for each in copies:  # links of former shows, also of before a restart of the server
            for link in self.hub.access.called(each.terrain, "view", SHOWN):
                if keep is not None and self.hub.access.check(each.terrain, keep[1].secret) == link:
                    continue
                ended = await _done(self.hub.access.revoke(each.terrain, link.id))
                asyncio.get_running_loop().call_later(2.0, self.hub.end_links, each.terrain, ended)

    # --- the end ------------------------------------------------------------------------------------------------

    async def end(self, lesson: Class, at_once: bool, who: Who = SERVER) -> float:
        """Deletes a class with all its copies; everybody in them is closed. Returns until when it can be brought back,
        seconds since 1970. ``at_once``: never."""
        ended = await _done(self.store.end(lesson.id, at_once))
        self._shown.pop(lesson.id, None)
        for copy in self.store.copies(lesson.id):
            await self.hub.close_deleted(copy.terrain)
        if at_once:
            await self.hub.read(who, self.hub.deletion.remove_old)
        self._changed(lesson.id)
        return ended if at_once else ended + GRACE_SECONDS

    async def end_all(self, terrain: str) -> None:
        """Deletes the classes of a terrain that was deleted."""
        for lesson in self.store.of_terrain(terrain):
            if lesson.ended is None:
                await self.end(lesson, at_once=False)

    async def bring_back(self, lesson: Class) -> None:
        """Takes the deletion of a class back. Raises Cannot."""
        if not await _done(self.store.bring_back(lesson.id)):
            raise Cannot(409, "not_deleted", "This class is not deleted.")
        self._changed(lesson.id)


async def _done(future: Future[T]) -> T:
    return await asyncio.wrap_future(future)
