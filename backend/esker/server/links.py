"""Routes of links, roles and join codes."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any, Final

from fastapi import FastAPI, Request
from pydantic import StringConstraints

from esker import contract as c
from esker.contract import Role
from esker.server.answers import AnyLink, OwnerLink, Problem, limited
from esker.session.hub import Hub
from esker.store.access import CODE_SECONDS, Link, TooManyLinks

RENEWED_AFTER: Final = 1.0


class NewLink(c.Wire):
    """Body of POST /api/terrains/{id}/links."""

    role: Role
    name: c.Name = ""


class NewCode(c.Wire):
    """Body of POST /api/terrains/{id}/codes."""

    role: Role = "edit"


class JoinCode(c.Wire):
    """Body of POST /api/join."""

    code: Annotated[str, StringConstraints(min_length=1, max_length=20)]


def add_links(app: FastAPI, hub: Hub) -> None:
    """Adds them."""
    access = hub.access
    _add_codes(app, hub)

    @app.get("/api/terrains/{terrain}/links")
    async def list_links(terrain: str, link: OwnerLink) -> list[dict[str, Any]]:  # noqa: ARG001
        keys = ("id", "role", "name", "created", "revoked")
        return [{key: getattr(found, key) for key in keys} for found in access.links(terrain)]

    @app.post("/api/terrains/{terrain}/links", status_code=201)
    async def new_link(terrain: str, link: OwnerLink, body: NewLink) -> dict[str, str]:  # noqa: ARG001
        made, secret = await _new(hub, terrain, body.role, body.name)
        return {"id": made.id, "role": made.role, "name": made.name, "secret": secret}

    @app.post("/api/terrains/{terrain}/links/{link_id}/rotate")
    async def rotate(terrain: str, link_id: str, link: OwnerLink) -> dict[str, str]:
        secret = await asyncio.wrap_future(access.rotate(terrain, link_id))
        if secret is None:
            raise Problem(404, "no_link", "There is no such link, or it was revoked.")
        access.drop_codes(link_id)
        if link_id != link.id:
            hub.revoke_members(terrain, link_id)
        else:  # whoever asked has the new secret in a moment and comes back; nobody else with the old one does
            asyncio.get_running_loop().call_later(RENEWED_AFTER, hub.renew_members, terrain, link_id)
        return {"id": link_id, "secret": secret}

    @app.delete("/api/terrains/{terrain}/links/{link_id}", status_code=204)
    async def revoke(terrain: str, link_id: str, link: OwnerLink) -> None:
        if link_id == link.id:
            raise Problem(409, "own_link", "You cannot revoke the link that you came in by; rotate it instead.")
        if not await asyncio.wrap_future(access.revoke(terrain, link_id)):
            raise Problem(404, "no_link", "There is no such link, or it was revoked already.")
        access.drop_codes(link_id)
        hub.revoke_members(terrain, link_id)


async def _new(hub: Hub, terrain: str, role: Role, name: str) -> tuple[Link, str]:
    """A new link and its secret. Raises Problem."""
    try:
        return await asyncio.wrap_future(hub.access.add(terrain, role, name))
    except TooManyLinks:
        raise Problem(409, "too_many_links", "This terrain has too many links. Revoke some.") from None


def _add_codes(app: FastAPI, hub: Hub) -> None:
    access = hub.access

    @app.post("/api/terrains/{terrain}/codes", status_code=201)
    async def new_code(terrain: str, link: AnyLink, body: NewCode) -> dict[str, Any]:
        if link.role == "view" or (link.role == "edit" and body.role == "owner"):
            raise Problem(403, "not_allowed", "Your link does not allow you to invite people in this role.")
        return {"code": access.make_code(terrain, body.role, link.id), "expires_s": CODE_SECONDS}

    @app.post("/api/join")
    async def join(request: Request, body: JoinCode) -> dict[str, str]:
        limited(request, app.state.code_tries, "join codes came")
        found = access.open_code(body.code)
        if found is None:
            raise Problem(404, "bad_code", "This code is wrong or too old. Ask for a new one.")
        terrain, role = found
        _, secret = await _new(hub, terrain, role, "Joined by code")
        return {"id": terrain, "secret": secret, "role": role}
