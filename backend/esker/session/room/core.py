"""The document of a room and who is told what about it (DESIGN 4 "Order", 8 "Ticks", "Resume"). No I/O, no time.

Ops are checked and ordered against ``head`` as they come. ``take`` hands the tick's ops to whoever writes the
journal; after the commit ``committed`` tells the members, so nobody ever sees an op that could still be lost. If the
commit fails, ``failed`` forgets the ops and refuses them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from esker import contract as c
from esker.contract import CloseCode, RejectCode, Role
from esker.document.ops import Limits, Refusal, StrokeSet
from esker.document.wire import op_json
from esker.fairness.shares import RANK, Full, Place, Places, Rate, Rates, Who, homes
from esker.session.lesson.rules import WAIT, Lesson
from esker.session.room import protocol
from esker.session.room.entry import Denied as Denied
from esker.session.room.entry import Owners
from esker.session.room.members import Member, Members, seats
from esker.session.room.outbox import Long, Outbox
from esker.session.room.replicas.replicas import Replicas
from esker.store.claims import Claims
from esker.store.journal import Loaded, Row
from esker.store.writing import SNAPSHOT_EVERY
from esker.version import VERSION

UNSAVED: Final = "The server could not save this change (is its disk full?). It was taken back."
MOST_AGAINST: Final = protocol.MAX_REFUSED_OPS
"""The connection is closed after so many ops in a row that the lesson did not allow."""


def history_rates() -> Rates:
    """Returns what the journal of a server takes: characters of operations, by link, by address and in all.

    A pen sends some 10,000 a second: a class behind one address, and on one link, draws without meeting this.
    """
    mega = 1 << 20
    return Rates(Rate(mega, 32 * mega), link=Rate(mega / 2, 16 * mega), total=Rate(8 * mega, 128 * mega))


@dataclass(frozen=True)
class Batch:
    """One tick's ops, in clock order, with the document after them."""

    rows: tuple[Row, ...]
    after: StrokeSet
    snapshot: c.Document | None


@dataclass(frozen=True)
class RoomInfo:
    """Facts that a welcome gives about the server."""

    levels: int
    finest: int
    device: str


class RoomCore:
    """One terrain with its members."""

    def __init__(
        self,
        loaded: Loaded,
        find: Callable[[str, int], int | None],
        limits: Limits | None = None,
        max_members: int = c.MAX_MEMBERS,
        rates: Rates | None = None,
        now: Callable[[], float] = time.monotonic,
        claims: Claims | None = None,
        lesson: Lesson | None = None,
        replicas: Replicas | None = None,
    ) -> None:
        """``find``: the clock of an op of (client, counter) that is in the journal already, or None.

        ``rates``: characters of operations that a link and an address may send (``history_rates``); ``claims``: tells
        whose a client id is (default: of whoever comes with it); ``lesson``: its rules (default: nothing is switched);
        ``replicas``: what members are sent of the document.
        """
        self.head = self.document = loaded.document
        self.geometry_clock = loaded.document.clock
        """Clock of the last op that changed the ground."""
        self.base_clock = loaded.document.clock
        """Clock of the last op that changed the ground's elevation layers."""
        self.lesson = lesson or Lesson()
        self.look: str | None = None
        """The client whose view all follow."""
        self.members = Members(self.lesson)
        self._find, self._limits, self._seats = find, limits or Limits(), Places(seats(max_members))
        self._rates, self._now = rates or history_rates(), now
        self._counters = dict(loaded.counters)
        self._owners = Owners(loaded.document.id, claims or Claims(), self._counters)
        self._replicas = replicas or Replicas(loaded, self.lesson)
        self._snapshot_clock = loaded.document.clock - len(loaded.recent)
        self._waiting: list[Row] = []
        self._in_flight: list[Row] = []

    # --- people -------------------------------------------------------------------------------------------------

    def join(
        self,
        hello: c.Hello,
        role: Role,
        link: str,
        outbox: Outbox,
        info: RoomInfo,
        address: str = "",
        asked: int | None = None,
    ) -> Member:
        """Lets a client in and queues its welcome. Raises Denied (room_full, bad_hello, removed).

        ``asked``: the document's clock when it came (default: now), if it had to wait for a heavy document.
        """
        owner, caller = self._owners.owner(hello, link), self._owners.caller(hello, role)
        kept_out = self.lesson.door(caller, caller.since, homes(address)[0])
        if kept_out is not None:
            if kept_out == WAIT:
                self.lesson.waits(caller.person, hello.name)
            raise Denied("removed", kept_out, caller.ticket)
        old = self.members.by_client.get(hello.client)
        if old is not None:
            self.members.remove(old)
            old.outbox.close("bad_hello", "This page connected again; the older connection is closed.")
        seat = self._seat(Who(address, link, RANK[role]))
        colour = self.members.colour(hello.colour)
        member = Member(
            hello.client,
            hello.name,
            colour,
            role,
            link,
            outbox,
            address,
            seat,
            person=caller.person,
            ticket=caller.ticket,
        )
        self.members.add(member)
        self._owners.put(hello.client, owner)
        outbox.belongs(link)
        outbox.push(*self._welcome(member, hello.clock, info, asked=asked), counted=False)
        return member

    def heard(self, member: Member) -> None:
        """Notes that a member said something, so that its welcome has arrived."""
        self._owners.heard(member.client, member.link)

    def belongs(self, client: str, link: str) -> bool:
        """Returns whether things may be done in the name of a client id by who came in by this link."""
        return self._owners.belongs(client, link)

    def _seat(self, who: Who) -> Place:
        try:
            return self._seats.take(who)
        except Full as full:
            most = self._seats.share.total
            sentence = f"This terrain has {most} people in it, which is the limit."
            if full.yours:
                sentence = "As many people as may came in to look by this link or from your address. Try again later."
            elif len(self._seats) < most:
                sentence = "The last seats of this terrain are kept for people who draw. Try again later."
            raise Denied("room_full", sentence) from None

    def leave(self, member: Member) -> None:
        """Takes a member out. It is harmless when the member is out already."""
        self.members.remove(member)

    def revoke(
        self,
        link: str,
        code: CloseCode = "revoked",
        sentence: str = "The link that you opened was revoked by the owner.",
    ) -> None:
        """Closes everybody who came in by this link."""
        for member in self.members:
            if member.link == link:
                member.outbox.close(code, sentence)

    def tell_owners(self, sentence: str, besides: str) -> None:
        """Tells a sentence to the owners who did not come in by the link ``besides``."""
        text = c.ErrorMessage(code="revoked", message=sentence, fatal=False).model_dump_json()
        for member in self.members:
            if member.role == "owner" and member.link != besides:
                member.outbox.push(text)

    def _welcome(
        self, member: Member, clock: int | None, info: RoomInfo, *, exact: bool = False, asked: int | None = None
    ) -> tuple[str | Long, ...]:
        """Returns the welcome.

        Where a heavy document was encoded a while ago, and not ``exact`` is asked, the ops after it too.
        """
        opening = self._replicas.opening(self.document, member, clock, exact=exact, asked=asked)
        head = c.Welcome(
            protocol=c.PROTOCOL_VERSION,
            server=f"esker {VERSION}",
            client=member.client,
            token=self._owners.token(member.client, member.link),
            ticket=member.ticket,
            role=member.role,
            colour=member.colour,
            levels=info.levels,
            finest=info.finest,
            clock=opening.clock,
            members=self.members.public(member),
            device=info.device,
            lesson=self.lesson_for(member),
        ).model_dump_json(exclude={"document", "ops"})
        return self._replicas.welcome(self.document, member, head, opening)

    def lesson_for(self, member: Member) -> c.Lesson:
        """How the lesson stands, as a member may know it."""
        return self.lesson.message_for(member, self.look)

    def keep(self, clock: int, body: bytes, view: bool = False) -> None:
        """Takes the document of a clock that was encoded elsewhere. ``view``: as a link to look is shown it."""
        self._replicas.keep(clock, body, view)

    def ready(self, clock: int | None, view: bool = False, asked: int | None = None) -> bool:
        """Returns whether who has seen ``clock`` (None: nothing) can be welcomed without encoding a heavy document."""
        return self._replicas.ready(self.document, clock, view, asked)

    # --- ops ----------------------------------------------------------------------------------------------------

    def submit(self, member: Member, ops: Sequence[c.OpEnvelope]) -> int:
        """Orders the ops that apply and refuses the others; returns how many ops were ordered."""
        if member.role == "view":
            for envelope in ops:
                self.refuse(member, envelope.id, "view_only", "You opened this terrain with a link to look at it.")
            return 0
        ordered = 0
        for envelope in ops:
            ordered += self._one(member, envelope)
        return ordered

    def refuse(self, member: Member, op_id: str, code: RejectCode, message: str) -> None:
        """Answers one op with a reason."""
        member.outbox.message(c.Reject(id=op_id, code=code, message=message))

    def _one(self, member: Member, envelope: c.OpEnvelope) -> bool:
        client, _, digits = envelope.id.partition(":")
        counter = int(digits)
        if client != member.client:
            self.refuse(member, envelope.id, "malformed", "An op's id starts with the id of the client that sends it.")
            return False
        if counter <= self._counters.get(client, -1) and self._known(member, client, counter):
            return False
        if _adds_layer(envelope.op):
            self.refuse(member, envelope.id, "server_only", "A layer is added by importing a file, not by this op.")
            return False
        text = op_json(envelope.op)
        if not self._rates.take(Who(member.address, member.link), self._now(), len(text)):
            sentence = "Far more came than a pen draws. Slow down and send it again."
            self.refuse(member, envelope.id, "rate_limited", sentence)
            return False
        refused = self.lesson.refusal(member, envelope.op)
        if refused is not None:
            self._against(member, envelope.id, *refused)
            return False
        member.refused = 0
        signed = self.lesson.signed(member, member.name, envelope.op)
        try:
            self._order(signed, text if signed is envelope.op else op_json(signed), client, counter, client)
        except Refusal as refusal:
            self.refuse(member, envelope.id, refusal.code, refusal.message)
            return False
        return True

    def _against(self, member: Member, op_id: str, code: RejectCode, message: str) -> None:
        """Refuses an op that the lesson does not let this member do; a page knows that, so who goes on is closed."""
        self.refuse(member, op_id, code, message)
        member.refused += 1
        if member.refused > MOST_AGAINST:
            member.outbox.close("rate_limited", "Far too many changes came that are not allowed now.")

    def perform(self, op: c.Op, agent: str, author: str, number: int = 0) -> int:
        """Orders an op of the server's own, the one of ``agent`` with this number; returns its clock. Raises Refusal.

        ``author``: the client in whose name it is done, who may undo it (``document/sync.py``).
        """
        if self._counters.get(agent, -1) >= number:
            raise Refusal("duplicate_layer", "This was done already.")
        self._order(op, op_json(op), agent, number, author)
        return self.head.clock

    def _order(self, op: c.Op, text: str, client: str, counter: int, author: str) -> None:
        before = self.head
        after, _ = before.apply(op, self._limits)
        self.head = after
        self._replicas.note(before, op, after.clock)
        self.lesson.made(op, author, self.members.by_client.get(author))
        if after.layers_rev != before.layers_rev:
            self.base_clock = self.geometry_clock = after.clock
        if after.channels_rev != before.channels_rev:
            self.geometry_clock = after.clock
        self._counters[client] = max(counter, self._counters.get(client, -1))
        self._waiting.append(Row(after.clock, client, counter, author, text))

    def _known(self, member: Member, client: str, counter: int) -> bool:
        """Returns True for an op that is ordered already.

        It is acknowledged now, or with its tick if that is still under way.
        """
        if any(r.client == client and r.counter == counter for r in (*self._in_flight, *self._waiting)):
            return True
        clock = self._find(client, counter)
        if clock is not None:
            member.outbox.message(c.Ack(ids=(f"{client}:{counter}",), clocks=(clock,)))
        return clock is not None

    # --- ticks --------------------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """Whether ops are ordered that are not committed yet."""
        return bool(self._waiting or self._in_flight)

    @property
    def waiting(self) -> bool:
        """Whether ``take`` has something to give."""
        return bool(self._waiting) and not self._in_flight

    def take(self) -> Batch | None:
        """Returns the ops of this tick, to be committed. None when there are none or a commit is still under way."""
        if not self.waiting:
            return None
        self._in_flight, self._waiting = self._waiting, []
        due = self.head.clock - self._snapshot_clock >= SNAPSHOT_EVERY
        return Batch(tuple(self._in_flight), self.head, self.head.to_document() if due else None)

    def committed(self, batch: Batch) -> None:
        """Tells everybody about a batch that is in the journal, then acknowledges its authors."""
        self.document = batch.after
        if batch.snapshot is not None:
            self._snapshot_clock = batch.after.clock
        self._in_flight = []
        text_for = self._replicas.committed(batch.rows)
        acks: dict[str, list[Row]] = {}
        for row in batch.rows:
            acks.setdefault(row.client, []).append(row)
        for member in self.members:
            mine = None if self._replicas.looks(member) else acks.get(member.client)
            member.outbox.push(text_for(member), *([] if mine is None else [_ack(mine)]))

    def abandon(self) -> None:
        """Goes back to the committed document without a word: authors send again what was not acknowledged."""
        self._in_flight, self._waiting = [], []
        self.head = self.document

    def failed(self, sentence: str = UNSAVED) -> None:
        """Goes back to the committed document, since the journal did not take the batch.

        Every op since is refused with a sentence.
        """
        lost = [*self._in_flight, *self._waiting]
        self._in_flight, self._waiting = [], []
        self.head = self.document
        self._replicas.forget(self.head.clock)
        self.geometry_clock = self.base_clock = self.head.clock
        for row in lost:
            author = self.members.by_client.get(row.client)
            if author is not None:
                self.refuse(author, f"{row.client}:{row.counter}", "unavailable", sentence)


def _ack(rows: Sequence[Row]) -> str:
    ids, clocks = ",".join(f'"{r.client}:{r.counter}"' for r in rows), ",".join(str(r.clock) for r in rows)
    return f'{{"type":"ack","ids":[{ids}],"clocks":[{clocks}]}}'


def _adds_layer(op: c.Op) -> bool:
    return any(isinstance(part, c.AddLayer) for part in (op.ops if isinstance(op, c.Group) else (op,)))
