"""Leases of terrains, in memory and in a database (SPEC J460 to J463, J565)."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import psycopg
import pytest

from esker.store.engine.leases import Lease, Leases, Node, OwnLeases
from esker.store.engine.postgres.leases import PostgresLeases
from tests.store.engines import ENGINES, Database

A, B = Node("a", "http://10.0.0.1:8000", 1.0), Node("b", "http://10.0.0.2:8000", 2.5)


class Kept:
    """Leases with a clock that a test sets on."""

    def __init__(self, url: str | None) -> None:
        """``url``: of the database that keeps them; None for memory."""
        self._url, self._now = url, 1000.0
        self._in_database = None if url is None else PostgresLeases(url)
        self.leases: Leases = self._in_database or OwnLeases(lambda: self._now)
        self.leases.register(A, 60.0)
        self.leases.register(B, 60.0)

    def wait(self, seconds: float) -> None:
        """Lets time pass: in a database all that lasts ends earlier by so much."""
        self._now += seconds
        if self._url is not None:
            with psycopg.connect(self._url, autocommit=True) as db:
                for table in ("leases", "nodes"):
                    db.execute(f"UPDATE esker.{table} SET until = until - interval '{seconds} seconds'".encode())

    def close(self) -> None:
        if self._in_database is not None:
            self._in_database.close()


@pytest.fixture(params=ENGINES)
def kept(request: pytest.FixtureRequest) -> Iterator[Kept]:
    url = None
    if request.param == "postgres":
        database: Database = request.getfixturevalue("database")
        url = database.new()
    made = Kept(url)
    yield made
    made.close()


def taken(kept: Kept, terrain: str, node: str, seconds: float = 6.0) -> Lease:
    found = kept.leases.take(terrain, node, seconds)
    assert isinstance(found, Lease)
    return found


def test_a_terrain_has_one_owner_until_the_lease_ends(kept: Kept) -> None:
    """SPEC J460."""
    assert kept.leases.owner("lake") is None
    assert taken(kept, "lake", "a") == Lease("lake", "a", 1)
    assert kept.leases.take("lake", "b", 6.0) == A
    assert kept.leases.owner("lake") == A
    kept.wait(6.0)
    assert kept.leases.owner("lake") is None
    assert taken(kept, "lake", "b") == Lease("lake", "b", 2)


def test_a_node_that_was_started_again_takes_its_terrains_at_once(kept: Kept) -> None:
    """SPEC J460."""
    before, after = taken(kept, "lake", "a"), taken(kept, "lake", "a")
    assert after == Lease("lake", "a", 2)
    assert kept.leases.renew([before], 6.0) == frozenset()
    assert kept.leases.renew([after], 6.0) == {"lake"}


def test_a_lease_that_ended_is_not_renewed(kept: Kept) -> None:
    """SPEC J461."""
    lake, hill = taken(kept, "lake", "a", 30.0), taken(kept, "hill", "a", 40.0)
    kept.wait(25.0)
    assert kept.leases.renew([lake, hill], 30.0) == {"hill", "lake"}
    kept.wait(25.0)
    assert kept.leases.renew([lake], 30.0) == {"lake"}
    kept.wait(25.0)
    assert kept.leases.renew([lake, hill], 30.0) == {"lake"}
    assert kept.leases.renew([], 30.0) == frozenset()
    assert taken(kept, "hill", "b") == Lease("hill", "b", 2)


def test_what_is_released_is_free_at_once_and_only_its_owner_releases_it(kept: Kept) -> None:
    """SPEC J462."""
    old = taken(kept, "lake", "a")
    kept.leases.release([old])
    assert kept.leases.owner("lake") is None
    assert taken(kept, "lake", "b") == Lease("lake", "b", 2)
    kept.leases.release([old])
    assert kept.leases.owner("lake") == B


def test_nodes_are_live_as_long_as_they_said(kept: Kept) -> None:
    """SPEC J463."""
    assert kept.leases.nodes() == (A, B)
    again = Node("a", "http://10.0.0.9:8000", 3.0)
    kept.leases.register(again, 90.0)
    kept.wait(60.0)
    assert kept.leases.nodes() == (again,)
    taken(kept, "lake", "a")
    kept.leases.withdraw("a")
    kept.leases.withdraw("a")
    assert kept.leases.nodes() == ()
    assert kept.leases.owner("lake") == Node("a", "", 0.0)


def test_many_are_taken_at_once_each_for_itself(kept: Kept) -> None:
    """SPEC J565: released ones, own ones, ended ones, and those that another node has."""
    taken(kept, "ended", "b")
    kept.wait(6.0)
    kept.leases.release([taken(kept, "free", "b")])
    taken(kept, "own", "a")
    taken(kept, "theirs", "b")
    found = kept.leases.take_all(["theirs", "own", "free", "ended"], "a", 6.0)
    assert found == {
        "theirs": B,
        "own": Lease("own", "a", 2),
        "free": Lease("free", "a", 2),
        "ended": Lease("ended", "a", 2),
    }
    assert kept.leases.take_all([], "a", 6.0) == {}
    kept.leases.release([each for each in found.values() if isinstance(each, Lease)])
    again = kept.leases.take_all(["free", "ended"], "b", 6.0)
    assert again == {"free": Lease("free", "b", 3), "ended": Lease("ended", "b", 3)}


def test_one_terrain_that_is_held_up_holds_up_no_other(database: Database) -> None:
    """SPEC J565: a commit that does not end has locked the row of one; it is left out, and the others are taken."""
    kept = Kept(database.new())
    assert kept._url is not None
    for terrain in ("lake", "hill"):
        taken(kept, terrain, "b")
    kept.wait(6.0)
    with psycopg.connect(kept._url) as db:
        db.execute("SELECT 1 FROM esker.leases WHERE terrain='lake' FOR SHARE")
        found = kept.leases.take_all(["lake", "hill"], "a", 6.0)
        assert found == {"hill": Lease("hill", "a", 2)}
        db.rollback()
        assert kept.leases.take_all(["lake"], "a", 6.0) == {"lake": Lease("lake", "a", 2)}
    kept.close()


def test_nodes_that_want_the_same_at_once_get_each_terrain_once(database: Database) -> None:
    """SPEC J460, J565: whatever the order in which they name them, nobody waits for ever and nothing has two owners."""
    kept = Kept(database.new())
    names = [f"t{n}" for n in range(60)]
    kept.leases.release([taken(kept, name, "a") for name in names])

    def take(node: str) -> dict[str, Lease | Node]:
        return kept.leases.take_all(names if node == "a" else names[::-1], node, 60.0)

    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(take, "abab"))
    for name in names:
        owner = kept.leases.owner(name)
        assert owner is not None
        answers = [each[name] for each in found if name in each]
        leases = {lease.epoch: lease.node for lease in answers if isinstance(lease, Lease)}
        assert len(leases) == sum(isinstance(each, Lease) for each in answers) > 0
        assert set(leases.values()) == {owner.name}
    kept.close()
