"""Classes of one server: making them, coming in, and what a teacher does to all copies (docs/teaching.md).

A class belongs to the terrain that it was made from: every owner of that terrain is its teacher. A copy is a terrain
like any other, in a room of its own, so everything that a room promises holds for it. Lives in the event loop.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Final, NamedTuple, TypeVar

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet
from esker.errors import Cannot
from esker.fairness.shares import Who
from esker.lesson import merge
from esker.session.room.core import Denied
from esker.session.room.hub import Hub, born_as
from esker.store.access import Link
from esker.store.classes import Class, ClassStore, Copy, NoPlace, Pupil
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


class Seat(NamedTuple):
    """Where a device sits: the class, its copy, and what it is called."""

    lesson: Class
    copy: Copy
    pupil: Pupil


class Classes:
    """All classes of one server."""

    def __init__(self, hub: Hub, grids: GridStore) -> None:
        self.hub, self.grids = hub, grids
        self.store = ClassStore(hub.journal)
        self._shown: dict[str, tuple[int, c.Shown]] = {}
        """What each class is shown, by class: the number of the copy, and how it is reached."""
        self._locks: dict[str, asyncio.Lock] = {}
        self.hear: list[Callable[[str], object]] = []
        """Who is told that something of a class changed."""
        hub.class_of = self.facts_of

    # --- a class ------------------------------------------------------------------------------------------------

    async def make(self, link: Link, title: str, together: int, places: int, at: int | None, who: Who) -> Class:
        """A class from the terrain of an owner's link as it is, or as it was at a clock. Raises Cannot, Denied."""
        document = await self._source(link.terrain, at, who)
        self.hub.door.demand(link)
        lesson = secrets.token_urlsafe(9)
        title = title.strip() or document.settings.title
        made = Class(lesson, link.terrain, title, self.store.now(), document.clock, together, places, None, 0.0, None)
        if not await _done(self.store.make(made, document, c.MAX_CLASSES)):
            raise Cannot(409, "too_many_classes", f"A terrain has at most {c.MAX_CLASSES} classes. Delete one.")
        await _done(self.store.open_door(lesson))
        return self._found(lesson)

    async def _source(self, terrain: str, at: int | None, who: Who) -> c.Document:
        document = await self.hub.document(terrain, at, who)
        if not all(self.grids.has(layer.content) for layer in document.layers):
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

    async def sit(self, lesson: Class, secret: str, name: str, chosen: int | None) -> Seat:
        """A seat for a device: the same one again where it has one. ``chosen``: the number of the copy that it wants to
        share, 0 for one of its own, None for whichever has room. Raises Cannot, store.journal.Unwritable."""
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
                await self._take(lesson, secret, name, self._number(lesson, copies, pupils, chosen))
            except NoPlace:
                raise Cannot(409, "class_full", FULL) from None
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
        following = max((copy.number for copy in copies), default=0) + 1
        if lesson.together == 1 or chosen == 0:
            return following
        free = [k.number for k in copies if sum(p.number == k.number for p in pupils) < lesson.together]
        if chosen is None:
            return free[0] if free else following
        if chosen not in free:
            raise Cannot(409, "group_full", TAKEN)
        return chosen

    async def _take(self, lesson: Class, secret: str, name: str, number: int) -> None:
        """Writes the seat, and the copy where it is a new one, in one commit."""
        copy = next((each for each in self.store.copies(lesson.id) if each.number == number), None)
        if copy is not None:
            link, _, insert = self.hub.access.make(copy.terrain, "edit", name, None, secret)
            pupil = Pupil(link.id, lesson.id, number, name, self.store.now())
            await _done(self.hub.journal.submit(self.store.seating(insert, pupil), lesson.terrain))
            return
        start = await asyncio.to_thread(self.store.document, lesson.id)
        if start is None:
            raise Cannot(404, "no_class", OVER)
        settings = start.settings.model_copy(update={"title": lesson.title})
        born = born_as(start.model_copy(update={"settings": settings}))
        link, _, insert = self.hub.access.make(born.id, "edit", name, None, secret)
        pupil = Pupil(link.id, lesson.id, number, name, self.store.now())
        await _done(self.hub.journal.create(born, self.store.seating(insert, pupil, born.id), lesson.terrain))

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
        """A link of an owner to a copy, made through the teacher's own: terrain and secret. It ends with that."""
        (copy,) = self.chosen(lesson, [number])
        _, secret = await _done(self.hub.access.add(copy.terrain, "owner", OPENED, link))
        return copy.terrain, secret

    async def freeze(self, lesson: Class, numbers: Sequence[int] | None, frozen: bool) -> None:
        """Nobody but owners changes these copies any more, or everybody may again."""
        copies = self.chosen(lesson, numbers)
        await _done(self.store.freeze(lesson.id, [copy.number for copy in copies], frozen))
        self._tell(lesson.id)
        self._changed(lesson.id)

    async def restart(self, lesson: Class, numbers: Sequence[int] | None) -> int:
        """Brings copies back to their beginning; what was drawn stays in their history. Returns how many changed."""
        start = await self._beginning(lesson)
        return await self._each(self.chosen(lesson, numbers), partial(merge.beginning, start))

    async def push(self, lesson: Class, who: Who) -> int:
        """Brings what changed in the terrain of the class since into all copies. Returns how many copies changed.

        The class notes it last: cut off half way, it is done again, and nothing of it twice.
        """
        before, now = await self._beginning(lesson), await self._source(lesson.terrain, None, who)
        known = {stroke.id for stroke in before.strokes}
        drawn = tuple(stroke for stroke in now.strokes if stroke.finished or stroke.id in known)
        now = now.model_copy(update={"strokes": drawn})
        changed = await self._each(self.store.copies(lesson.id), partial(merge.additions, before, now))
        await _done(self.store.set_document(lesson.id, now.clock, now))
        return changed

    async def _beginning(self, lesson: Class) -> c.Document:
        start = await asyncio.to_thread(self.store.document, lesson.id)
        if start is None:
            raise Cannot(404, "no_class", OVER)
        return start

    async def _each(self, copies: Sequence[Copy], plan: Callable[[StrokeSet], list[c.SimpleOp]]) -> int:
        """Does in each copy what ``plan`` says of it, one copy after another. Raises Cannot once all were tried."""
        changed, refused = 0, ""
        for copy in copies:
            if self.hub.deletion.deleted(copy.terrain) is not None:
                continue
            try:
                room = await self.hub.room(copy.terrain)
                ops = plan(room.core.head)
                for op in merge.groups(ops):
                    agent = f"class-{secrets.token_urlsafe(9)}"
                    self.hub.journal.append(copy.terrain, (), None, (Person(agent, OPENED, TEACHER_COLOUR),))
                    await room.perform(op, agent, agent, teacher=True)
                changed += bool(ops)
                self.hub.sleep(copy.terrain)
            except (Refusal, Denied) as error:
                refused = f"Copy {copy.number} could not take it: {error.message}"
        if refused:
            raise Cannot(409, "refused", refused)
        return changed

    async def together(self, lesson: Class, numbers: Sequence[int], title: str, who: Who) -> tuple[c.Document, str]:
        """A new terrain with the strokes of these copies: its document, and the secret of its owner's link."""
        copies = self.chosen(lesson, numbers)
        start = await self._beginning(lesson)
        sets = [await self.hub.strokes(copy.terrain, None, who) for copy in copies]
        try:
            made = merge.together(start, [found.strokes.values() for found in sets], title.strip() or lesson.title)
        except Refusal as refusal:
            raise Cannot(409, "refused", f"Together they are too much for one terrain. {refusal.message}") from None
        born, _, secret = await self.hub.create(made)
        return born, secret

    async def show(self, lesson: Class, number: int | None) -> None:
        """Sends the pages of the class to look at one copy; None: back to their own."""
        copies = self.store.copies(lesson.id)
        if number is not None:
            (copy,) = self.chosen(lesson, [number])
            _, secret = await _done(self.hub.access.add(copy.terrain, "view", SHOWN))
            names = ", ".join(p.name for p in self.store.pupils(lesson.id) if p.number == number and p.name)
            line = (names or f"Copy {number}")[:240]
            self._shown[lesson.id] = (number, c.Shown(terrain=copy.terrain, secret=secret, name=line))
        else:
            self._shown.pop(lesson.id, None)
        self._tell(lesson.id, copies)
        self._changed(lesson.id)
        keep = self._shown.get(lesson.id)
        for each in copies:  # links of former shows, also of before a restart of the server
            for link in self.hub.access.links(each.terrain):
                if link.name == SHOWN and link.role == "view" and link.revoked is None:
                    if keep is not None and self.hub.access.check(each.terrain, keep[1].secret) == link:
                        continue
                    ended = await _done(self.hub.access.revoke(each.terrain, link.id))
                    asyncio.get_running_loop().call_later(2.0, self.hub.end_links, each.terrain, ended)

    # --- the end ------------------------------------------------------------------------------------------------

    async def end(self, lesson: Class, at_once: bool) -> float:
        """Deletes a class with all its copies; everybody in them is closed. Returns until when it can be brought back,
        seconds since 1970. ``at_once``: never."""
        ended = await _done(self.store.end(lesson.id, at_once))
        self._shown.pop(lesson.id, None)
        for copy in self.store.copies(lesson.id):
            await self.hub.close_deleted(copy.terrain)
        if at_once:
            await asyncio.to_thread(self.hub.deletion.remove_old)
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
