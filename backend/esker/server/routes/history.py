"""Routes of the history: its list, the document at a clock, a copy from there (docs/decisions/0021-history.md)."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Final

from fastapi import FastAPI, Query, Request, Response

from esker import contract as c
from esker.document.history.words import facts, sentence
from esker.document.ops import StrokeSet
from esker.document.wire import document_json
from esker.errors import Cannot
from esker.server.routes.answers import AnyLink, EditorLink, asker, limited, shown
from esker.session.room.hub import Hub
from esker.session.room.replicas.viewing import things
from esker.store.activity import ActivityLogs, Page
from esker.store.grids import GridStore
from esker.store.timestamps import Person

DEFAULT_PAGE: Final = 50
COPY: Final = "Copy of "

At = Annotated[int, Query(ge=0, le=2**53)]


class NewFork(c.Wire):
    """Body of POST /api/terrains/{id}/fork. ``at``: the clock, None for now."""

    at: c.Clock | None = None
    title: c.Name | None = None


def add_history(app: FastAPI, hub: Hub, grids: GridStore) -> None:
    """Adds the routes."""
    activity_logs = ActivityLogs(hub.journal)

    @app.get("/api/terrains/{terrain}/history")
    async def history(
        request: Request,
        terrain: str,
        link: AnyLink,
        before: At | None = None,
        limit: Annotated[int, Query(ge=1, le=c.MAX_HISTORY_PAGE)] = DEFAULT_PAGE,
    ) -> dict[str, Any]:
        who = asker(request, link)
        document = await hub.strokes(terrain, None, who)
        page = await hub.read(who, activity_logs.page, terrain, before, limit)
        hub.door.demand(link)
        lesson = hub.lessons.of(terrain).state
        if link.role != "owner" and (lesson.hide or lesson.animals or link.role == "view"):
            room = hub.open_room(terrain)
            here = {} if room is None or lesson.hide else {m.client: m.name for m in room.core.members}
            if link.role == "edit":
                return _answer(_without_names(page, here), document)
            return _answer(_without_names(page, here), replace(document, deleted={}, deleted_layers={}))
        return _answer(page, document)

    @app.get("/api/terrains/{terrain}/document", response_model=c.Document)
    async def at_clock(request: Request, terrain: str, link: AnyLink, at: At | None = None) -> Response:
        who = asker(request, link)
        document = await hub.document(terrain, at, who)
        still = None if at is None else things(await hub.strokes(terrain, None, who))
        # This runs in a thread, stroke by stroke: the framework would encode the document in the event loop, at once.
        text = await hub.read(who, document_json, shown(document, link, hub.lessons.of(terrain), still))
        hub.door.demand(link)
        return Response(text, media_type="application/json")

    @app.post("/api/terrains/{terrain}/fork", status_code=201)
    async def fork(request: Request, terrain: str, link: EditorLink, body: NewFork) -> dict[str, Any]:
        limited(request, app.state.new_terrains, "new terrains came")
        document = await hub.document(terrain, body.at, asker(request, link))
        if not await asyncio.to_thread(grids.has_all, document):
            raise Cannot(409, "no_grid", "An elevation grid of that time is not on this server any more.")
        hub.door.demand(link)
        born, made, secret = await hub.create(_copy(document, body.title), asker(request, link))
        return {
            "id": born.id,
            "title": born.settings.title,
            "secret": secret,
            "role": made.role,
            "clock": document.clock,
        }


def _copy(document: c.Document, title: str | None) -> c.Document:
    """Returns the terrain without what had been deleted from it: nobody there could bring it back."""
    name = (COPY + document.settings.title)[: c.MAX_NAME_LENGTH] if title is None else title
    settings = document.settings.model_copy(update={"title": name})
    return document.model_copy(update={"settings": settings, "deleted": (), "deleted_layers": ()})


def _without_names(page: Page, here: Mapping[str, str]) -> Page:
    """Returns the page for a link to look: only people who are ``here`` (names by client) have a name."""
    return page._replace(people={k: Person(k, here[k], each.colour) for k, each in page.people.items() if k in here})


def _answer(page: Page, document: StrokeSet) -> dict[str, Any]:
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
                "facts": facts(entry, strokes, layers),
            }
            for entry in page.entries
        ],
        "people": {client: {"name": person.name, "colour": person.colour} for client, person in page.people.items()},
    }
