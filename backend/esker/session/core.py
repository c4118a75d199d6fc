"""The document of a room and who is told what about it (DESIGN 4 "Order", 8 "Ticks", "Resume"). No I/O, no time.

Ops are checked and ordered against ``head`` as they come. ``take`` hands the tick's ops to whoever writes the
journal; after the commit ``committed`` tells the members, so nobody ever sees an op that could still be lost. If the
commit fails, ``failed`` forgets the ops and refuses them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from esker import contract as c
from esker.contract import CloseCode, RejectCode, Role
from esker.document.ops import Limits, Refusal, StrokeSet
from esker.document.wire import op_json
from esker.session.members import Member, Members
from esker.session.outbox import Outbox
from esker.store.journal import SNAPSHOT_EVERY, Loaded, Row
from esker.version import VERSION

RECENT_OPS: Final = 2_000
RECENT_CHARACTERS: Final = 4 * 1024 * 1024
"""Ops kept as text for clients that resume, at most so many and so long; who missed more gets a snapshot."""


class Denied(Exception):
    """A client that may not come in: the close code and a sentence."""

    def __init__(self, code: CloseCode, message: str) -> None:
        super().__init__(message)
        self.code: CloseCode = code
        self.message = message


@dataclass(frozen=True)
class Batch:
    """One tick's ops, in clock order, with the document after them."""

    rows: tuple[Row, ...]
    after: StrokeSet
    snapshot: c.Document | None


@dataclass(frozen=True)
class RoomInfo:
    """What a welcome says about the server."""

    levels: int
    finest: int
    device: str


class Recent:
    """The newest committed ops as JSON text, bounded in number and size."""

    def __init__(self) -> None:
        self._ops: deque[tuple[int, str]] = deque()
        self._characters = 0

    def add(self, clock: int, text: str) -> None:
        """The next op; clocks come without gaps."""
        self._ops.append((clock, text))
        self._characters += len(text)
        while len(self._ops) > RECENT_OPS or self._characters > RECENT_CHARACTERS:
            self._characters -= len(self._ops.popleft()[1])

    def after(self, clock: int) -> list[str] | None:
        """The ops after ``clock``, or None when they are not all here."""
        if not self._ops or self._ops[0][0] > clock + 1:
            return None
        return [text for at, text in self._ops if at > clock]


class RoomCore:
    """One terrain with its members."""

    def __init__(
        self,
        loaded: Loaded,
        find: Callable[[str, int], int | None],
        limits: Limits | None = None,
        max_members: int = c.MAX_MEMBERS,
    ) -> None:
        """``find``: the clock of an op of (client, counter) that is in the journal already, or None."""
        self.head = self.document = loaded.document
        self.geometry_clock = loaded.document.clock
        """Clock of the last op that changed the ground."""
        self.base_clock = loaded.document.clock
        """Clock of the last op that changed the elevation layers' part of it."""
        self.members = Members()
        self._find, self._limits, self._max_members = find, limits or Limits(), max_members
        self._counters = dict(loaded.counters)
        self._recent = Recent()
        for row in loaded.recent:
            self._recent.add(row.clock, row.ordered_json())
        self._snapshot_clock = loaded.document.clock - len(loaded.recent)
        self._waiting: list[Row] = []
        self._in_flight: list[Row] = []
        self._document_text: tuple[int, str] = (-1, "")

    # --- people -------------------------------------------------------------------------------------------------

    def join(self, hello: c.Hello, role: Role, link: str, outbox: Outbox, info: RoomInfo) -> Member:
        """Lets a client in and queues its welcome. Raises Denied (room_full, bad_hello)."""
        old = self.members.by_client.get(hello.client)
        if old is not None:
            if old.link != link:
                raise Denied("bad_hello", "Another member has this client id. Reload the page.")
            self.members.remove(old)
            old.outbox.close("bad_hello", "This page connected again; the older connection is closed.")
        if len(self.members) >= self._max_members:
            raise Denied("room_full", f"This terrain has {self._max_members} people in it, which is the limit.")
        member = Member(hello.client, hello.name, self.members.colour(hello.colour), role, link, outbox)
        self.members.add(member)
        outbox.push(self._welcome(member, hello.clock, info), counted=False)
        return member

    def leave(self, member: Member) -> None:
        """Takes a member out. Harmless when it is out already."""
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

    def _welcome(self, member: Member, clock: int | None, info: RoomInfo) -> str:
        missed = self._missed(clock)
        head = c.Welcome(
            protocol=c.PROTOCOL_VERSION,
            server=f"esker {VERSION}",
            client=member.client,
            role=member.role,
            colour=member.colour,
            levels=info.levels,
            finest=info.finest,
            clock=self.document.clock,
            members=self.members.public(),
            device=info.device,
        ).model_dump_json(exclude={"document", "ops"})
        if missed is not None:
            return f'{head[:-1]},"document":null,"ops":[{",".join(missed)}]}}'
        return f'{head[:-1]},"document":{self.document_text()},"ops":null}}'

    def document_text(self) -> str:
        """The confirmed document as JSON, encoded once per clock."""
        if self._document_text[0] != self.document.clock:
            self._document_text = (self.document.clock, self.document.to_document().model_dump_json())
        return self._document_text[1]

    def _missed(self, clock: int | None) -> list[str] | None:
        """The committed ops after ``clock``, or None when only a snapshot will do."""
        now = self.document.clock
        if clock is None or clock > now:
            return None
        return [] if clock == now else self._recent.after(clock)

    # --- ops ----------------------------------------------------------------------------------------------------

    def submit(self, member: Member, ops: Sequence[c.OpEnvelope]) -> int:
        """Orders what applies and refuses the rest; returns how many ops were ordered."""
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
        try:
            self._order(envelope.op, client, counter, client)
        except Refusal as refusal:
            self.refuse(member, envelope.id, refusal.code, refusal.message)
            return False
        return True

    def perform(self, op: c.Op, agent: str, author: str) -> int:
        """Orders an op of the server's own, the first and only one of ``agent``; returns its clock. Raises Refusal.

        ``author``: the client in whose name it is done, who may undo it (``document/sync.py``).
        """
        if self._counters.get(agent, -1) >= 0:
            raise Refusal("duplicate_layer", "This was done already.")
        self._order(op, agent, 0, author)
        return self.head.clock

    def _order(self, op: c.Op, client: str, counter: int, author: str) -> None:
        before = self.head
        after, _ = before.apply(op, self._limits)
        self.head = after
        if after.ground is not before.ground:
            self.base_clock = self.geometry_clock = after.clock
        if after.says is not before.says:
            self.geometry_clock = after.clock
        self._counters[client] = max(counter, self._counters.get(client, -1))
        self._waiting.append(Row(after.clock, client, counter, author, op_json(op)))

    def _known(self, member: Member, client: str, counter: int) -> bool:
        """True for an op that is ordered already: acknowledged now, or with its tick if that is still under way."""
        if any(r.client == client and r.counter == counter for r in (*self._in_flight, *self._waiting)):
            return True
        clock = self._find(client, counter)
        if clock is not None:
            member.outbox.message(c.Ack(ids=(f"{client}:{counter}",), clocks=(clock,)))
        return clock is not None

    # --- ticks --------------------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """True while ops are ordered that are not committed yet."""
        return bool(self._waiting or self._in_flight)

    @property
    def waiting(self) -> bool:
        """True when ``take`` has something to give."""
        return bool(self._waiting) and not self._in_flight

    def take(self) -> Batch | None:
        """The ops of this tick, to be committed. None when there are none or a commit is still under way."""
        if not self.waiting:
            return None
        self._in_flight, self._waiting = self._waiting, []
        due = self.head.clock - self._snapshot_clock >= SNAPSHOT_EVERY
        return Batch(tuple(self._in_flight), self.head, self.head.to_document() if due else None)

    def committed(self, batch: Batch) -> None:
        """The batch is in the journal: tell everybody, then acknowledge the authors."""
        self.document = batch.after
        if batch.snapshot is not None:
            self._snapshot_clock = batch.after.clock
        self._in_flight = []
        texts = [row.ordered_json() for row in batch.rows]
        for row, text in zip(batch.rows, texts, strict=True):
            self._recent.add(row.clock, text)
        shared = f'{{"type":"ordered","ops":[{",".join(texts)}]}}'
        acks: dict[str, list[Row]] = {}
        for row in batch.rows:
            acks.setdefault(row.client, []).append(row)
        for member in self.members:
            mine = acks.get(member.client)
            if mine is None:
                member.outbox.push(shared)
            else:
                member.outbox.push(shared, _ack(mine))

    def failed(self) -> None:
        """The journal did not take the batch: back to what is committed; every op since is refused."""
        lost = [*self._in_flight, *self._waiting]
        self._in_flight, self._waiting = [], []
        self.head = self.document
        self.geometry_clock = self.base_clock = self.head.clock
        for row in lost:
            author = self.members.by_client.get(row.client)
            if author is not None:
                sentence = "The server could not save this change (is its disk full?). It was taken back."
                self.refuse(author, f"{row.client}:{row.counter}", "unavailable", sentence)


def _ack(rows: Sequence[Row]) -> str:
    ids, clocks = ",".join(f'"{r.client}:{r.counter}"' for r in rows), ",".join(str(r.clock) for r in rows)
    return f'{{"type":"ack","ids":[{ids}],"clocks":[{clocks}]}}'


def _adds_layer(op: c.Op) -> bool:
    return any(isinstance(part, c.AddLayer) for part in (op.ops if isinstance(op, c.Group) else (op,)))
