"""The tenure of a node: for how long it may act as the owner of its rooms, by its own clock alone. Pure.

The database lends a room for ``LEASE_SECONDS`` from the moment at which it does a renewal. The node does not know that
moment, but it knows when it asked, and that was earlier. So a node that counts from *before* it sent a renewal ends its
tenure before the database gives the room to another, whatever the clocks of the two machines say, where seconds are
about as long on both: the last second of a lease is left unused for that.

```
  granted ----> HELD ---- 3 s without an answer ----> DOUBTFUL ---- 2 s more ----> SHUT
                 ^                                        |
                 +------- an answer to a newer question --+          SHUT stays shut: the room is opened anew
```
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from esker.store.engine.leases import SHUT_SECONDS, SILENT_SECONDS


class Phase(Enum):
    """What an owner may do."""

    HELD = "held"
    DOUBTFUL = "doubtful"
    SHUT = "shut"


@dataclass(frozen=True)
class Tenure:
    """The tenure of one lease. Times are of a clock of this process that only ever goes on.

    asked: when the newest question was sent that was answered with yes. ended: the tenure is over for good.
    """

    asked: float
    ended: bool = False

    def phase(self, now: float) -> Phase:
        """Returns what the owner may do now.

        >>> [Tenure(10.0).phase(at).value for at in (10.0, 12.9, 13.0, 14.9, 15.0)]
        ['held', 'held', 'doubtful', 'doubtful', 'shut']
        """
        if self.ended or now - self.asked >= SHUT_SECONDS:
            return Phase.SHUT
        return Phase.HELD if now - self.asked < SILENT_SECONDS else Phase.DOUBTFUL

    def answered(self, asked: float, renewed: bool, now: float) -> Tenure:
        """The answer to a renewal came at ``now`` that was sent at ``asked``. ``renewed``: the lease is still this
        node's. An answer that comes when the tenure is over changes nothing."""
        if self.phase(now) is Phase.SHUT or not renewed:
            return replace(self, ended=True)
        return replace(self, asked=max(self.asked, asked))

    def over(self) -> Tenure:
        """The database refused a write of this lease, or the node has given it back."""
        return replace(self, ended=True)
