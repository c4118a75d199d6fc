"""Which node should have a terrain (SPEC P570, P571)."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from esker.cluster.rendezvous import LEAST_WEIGHT, chosen, stepped
from esker.store.engine.leases import Node

TERRAINS = [f"terrain-{n}" for n in range(4000)]


def nodes(*weights: float) -> list[Node]:
    return [Node(f"n{i}", f"http://10.0.0.{i}:8000", weight) for i, weight in enumerate(weights)]


def owners(some: list[Node]) -> dict[str, str]:
    return {terrain: node.name for terrain in TERRAINS if (node := chosen(terrain, some)) is not None}


def test_terrains_are_shared_by_weight() -> None:
    """SPEC P570: within five standard deviations of the share."""
    counts = Counter(owners(nodes(1.0, 2.0, 5.0)).values())
    for name, share in (("n0", 1 / 8), ("n1", 2 / 8), ("n2", 5 / 8)):
        spread = (len(TERRAINS) * share * (1 - share)) ** 0.5
        assert abs(counts[name] - len(TERRAINS) * share) < 5 * spread


def test_only_terrains_of_a_node_that_goes_move() -> None:
    """SPEC P571."""
    before, after = owners(nodes(1.0, 1.0, 1.0)), owners(nodes(1.0, 1.0))
    assert {t for t in TERRAINS if before[t] != after[t]} == {t for t in TERRAINS if before[t] == "n2"}


def test_a_node_that_takes_more_takes_only_from_others() -> None:
    """SPEC P571: where a weight grows, whatever moves moves there."""
    before, after = owners(nodes(1.0, 1.0, 1.0)), owners(nodes(1.0, 1.0, 2.0))
    moved = {after[t] for t in TERRAINS if before[t] != after[t]}
    assert moved == {"n2"}


@given(st.permutations(nodes(1.0, 0.3, 4.0, 0.0)), st.sampled_from(TERRAINS))
def test_all_nodes_agree(some: list[Node], terrain: str) -> None:
    """SPEC P570: in whatever order the database names them."""
    assert chosen(terrain, some) == chosen(terrain, nodes(1.0, 0.3, 4.0, 0.0))


@given(st.floats(0, 1e6))
def test_weights_are_told_in_steps(weight: float) -> None:
    """SPEC P571: a step is near, and a step of a step is itself."""
    told = stepped(weight)
    assert stepped(told) == told
    assert told / 2**0.26 <= max(weight, LEAST_WEIGHT) <= told * 2**0.26
