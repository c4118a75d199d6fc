"""Figures for Prometheus, for whom the settings allow them: by default only this machine (docs/operations.md)."""

from __future__ import annotations

from collections.abc import Iterator

from fastapi import FastAPI, Request, Response

from esker.cluster.exposition import CONTENT_TYPE, Family, Histogram, one, text
from esker.cluster.node import Cluster
from esker.errors import Cannot
from esker.server.routes.answers import address
from esker.server.wire.front import Proxies
from esker.session.ground.worker import Worker
from esker.session.room.hub import Hub
from esker.version import VERSION


class Gauges:
    """What a server counts (``session.room.ports.Meter``), and what it can be asked."""

    def __init__(self, readers: str) -> None:
        """``readers``: addresses and networks that may read, separated by commas. Raises ValueError."""
        self.readers = Proxies(readers)
        self.hub: Hub | None = None
        self.worker: Worker | None = None
        self.cluster: Cluster | None = None
        self._acks = Histogram()
        self._frames = self._bytes = 0

    def acknowledged(self, seconds: float) -> None:
        """Operations were acknowledged, so long after the first of them came."""
        self._acks.note(seconds)

    def framed(self, size: int) -> None:
        """A frame of tiles was taken for a socket."""
        self._frames += 1
        self._bytes += size

    def families(self) -> Iterator[Family]:
        """Yields all figures as they are now. None says anything about anybody's terrain."""
        yield Family("esker_info", "gauge", "The version that runs.", {(("version", VERSION),): 1})
        if self.hub is not None:
            journal = self.hub.journal
            yield one("esker_rooms", "gauge", "Terrains that are open.", self.hub.open_rooms)
            yield one("esker_members", "gauge", "People who are in them.", self.hub.members)
            yield one("esker_journal_writable", "gauge", "1 where the last commit could be written.", journal.writable)
            yield one("esker_journal_waiting", "gauge", "Writes that wait for a commit.", journal.waiting)
            yield one("esker_disk_low", "gauge", "1 where the disk is nearly full.", journal.space.low)
        if self.worker is not None:
            yield one("esker_solver_seconds_total", "counter", "Time that solves took.", self.worker.spent)
        yield Family("esker_ack_seconds", "histogram", "From an operation to its acknowledgement.", self._acks)
        yield one("esker_frames_total", "counter", "Frames of tiles that were sent.", self._frames)
        yield one("esker_frame_bytes_total", "counter", "Their bytes.", self._bytes)
        if self.cluster is not None:
            yield from _of_node(self.cluster)


def _of_node(cluster: Cluster) -> Iterator[Family]:
    counts = cluster.counts
    yield Family("esker_node_info", "gauge", "The name of this node.", {(("node", cluster.name),): 1})
    yield one("esker_nodes", "gauge", "Live nodes.", len(cluster.nodes))
    yield one("esker_node_draining", "gauge", "1 where this node is being stopped.", cluster.draining)
    yield one("esker_leases", "gauge", "Leases that this node has.", len(cluster.held))
    yield one("esker_lease_age_seconds", "gauge", "Since the last answered renewal was sent.", cluster.age)
    yield one("esker_renewals_failed_total", "counter", "Renewals without an answer.", counts.renewals_failed)
    yield one("esker_terrains_taken_total", "counter", "Leases that were taken.", counts.taken)
    yield one("esker_terrains_released_total", "counter", "Leases that were given back.", counts.released)
    yield one("esker_terrains_lost_total", "counter", "Leases that were lost.", counts.lost)
    yield one("esker_fenced_writes_total", "counter", "Writes that the database refused.", counts.fenced)
    yield one("esker_requests_passed_total", "counter", "Requests that were passed on.", counts.requests_passed)
    yield one("esker_sockets_passed_total", "counter", "Sockets that were passed on.", counts.sockets_passed)
    yield one("esker_sockets_passing", "gauge", "Sockets that are passed on now.", counts.sockets_passing)


def add_metrics(app: FastAPI, gauges: Gauges) -> None:
    """Adds the route. Whoever may not read finds nothing there."""

    @app.get("/metrics", include_in_schema=False)
    async def metrics(request: Request) -> Response:
        if address(request) not in gauges.readers:
            raise Cannot(404, "not_found", "There is nothing at this address.")
        return Response(text(gauges.families()), media_type=CONTENT_TYPE)
