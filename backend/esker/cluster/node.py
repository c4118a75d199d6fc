"""This node among the others: which terrains it has, for how long still, and where the others are (DESIGN 18).

Lives in the event loop. The database is asked in threads: leases are renewed by one that has a connection of its own,
so that neither a slow query nor a full loop ends a tenure. What a tenure allows is decided here, by the time that has
passed and by nothing that might come late.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any, Final, TypeVar

from esker.cluster.peers import Elsewhere, Peer, resolved
from esker.cluster.rendezvous import chosen, stepped
from esker.cluster.rooms import Counts, Holding, Rooms
from esker.cluster.tenure import Phase, Tenure
from esker.cluster.together import Together
from esker.store.engine.leases import (
    LEASE_SECONDS,
    RENEW_SECONDS,
    SHUT_SECONDS,
    Lease,
    Leases,
    Node,
    Unreachable,
)

log = logging.getLogger("esker.cluster")
T = TypeVar("T")

IDLE_SECONDS: Final = 30.0
"""A terrain in which nothing happens is given back after so long."""
LOOK_SECONDS: Final = 0.25
PATIENCE_SECONDS: Final = 8.5
"""Whoever comes while a terrain moves is kept waiting for so long: a node that was killed has its leases for six."""
AGAIN_SECONDS: Final = 0.2
KNOWN_SECONDS: Final = 1.0
"""For so long it is believed where a terrain was found. Who is wrong about it is told so by the node that is asked."""
MOST_KNOWN: Final = 10_000
LIVE_SECONDS: Final = 3 * RENEW_SECONDS
THREADS: Final = 6


class Cluster:
    """The node that this process is."""

    def __init__(
        self,
        name: str,
        address: str,
        leases: Leases,
        key: bytes,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name, self.address, self.key = name, address, key
        self.free: Callable[[], float] = lambda: 1.0
        """Solver seconds a second that are not used, by which terrains are shared out."""
        self.counts = Counts()
        self.draining = False
        self._leases, self._now = leases, now
        self._held: dict[str, Holding] = {}
        """By home: the terrain under whose lease others move with it. Never changed in place: threads read it."""
        self._of: dict[str, str] = {}
        """Homes of the terrains that were asked for here, while this node has them."""
        self._taking: dict[str, asyncio.Task[None]] = {}
        self._takes, self._releases = Together(self._take_all), Together(self._release_all)
        self._nodes: tuple[Node, ...] = ()
        self._addresses: dict[str, frozenset[str]] = {}
        """Addresses of nodes on the network, by what they advertise."""
        self._peers: dict[str, Peer] = {}
        self._known: dict[str, tuple[Node, float]] = {}
        """Where terrains were found, and until when that is believed."""
        self._homes: dict[str, str] = {}
        self._using: dict[str, int] = {}
        self._rooms: Rooms | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._threads = ThreadPoolExecutor(THREADS, "leases")
        self._stop = threading.Event()
        self._renewing = threading.Thread(target=self._renew_all, name="renewal", daemon=True)
        self._look: asyncio.TimerHandle | None = None
        self._heard = now()
        """When the newest renewal that was answered was sent."""

    # --- the life of a node -------------------------------------------------------------------------------------

    async def start(self, rooms: Rooms, *, renewing: bool = True) -> None:
        """Registers the node and begins to renew. ``renewing`` False: whoever tests it renews. Raises Unreachable."""
        self._rooms, self._loop = rooms, asyncio.get_running_loop()
        asked = self._now()
        await self._ask(self._leases.register, self._me(), LIVE_SECONDS)
        self._answered(asked, (), frozenset(), await self._ask(self._leases.nodes))
        if renewing:
            self._renewing.start()
        self._watch()

    def _me(self) -> Node:
        return Node(self.name, self.address, stepped(self.free()))

    async def drain(self) -> None:
        """Takes no more terrains, and gives those that it has away, one after the other."""
        self.draining = True
        try:
            await self._ask(self._leases.withdraw, self.name)
        except Unreachable as error:
            log.warning("node %s could not be withdrawn: %s", self.name, error)
        await asyncio.gather(*self._taking.values(), return_exceptions=True)
        log.info("node %s gives %d terrains away", self.name, len(self._held))
        releasing = []
        for home in list(self._held):
            await self._give(home)
            releasing.append(asyncio.create_task(self._release(home)))
        await asyncio.gather(*releasing)

    async def _give(self, home: str) -> None:
        assert self._rooms is not None
        found = self._held.get(home)
        if found is None:
            return
        for terrain in sorted(found.terrains, key=lambda terrain: terrain == home):  # a class goes after its copies
            await self._rooms.hand_over(terrain)

    async def _release(self, home: str) -> None:
        found = self._forget(home)
        if found is None:
            return
        self.counts.released += 1
        try:
            await self._releases.answer(found.lease)
        except Unreachable as error:
            log.warning("the lease of %s ends by itself: %s", home, error)

    async def _release_all(self, leases: list[Lease]) -> dict[Lease, None]:
        await self._ask(self._leases.release, leases)
        return {}

    def _forget(self, home: str) -> Holding | None:
        found = self._held.get(home)
        self._held = {name: each for name, each in self._held.items() if name != home}
        for terrain in found.terrains if found is not None else ():
            self._of.pop(terrain, None)
        return found

    async def close(self) -> None:
        """Ends the threads. Call ``drain`` first."""
        self._stop.set()
        if self._look is not None:
            self._look.cancel()
        for peer in self._peers.values():
            peer.close()
        self._threads.shutdown(wait=False, cancel_futures=True)

    async def _ask(self, work: Callable[..., T], *arguments: Any) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._threads, partial(work, *arguments))

    # --- having terrains ----------------------------------------------------------------------------------------

    @property
    def held(self) -> tuple[str, ...]:
        """The terrains whose leases this node has."""
        return tuple(self._held)

    @property
    def age(self) -> float:
        """Seconds since the newest renewal was sent that was answered."""
        return self._now() - self._heard

    def knows(self, address: str) -> bool:
        """Returns whether a connection from an address may be another node's: it counts as nobody's share."""
        return any(address in found for found in self._addresses.values())

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The live nodes as of the newest renewal."""
        return self._nodes

    def may_acknowledge(self, terrain: str) -> bool:
        """Returns whether what is durable may be acknowledged now."""
        return self._phase(self._of.get(terrain, terrain)) is Phase.HELD

    def right(self, terrain: str) -> tuple[str, int] | None:
        """The name and the epoch of the lease under which this node writes for a terrain; None where it has none. For
        any thread (``store.engine``)."""
        home = self._of.get(terrain, terrain)
        found = self._held.get(home)
        return None if found is None else (home, found.lease.epoch)

    def _phase(self, home: str) -> Phase:
        found = self._held.get(home)
        return Phase.SHUT if found is None else found.tenure.phase(self._now())

    async def hold(self, terrain: str) -> None:
        """Returns when this node has a terrain. Raises Elsewhere."""
        home = await self.home(terrain)
        await self._have(home)
        found = self._held[home]
        if terrain not in found.terrains:
            assert self._rooms is not None
            self._rooms.taken(terrain)
            self._of[terrain] = home
        self._held = {
            **self._held,
            home: replace(found, used=self._now(), terrains=found.terrains | {terrain}),
        }

    @contextmanager
    def using(self, terrain: str) -> Iterator[None]:
        """Keeps a terrain from being given back while something is done with it."""
        self._using[terrain] = self._using.get(terrain, 0) + 1
        try:
            yield
        finally:
            self._using[terrain] -= 1
            if not self._using[terrain]:
                del self._using[terrain]

    async def _have(self, home: str) -> None:
        while True:
            if self.draining:
                raise Elsewhere("This node is being stopped.")
            match self._phase(home):
                case Phase.HELD:
                    return
                case Phase.DOUBTFUL:
                    raise Elsewhere("This node does not reach its database.")
                case Phase.SHUT:
                    self._lose(home)
            task = self._taking.get(home)
            if task is None:
                task = self._taking[home] = asyncio.create_task(self._take(home))
                task.add_done_callback(lambda _: self._taking.pop(home, None))
            await asyncio.shield(task)

    async def _take(self, home: str) -> None:
        self._demand_database()
        try:
            asked, answer = await self._takes.answer(home) or await self._take_alone(home)
        except Unreachable as error:
            raise Elsewhere(f"This node does not reach its database: {error}") from None
        if isinstance(answer, Node):
            self._note(home, answer)
            raise Elsewhere(f"Node {answer.name} has this terrain.")
        if self.draining:
            await self._releases.answer(answer)
            raise Elsewhere("This node is being stopped.")
        self.counts.taken += 1
        self._held = {**self._held, home: Holding(answer, Tenure(asked), self._now())}

    async def _take_all(self, homes: list[str]) -> dict[str, tuple[float, Lease | Node]]:
        """Each with the time before it was asked for, from which its tenure counts."""
        asked = self._now()
        found = await self._ask(self._leases.take_all, homes, self.name, LEASE_SECONDS)
        return {home: (asked, answer) for home, answer in found.items()}

    async def _take_alone(self, home: str) -> tuple[float, Lease | Node]:
        """What others hold up is waited for, beside all other takes."""
        asked = self._now()
        return asked, await self._ask(self._leases.take, home, self.name, LEASE_SECONDS)

    def _demand_database(self) -> None:
        """Raises Elsewhere at once where the database has not answered for long: everybody would wait for it."""
        if self.age >= SHUT_SECONDS:
            raise Elsewhere("This node does not reach its database.")

    def fenced(self, terrain: str) -> None:
        """The database refused a write: another node has the terrain. For any thread."""
        self.counts.fenced += 1
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._lose, self._of.get(terrain, terrain))

    def _lose(self, home: str) -> None:
        found = self._forget(home)
        if found is None:
            return
        self.counts.lost += 1
        log.warning("node %s no longer has terrain %s", self.name, home)
        assert self._rooms is not None
        for terrain in found.terrains:
            self._rooms.lose(terrain)

    async def home(self, terrain: str) -> str:
        """The terrain with which this one moves."""
        found = self._homes.get(terrain)
        if found is None:
            assert self._rooms is not None
            try:
                found = await self._ask(self._rooms.home, terrain)
            except Unreachable as error:
                raise Elsewhere(f"This node does not reach its database: {error}") from None
            if len(self._homes) >= MOST_KNOWN:
                self._homes.clear()
            self._homes[terrain] = found
        return found

    # --- renewing -----------------------------------------------------------------------------------------------

    def _renew_all(self) -> None:
        """Runs in a thread of its own until the node ends."""
        assert self._loop is not None
        while not self._stop.wait(RENEW_SECONDS):
            answer = self._renew()
            if answer is not None and not self._stop.is_set():
                self._loop.call_soon_threadsafe(self._answered, *answer)

    def _renew(self) -> tuple[float, tuple[Lease, ...], frozenset[str], tuple[Node, ...]] | None:
        """Asks the database to renew all leases; None where it does not answer."""
        asked, leases = self._now(), tuple(each.lease for each in self._held.values())
        try:
            if not self.draining:
                self._leases.register(self._me(), LIVE_SECONDS)
            renewed = self._leases.renew(leases, LEASE_SECONDS) if leases else frozenset()
            nodes = self._leases.nodes()
        except Unreachable as error:
            self.counts.renewals_failed += 1
            log.warning("the leases of node %s could not be renewed: %s", self.name, error)
            return None
        others = {node.address for node in nodes}
        new = {each: resolved(each) for each in others - self._addresses.keys()}
        self._addresses = {each: found for each, found in (self._addresses | new).items() if each in others}
        return asked, leases, renewed, nodes

    def _answered(
        self, asked: float, leases: tuple[Lease, ...], renewed: frozenset[str], nodes: tuple[Node, ...]
    ) -> None:
        now = self._now()
        self._heard = max(self._heard, asked)
        self._nodes = nodes
        for name in self._peers.keys() - {node.name for node in nodes}:
            self._peers.pop(name).close()
        held = dict(self._held)
        for lease in leases:
            found = held.get(lease.terrain)
            if found is not None and found.lease == lease:
                tenure = found.tenure.answered(asked, lease.terrain in renewed, now)
                held[lease.terrain] = replace(found, tenure=tenure)
        self._held = held

    def _watch(self) -> None:
        """Shuts what is over, and gives back what nobody uses."""
        assert self._loop is not None
        assert self._rooms is not None
        self._look = self._loop.call_later(LOOK_SECONDS, self._watch)
        now = self._now()
        for terrain, found in list(self._held.items()):
            if found.tenure.phase(now) is Phase.SHUT:
                self._lose(terrain)
            elif now - found.used > IDLE_SECONDS and not self._in_use(terrain):
                self._loop.create_task(self._release(terrain))

    def _in_use(self, home: str) -> bool:
        assert self._rooms is not None
        return any(each in self._using or self._rooms.in_use(each) for each in self._held[home].terrains)

    # --- finding terrains ---------------------------------------------------------------------------------------

    def peer(self, node: Node) -> Peer:
        """The other node to be asked. Raises Elsewhere where it says no address."""
        if not node.address:
            raise Elsewhere(f"Node {node.name} is not there.")
        found = self._peers.get(node.name)
        if found is None or found.node.address != node.address:
            if found is not None:
                found.close()
            found = self._peers[node.name] = Peer(node, self.name, self.key)
        return found

    def _note(self, terrain: str, node: Node) -> None:
        if len(self._known) >= MOST_KNOWN:
            self._known.clear()
        self._known[terrain] = node, self._now() + KNOWN_SECONDS

    async def _owner(self, home: str) -> Node | None:
        found = self._known.get(home)
        if found is not None and found[1] > self._now():
            return found[0]
        self._demand_database()
        try:
            owner = await self._ask(self._leases.owner, home)
        except Unreachable as error:
            raise Elsewhere(f"This node does not reach its database: {error}") from None
        if owner is not None and owner.name != self.name:
            self._note(home, owner)
        return owner

    async def reach(self, terrain: str, attempt: Callable[[Peer], Awaitable[None]], *, taking: bool) -> bool:
        """Does something where a terrain is. Returns False where that is here, and nothing was done.

        ``attempt`` raises Elsewhere as long as it may be tried again. ``taking``: a terrain that nobody has is taken,
        by the node that should have it. Raises Elsewhere when the terrain was found nowhere in time.
        """
        end, tried = self._now() + PATIENCE_SECONDS, set[str]()
        while True:
            try:
                return await self._reached(await self.home(terrain), terrain, attempt, taking, tried)
            except Elsewhere as moved:
                if self._now() > end:
                    raise Elsewhere(f"This terrain is on its way to another server. {moved}") from None
            await asyncio.sleep(AGAIN_SECONDS)

    async def _reached(
        self, home: str, terrain: str, attempt: Callable[[Peer], Awaitable[None]], taking: bool, tried: set[str]
    ) -> bool:
        if self._phase(home) is Phase.HELD:
            if taking:
                await self.hold(terrain)
            return False
        owner = await self._owner(home)
        if owner is None and not taking:
            return False
        if owner is None:
            others = [node for node in self._nodes if node.name not in tried and node.name != self.name]
            owner = chosen(home, others if self.draining else [*others, self._me()])
        if owner is None or owner.name == self.name:
            await self.hold(terrain)
            return False
        try:
            await attempt(self.peer(owner))
        except Elsewhere:
            self._known.pop(home, None)
            tried.add(owner.name)
            raise
        return True
