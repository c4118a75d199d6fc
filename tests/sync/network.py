"""Clients and a room over an in-memory network with random delay and cuts; time is a number, nothing is real.

The room is the real ``RoomCore`` behind the real ``protocol.Connection``; clients are the real ``SyncDoc``. Messages
travel as text. A connection delivers in order, or is cut and loses what is under way, in both directions. The server
may die: what was committed survives, what was not is gone.
"""

from __future__ import annotations

import heapq
import itertools
import random
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet
from esker.document.sync import SyncDoc
from esker.document.wire import op_json
from esker.session.lesson.rules import Lesson
from esker.session.lesson.state import State
from esker.session.room import protocol
from esker.session.room.core import Batch, RoomCore, RoomInfo
from esker.session.room.members import Member
from esker.session.room.outbox import Outbox
from esker.store.claims import Claims
from esker.store.journal import Loaded, Row, replay

INFO = RoomInfo(levels=2, finest=2, device="none")
TICK = 0.033


@dataclass(order=True)
class _Event:
    at: float
    order: int
    run: Callable[[], None] = field(compare=False)


class World:
    """The clock and everything that will happen."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.now = 0.0
        self._events: list[_Event] = []
        self._order = itertools.count()

    def after(self, delay: float, run: Callable[[], None]) -> None:
        self.at(self.now + delay, run)

    def at(self, moment: float, run: Callable[[], None]) -> None:
        """Exactly then: what is added and taken away again may come out of order by a rounding."""
        heapq.heappush(self._events, _Event(moment, next(self._order), run))

    def run(self, until: float = float("inf")) -> None:
        while self._events and self._events[0].at <= until:
            event = heapq.heappop(self._events)
            self.now = event.at
            event.run()


class Server:
    """A room with a journal that is a list."""

    def __init__(self, world: World, birth: StrokeSet) -> None:
        self.world, self.birth = world, birth
        self.rows: list[Row] = []
        self.generation = 0
        self.links: list[Link] = []
        self.claims = Claims()
        self.state = State()
        """How the lesson stands; all clients are pupils."""
        self.core = self._open()
        self._ticking = False

    def _open(self) -> RoomCore:
        counters: dict[str, int] = {}
        for row in self.rows:
            counters[row.client] = max(row.counter, counters.get(row.client, -1))
        loaded = Loaded(replay(self.birth, self.rows), self.rows[-50:], counters)
        return RoomCore(loaded, self._find, claims=self.claims, lesson=Lesson(self.state))

    def _find(self, client: str, counter: int) -> int | None:
        return next((r.clock for r in self.rows if (r.client, r.counter) == (client, counter)), None)

    def ordered(self) -> None:
        if not self._ticking and self.core.waiting:
            self._ticking = True
            self.world.after(self.world.random.uniform(0, TICK), self._tick)

    def _tick(self) -> None:
        self._ticking = False
        batch = self.core.take()
        if batch is None:
            return
        generation = self.generation
        self.world.after(self.world.random.uniform(0, 0.02), lambda: self._committed(generation, batch))

    def _committed(self, generation: int, batch: Batch) -> None:
        if generation != self.generation:
            return  # the server died before the commit
        self.rows.extend(batch.rows)
        self.core.committed(batch)
        self.ordered()

    def lay(self, author: str, n: int, make: Callable[[str, float], c.Layer]) -> None:
        """The end of an import of ``author``'s."""
        layer = make(f"{author}-layer-{n}", 10.0 * n)
        with suppress(Refusal):  # a server that died may find that it has done this already
            self.core.perform(c.AddLayer(layer=layer), f"import-{author}-{n}", author)
            self.ordered()

    def hands(self, off: bool) -> None:
        """A conductor switches."""
        self.state = self.core.lesson.state = self.state.model_copy(update={"hands_off": off})

    def die(self) -> None:
        """SIGKILL and restart: uncommitted ops are gone, every connection is cut."""
        self.generation += 1
        self._ticking = False
        for link in list(self.links):
            link.cut()
        self.core = self._open()


class Link:
    """One connection: two ordered, delaying pipes and the server's protocol state."""

    def __init__(self, client: Client, server: Server) -> None:
        self.client, self.server, self.world = client, server, client.world
        self.alive = True
        self.member: Member | None = None
        self.connection = protocol.Connection(self.world.now, c.SUBPROTOCOL)
        self.outbox = Outbox(self._flush)
        self._last_up = self._last_down = 0.0
        server.links.append(self)

    def _delay(self) -> float:
        rng = self.world.random
        return rng.uniform(0.0002, 0.005) if rng.random() < 0.5 else rng.uniform(0.001, 0.150)

    def up(self, text: str) -> None:
        at = max(self.world.now + self._delay(), self._last_up)
        self._last_up = at
        self.world.at(at, lambda: self._arrive(text))

    def _arrive(self, text: str) -> None:
        if not self.alive:
            return
        for event in self.connection.text(text, self.world.now):
            self._handle(event)

    def _handle(self, event: protocol.Event) -> None:
        core = self.server.core
        if isinstance(event, protocol.Hi):
            self.member = core.join(event.hello, "edit", "link", self.outbox, INFO)
        elif isinstance(event, protocol.Accepted):
            assert self.member is not None
            core.heard(self.member)
            before = core.head.clock
            core.submit(self.member, event.ops)
            assert core.lesson.draws(self.member) or core.head.clock == before, "an op came in while hands were off"
            self.server.ordered()
        else:
            raise AssertionError(f"the simulated client misbehaved: {event}")

    def _flush(self) -> None:
        while (text := self.outbox.pop()) is not None:
            at = max(self.world.now + self._delay(), self._last_down)
            self._last_down = at
            self.world.at(at, lambda text=str(text): self._deliver(text))  # type: ignore[misc]
        if self.outbox.closing is not None:
            self.cut()

    def _deliver(self, text: str) -> None:
        if self.alive:
            self.client.receive(c.SERVER_MESSAGE.validate_json(text))

    def cut(self) -> None:
        if not self.alive:
            return
        self.alive = False
        self.server.links.remove(self)
        if self.member is not None:
            self.server.core.leave(self.member)
        self.client.lost()


class Client:
    """A ``SyncDoc`` that reconnects."""

    def __init__(self, world: World, server: Server, name: str) -> None:
        self.world, self.server, self.name = world, server, name
        self.doc = SyncDoc(name)
        self.link: Link | None = None
        self.refusals: list[c.Reject] = []
        self.acked: set[str] = set()
        self.online = False
        self.token: str | None = None
        self.connect()

    def connect(self) -> None:
        if self.link is not None:
            return
        self.link = Link(self, self.server)
        hello = c.Hello(
            protocol=c.PROTOCOL_VERSION,
            terrain="t",
            secret="s",
            client=self.name,
            token=self.token,
            clock=self.doc.clock,
        )
        self.link.up(hello.model_dump_json())

    def lost(self) -> None:
        self.link, self.online = None, False
        self.doc.disconnected()
        # Often at once: then the server still has ops under way that this client will send again.
        rng = self.world.random
        self.world.after(rng.uniform(0, 0.01) if rng.random() < 0.5 else rng.uniform(0.01, 1.0), self.connect)

    def receive(self, message: object) -> None:
        match message:
            case c.Welcome():
                self.doc.welcome(message)
                self.token, self.online = message.token, True
            case c.OpsBroadcast():
                self.doc.ordered(message)
            case c.Ack():
                self.acked.update(message.ids)
                self.doc.ack(message)
            case c.Reject():
                self.refusals.append(message)
                self.doc.reject(message)
        self.flush()

    def flush(self) -> None:
        if not self.online or self.link is None:
            return
        envelopes = self.doc.outgoing()
        if envelopes:
            items = ",".join(f'{{"id":"{e.id}","op":{op_json(e.op)}}}' for e in envelopes)
            self.link.up(f'{{"type":"ops","ops":[{items}]}}')

    def do(self, op: c.Op, gesture: str | None = None) -> bool:
        """Submits an op; False when it does not apply here (or nothing is loaded yet)."""
        try:
            self.doc.submit(op, gesture)
        except Refusal:
            return False
        self.flush()
        return True

    def undo(self) -> None:
        if self.doc.clock is not None:
            self.doc.undo()
            self.flush()

    def redo(self) -> None:
        if self.doc.clock is not None:
            self.doc.redo()
            self.flush()
