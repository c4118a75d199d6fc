"""Routes for who watches over a server: is it alive, and should people be sent to it?"""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.responses import JSONResponse

from esker.session.room.hub import Hub
from esker.version import VERSION


def add_health(app: FastAPI, hub: Hub) -> None:
    """Adds the routes. While a server starts both answer 503 (``server/starting.py``)."""

    @app.get("/healthz")
    async def healthz() -> dict[str, Any]:
        """The process answers 200, with what it is made of and how that is."""
        return {"ok": True, "version": VERSION, "device": hub.device, **_state(hub)}

    @app.get("/readyz")
    async def readyz() -> JSONResponse:
        """The server answers 200 where people can be served in full; 503, with the reasons, where something would be
        refused."""
        state = _state(hub)
        reasons = [name for name in ("journal", "disk") if state[name] != "ok"]
        return JSONResponse({"ready": not reasons, "reasons": reasons} | state, 503 if reasons else 200)


def _state(hub: Hub) -> dict[str, Any]:
    """Returns the state of the journal and the disk, what waits, and the number of open rooms. Nothing of it says
    anything about anybody's terrain."""
    journal = hub.journal
    return {
        "journal": "ok" if journal.writable else "cannot be written",
        "disk": "low" if journal.space.low else "ok",
        "waiting": journal.waiting,
        "rooms": hub.open_rooms,
    }
