"""Leases of terrains, whatever keeps them (SPEC J460 to J463)."""

from __future__ import annotations

from esker.store.engine.leases import Lease, Node, OwnLeases

A, B = Node("a", "http://10.0.0.1:8000", 1.0), Node("b", "http://10.0.0.2:8000", 2.5)


class Clock:
    """The clock of a store, which a test sets."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def made() -> tuple[OwnLeases, Clock]:
    clock = Clock()
    leases = OwnLeases(clock)
    leases.register(A, 60.0)
    leases.register(B, 60.0)
    return leases, clock


def test_a_terrain_has_one_owner_until_the_lease_ends() -> None:
    """SPEC J460."""
    leases, clock = made()
    assert leases.owner("lake") is None
    first = leases.take("lake", "a", 6.0)
    assert first == Lease("lake", "a", 1)
    assert leases.take("lake", "b", 6.0) == A
    assert leases.owner("lake") == A
    clock.now += 6.0
    assert leases.owner("lake") is None
    assert leases.take("lake", "b", 6.0) == Lease("lake", "b", 2)


def test_a_node_that_was_started_again_takes_its_terrains_at_once() -> None:
    """SPEC J460."""
    leases, _ = made()
    before = leases.take("lake", "a", 6.0)
    after = leases.take("lake", "a", 6.0)
    assert isinstance(before, Lease)
    assert after == Lease("lake", "a", 2)
    assert leases.renew([before], 6.0) == frozenset()
    assert leases.renew([after], 6.0) == {"lake"}


def test_a_lease_that_ended_is_not_renewed() -> None:
    """SPEC J461."""
    leases, clock = made()
    lake, hill = leases.take("lake", "a", 6.0), leases.take("hill", "a", 8.0)
    assert isinstance(lake, Lease)
    assert isinstance(hill, Lease)
    clock.now += 5.0
    assert leases.renew([hill, lake], 6.0) == {"hill", "lake"}
    clock.now += 5.0
    assert leases.renew([lake], 6.0) == {"lake"}
    clock.now += 5.0
    assert leases.renew([lake, hill], 6.0) == {"lake"}
    assert leases.take("hill", "b", 6.0) == Lease("hill", "b", 2)


def test_what_is_released_is_free_at_once_and_only_its_owner_releases_it() -> None:
    """SPEC J462."""
    leases, _ = made()
    old = leases.take("lake", "a", 6.0)
    assert isinstance(old, Lease)
    leases.release([old])
    assert leases.owner("lake") is None
    new = leases.take("lake", "b", 6.0)
    assert new == Lease("lake", "b", 2)
    leases.release([old])
    assert leases.owner("lake") == B


def test_nodes_are_live_as_long_as_they_said() -> None:
    """SPEC J463."""
    leases, clock = made()
    assert leases.nodes() == (A, B)
    leases.register(Node("a", "http://10.0.0.9:8000", 3.0), 90.0)
    clock.now += 60.0
    assert leases.nodes() == (Node("a", "http://10.0.0.9:8000", 3.0),)
    leases.take("lake", "a", 6.0)
    leases.withdraw("a")
    leases.withdraw("a")
    assert leases.nodes() == ()
    assert leases.owner("lake") == Node("a", "", 0.0)
