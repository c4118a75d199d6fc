"""What two nodes over one database survive together, process by process (SPEC P631 to P635; DESIGN 18).

Each fault has a terrain of its own, on which one person draws through each node, and ends when both go on and all is
there once.
"""

from __future__ import annotations

import os
import signal
import time

from tests.cluster.pair import Pair
from tests.cluster.processes import Artist, all_is_there, gone_on, made, until

IS_LONG = bool(os.environ.get("ESKER_LONG"))
ROOMS, PEOPLE = (20, 10) if IS_LONG else (3, 2)
"""Terrains of the rolling restart, and how many draw on each."""
WAIT_SECONDS = 3.0 if IS_LONG else 9.0
"""The long form has a machine to itself; beside other tests everything may take three times as long."""


def test_one_nodes_line_to_the_database_swallows_everything(pair: Pair) -> None:
    """SPEC P631: the node says so, the other one takes the terrain, and later both are nodes again."""
    artists, deaf, left = pair.drawn_on()
    line = pair.lines[pair.at(deaf)]
    line.is_deaf = True
    for each in artists:
        each.turn_to(left.base)
    gone_on(artists)
    began = time.monotonic()
    assert deaf.refused("GET", "/readyz") == 503
    assert time.monotonic() - began < 1.0
    assert deaf.figures()["esker_leases"] == 0
    line.is_deaf = False
    deaf.ready()
    artists[0].turn_to(deaf.base)
    artists[0].cut()
    gone_on(artists)
    all_is_there(artists)


def test_the_database_is_killed_under_two_nodes(pair: Pair) -> None:
    """SPEC P632: it comes back after a second, and both people go on where they were."""
    artists, _, _ = pair.drawn_on()
    pair.postgres.kill()
    time.sleep(1.0)
    pair.postgres.start()
    gone_on(artists)
    all_is_there(artists)


def test_the_line_between_the_nodes_is_cut(pair: Pair) -> None:
    """SPEC P633: who is at the owner goes on, who is at the other node waits and loses nothing."""
    artists, owner, other = pair.drawn_on()
    near, far = artists if pair.at(owner) == 0 else artists[::-1]
    line = pair.private[pair.at(owner)]
    line.cut()
    until(lambda: not far.live._connection.is_online)
    waiting = far.saved
    gone_on([near])
    assert far.saved == waiting
    assert other.figures()["esker_sockets_passing"] == 0
    line.is_open = True
    gone_on(artists)
    all_is_there(artists)


def test_a_node_that_is_slow_but_alive(pair: Pair) -> None:
    """SPEC P634: it stands still for most of each second, and people go on."""
    artists, slow, _ = pair.drawn_on()
    for _ in range(6):
        slow.tell(signal.SIGSTOP)
        time.sleep(0.7)
        slow.tell(signal.SIGCONT)
        time.sleep(0.2)
    gone_on(artists)
    all_is_there(artists)


def test_nobody_waits_long_while_nodes_are_restarted(pair: Pair) -> None:
    """SPEC P594, P635: several terrains on both nodes, one node after the other; people are told that their terrain
    moves, and go with it; nobody reloads."""
    for node in pair.nodes:
        node.ready()
    rooms = []
    for n in range(ROOMS):
        terrain, secret = made(pair.nodes[n % 2])
        rooms.append([Artist(pair.nodes[(n + k) % 2].base, terrain, secret, f"r{n}p{k}") for k in range(PEOPLE)])
    everybody = [each for room in rooms for each in room]
    for each in everybody:
        each.pause = PEOPLE / 20
        each.begin()
    gone_on(everybody, 3)
    for each in everybody:
        each.waited = 0.0
    for node, other in (pair.nodes, pair.nodes[::-1]):
        for each in everybody:
            each.turn_to(other.base)
        node.end(signal.SIGTERM)
        gone_on(everybody, 3)
        node.start()
        node.ready()
    assert max(each.waited for each in everybody) <= WAIT_SECONDS
    assert all("terrains away" in node.log() for node in pair.nodes)
    for room in rooms:
        all_is_there(room)
