"""The people in a room: colours, presence, membership messages (DESIGN 8)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

from esker import contract as c
from esker.contract import Role
from esker.fairness.shares import Place, Share
from esker.session.lesson.rules import Lesson
from esker.session.room.outbox import Outbox

COLOURS: Final = (
    "#3d7dd8",
    "#e0563f",
    "#2f9e63",
    "#b35fd0",
    "#d99a1c",
    "#1f9fb5",
    "#d6457f",
    "#7a8c2e",
    "#6a63e0",
    "#c0713a",
    "#4a9e8f",
    "#a05252",
)
LIST_SECONDS: Final = 0.25
"""The list of members is told at most this often: in a full room it is twenty kilobytes for each of two hundred."""
KEPT_MEMBERS: Final = 2_048
"""What is told of so many members is kept as it is: to check it anew took a fifth of what letting somebody in takes."""
QUIET_BACKLOG_BYTES: Final = 64 * 1024
"""A client with more than this waiting gets no cursors until it catches up: they are worth nothing late."""


def seats(most: int) -> Share:
    """Seats of a room: a fifth is kept for those who draw, a twentieth of all for owners; one address and one link take
    half of all to look."""
    return Share(
        most, address=-(-most // 2), network=-(-most * 3 // 5), link=-(-most // 2), reserve=(most // 5, most // 20)
    )


@lru_cache(maxsize=KEPT_MEMBERS)
def _public_member(client: str, name: str, colour: str, role: Role, person: str, conducts: bool, pen: bool) -> c.Member:
    """What others are told of a member: the same for each of two hundred who come, and with each list of members."""
    return c.Member(client=client, name=name, colour=colour, role=role, person=person, conducts=conducts, pen=pen)


@dataclass(eq=False)
class Member:
    """One client in a room."""

    client: str
    name: str
    colour: str
    role: Role
    link: str
    outbox: Outbox
    address: str = ""
    seat: Place | None = None
    since: int = 0
    """Clock of the document that the member got."""
    presence: c.MemberPresence | None = field(default=None)
    person: str = "-"
    """Who it is, over reloads of the page."""
    ticket: str = ""
    own: str = ""
    """What they call themselves; ``name`` is what the others read."""
    refused: int = 0
    """Ops in a row that the lesson did not allow."""


class Members:
    """The members of a room by client id, and what the others must be told about them at the next presence tick."""

    def __init__(self, lesson: Lesson | None = None) -> None:
        """``lesson``: says what people are called, and who sees whom."""
        self.by_client: dict[str, Member] = {}
        self._lesson = lesson or Lesson()
        self._moved: set[str] = set()
        self._listed = False
        self._listed_at = float("-inf")

    def __len__(self) -> int:
        return len(self.by_client)

    def __iter__(self) -> Iterator[Member]:
        return iter(tuple(self.by_client.values()))

    def public(self, reader: Member) -> tuple[c.Member, ...]:
        """Everybody of whom a member is told, in the order of joining."""
        return tuple(self._public(m) for m in self if self._lesson.sees(reader, m))

    def _public(self, member: Member) -> c.Member:
        conducts, pen = self._lesson.conducts(member), member.person in self._lesson.state.pens
        return _public_member(member.client, member.name, member.colour, member.role, member.person, conducts, pen)

    def add(self, member: Member) -> None:
        """Lets a member in. Where there are others, they hear of it at the next tick."""
        self.by_client[member.client] = member
        member.own = member.own or member.name
        member.name = self._lesson.name(member, member.own)
        self._listed = True
        self._moved.update(m.client for m in self if m.presence is not None)

    def remove(self, member: Member) -> bool:
        """Takes a member out; False when it was out already (or replaced by a newer connection)."""
        if self.by_client.get(member.client) is not member:
            return False
        del self.by_client[member.client]
        if member.seat is not None:
            member.seat.release()
        self._moved.discard(member.client)
        self._listed = True
        return True

    def rename(self, member: Member, name: str, colour: str | None) -> None:
        """Takes a new name, and a new colour unless it is None."""
        member.own, member.colour, self._listed = name, colour or member.colour, True
        member.name = self._lesson.name(member, name)

    def switched(self) -> None:
        """The lesson stands otherwise: names, and who sees whom, may be others."""
        for member in self:
            member.name = self._lesson.name(member, member.own)
        self._listed = True
        self._moved.update(m.client for m in self if m.presence is not None)

    def moved(self, member: Member, presence: c.Presence) -> None:
        """Takes the newest presence, which replaces the one before."""
        member.presence = c.MemberPresence(client=member.client, **presence.model_dump(exclude={"type"}))
        self._moved.add(member.client)

    def colour(self, wanted: str | None) -> str:
        """Returns the wanted colour, else the one of the palette that the fewest members have."""
        if wanted is not None:
            return wanted
        used = [m.colour for m in self]
        return min(COLOURS, key=used.count)

    @property
    def pending(self) -> bool:
        """Whether ``tick`` has something to send."""
        return bool(self._moved) or self._listed

    def tick(self, now: float) -> None:
        """Sends the list of members if it changed, at most every LIST_SECONDS, and the presences that changed."""
        listed = self._listed and now - self._listed_at >= LIST_SECONDS
        if listed:
            self._listed, self._listed_at = False, now
        moved, self._moved = self._moved, set()
        everybody = tuple(self)
        leaders, own = self._seen_by_all(everybody)
        texts: dict[object, list[tuple[str, bool]]] = {}
        for member in everybody:
            # All who see everybody are told the same text, made once; whom others are hidden from sees a few.
            hidden = self._lesson.nameless(member)
            key = member.person if hidden else None
            if key not in texts:
                seen = self._in_order(leaders, own[member.person]) if hidden else everybody
                texts[key] = self._texts(seen, listed, moved)
            for text, always in texts[key]:
                if always or member.outbox.backlog < QUIET_BACKLOG_BYTES:
                    member.outbox.push(text)

    def _seen_by_all(self, everybody: Sequence[Member]) -> tuple[dict[int, Member], dict[str, dict[int, Member]]]:
        """Who leads, and who is the same person, each by the place in the order of joining: who sees nobody else while
        names are hidden sees these (``Lesson.sees``)."""
        leaders: dict[int, Member] = {}
        own: dict[str, dict[int, Member]] = {}
        for place, member in enumerate(everybody):
            own.setdefault(member.person, {})[place] = member
            if self._lesson.conducts(member):
                leaders[place] = member
        return leaders, own

    def _in_order(self, leaders: dict[int, Member], own: dict[int, Member]) -> tuple[Member, ...]:
        both = leaders | own
        return tuple(both[place] for place in sorted(both))

    def _texts(self, seen: Sequence[Member], listed: bool, moved: Collection[str]) -> list[tuple[str, bool]]:
        """What somebody is told who sees these members: texts, and whether also who is behind needs them."""
        texts = [(c.Members(members=tuple(map(self._public, seen))).model_dump_json(), True)] if listed else []
        presences = tuple(m.presence for m in seen if m.client in moved and m.presence is not None)
        if presences:
            texts.append((c.PresenceBroadcast(members=presences).model_dump_json(), False))
        return texts
