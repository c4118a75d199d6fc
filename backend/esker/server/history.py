"""Routes of the history: its list, the document at a clock, a copy from there (docs/decisions/0021-history.md)."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any, Final

from fastapi import FastAPI, Query, Request

from esker import contract as c
from esker.document.chronicle_words import sentence
from esker.document.ops import StrokeSet
from esker.server.answers import AnyLink, EditorLink, Problem, limited
from esker.session.hub import Hub
from esker.store.chronicles import Chronicles, Page
from esker.store.grids import GridStore

DEFAULT_PAGE: Final = 50
COPY: Final = "Copy of "

At = Annotated[int, Query(ge=0, le=2**53)]


class NewFork(c.Wire):
    """Body of POST /api/terrains/{id}/fork. ``at``: the clock, None for now."""

    at: c.Clock | None = None
    title: c.Name | None = None


def add_history(app: FastAPI, hub: Hub, grids: GridStore) -> None:
    """Adds them."""
    chronicles = Chronicles(hub.journal)

    @app.get("/api/terrains/{terrain}/history")
    async def history(
        terrain: str,
        link: AnyLink,  # noqa: ARG001
        before: At | None = None,
        limit: Annotated[int, Query(ge=1, le=c.MAX_HISTORY_PAGE)] = DEFAULT_PAGE,
    ) -> dict[str, Any]:
        document = await hub.strokes(terrain)
        return _told(await asyncio.to_thread(chronicles.page, terrain, before, limit), document)

    @app.get("/api/terrains/{terrain}/document")
    async def at_clock(terrain: str, link: AnyLink, at: At | None = None) -> c.Document:  # noqa: ARG001
        return await hub.document(terrain, at)

    @app.post("/api/terrains/{terrain}/fork", status_code=201)
    async def fork(request: Request, terrain: str, link: EditorLink, body: NewFork) -> dict[str, Any]:  # noqa: ARG001
        limited(request, app.state.new_terrains, "new terrains came")
        document = await hub.document(terrain, body.at)
        if not all(grids.has(layer.content) for layer in document.layers):
            raise Problem(409, "no_grid", "An elevation grid of that time is not on this server any more.")
        born, made, secret = await hub.create(_copy(document, body.title))
        return {
            "id": born.id,
            "title": born.settings.title,
            "secret": secret,
            "role": made.role,
            "clock": document.clock,
        }


def _copy(document: c.Document, title: str | None) -> c.Document:
    """The terrain without what had been deleted from it: nobody there could bring it back."""
    name = (COPY + document.settings.title)[: c.MAX_NAME_LENGTH] if title is None else title
    settings = document.settings.model_copy(update={"title": name})
    return document.model_copy(update={"settings": settings, "deleted": (), "deleted_layers": ()})


def _told(page: Page, document: StrokeSet) -> dict[str, Any]:
    strokes, layers = document.deleted | document.strokes, document.deleted_layers | document.layers
    return {
        "clock": page.clock,
        "first": page.first,
        "more": page.more,
        "entries": [
            {
                "first": entry.first,
                "last": entry.last,
                "at": entry.at,
                "author": entry.author,
                "action": entry.action,
                "turn": entry.turn,
                "text": sentence(entry, strokes, layers),
            }
            for entry in page.entries
        ],
        "people": {client: {"name": person.name, "colour": person.colour} for client, person in page.people.items()},
    }
