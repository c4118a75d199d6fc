"""Requests and sockets that come to the wrong node, over the real wire (SPEC P574 to P580)."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from esker.cluster import passing
from esker.cluster.peers import Peer
from esker.cluster.relay import NearEnd, Relay
from esker.cluster.signing import HEADER, Opened, Session, Visit, opening
from esker.store.engine.leases import Lease, Node, OwnLeases
from tests.cluster.machines import KEY, Machine, machines, slowly


async def ask(machine: Machine, method: str, path: str, **more: Any) -> httpx.Response:
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{machine.port}", trust_env=False) as client:
        return await client.request(method, path, **more)


def owned(leases: OwnLeases, terrain: str, name: str) -> None:
    assert isinstance(leases.take(terrain, name, 60.0), Lease)


async def test_a_request_is_answered_by_the_owner_as_if_it_had_come_there() -> None:
    """SPEC P578: address, scheme, host, path, query, body and fields; what a visitor says of the address is dropped."""
    leases = OwnLeases()
    async with machines(leases, "a", "b") as (a, b):
        await b.cluster.hold("lake")
        told = {"x-told": "yes", "x-forwarded-for": "192.0.2.9", "host": "terrain.example.org"}
        for _ in range(3):  # over the kept connection too
            answer = await ask(a, "POST", "/api/terrains/lake/x?y=%20", content=b"z" * 70_000, headers=told)
            found = answer.json()
            assert (found["node"], found["bytes"], found["passed"]) == ("b", 70_000, True)
            assert (found["client"], found["header"], found["forwarded"]) == ("127.0.0.1", "yes", "")
            assert (found["host"], found["scheme"]) == ("terrain.example.org", "http")
        assert a.cluster.counts.requests_passed == 3
        assert (await ask(b, "GET", "/api/terrains/lake/x")).json()["passed"] is False


async def test_who_reads_a_terrain_that_nobody_has_takes_nothing_and_who_changes_it_does() -> None:
    """SPEC P579."""
    leases = OwnLeases()
    async with machines(leases, "a", "b") as (a, _):
        assert (await ask(a, "GET", "/api/terrains/lake/x")).json()["node"] == "a"
        assert leases.owner("lake") is None
        found = (await ask(a, "DELETE", "/api/terrains/lake/x")).json()
        owner = leases.owner("lake")
        assert owner is not None
        assert found["node"] == owner.name


async def test_a_body_is_read_as_fast_as_the_owner_reads() -> None:
    """SPEC P580: of 64 MiB for a slow reader most wait at whoever sends them. On two hops kernels hold up to 20."""
    leases, size = OwnLeases(), 64 << 20
    async with machines(leases, "a", "b") as (a, b):
        await b.cluster.hold("lake")

        async def body() -> Any:
            for _ in range(size >> 16):
                b.sent += 1 << 16
                yield bytes(1 << 16)

        answer = await ask(a, "POST", "/api/terrains/lake/slow", content=body(), timeout=60)
        assert answer.json()["bytes"] == size
        assert max(b.lags) < size // 2


async def test_an_answer_is_sent_as_fast_as_it_is_read_and_no_longer_than_somebody_reads() -> None:
    """SPEC P580: of 32 MiB that are read slowly no node keeps more than a few pieces."""
    leases, kept, size = OwnLeases(), list[int](), 0
    async with machines(leases, "a", "b") as (a, b):
        await b.cluster.hold("lake")
        async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{a.port}", trust_env=False) as client:
            async with client.stream("GET", "/api/terrains/lake/stream") as answer:
                async for part in answer.aiter_raw():
                    await slowly()
                    size += len(part)
                    ends = [*a.server.server_state.connections, *b.server.server_state.connections]
                    kept += [each.transport.get_write_buffer_size() for each in ends]
            assert size == 512 * 65536
            assert 0 < max(kept) < 1 << 20
            b.bodies.clear()
            b.ended.clear()
            async with client.stream("GET", "/api/terrains/lake/stream") as answer:
                await anext(answer.aiter_raw())
        await asyncio.wait_for(b.ended.wait(), 60)
        assert len(b.bodies) < 512


async def test_a_refusal_in_the_middle_of_a_body_arrives() -> None:
    """SPEC P578."""
    leases = OwnLeases()
    async with machines(leases, "a", "b") as (a, b):
        await b.cluster.hold("lake")
        answer = await ask(a, "POST", "/api/terrains/lake/refused", content=b"z" * 1_000_000)
        assert (answer.status_code, answer.text) == (413, "no")


async def test_a_socket_is_served_by_the_owner_and_nobody_sees_it() -> None:
    """SPEC P578: whatever the sizes of messages, and with bytes behind the first one."""
    leases = OwnLeases()
    async with machines(leases, "a", "b") as (a, b):
        await b.cluster.hold("lake")
        async with connect(f"ws://127.0.0.1:{a.port}/ws", proxy=None, compression=None) as ws:
            for text in ('{"terrain": "lake"}', "one", "x" * 200_000, "€" * 70_000):
                await ws.send(text)
            assert json.loads(await ws.recv()) == {"node": "b", "client": "127.0.0.1", "terrain": "lake"}
            assert [await ws.recv() for _ in range(3)] == ["one", "x" * 200_000, "€" * 70_000]
            await (await ws.ping())
            assert a.cluster.counts.sockets_passing == 1
        assert (a.cluster.counts.sockets_passed, b.cluster.counts.sockets_passed) == (1, 0)


async def test_a_socket_is_read_as_fast_as_it_can_be_sent_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P580: of 40 MB of echoes that are read slowly no node keeps more than one piece, in either direction."""
    leases, relays, piece, count = OwnLeases(), list[Relay](), "x" * 200_000, 200

    def noted(near: NearEnd) -> Relay:
        relays.append(Relay(near))
        return relays[-1]

    monkeypatch.setattr(passing, "Relay", noted)
    async with machines(leases, "a", "b") as (a, b):
        await b.cluster.hold("lake")
        url = f"ws://127.0.0.1:{a.port}/ws"
        async with connect(url, proxy=None, compression=None, max_queue=1, max_size=None) as ws:
            await ws.send('{"terrain": "lake"}')
            await ws.recv()

            async def say() -> None:
                for _ in range(count):
                    await ws.send(piece)

            saying, kept = asyncio.create_task(say()), []
            for _ in range(count):
                await slowly()
                ends = [*a.server.server_state.connections, *b.server.server_state.connections]
                kept += [each.transport.get_write_buffer_size() for each in ends]
                kept += [each._transport.get_write_buffer_size() for each in relays]  # type: ignore[union-attr]
                assert await ws.recv() == piece
            await saying
            assert 0 < max(kept) < 3 * len(piece)


async def test_the_owner_of_a_forwarded_socket_closes_it_with_its_own_code() -> None:
    """SPEC P578: and where the owner's process ends the visitor's connection does."""
    leases = OwnLeases()
    async with machines(leases, "a", "b") as (a, b):
        await b.cluster.hold("lake")
        async with connect(f"ws://127.0.0.1:{a.port}/ws", proxy=None) as ws:
            await ws.send('{"terrain": "lake"}')
            await ws.recv()
            for each in list(b.server.server_state.connections):
                each.transport.abort()
            with pytest.raises(ConnectionClosed):
                await ws.recv()


async def test_what_is_no_hello_is_answered_here() -> None:
    """SPEC P578."""
    async with machines(OwnLeases(), "a", "b") as (a, _), connect(f"ws://127.0.0.1:{a.port}/ws", proxy=None) as ws:
        await ws.send('{"terrain": 5}')
        assert json.loads(await ws.recv())["node"] == "a"


async def test_a_terrain_that_moved_meanwhile_is_found() -> None:
    """SPEC P579: a believes that b has it still; nothing of the body is lost."""
    leases = OwnLeases()
    async with machines(leases, "a", "b", "c") as (a, b, c):
        await b.cluster.hold("lake")
        assert (await ask(a, "POST", "/api/terrains/lake/x", content=b"1")).json()["node"] == "b"
        await b.cluster._release("lake")
        await c.cluster.hold("lake")
        found = (await ask(a, "POST", "/api/terrains/lake/x", content=b"123")).json()
        assert (found["node"], found["bytes"]) == ("c", 3)
        async with connect(f"ws://127.0.0.1:{a.port}/ws", proxy=None) as ws:
            await ws.send('{"terrain": "lake"}')
            assert json.loads(await ws.recv())["node"] == "c"


async def test_nothing_goes_round_in_a_circle() -> None:
    """SPEC P577: a node to which something was passed on passes it to nobody, whatever it believes."""
    leases = OwnLeases()
    async with machines(leases, "a", "b") as (a, b):
        owned(leases, "lake", "c")  # whose machine is gone; both nodes ask each other in vain
        for each in (a, b):
            each.cluster._known["lake"] = Node("b", b.cluster.address, 1.0), each.cluster._now() + 60
        peer = Peer(Node("b", b.cluster.address, 1.0), "a", KEY)
        scope = {"method": "POST", "path": "/api/terrains/lake/x", "headers": [(b"host", b"h")], "query_string": b""}
        with pytest.raises(Exception, match="moved"):
            await peer.request(scope, None, None, Visit("192.0.2.1", "http", terrain="lake"))  # type: ignore[arg-type]
        with pytest.raises(Exception, match="409"):
            await peer.socket(
                {"path": "/ws", "headers": [(b"host", b"h"), (b"sec-websocket-key", b"A" * 22 + b"=="),
                 (b"sec-websocket-version", b"13")]},
                Visit("192.0.2.1", "http", terrain="lake"),
                Relay(None),  # type: ignore[arg-type]
            )  # fmt: skip
        peer.close()


async def test_what_somebody_recorded_opens_nothing() -> None:
    """SPEC P575: the very bytes of a request, sent again."""
    leases = OwnLeases()
    async with machines(leases, "b") as (b,):
        asked = opening(KEY, "a")
        made = await ask(b, "POST", "/node/session", json=asked.__dict__)
        session = Session(KEY, asked, Opened(**made.json()))
        path, host = "/api/terrains/lake/x", f"127.0.0.1:{b.port}"
        field = session.sign(Visit("192.0.2.1", "https", terrain="lake"), "GET", path, host)
        first = await ask(b, "GET", path, headers={HEADER: field})
        assert (first.json()["client"], first.json()["scheme"]) == ("192.0.2.1", "https")
        again = await ask(b, "GET", path, headers={HEADER: field})
        assert (again.status_code, again.json()["code"]) == (401, "not_signed")
        forged = await ask(b, "GET", path, headers={HEADER: field.replace("192.0.2.1", "192.0.2.2")})
        assert forged.status_code == 401
        stranger = await ask(b, "POST", "/node/session", json={"node": "a", "nonce": "0" * 32, "code": "0"})
        assert stranger.status_code == 401
        assert (await ask(b, "POST", "/node/session", content=b"{")).status_code == 400


async def test_a_node_that_was_started_anew_is_asked_anew() -> None:
    """SPEC P576: its sessions are gone; whoever asks notices nothing."""
    leases = OwnLeases()
    async with machines(leases, "a", "b") as (a, b):
        await b.cluster.hold("lake")
        assert (await ask(a, "GET", "/api/terrains/lake/x")).json()["node"] == "b"
        entrance: Any = b.server.config.loaded_app
        while not hasattr(entrance, "_sessions"):
            entrance = getattr(entrance, "app", None) or entrance.middleware_stack
        entrance._sessions._known.clear()
        assert (await ask(a, "POST", "/api/terrains/lake/x", content=b"12")).json()["bytes"] == 2
        entrance._sessions._known.clear()
        async with connect(f"ws://127.0.0.1:{a.port}/ws", proxy=None) as ws:
            await ws.send('{"terrain": "lake"}')
            assert json.loads(await ws.recv())["node"] == "b"
