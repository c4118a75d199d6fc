"""A node among others: what it has, loses and gives away (SPEC P572, P579, P583, P584)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Collection
from contextlib import asynccontextmanager
from itertools import chain

import pytest

from esker.cluster.node import IDLE_SECONDS, Cluster
from esker.cluster.peers import Elsewhere, Peer
from esker.store.engine.leases import LEASE_SECONDS, Lease, Node, OwnLeases, Unreachable
from tests.cluster.machines import KEY, NoRooms


class Clock:
    """Seconds that a test lets pass: of the database and of the node."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class Cut(OwnLeases):
    """Leases of a database that may be out of reach."""

    cut = False

    def renew(self, *arguments: object) -> frozenset[str]:
        if self.cut:
            raise Unreachable("the line is cut")
        return super().renew(*arguments)  # type: ignore[arg-type]

    def __init__(self, now: Callable[[], float]) -> None:
        super().__init__(now)
        self.statements = list[list[str]]()
        """The terrains of each statement that takes or releases."""
        self.held_up = set[str]()
        """Terrains for which a statement would wait."""

    def take_all(self, terrains: Collection[str], node: str, seconds: float) -> dict[str, Lease | Node]:
        if self.cut:
            raise Unreachable("the line is cut")
        self.statements.append(sorted(terrains))
        return super().take_all([each for each in terrains if each not in self.held_up], node, seconds)

    def release(self, leases: Collection[Lease]) -> None:
        self.statements.append(sorted(lease.terrain for lease in leases))
        super().release(leases)

    def owner(self, terrain: str) -> Node | None:
        if self.cut:
            raise Unreachable("the line is cut")
        return super().owner(terrain)


class Scene:
    """One node, its rooms, its database and the clock of both."""

    def __init__(self, homes: dict[str, str] | None = None) -> None:
        self.clock = Clock()
        self.leases = Cut(self.clock)
        self.rooms = NoRooms(homes)
        self.node = Cluster("a", "http://10.0.0.1:8000", self.leases, KEY, now=self.clock)

    def renew(self) -> None:
        answer = self.node._renew()
        if answer is not None:
            self.node._answered(*answer)

    async def look(self) -> None:
        """What the node does by itself every so often."""
        assert self.node._look is not None
        self.node._look.cancel()
        self.node._watch()
        await asyncio.gather(*(task for task in asyncio.all_tasks() if task is not asyncio.current_task()))


async def settled() -> None:
    """Lets the loop do what others gave it to do."""
    await asyncio.sleep(0)


@asynccontextmanager
async def scene(homes: dict[str, str] | None = None) -> AsyncIterator[Scene]:
    made = Scene(homes)
    await made.node.start(made.rooms, renewing=False)
    yield made
    await made.node.close()


async def test_a_node_that_renews_keeps_its_terrains() -> None:
    """SPEC P572."""
    async with scene() as s:
        await s.node.hold("lake")
        for _ in range(10):
            s.clock.now += 2
            s.renew()
            assert s.node.may_acknowledge("lake")
        assert s.leases.take("lake", "b", LEASE_SECONDS) == Node("a", "http://10.0.0.1:8000", 1.0)


async def test_a_node_without_its_database_shuts_its_rooms_before_another_has_them() -> None:
    """SPEC P572, P573: it acknowledges nothing first; what comes then waits or is sent on."""
    async with scene() as s:
        await s.node.hold("lake")
        s.leases.cut = True
        s.clock.now += 2.9
        s.renew()
        assert s.node.may_acknowledge("lake")
        s.clock.now += 0.2
        assert not s.node.may_acknowledge("lake")
        await s.look()
        assert s.rooms.lost == []
        with pytest.raises(Elsewhere, match="reach its database"):
            await s.node.hold("lake")
        s.clock.now += 2
        await s.look()
        assert s.rooms.lost == ["lake"]
        assert s.leases._holds(Lease("lake", "a", 1)), "the database would have given it to nobody yet"
        assert s.node.held == ()


async def test_a_process_that_was_frozen_finds_its_rooms_shut_whatever_it_does_first() -> None:
    """SPEC P573: before any timer and any answer."""
    async with scene() as s:
        await s.node.hold("lake")
        s.clock.now += 60
        assert not s.node.may_acknowledge("lake")
        assert s.leases.take("lake", "b", LEASE_SECONDS) == Lease("lake", "b", 2)
        s.renew()
        assert not s.node.may_acknowledge("lake")
        with pytest.raises(Elsewhere, match="Node b has"):
            await s.node.hold("lake")
        assert s.rooms.lost == ["lake"]


async def test_a_refused_write_ends_a_tenure() -> None:
    """SPEC P584."""
    async with scene() as s:
        await s.node.hold("lake")
        s.node.fenced("lake")
        await settled()
        assert (s.rooms.lost, s.node.held, s.node.counts.fenced) == (["lake"], (), 1)
        await s.node.hold("lake")
        assert s.node.may_acknowledge("lake")


async def test_what_nobody_uses_is_given_back() -> None:
    """SPEC P583: not while something is open, under way, or done by a request."""
    async with scene() as s:
        for terrain in ("idle", "open", "asked"):
            await s.node.hold(terrain)
        s.rooms.used = {"open"}
        with s.node.using("asked"):
            for _ in range(20):
                s.clock.now += IDLE_SECONDS / 15
                s.renew()
            await s.look()
            assert set(s.node.held) == {"open", "asked"}
            assert s.leases.owner("idle") is None
        await s.look()
        assert set(s.node.held) == {"open"}


async def test_a_copy_moves_with_its_class() -> None:
    """SPEC P586: under one lease, which all that is written for any of them names; the class goes after its copies."""
    async with scene({"copy": "class", "other": "class"}) as s:
        await s.node.hold("copy")
        assert s.node.held == ("class",)
        assert s.node.right("copy") == ("class", 1)
        assert s.node.may_acknowledge("copy")
        for terrain in ("class", "other"):
            await s.node.hold(terrain)
        assert s.node.counts.taken == 1
        assert s.rooms.fresh == ["copy", "class", "other"]
        s.rooms.used = {"other"}
        for _ in range(20):
            s.clock.now += IDLE_SECONDS / 15
            s.renew()
        await s.look()
        assert s.node.held == ("class",)
        await s.node.drain()
        assert sorted(s.rooms.given[:2]) == ["copy", "other"]
        assert s.rooms.given[2:] == ["class"]
        assert s.leases.owner("class") is None
        assert s.node.right("copy") is None


async def test_with_a_class_all_its_copies_are_lost() -> None:
    """SPEC P584, P586."""
    async with scene({"copy": "class"}) as s:
        await s.node.hold("copy")
        await s.node.hold("class")
        s.node.fenced("copy")
        await settled()
        assert sorted(s.rooms.lost) == ["class", "copy"]


async def test_a_copy_is_looked_for_where_its_class_is() -> None:
    """SPEC P586."""
    async with scene({"copy": "class"}) as s:
        s.leases.register(Node("b", "http://10.0.0.2:8000", 1.0), 60)
        s.leases.take("class", "b", 60)
        with pytest.raises(Elsewhere):
            await s.node.hold("copy")
        assert s.leases.owner("copy") is None
        asked = []

        async def attempt(peer: Peer) -> None:
            asked.append(peer.node.name)

        assert await s.node.reach("copy", attempt, taking=True)
        assert asked == ["b"]


async def test_a_node_that_is_stopped_takes_nothing_and_gives_everything_away() -> None:
    """SPEC P583: what is asked of it meanwhile waits for another node."""
    async with scene() as s:
        await s.node.hold("lake")
        await s.node.drain()
        assert s.rooms.given == ["lake"]
        assert s.leases.nodes() == ()
        assert s.leases.owner("lake") is None
        for terrain in ("lake", "hill"):
            with pytest.raises(Elsewhere, match="being stopped"):
                await s.node.hold(terrain)


async def test_two_that_come_at_once_take_a_terrain_once() -> None:
    """SPEC P579."""
    async with scene() as s:
        await asyncio.gather(*(s.node.hold("lake") for _ in range(20)))
        assert s.node.counts.taken == 1
        assert s.leases.take("lake", "a", LEASE_SECONDS) == Lease("lake", "a", 2)


async def test_a_crowd_of_terrains_is_taken_and_released_by_a_few_statements() -> None:
    """SPEC P660: all that is asked for while one statement is on its way makes up the next one."""
    async with scene() as s:
        names = [f"t{n:02}" for n in range(40)]
        await asyncio.gather(*(s.node.hold(name) for name in names))
        assert len(s.leases.statements) <= 3
        assert sorted(chain(*s.leases.statements)) == names
        assert set(s.node.held) == set(names)
        s.leases.statements.clear()
        await s.node.drain()
        assert len(s.leases.statements) <= 3
        assert sorted(chain(*s.leases.statements)) == names
        assert all(s.leases.owner(name) is None for name in names)


async def test_in_a_crowd_each_is_told_of_its_own_terrain() -> None:
    """SPEC P660, P579: one that another node has, one that is held up, and one that is free."""
    async with scene() as s:
        s.leases.take("theirs", "b", 60)
        s.leases.held_up = {"slow"}
        found = await asyncio.gather(*map(s.node.hold, ("free", "theirs", "slow")), return_exceptions=True)
        assert [type(each) for each in found] == [type(None), Elsewhere, type(None)]
        assert set(s.node.held) == {"free", "slow"}
        s.leases.cut = True
        found = await asyncio.gather(*map(s.node.hold, ("hill", "vale")), return_exceptions=True)
        assert [type(each) for each in found] == [Elsewhere, Elsewhere]
        s.leases.cut = False
        await s.node.hold("hill")
