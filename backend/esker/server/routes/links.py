"""Routes of links, roles and join codes."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Annotated, Any, Final, TypeVar

from fastapi import FastAPI, Request
from pydantic import StringConstraints

from esker import contract as c
from esker.contract import Role
from esker.errors import Cannot
from esker.fairness.shares import Rate, Rates
from esker.lesson.classes import Classes
from esker.server.routes.answers import AnyLink, OwnerLink, asker, bad_code, guess, limited
from esker.server.routes.classes import asked_in
from esker.session.room.hub import Hub
from esker.store.access import CODE_SECONDS, JOINED_BY_CODE, Ended, Link, OwnLink, SecretTaken, TooManyLinks
from esker.store.access import JoinCode as OpenedCode
from esker.store.classes import Class
from esker.store.kept import kept_one

T = TypeVar("T")

RENEWED_AFTER: Final = 1.0
ROOM_ASKS: Final = (2.0, 60)
"""What projectors ask about the codes that they show, by address: rate a second, burst."""


class NewLink(c.Wire):
    """Body of POST /api/terrains/{id}/links."""

    role: Role
    name: c.Name = ""


class NewCode(c.Wire):
    """Body of POST /api/terrains/{id}/codes."""

    role: Role = "edit"


class Replacement(c.Wire):
    """Body of POST /api/terrains/{id}/links/{link}/rotate, which may be empty."""

    secret: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{32,128}$")] | None = None
    """The link's new secret: 192 random bits at least, made by whoever asks."""
    client: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{0,40}$")] = ""
    """Returns a person's name as the room knows it: the other owners are told the name."""


class JoinCode(c.Wire):
    """Body of POST /api/join and POST /api/room."""

    code: Annotated[str, StringConstraints(min_length=1, max_length=20)]


def add_links(app: FastAPI, hub: Hub, warned: Callable[[Request], bool] = lambda _: False) -> None:
    """Adds the routes. ``warned``: whether a browser that asks so has warned of this server's certificate."""
    access = hub.access
    _add_codes(app, hub)
    _add_room(app, hub, warned)

    @app.get("/api/terrains/{terrain}/links")
    async def list_links(terrain: str, link: OwnerLink) -> list[dict[str, Any]]:
        keys = ("id", "role", "name", "created", "revoked", "parent")
        found = access.links(terrain)
        return [{key: getattr(each, key) for key in keys} | {"own": each.id == link.id} for each in found]

    @app.post("/api/terrains/{terrain}/links", status_code=201)
    async def new_link(request: Request, terrain: str, link: OwnerLink, body: NewLink) -> dict[str, str]:
        limited(request, app.state.new_links, "new links came")
        try:
            made, secret = await _new(hub, terrain, body.role, body.name, link)
        except Ended:
            raise _ended() from None
        return {"id": made.id, "role": made.role, "name": made.name, "secret": secret}

    @app.post("/api/terrains/{terrain}/links/{link_id}/rotate")
    async def rotate(
        request: Request, terrain: str, link_id: str, link: OwnerLink, body: Replacement | None = None
    ) -> dict[str, str]:
        limited(request, app.state.new_links, "new links came")
        asked = body or Replacement()
        try:
            found = await asyncio.wrap_future(access.rotate(terrain, link_id, link, asked.secret))
        except Ended:
            raise _ended() from None
        except SecretTaken:
            raise Cannot(409, "secret_taken", "Another link has this secret already. Make another one.") from None
        if found is None:
            raise Cannot(404, "no_link", "There is no such link, or it was revoked.")
        secret, ended = found
        access.drop_codes(link_id)
        hub.end_links(terrain, ended)
        who = hub.name_of(terrain, asked.client, link.id)
        replaced = next((each for each in access.links(terrain) if each.id == link_id), None)
        if link_id != link.id:
            hub.revoke_members(terrain, link_id)
        else:  # the owner who asked has the new secret in a moment and comes back; people with the old one do not
            asyncio.get_running_loop().call_later(RENEWED_AFTER, hub.renew_members, terrain, link_id, who)
        if replaced is not None and replaced.role == "owner":
            what = "an owner link" if replaced.name == "" else f"the owner link “{replaced.name}”"
            sentence = f"{who or 'Another owner'} replaced {what}. Whoever came by the old one needs the new one."
            hub.tell_owners(terrain, sentence, link_id)
        return {"id": link_id, "secret": secret}

    @app.delete("/api/terrains/{terrain}/links/{link_id}", status_code=204)
    async def revoke(terrain: str, link_id: str, link: OwnerLink) -> None:
        if link_id == link.id:
            raise Cannot(409, "own_link", "You cannot revoke the link that you came in by; rotate it instead.")
        try:
            ended = await asyncio.wrap_future(access.revoke(terrain, link_id, link))
        except Ended:
            raise _ended() from None
        except OwnLink:
            raise Cannot(409, "own_link", "Your own link was made through this one and would end with it.") from None
        if not ended:
            raise Cannot(404, "no_link", "There is no such link, or it was revoked already.")
        hub.end_links(terrain, ended)


def _ended() -> Cannot:
    return Cannot(403, "revoked", "Your own link was revoked or renewed meanwhile. Nothing was changed.")


async def _new(hub: Hub, terrain: str, role: Role, name: str, by: Link | str) -> tuple[Link, str]:
    """Returns a new link and its secret. Raises Cannot, Ended."""
    try:
        return await asyncio.wrap_future(hub.access.add(terrain, role, name, by))
    except TooManyLinks:
        raise Cannot(409, "too_many_links", "This terrain has too many links. Revoke some.") from None


def _add_codes(app: FastAPI, hub: Hub) -> None:
    access = hub.access

    async def coded(work: Callable[..., T], *arguments: object) -> T:
        """Codes in a database are made in a thread."""
        return await asyncio.to_thread(work, *arguments) if access.codes.is_slow else work(*arguments)

    @app.post("/api/terrains/{terrain}/codes", status_code=201)
    async def new_code(request: Request, terrain: str, link: AnyLink, body: NewCode) -> dict[str, Any]:
        if link.role == "view" or (link.role == "edit" and body.role == "owner"):
            raise Cannot(403, "not_allowed", "Your link does not allow you to invite people in this role.")
        limited(request, app.state.new_codes, "join codes were made", link)
        return {"code": await coded(access.make_code, terrain, body.role, link.id), "expires_s": CODE_SECONDS}

    @app.post("/api/terrains/{terrain}/codes/prolong")
    async def prolong(request: Request, terrain: str, link: AnyLink, body: JoinCode) -> dict[str, Any]:
        limited(request, app.state.code_tries, "join codes came")
        left = await coded(access.prolong_code, terrain, body.code, link.id)
        if left is None:
            raise Cannot(404, "bad_code", "This code has ended. Make a new one.")
        return {"code": body.code, "expires_s": left}

    @app.post("/api/join")
    async def join(request: Request, body: JoinCode) -> dict[str, Any]:
        classes: Classes = app.state.classes

        def find() -> OpenedCode | Class | None:
            return access.open_code(body.code) or classes.by_code(body.code)

        found = guess(request, find)
        if isinstance(found, Class):
            return asked_in(classes, found)
        assert isinstance(found, OpenedCode)
        try:
            _, secret = await _new(hub, found.terrain, found.role, JOINED_BY_CODE, found.link)
        except Ended:  # the link that made the code ended in this very moment
            raise bad_code() from None
        return {"id": found.terrain, "secret": secret, "role": found.role}


def _add_room(app: FastAPI, hub: Hub, warned: Callable[[Request], bool]) -> None:
    """What the projector's page says of the code that it shows. It names no link and no person: whoever has the code
    could come in by it (docs/decisions/0069-the-projector.md)."""
    app.state.room_asks = Rates(Rate(*ROOM_ASKS))

    @app.post("/api/room")
    async def room(request: Request, body: JoinCode) -> dict[str, Any]:
        limited(request, app.state.room_asks, "questions about codes came")
        classes: Classes = app.state.classes
        found = guess(request, lambda: hub.access.open_code(body.code) or classes.by_code(body.code), again=True)
        facts: dict[str, Any]
        if isinstance(found, Class):
            terrains = [copy.terrain for copy in classes.store.copies(found.id)]
            facts = {"kind": "class", "terrain": None, "role": "edit", "title": found.title}
            facts["expires_s"] = found.code_until - classes.store.now()
        else:
            assert isinstance(found, OpenedCode)
            if hub.deletion.deleted(found.terrain) is not None:
                raise bad_code()
            terrains = [found.terrain]
            kept = await hub.read(asker(request), kept_one, hub.journal, found.terrain)
            facts = {"kind": "terrain", "terrain": found.terrain, "role": found.role}
            facts |= {"title": "" if kept is None else kept.title, "expires_s": found.seconds}
        return facts | {"here": sum(_pupils(hub, each) for each in terrains), "warned": warned(request)}


def _pupils(hub: Hub, terrain: str) -> int:
    """How many people are in a terrain who do not own it."""
    room = hub.open_room(terrain)
    return 0 if room is None else len({member.person for member in room.core.members if member.role != "owner"})
