"""Two people in real browsers, through different nodes over one PostgreSQL (SPEC E61)."""

from __future__ import annotations

import json
import secrets
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cluster.balancer import Balancer
from tests.e2e.conftest import Server, Visitors
from tests.e2e.hands import arch, draw, on_screen, press_and_move, wait, wait_settled
from tests.store.engines import Database


@pytest.fixture
def nodes(tmp_path: Path, database: Database) -> Iterator[list[Server]]:
    """Two nodes, started by the two commands that the README names."""
    shared = {"ESKER_DATABASE": database.new(), "ESKER_CLUSTER_KEY": secrets.token_urlsafe(32)}
    made = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        node = Server(tmp_path / name / "data", environment=shared)
        node.options = ("--node", name, "--advertise", node.url)
        made.append(node)
    for node in made:
        node.start()
    yield made
    for node in made:
        node.kill()


@pytest.fixture
def server(nodes: list[Server]) -> Server:
    """The node at which terrains are made."""
    return nodes[0]


def leases(node: Server) -> int:
    """How many terrains a node has."""
    with urllib.request.urlopen(f"{node.url}/healthz", timeout=30) as answer:
        return int(json.loads(answer.read())["leases"])


def test_the_owner_is_killed_in_the_middle_of_a_stroke_and_both_go_on(visitors: Visitors, nodes: list[Server]) -> None:
    """SPEC E61."""
    terrain, secret = nodes[0].create(title="Two nodes")
    doors = [Balancer([nodes[0].port, nodes[1].port]), Balancer([nodes[1].port, nodes[0].port])]
    ada, ben = visitors(on_map=True), visitors(on_map=True)
    for person, door in ((ada, doors[0]), (ben, doors[1])):
        person.origin = door.url
        person.open(f"/t/{terrain}#{secret}")
    draw(ada, "b", arch(on_screen(ada, 900, 2200), on_screen(ada, 2300, 2500), 110))
    draw(ben, "c", arch(on_screen(ben, 2500, 1500), on_screen(ben, 3500, 1700), -40))
    wait_settled(ada, ben)
    before = ben.js("() => window.esker.strokes()")
    assert len(before) == 2

    path = arch(on_screen(ada, 2600, 2600), on_screen(ada, 3500, 2800), 90)
    ada.page.keyboard.press("b")
    press_and_move(ada.page, path[: len(path) // 2])
    wait(ada, "() => window.esker.strokes().length === 3")
    owner = max(nodes, key=leases)
    assert [leases(node) for node in nodes].count(0) == 1
    owner.kill()
    for x, y in path[len(path) // 2 :]:
        ada.page.mouse.move(x, y)
    ada.page.mouse.up()
    for person in (ada, ben):
        wait(person, "() => window.esker.connection() === 'online' && window.esker.pending() === 0")
        wait(person, "() => window.esker.strokes().length === 3")
    draw(ben, "b", arch(on_screen(ben, 500, 3000), on_screen(ben, 1500, 3200), 60))
    wait(ada, "() => window.esker.strokes().length === 4")
    wait_settled(ada, ben)
    assert ada.js("() => window.esker.strokes()") == ben.js("() => window.esker.strokes()")
    for stroke in before:
        assert stroke in ada.js("() => window.esker.strokes()")
    for person in (ada, ben):
        assert person.foreign == []
        lost = ("ERR_CONNECTION", "ERR_EMPTY_RESPONSE", "WebSocket connection")
        assert [error for error in person.errors if not any(words in error for words in lost)] == []
    for door in doors:
        door.close()
