"""What members of a room are sent of its document: the whole, or what they missed, and then each tick's ops.

All is committed, and is text. A heavy document is encoded once for all who come, in one of two ways: as it is, and as a
link to look shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.session.lesson.rules import Lesson
from esker.session.room.members import Member
from esker.session.room.outbox import Long
from esker.session.room.replicas.recent import Recent, encoded, points_of
from esker.session.room.replicas.viewing import Viewing, nameless, unsigned
from esker.store.journal import Loaded, Row

HEAVY_BYTES: Final = 256 * 1024
"""Documents that are longer as JSON are sent as one piece of memory to all who come."""
HEAVY_POINTS: Final = 4_000
"""Documents with more points are encoded outside of the event loop."""
SINCE_CHARACTERS: Final = 512 * 1024
"""A heavy document that was encoded is sent to newcomers, and then the ops after it, while these are no more than
this."""


class Opening(NamedTuple):
    """What a member begins with: the whole document of a clock, or the ops that were missed up to it."""

    clock: int
    body: bytes
    missed: list[tuple[int, str]] | None


class Replicas:
    """The replicas of one document that the members of its room hold."""

    def __init__(self, loaded: Loaded, lesson: Lesson) -> None:
        self._lesson = lesson
        self._recent, self._viewing = Recent(), Viewing()
        for row in loaded.recent:
            self._recent.add(row.clock, row.ordered_json())
            self._viewing.loaded(row.clock, row.op)
        self._kept: dict[bool, tuple[int, bytes]] = {}
        """Encoded documents with their clocks. The key says whether they are as links to look are shown them."""
        self._weighed = (-1, 0)
        """The clock at which the points of the document were counted last, and how many there were."""
        self._unsigned: tuple[int, bytes] | None = None
        """The encoded document without the names of people who drew, with its clock."""

    def note(self, before: StrokeSet, op: c.Op, clock: int) -> None:
        """Takes an op that was ordered on the document ``before``."""
        self._viewing.note(before, op, clock)

    def forget(self, clock: int) -> None:
        """Forgets what was ordered after ``clock``: nothing of it was committed."""
        self._viewing.forget(clock)

    # --- whoever comes ------------------------------------------------------------------------------------------

    def ready(self, document: StrokeSet, clock: int | None, view: bool = False, asked: int | None = None) -> bool:
        """Returns whether who has seen ``clock`` (None: nothing) can be welcomed without encoding a heavy document."""
        if self._missed(document, clock, view) is not None or not self._is_heavy(document):
            return True
        return self._usable(document, view, asked=asked) is not None

    def _is_heavy(self, document: StrokeSet) -> bool:
        if self._weighed[0] != document.clock:
            self._weighed = document.clock, points_of(document)
        return self._weighed[1] > HEAVY_POINTS

    def keep(self, clock: int, body: bytes, view: bool = False) -> None:
        """Takes the document of a clock that was encoded elsewhere. ``view``: as a link to look is shown it."""
        if view not in self._kept or self._kept[view][0] < clock:
            self._kept[view] = clock, body

    def opening(
        self, document: StrokeSet, member: Member, clock: int | None, *, exact: bool = False, asked: int | None = None
    ) -> Opening:
        """Returns what a member who has seen ``clock`` begins with; from then on the member has it.

        ``exact``: the document of now and no other; ``asked``: the clock when the member came.
        """
        view = self.looks(member)
        missed = self._missed(document, clock, view)
        if missed is not None:
            member.since = clock or 0
            return Opening(document.clock, b"", missed)
        now, body = self._usable(document, view, exact, asked) or self._encode(document, view)
        member.since = now
        if not view and self._lesson.nameless(member):
            body = self._without_names(now, body)
        return Opening(now, body, None)

    def welcome(self, document: StrokeSet, member: Member, head: str, opening: Opening) -> tuple[str | Long, ...]:
        """Returns the ``welcome`` that begins as ``head``; after a heavy document the ops since it was encoded, too."""
        now, body, missed = opening
        if missed is not None:
            return (f'{head[:-1]},"document":null,"ops":[{",".join(self._as_seen(member, missed))}]}}',)
        if len(body) <= HEAVY_BYTES:
            return (f'{head[:-1]},"document":{body.decode()},"ops":null}}',)
        text = Long(f'{head[:-1]},"document":'.encode(), body, b',"ops":null}')
        since = self._recent.after(now) if now < document.clock else None
        return (text, _ordered(self._as_seen(member, since))) if since else (text,)

    def looks(self, member: Member) -> bool:
        """Returns whether a member is shown what a link to look shows."""
        return member.role == "view"

    def encoded(self, document: StrokeSet, view: bool) -> bytes:
        """Returns the document as JSON; ``view``: as a link to look is shown it."""
        return encoded(document, view)

    def _encode(self, document: StrokeSet, view: bool) -> tuple[int, bytes]:
        found = self._kept[view] = document.clock, self.encoded(document, view)
        return found

    def _without_names(self, clock: int, body: bytes) -> bytes:
        if self._unsigned is None or self._unsigned[0] != clock:
            self._unsigned = clock, unsigned(body)
        return self._unsigned[1]

    def _usable(
        self, document: StrokeSet, view: bool, exact: bool = False, asked: int | None = None
    ) -> tuple[int, bytes] | None:
        """Returns the encoded document with its clock, if it is still good for a client that came when the clock was
        ``asked``: a viewer gets nothing that was deleted before."""
        kept = self._kept.get(view)
        if kept is None or kept[0] == document.clock:
            return kept
        if exact or len(kept[1]) <= HEAVY_BYTES:
            return None
        if view and kept[0] < (document.clock if asked is None else asked) and self._viewing.ended(kept[0]):
            return None
        since = self._recent.after(kept[0])
        return kept if since is not None and sum(len(text) for _, text in since) <= SINCE_CHARACTERS else None

    def _missed(self, document: StrokeSet, clock: int | None, view: bool = False) -> list[tuple[int, str]] | None:
        """Returns the committed ops after ``clock``, or None when only a snapshot will do."""
        now = document.clock
        if clock is None or clock > now or (view and not self._viewing.resumable(clock)):
            return None
        return [] if clock == now else self._recent.after(clock)

    # --- whoever is here ----------------------------------------------------------------------------------------

    def committed(self, rows: Sequence[Row]) -> Callable[[Member], str]:
        """Takes ops that are in the journal. Returns what tells a member about them."""
        texts = [(row.clock, row.ordered_json()) for row in rows]
        for clock, text in texts:
            self._recent.add(clock, text)
        shared = _ordered([text for _, text in texts])
        others: dict[object, str] = {}

        def text_for(member: Member) -> str:
            if self.looks(member):
                variant: object = self._viewing.variant((row.clock for row in rows), member.since)
            elif self._lesson.nameless(member):
                variant = ""
            else:
                return shared
            if variant not in others:
                others[variant] = _ordered(self._as_seen(member, texts))
            return others[variant]

        return text_for

    def _as_seen(self, member: Member, ordered: list[tuple[int, str]]) -> list[str]:
        if self.looks(member):
            return self._viewing.texts(ordered, member.since)
        if self._lesson.nameless(member):
            return [nameless(text) for _, text in ordered]
        return [text for _, text in ordered]


def _ordered(texts: Sequence[str]) -> str:
    return f'{{"type":"ordered","ops":[{",".join(texts)}]}}'
