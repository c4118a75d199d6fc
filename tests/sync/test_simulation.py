"""Seeded clients over an unreliable network all converge (SPEC P20 to P24, D20).

A seed that ever failed is kept by name in ``KEPT``.
"""

from __future__ import annotations

import random
from functools import partial
from typing import Any

import pytest

from esker import contract as c
from esker.document.ops import StrokeSet
from tests.sync.network import Client, Server, World

SEEDS = 200
KEPT: dict[str, int] = {}
FIELDS: tuple[tuple[str, object], ...] = (
    ("label", ""),
    ("roughness", 0.5),
    ("plateau_radius_m", 0.0),
    ("amplitude_m", 0.0),
)
"""One field for each client that nobody else writes, for the undo property."""


def _stroke(stroke_id: str, x: float) -> c.Stroke:
    return c.Stroke(id=stroke_id, kind="profile", first=(x, 0, 0), last=(x, 500, 0), curve=((0, 0), (1, 5)))


def _paint(value: float) -> c.Paint:
    return c.Paint(channel="forest", value=value, radius_m=50.0)


def _line(stroke_id: str, x: float) -> c.Stroke:
    anchors: Any = {"first": (x, 0, 0), "last": (x, 500, 0), "curve": ((0, 0), (1, 0.5))}
    return c.Stroke(id=stroke_id, kind="paint", paint=_paint(1.0), **anchors)


def _layer(layer_id: str, x: float) -> c.Layer:
    facts = c.GridFacts(rows=9, cols=9, low_m=0.0, high_m=10.0)
    fields: Any = {"content": "0" * 64, "facts": facts, "anchor": (x, 0.0), "spacing_m": (1.0, 1.0), "accuracy_m": 1.0}
    return c.Layer(id=layer_id, **fields)


def _birth() -> StrokeSet:
    shared = {f"s{i}": _stroke(f"s{i}", 100.0 * i) for i in range(3)} | {"p0": _line("p0", 300.0)}
    return StrokeSet("t", strokes=shared, layers={"v0": _layer("v0", 0.0)})


def _fields(**fields: object) -> c.StrokeFields:
    return c.StrokeFields.model_validate(fields)


def _random_op(rng: random.Random, client: Client, n: int) -> tuple[c.Op, str | None]:
    ids = [*client.doc.document.strokes, *client.doc.document.deleted]
    target = rng.choice(ids)
    x = float(rng.randrange(4000))
    kind = rng.randrange(8)
    if kind == 0:
        make = _line if n % 3 == 0 else _stroke
        return c.BeginStroke(stroke=make(f"{client.name}-{n}", x)), f"g{n}"
    if kind == 1:
        return c.AppendPoints(stroke=target, start=rng.randrange(4), points=((0.5, x),), last=(x, x, 0)), None
    if kind == 2:
        return c.MoveAnchor(stroke=target, which="first", to=(x, 1, 2)), f"g{n // 5}"
    if kind == 3:
        return c.DeleteStroke(stroke=target), None
    if kind == 4:
        return c.RestoreStroke(stroke=target), None
    if kind == 5:
        return c.SetTerrain(fields=c.TerrainFields(title=f"{client.name} {n}")), None
    if kind == 6:
        parts = (
            c.SetStroke(stroke=target, fields=_fields(hidden=bool(n % 2))),
            c.MoveAnchor(stroke=target, which="last", to=(x, 3, 4)),
        )
        return c.Group(ops=parts), None
    found = client.doc.document.strokes.get(target)
    if found is not None and found.paint is not None and n % 2:
        return c.SetStroke(stroke=target, fields=_fields(paint=_paint(round(rng.uniform(-1, 1), 3)))), None
    return c.SetStroke(stroke=target, fields=_fields(locked=rng.random() < 0.2, label=f"{n}")), None


def _layer_op(rng: random.Random, client: Client, n: int) -> tuple[c.Op, str | None]:
    known = [*client.doc.document.layers, *client.doc.document.deleted_layers]
    target, x = rng.choice(known), float(rng.randrange(4000))
    kind = rng.randrange(5)
    if kind == 0:
        return c.DeleteLayer(layer=target), None
    if kind == 1:
        return c.RestoreLayer(layer=target), None
    if kind == 2:
        return c.Group(ops=(c.SetLayer(layer=target, fields=c.LayerFields(hidden=bool(n % 2))),)), None
    if kind == 3:
        return c.SetLayer(layer=target, fields=c.LayerFields(name=f"{n}", priority=n)), None
    return c.SetLayer(layer=target, fields=c.LayerFields(anchor=(x, 0.0))), f"g{n // 5}"


def _act(rng: random.Random, client: Client, n: int) -> None:
    if client.doc.clock is None:
        return
    roll = rng.random()
    if roll < 0.12:
        client.undo()
    elif roll < 0.18:
        client.redo()
    elif roll < 0.22 and client.link is not None:
        client.link.cut()
    elif roll < 0.40:
        client.do(*_layer_op(rng, client, n))
    else:
        client.do(*_random_op(rng, client, n))


def _settle(world: World, clients: list[Client]) -> None:
    world.run()
    assert all(client.online for client in clients)


@pytest.mark.parametrize("block", range(10))
def test_all_clients_converge(block: int) -> None:
    seeds = range(block, SEEDS, 10)
    for seed in [*seeds, *(KEPT.values() if block == 0 else ())]:
        _converges(seed)


def _converges(seed: int) -> None:
    world = World(seed)
    server = Server(world, _birth())
    clients = [Client(world, server, f"c{i}") for i in range(4)]
    for i, client in enumerate(clients):
        for n in range(25):
            delay = world.random.uniform(0, 5)
            world.after(delay, lambda client=client, n=n: _act(world.random, client, n))  # type: ignore[misc]
        for n in range(2):  # an import comes to its end
            world.after(world.random.uniform(0, 5), lambda client=client, n=n: server.lay(client.name, n, _layer))  # type: ignore[misc]
        if seed % 3 == 0 and i == 0:
            world.after(world.random.uniform(1, 5), server.die)
    _settle(world, clients)
    final = server.core.document
    assert final == server.core.head
    assert final.clock == len(server.rows)
    ids = [f"{row.client}:{row.counter}" for row in server.rows]
    assert len(ids) == len(set(ids)), f"seed {seed}: an op was ordered twice"
    for client in clients:
        assert client.doc.pending == (), f"seed {seed}: {client.name} still has unconfirmed ops"
        assert client.doc.confirmed == final, f"seed {seed}: {client.name} differs"
        assert client.doc.document == final, f"seed {seed}: {client.name} shows something else"
        assert client.acked <= set(ids), f"seed {seed}: an acknowledged op is missing"


@pytest.mark.parametrize("block", range(5))
def test_all_converge_while_a_conductor_switches(block: int) -> None:
    """SPEC L24: over cuts and a restart; and what is refused leaves nothing behind."""
    assert sum(_converges_with_switches(seed) for seed in range(block, 60, 5)) > 0


def _converges_with_switches(seed: int) -> int:
    """Returns how many ops were refused because hands were off."""
    world = World(20_000 + seed)
    server = Server(world, _birth())
    clients = [Client(world, server, f"c{i}") for i in range(4)]
    for client in clients:
        for n in range(20):
            world.after(world.random.uniform(0, 4), partial(_act, world.random, client, n))
    for _ in range(6):
        world.after(world.random.uniform(0, 4), partial(server.hands, world.random.random() < 0.5))
    if seed % 2:
        world.after(world.random.uniform(1, 4), server.die)
    _settle(world, clients)
    final = server.core.document
    for client in clients:
        assert client.doc.pending == (), f"seed {seed}: {client.name} still has unconfirmed ops"
        assert client.doc.document == client.doc.confirmed == final, f"seed {seed}: {client.name} differs"
    return sum(each.code == "hands_off" for client in clients for each in client.refusals)


@pytest.mark.parametrize("block", range(4))
def test_undo_never_touches_what_others_did(block: int) -> None:
    """Each client writes one field of the shared strokes; one takes back all it did; the others' fields stay."""
    for seed in range(block, 60, 4):
        world = World(10_000 + seed)
        server = Server(world, _birth())
        clients = [Client(world, server, f"c{i}") for i in range(4)]
        for i, client in enumerate(clients):
            for n in range(12):
                op = c.SetStroke(stroke=f"s{n % 3}", fields=_fields(**{FIELDS[i][0]: _value(i, n)}))
                delay = world.random.uniform(0.5, 3)
                world.after(delay, lambda client=client, op=op: client.do(op) and None)  # type: ignore[misc]
            world.after(world.random.uniform(1, 3), lambda client=client: client.link and client.link.cut())  # type: ignore[misc]
        _settle(world, clients)
        before = server.core.document
        undoer = clients[seed % 4]
        while undoer.doc.stack.can_undo:
            undoer.undo()
        _settle(world, clients)
        after = server.core.document
        for stroke_id, stroke in after.strokes.items():
            for i, (name, initial) in enumerate(FIELDS):
                expected = initial if i == seed % 4 else getattr(before.strokes[stroke_id], name)
                assert getattr(stroke, name) == expected, f"seed {seed}: {stroke_id}.{name}"


def _value(client: int, n: int) -> object:
    return f"v{n}" if client == 0 else (n + 1) / 100.0


def test_what_the_server_did_in_my_name_is_mine_to_undo() -> None:
    """SPEC D31: also where the op came while I was away."""
    world = World(9)
    server = Server(world, _birth())
    mine, other = (Client(world, server, name) for name in ("c0", "c1"))
    world.run()
    assert mine.link is not None
    mine.link.cut()
    server.lay("c0", 0, _layer)
    _settle(world, [mine, other])
    laid = "c0-layer-0"
    assert laid in other.doc.document.layers
    other.undo()
    _settle(world, [mine, other])
    assert laid in server.core.document.layers
    mine.undo()
    _settle(world, [mine, other])
    assert laid not in server.core.document.layers
    assert laid in other.doc.document.deleted_layers
    mine.redo()
    _settle(world, [mine, other])
    assert server.core.document.layers == other.doc.document.layers
    assert laid in other.doc.document.layers


def test_redo_brings_back_what_undo_took() -> None:
    world = World(5)
    server = Server(world, _birth())
    client = Client(world, server, "c0")
    world.run()
    for n in range(6):
        client.do(c.MoveAnchor(stroke="s0", which="last", to=(n, n, n)))
    _settle(world, [client])
    done = server.core.document.strokes
    for _ in range(6):
        client.undo()
    _settle(world, [client])
    assert server.core.document.strokes == _birth().strokes
    for _ in range(6):
        client.redo()
    _settle(world, [client])
    assert server.core.document.strokes == done
