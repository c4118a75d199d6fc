"""Routes for who watches over a server: is it alive, and should people be sent to it?"""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.responses import JSONResponse

from esker.cluster.node import Cluster
from esker.session.room.hub import Hub
from esker.store.engine.leases import SILENT_SECONDS
from esker.version import VERSION


def add_health(app: FastAPI, hub: Hub, cluster: Cluster | None = None) -> None:
    """Adds the routes. While a server starts both answer 503 (``server/starting.py``)."""

    @app.get("/healthz")
    async def healthz() -> dict[str, Any]:
        """The process answers 200, with what it is made of and how that is."""
        return {"ok": True, "version": VERSION, "device": hub.device, **_state(hub), **_node(cluster)}

    @app.get("/readyz")
    async def readyz() -> JSONResponse:
        """The server answers 200 where people can be served in full; 503, with the reasons, where something would be
        refused."""
        state = _state(hub) | _node(cluster)
        # A node that nobody is sent to writes nothing, so its last commit says nothing: its renewals do.
        looked_at = ("journal", "database", "disk") if cluster is None else ("database", "disk", "node")
        reasons = [name for name in looked_at if state.get(name, "ok") != "ok"]
        return JSONResponse({"ready": not reasons, "reasons": reasons} | state, 503 if reasons else 200)


def _node(cluster: Cluster | None) -> dict[str, Any]:
    """Returns the state of this server among others; nothing of one that is alone."""
    if cluster is None:
        return {}
    state = "is being stopped" if cluster.draining else "ok" if cluster.age < SILENT_SECONDS else "lost its database"
    return {"node": state, "name": cluster.name, "nodes": len(cluster.nodes), "leases": len(cluster.held)}


def _state(hub: Hub) -> dict[str, Any]:
    """Returns the state of the journal and the disk, what waits, and the number of open rooms; of a database
    elsewhere, whether it answers. Nothing of it says anything about anybody's terrain, and nothing is asked for it."""
    journal = hub.journal
    shared = {} if journal.engine.is_local else {"database": "ok" if journal.engine.answers else "does not answer"}
    return {
        "journal": "ok" if journal.writable else "cannot be written",
        **shared,
        "disk": "low" if journal.space.low else "ok",
        "waiting": journal.waiting,
        "rooms": hub.open_rooms,
    }
