"""Leases: which node owns a terrain, for a few seconds at a time (DESIGN 18).

A node that owns a terrain renews its lease again and again. It counts on its own monotonic clock, from before it sent
the renewal: clocks of two machines are never compared, and the store compares a lease with its own clock only. Each
taking has an epoch, one more than the one before. Whatever is written for a terrain names the epoch, so that a node
which lost the lease without knowing writes nothing.

``Leases`` is the port. ``OwnLeases`` keeps leases in memory: for a server that is alone on its data folder, and for
tests, where many nodes share one. ``postgres/`` keeps them in the database.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Final, Protocol

from esker.store.engine.ports import Unreachable as Unreachable

LEASE_SECONDS: Final = 6.0
"""How long a lease lives by the store's clock unless it is renewed."""
RENEW_SECONDS: Final = 2.0
"""How often a node renews."""
SILENT_SECONDS: Final = 3.0
"""Seconds since the node sent the last renewal that was answered after which it acknowledges nothing more."""
SHUT_SECONDS: Final = 5.0
"""Seconds after which it shuts the rooms: the lease lives longer, so nobody else has opened them yet."""


@dataclass(frozen=True)
class Node:
    """A process that serves terrains. ``address``: where the other nodes reach it; ``weight``: its share of rooms."""

    name: str
    address: str
    weight: float


@dataclass(frozen=True)
class Lease:
    """A terrain that a node owns. ``epoch``: the number of this taking, greater than all before."""

    terrain: str
    node: str
    epoch: int


class Leases(Protocol):
    """Nodes and leases of one store. Every call blocks, for at most a few seconds, and may come from any thread.

    All raise ``Unreachable`` where the store does not answer: then nobody knows whether it was done.
    """

    def register(self, node: Node, seconds: float) -> None:
        """Writes a node down, anew or again; it is live for ``seconds`` from now."""

    def withdraw(self, name: str) -> None:
        """Removes a node. Its leases stay until they are released or end."""

    def nodes(self) -> tuple[Node, ...]:
        """The live nodes by name."""

    def take(self, terrain: str, node: str, seconds: float) -> Lease | Node:
        """Takes a terrain that nobody owns, or that a node of this name owns; else returns its owner.

        A node that was killed and started again takes its terrains at once: the new epoch shuts the former process
        out. A node that holds a lease does not take it again.
        """

    def take_all(self, terrains: Collection[str], node: str, seconds: float) -> dict[str, Lease | Node]:
        """Takes many terrains at once, each as ``take`` does. One that the store would have to wait for, or that it
        does not know, is left out: ``take`` takes it, and keeps nobody else waiting."""

    def renew(self, leases: Collection[Lease], seconds: float) -> frozenset[str]:
        """Lets leases live for ``seconds`` from now; returns the terrains of those that are held still.

        One that ended is not, even where nobody took it in between: others may have written without a lease.
        """

    def release(self, leases: Collection[Lease]) -> None:
        """Ends leases, those that are still held."""

    def owner(self, terrain: str) -> Node | None:
        """The node that owns a terrain now. One that is not registered any more has an empty address."""


class OwnLeases:
    """Leases in the memory of this process.

    >>> leases = OwnLeases()
    >>> leases.take("lake", "a", 6.0)
    Lease(terrain='lake', node='a', epoch=1)
    >>> leases.register(Node("a", "http://10.0.0.1:8000", 1.0), 6.0)
    >>> leases.take("lake", "b", 6.0)
    Node(name='a', address='http://10.0.0.1:8000', weight=1.0)
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        """``now``: the clock of the store."""
        self._now = now
        self._lock = threading.Lock()
        self._nodes: dict[str, tuple[Node, float]] = {}
        self._leases: dict[str, tuple[Lease, float]] = {}
        """Each with the time at which it ends. A lease that ended stays: its epoch is the last one."""

    def register(self, node: Node, seconds: float) -> None:
        with self._lock:
            self._nodes[node.name] = node, self._now() + seconds

    def withdraw(self, name: str) -> None:
        with self._lock:
            self._nodes.pop(name, None)

    def nodes(self) -> tuple[Node, ...]:
        with self._lock:
            now = self._now()
            return tuple(node for _, (node, until) in sorted(self._nodes.items()) if until > now)

    def take(self, terrain: str, node: str, seconds: float) -> Lease | Node:
        with self._lock:
            now = self._now()
            held, until = self._leases.get(terrain, (Lease(terrain, node, 0), now))
            if until > now and held.node != node:
                return self._node(held.node)
            made = Lease(terrain, node, held.epoch + 1)
            self._leases[terrain] = made, now + seconds
            return made

    def take_all(self, terrains: Collection[str], node: str, seconds: float) -> dict[str, Lease | Node]:
        return {terrain: self.take(terrain, node, seconds) for terrain in terrains}

    def renew(self, leases: Collection[Lease], seconds: float) -> frozenset[str]:
        with self._lock:
            until = self._now() + seconds
            held = [lease for lease in leases if self._holds(lease)]
            self._leases |= {lease.terrain: (lease, until) for lease in held}
            return frozenset(lease.terrain for lease in held)

    def release(self, leases: Collection[Lease]) -> None:
        with self._lock:
            now = self._now()
            self._leases |= {lease.terrain: (lease, now) for lease in leases if self._holds(lease)}

    def owner(self, terrain: str) -> Node | None:
        with self._lock:
            found = self._leases.get(terrain)
            return None if found is None or found[1] <= self._now() else self._node(found[0].node)

    def _holds(self, lease: Lease) -> bool:
        """Whether this taking is the last one of its terrain, and has not ended."""
        found = self._leases.get(lease.terrain)
        return found is not None and found[0] == lease and found[1] > self._now()

    def _node(self, name: str) -> Node:
        found = self._nodes.get(name)
        return Node(name, "", 0.0) if found is None else found[0]
