"""The rooms of a process as its node needs them, the leases under which they are, and what a node counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from esker.cluster.tenure import Tenure
from esker.store.engine.leases import Lease


class Rooms(Protocol):
    """The rooms of this process, as a node needs them."""

    def in_use(self, terrain: str) -> bool:
        """Whether something of a terrain is open or under way here."""

    def lose(self, terrain: str) -> None:
        """Shuts what is open of a terrain without writing: another node may have it."""

    async def hand_over(self, terrain: str) -> None:
        """Commits what was ordered, sends everybody on, and shuts what is open of a terrain."""

    def home(self, terrain: str) -> str:
        """Returns the terrain with which this one moves: that of its class, else itself. Asks the database."""

    def taken(self, terrain: str) -> None:
        """Forgets what was known of a terrain: another node may have written meanwhile."""


@dataclass(frozen=True)
class Holding:
    """A terrain that this node has, with those that move with it: a class with its copies, under one lease.

    terrains: those of them that were asked for here. used: when one was last asked for.
    """

    lease: Lease
    tenure: Tenure
    used: float
    terrains: frozenset[str] = frozenset()


@dataclass
class Counts:
    """What a node counts."""

    taken: int = 0
    lost: int = 0
    released: int = 0
    fenced: int = 0
    sockets_passed: int = 0
    sockets_passing: int = 0
    requests_passed: int = 0
    renewals_failed: int = 0
