"""Two nodes as processes over one real PostgreSQL, for all tests of this folder that need no nodes of their own."""

from __future__ import annotations

from pathlib import Path

import psycopg

from bench.cluster._postgres import Postgres
from tests.cluster.processes import Artist, NodeProcess, drawing
from tests.store.proxy import Proxy

HOURS = {"a": 11.0, "b": -13.0}
"""By how many the clocks of the two machines are wrong."""


class Pair:
    """Two nodes whose clocks are a day apart.

    Each reaches the database, and is reached by the other, through a line of its own.
    """

    def __init__(self, folder: Path) -> None:
        self.postgres = Postgres()
        url, place = self.postgres.database(), self.postgres.folder
        self.url = url
        self.lines = [Proxy(folder / f"line-{name}", place / ".s.PGSQL.5432") for name in "ab"]
        self.nodes = [
            NodeProcess(name, url.replace(str(place), str(folder / f"line-{name}")), folder / name, HOURS[name])
            for name in "ab"
        ]
        self.private = [Proxy(None, node.port) for node in self.nodes]
        for node, line in zip(self.nodes, self.private, strict=True):
            node.line = line.port

    def drawn_on(self) -> tuple[list[Artist], NodeProcess, NodeProcess]:
        """Two people who draw through different nodes, the node that has their terrain, and the other one."""
        artists, _, _ = self.drawing()
        passing = [node.figures()["esker_sockets_passing"] for node in self.nodes]
        assert sorted(passing) == [0, 1]
        return artists, self.nodes[passing.index(0)], self.nodes[passing.index(1)]

    def drawing(self) -> tuple[list[Artist], str, str]:
        """Two people who draw through different nodes, their terrain, and the secret of its owner's link."""
        for node in self.nodes:
            node.ready()
        return drawing([self.nodes[0]], [self.nodes[1]])

    def at(self, node: NodeProcess) -> int:
        """The number of a node."""
        return self.nodes.index(node)

    def owners_of(self, terrain: str) -> list[str]:
        """The names of the nodes that have a lease of this terrain which lives."""
        with psycopg.connect(self.url) as db:
            rows = db.execute(
                "SELECT node FROM esker.leases WHERE terrain=%s AND until > clock_timestamp()", (terrain,)
            )
            return [str(name) for (name,) in rows.fetchall()]

    def close(self) -> None:
        self.postgres.close()
        for line in (*self.lines, *self.private):
            line.close()
