"""A thousand nodes and a hundred thousand terrains, by arithmetic.

Scores are those of ``cluster/rendezvous.py`` with another hash, which NumPy computes for all pairs at once. What a take
of leases and the opening of a terrain cost is read from the last measured ``cluster.json``. The database does one
statement after the other; a node has one on its way, and takes by the next one all that was asked of it meanwhile; it
opens terrains on its processors; nothing else is in anybody's way.
"""

from __future__ import annotations

import heapq
import math
from collections import deque
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.report import result
from esker.store.engine.leases import LEASE_SECONDS, RENEW_SECONDS

NODES: Final = 1_000
TERRAINS: Final = 100_000
CHUNK: Final = 2_000
CORES: Final = 8
ACTIVE: Final = 0.2
"""Share of the terrains in which somebody draws at a time."""
SEED: Final = 18
Whole = NDArray[np.int64]
Real = NDArray[np.float64]


def run() -> dict[str, Any]:
    """All scenes."""
    costs = measured()
    random = np.random.default_rng(SEED)
    weights = np.ones(NODES)
    owners = placed(weights)
    # Most terrains ask little of a solver, and few ask much.
    load = np.where(random.random(TERRAINS) < ACTIVE, random.lognormal(-3.0, 1.0, TERRAINS), 0.0)
    return {
        "nodes": NODES,
        "terrains": TERRAINS,
        "costs": costs,
        "balance": balance(owners, load),
        "balance_with_weights": weighted(load),
        "one_node_more": grown(owners),
        "failures": [failed(owners, count, costs, random) for count in (1, 10, 100)],
        "rolling_restart": restarted(owners, costs),
        "flash_crowd": crowd(weights, costs, random),
    }


def measured() -> dict[str, float]:
    """What things cost, from the last run on a real database."""
    found = result("cluster")
    return {
        "takes_per_s": found["appends"]["takes_per_s"],
        "take_1000_ms": found["appends"]["take_1000_ms"],
        "open_s": found["openings"]["median_ms"] / 1000,
        "renew_1000_ms": found["appends"]["renew_1000_ms"],
    }


def _mixed(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """A finaliser of SplitMix64: every bit of the result depends on every bit of the value."""
    values = (values ^ (values >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ (values >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return values ^ (values >> np.uint64(31))


def placed(weights: Real, terrains: Whole | None = None) -> Whole:
    """The node of each terrain; a node of weight 0 is not there."""
    names = _mixed(np.arange(1, len(weights) + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15))
    there = np.flatnonzero(weights > 0)
    which = np.arange(TERRAINS) if terrains is None else terrains
    found = np.empty(len(which), dtype=np.int64)
    with np.errstate(over="ignore"):
        for begin in range(0, len(which), CHUNK):
            some = which[begin : begin + CHUNK].astype(np.uint64)
            keys = _mixed(some * np.uint64(0xD1342543DE82EF95) + np.uint64(1))
            share = (_mixed(keys[:, None] ^ names[None, there]) >> np.uint64(11)).astype(np.float64) * 2.0**-53
            scores = -weights[None, there] / np.log(share + 2.0**-54)
            found[begin : begin + CHUNK] = there[np.argmax(scores, axis=1)]
    return found


def balance(owners: Whole, load: Real) -> dict[str, Any]:
    """How evenly terrains and their solving lie."""
    counts = np.bincount(owners, minlength=NODES)
    loads = np.bincount(owners, weights=load, minlength=NODES)
    return {
        "terrains_a_node": {"mean": float(counts.mean()), "least": int(counts.min()), "most": int(counts.max())},
        "solver_most_to_mean": round(float(loads.max() / loads.mean()), 3),
        "solver_seconds_a_second_mean": round(float(loads.mean()), 3),
    }


def weighted(load: Real) -> dict[str, Any]:
    """Terrains come one after the other to the node that has most free then, by its weight of every ten seconds."""
    used, weights = np.zeros(NODES), np.full(NODES, float(CORES))
    for begin in range(0, TERRAINS, TERRAINS // 20):
        some = np.arange(begin, min(TERRAINS, begin + TERRAINS // 20))
        used += np.bincount(placed(weights, some), weights=load[some], minlength=NODES)
        weights = np.exp2(np.round(2 * np.log2(np.maximum(CORES - used, 0.05))) / 2)
    return {"solver_most_to_mean": round(float(used.max() / used.mean()), 3)}


def grown(owners: Whole) -> dict[str, Any]:
    """A node comes: what would move, if nobody were in it."""
    after = placed(np.ones(NODES + 1))
    moved = after != owners
    return {"moved": int(moved.sum()), "moved_elsewhere": int((after[moved] != NODES).sum())}


def failed(owners: Whole, count: int, costs: dict[str, float], random: np.random.Generator) -> dict[str, Any]:
    """Nodes die at once. Their terrains are taken when their leases end, as people come back."""
    weights = np.ones(NODES)
    weights[random.choice(NODES, count, replace=False)] = 0.0
    lost = np.flatnonzero(weights[owners] == 0)
    after = placed(weights, lost)
    active = lost[random.random(len(lost)) < ACTIVE]
    new = dict(zip(lost.tolist(), after.tolist(), strict=True))
    died = random.uniform(0.0, RENEW_SECONDS, len(active))
    wait = _opened(((LEASE_SECONDS - d, new[int(t)]) for t, d in zip(active, died, strict=True)), costs)
    return {
        "nodes_lost": count,
        "terrains_moved": len(lost),
        "moved_for_nothing": int((placed(weights)[weights[owners] > 0] != owners[weights[owners] > 0]).sum()),
        "most_for_one_node": int(np.bincount(after, minlength=NODES).max()),
        "seconds_until_open": _quantiles(wait),
    }


def _opened(arrivals: Iterator[tuple[float, int]], costs: dict[str, float]) -> list[float]:
    """When each is open, in order of arrival: a queue at the database, then one at the node's processors."""
    coming = sorted(arrivals)
    taken = _taken(coming, costs)
    cores: dict[int, list[float]] = {}
    done = [0.0] * len(coming)
    for n in sorted(range(len(coming)), key=taken.__getitem__):
        heap = cores.setdefault(coming[n][1], [0.0] * CORES)
        done[n] = max(heap[0], taken[n]) + costs["open_s"]
        heapq.heapreplace(heap, done[n])
    return done


def _statement(terrains: int, costs: dict[str, float]) -> float:
    """Seconds for which a statement keeps the database: what one terrain costs, and for each further one a thousandth
    of what a thousand cost together."""
    return 1.0 / costs["takes_per_s"] + (terrains - 1) * costs["take_1000_ms"] / 1e6


def _taken(coming: list[tuple[float, int]], costs: dict[str, float]) -> list[float]:
    """When the lease of each is taken."""
    taken, free = [0.0] * len(coming), 0.0
    queue: deque[tuple[float, int, list[int]]] = deque()
    """Statements by the time at which they were sent, with their node and what they take."""
    asked: dict[int, list[int]] = {}
    """What the next statement takes, of each node that has one on its way."""
    for n, (at, node) in enumerate([*coming, (math.inf, -1)]):
        while queue and (end := max(free, queue[0][0]) + _statement(len(queue[0][2]), costs)) <= at:
            _, sender, some = queue.popleft()
            free = end
            for each in some:
                taken[each] = end
            if gathered := asked.pop(sender):
                queue.append((end, sender, gathered))
                asked[sender] = []
        if node in asked:
            asked[node].append(n)
        elif node >= 0:
            queue.append((at, node, [n]))
            asked[node] = []
    return taken


def restarted(owners: Whole, costs: dict[str, float]) -> dict[str, Any]:
    """All nodes are stopped and started one after the other."""
    counts = np.bincount(owners, minlength=NODES)
    most = int(counts.max())
    return {
        "moves_for_each_terrain": 2,
        "seconds_to_give_away_one_node": round(_statement(round(most * ACTIVE), costs), 3),
        "terrains_taken_in_all": int(2 * TERRAINS * ACTIVE),
    }


def crowd(weights: Real, costs: dict[str, float], random: np.random.Generator) -> dict[str, Any]:
    """Ten thousand terrains that nobody had open are opened within ten seconds, as at the beginning of a school day."""
    count, seconds = 10_000, 10.0
    some = random.choice(TERRAINS, count, replace=False)
    at = random.uniform(0.0, seconds, count)
    nodes = placed(weights, some)
    done = _opened(((float(a), int(n)) for a, n in zip(at, nodes, strict=True)), costs)
    return {
        "terrains": count,
        "within_s": seconds,
        "most_for_one_node": int(np.bincount(nodes, minlength=NODES).max()),
        "seconds_waited": _quantiles([end - begin for end, begin in zip(done, sorted(at.tolist()), strict=True)]),
    }


def _quantiles(values: list[float]) -> dict[str, float]:
    found = np.array(values)
    return {"p50": round(float(np.percentile(found, 50)), 3), "p99": round(float(np.percentile(found, 99)), 3),
            "last": round(float(found.max()), 3)}  # fmt: skip
