"""Weighted rendezvous hashing: which node should have a terrain that nobody has. Pure; all nodes agree.

Each node has a score for each terrain, and the highest one is chosen. Where a node goes only its own terrains move, and
where one comes only those move that it is to have. With the score ``-weight / log(hash)`` the chance of a node is its
share of all weights (Schindelhauer and Schomaker, 2005).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from typing import Final

from esker.store.engine.leases import Node

LEAST_WEIGHT: Final = 1e-3
"""A node that is busy through and through still takes what nobody else is there to take."""
STEPS: Final = 2.0
"""Weights are told in steps, so many for each doubling: one that hardly changes moves nothing."""


def chosen(terrain: str, nodes: Iterable[Node]) -> Node | None:
    """Returns the node that should have a terrain; None where there is no node.

    >>> some = [Node("a", "http://a", 1.0), Node("b", "http://b", 1.0)]
    >>> {chosen(f"t{n}", some).name for n in range(20)} == {"a", "b"}
    True
    >>> chosen("t", []) is None
    True
    """
    return max(nodes, key=lambda node: (score(terrain, node), node.name), default=None)


def score(terrain: str, node: Node) -> float:
    """Returns how much a node is the one for a terrain."""
    digest = hashlib.blake2b(f"{node.name}\0{terrain}".encode(), digest_size=8).digest()
    share = (int.from_bytes(digest) + 0.5) / 2.0**64
    return -max(node.weight, LEAST_WEIGHT) / math.log(share)


def stepped(weight: float) -> float:
    """Returns a weight as it is told to others.

    >>> stepped(2.0), stepped(2.1), stepped(3.0)
    (2.0, 2.0, 2.8284271247461903)
    >>> stepped(0.0)
    0.0009765625
    """
    return float(2.0 ** (round(STEPS * math.log2(max(weight, LEAST_WEIGHT))) / STEPS))
