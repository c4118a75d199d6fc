"""A client's document: what the server confirmed, and my unconfirmed ops replayed on top (DESIGN 4). No I/O.

The server is the only one that orders, so this is all a client needs. ``frontend/src/doc/sync.ts`` is its twin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from esker import contract as c
from esker.contract import Op
from esker.document.changes import changes
from esker.document.ops import Refusal, StrokeSet
from esker.document.undo import UndoPlan, UndoStack


class Diverged(Exception):
    """A confirmed op does not follow or does not apply: the client must come back for a snapshot."""


@dataclass
class _Pending:
    id: str
    op: Op
    sent: bool = False


class SyncDoc:
    """One client's view of one terrain. Not thread-safe: the owner locks."""

    def __init__(self, client: str, first_counter: int = 0) -> None:
        """``first_counter``: greater than any that this client id ever used."""
        self.client = client
        self.stack = UndoStack()
        self._counter = first_counter
        self._confirmed: StrokeSet | None = None
        self._document: StrokeSet | None = None
        self._pending: list[_Pending] = []

    @property
    def clock(self) -> int | None:
        """Clock of the confirmed document, for the ``hello`` that resumes; None before the first welcome."""
        return None if self._confirmed is None else self._confirmed.clock

    @property
    def confirmed(self) -> StrokeSet:
        """The document that the server has. Raises Refusal before the first welcome."""
        if self._confirmed is None:
            raise Refusal("unavailable", "The terrain is still loading.")
        return self._confirmed

    @property
    def document(self) -> StrokeSet:
        """Confirmed and unconfirmed together. Raises Refusal before the first welcome."""
        if self._document is None:
            raise Refusal("unavailable", "The terrain is still loading.")
        return self._document

    @property
    def pending(self) -> tuple[str, ...]:
        """Ids of my ops that are not in the server's journal yet, oldest first."""
        return tuple(p.id for p in self._pending)

    def submit(self, op: Op, gesture: str | None = None) -> str:
        """Applies an op of mine at once and queues it; returns its id. Raises Refusal."""
        before = self.document
        op_id = self._queue(op)
        self.stack.record(before, op, self.document, gesture, op_id)
        return op_id

    def undo(self) -> UndoPlan:
        """Takes back my last step, as far as nobody else has changed the same fields since."""
        return self._travel(self.stack.undo(self.document))

    def redo(self) -> UndoPlan:
        """Takes back my last undo, by the same rules."""
        return self._travel(self.stack.redo(self.document))

    def _travel(self, plan: UndoPlan) -> UndoPlan:
        for op in plan.ops:
            self._queue(op)
        return plan

    def _queue(self, op: Op) -> str:
        self._document, _ = self.document.apply(op)
        op_id = f"{self.client}:{self._counter}"
        self._counter += 1
        self._pending.append(_Pending(op_id, op))
        return op_id

    def outgoing(self, most: int = c.MAX_OPS_PER_MESSAGE) -> list[c.OpEnvelope]:
        """The next unsent ops, which count as sent from now on."""
        unsent = [p for p in self._pending if not p.sent][:most]
        for entry in unsent:
            entry.sent = True
        return [c.OpEnvelope(id=p.id, op=p.op) for p in unsent]

    def disconnected(self) -> None:
        """The socket is gone: what was not acknowledged will be sent again, under the same ids."""
        for entry in self._pending:
            entry.sent = False

    def start_over(self) -> None:
        """Forgets the confirmed document, so that the next ``hello`` asks for a snapshot."""
        self._confirmed = None

    def welcome(self, message: c.Welcome) -> None:
        """A snapshot, or the ops that I missed. Raises Diverged."""
        self.disconnected()
        if message.document is not None:
            self._confirmed = StrokeSet.from_document(message.document)
        elif self._confirmed is None:
            raise Diverged("the server sent no document")
        self._confirm(message.ops or ())

    def ordered(self, message: c.OpsBroadcast) -> None:
        """One tick of the room. Raises Diverged."""
        self._confirm(message.ops)

    def ack(self, message: c.Ack) -> None:
        """These ops of mine are in the journal; those that the confirmed document holds already are done with."""
        clocks = dict(zip(message.ids, message.clocks, strict=True))
        done = [p for p in self._pending if p.id in clocks and clocks[p.id] <= self.confirmed.clock]
        if done:
            self._drop([p.id for p in done])
            self._rebuild()

    def reject(self, message: c.Reject) -> None:
        """An op of mine was refused: it is rolled back and will not be undone or redone."""
        self._drop([message.id])
        self.stack.forget(message.id)
        self._rebuild()

    def _confirm(self, ops: Sequence[c.OrderedOp]) -> None:
        confirmed = self.confirmed
        for ordered in ops:
            if ordered.clock <= confirmed.clock:
                continue
            if ordered.clock != confirmed.clock + 1:
                raise Diverged(f"op {ordered.clock} came after op {confirmed.clock}")
            before = confirmed
            try:
                confirmed, _ = confirmed.apply(ordered.op)
            except Refusal as refusal:
                raise Diverged(f"op {ordered.clock} does not apply: {refusal.message}") from refusal
            agent = ordered.id.partition(":")[0]
            if ordered.author == self.client != agent and not changes(ordered.op, before, confirmed).empty:
                # What the server did in my name, as the end of an import, is mine to undo: under one id one step.
                self.stack.record(before, ordered.op, confirmed, agent)
        self._confirmed = confirmed
        self._drop([ordered.id for ordered in ops])
        self._rebuild()

    def _drop(self, ids: Sequence[str]) -> None:
        gone = set(ids)
        self._pending = [p for p in self._pending if p.id not in gone]

    def _rebuild(self) -> None:
        """Replays what is unconfirmed. An op that no longer applies stays queued: the server will refuse it."""
        document = self.confirmed
        for entry in self._pending:
            try:
                document, _ = document.apply(entry.op)
            except Refusal:
                continue
        self._document = document
