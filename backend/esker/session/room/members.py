"""The people in a room: colours, presence, membership messages (DESIGN 8)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from esker import contract as c
from esker.contract import Role
from esker.fairness.shares import Place, Share
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
QUIET_BACKLOG_BYTES: Final = 64 * 1024
"""A client with more than this waiting gets no cursors until it catches up: they are worth nothing late."""


def seats(most: int) -> Share:
    """Seats of a room: a fifth is kept for those who draw, a twentieth of all for owners; one address and one link take
    half of all to look."""
    return Share(
        most, address=-(-most // 2), network=-(-most * 3 // 5), link=-(-most // 2), reserve=(most // 5, most // 20)
    )


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

    def public(self) -> c.Member:
        """Returns what the others may know."""
        return c.Member(client=self.client, name=self.name, colour=self.colour, role=self.role)


class Members:
    """The members of a room by client id, and what the others must be told about them at the next presence tick."""

    def __init__(self) -> None:
        self.by_client: dict[str, Member] = {}
        self._moved: set[str] = set()
        self._listed = False

    def __len__(self) -> int:
        return len(self.by_client)

    def __iter__(self) -> Iterator[Member]:
        return iter(tuple(self.by_client.values()))

    def public(self) -> tuple[c.Member, ...]:
        """All members, in the order of joining."""
        return tuple(m.public() for m in self)

    def add(self, member: Member) -> None:
        """Lets a member in. Where there are others, they hear of it at the next tick."""
        self.by_client[member.client] = member
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
        member.name, member.colour, self._listed = name, colour or member.colour, True

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

    def tick(self) -> None:
        """Sends the list of members if it changed, and the presences that changed."""
        texts: list[tuple[str, bool]] = []
        if self._listed:
            texts.append((c.Members(members=self.public()).model_dump_json(), True))
        live = [self.by_client[k].presence for k in self._moved if k in self.by_client]
        presences = tuple(p for p in live if p is not None)
        if presences:
            texts.append((c.PresenceBroadcast(members=presences).model_dump_json(), False))
        self._listed = False
        self._moved.clear()
        for member in self:
            for text, always in texts:
                if always or member.outbox.backlog < QUIET_BACKLOG_BYTES:
                    member.outbox.push(text)
