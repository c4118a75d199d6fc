"""Routes of classes: for teachers below the terrain that a class was made from, for devices that come in by a code."""

from __future__ import annotations

from typing import Annotated, Any, Final

from fastapi import FastAPI, Request, Response
from pydantic import Field

from esker import contract as c
from esker.errors import Cannot
from esker.fairness.shares import Rate, Rates
from esker.lesson.classes import Classes, Seat
from esker.lesson.collect import Collections
from esker.server.routes.answers import OwnerLink, asker, guess, limited, secret_of
from esker.server.wire.sending import Sent
from esker.store.classes import Class

ASKED: Final = (2.0, 60)
"""What teachers ask of classes, by address: rate a second, burst."""
Numbers = Annotated[list[c.Number], Field(min_length=1, max_length=c.MAX_PUPILS)]


class NewClass(c.Wire):
    """Body of POST …/classes. ``at``: the clock of the terrain, None for now; ``places``: devices that it takes."""

    title: c.Name = ""
    together: Annotated[int, Field(ge=1, le=c.MAX_TOGETHER)] = 1
    places: Annotated[int, Field(ge=1, le=c.MAX_PUPILS)] = c.DEFAULT_PUPILS
    at: c.Clock | None = None


class Door(c.Wire):
    """Body of POST …/door. ``open``: with a new code, or not at all."""

    open: bool


class Chosen(c.Wire):
    """Body of POST …/restart. ``numbers``: of copies, None: all."""

    numbers: Numbers | None = None


class Freeze(Chosen):
    """Body of POST …/freeze."""

    frozen: bool


class OneCopy(c.Wire):
    """Body of POST …/open and …/show. ``number`` None: show nothing any more."""

    number: c.Number | None = None


class Together(c.Wire):
    """Body of POST …/together."""

    numbers: Numbers
    title: c.Name = ""


class NewSeat(c.Wire):
    """Body of POST /api/classes/{class}/seats. ``seat``: the secret that the device made; ``number``: the copy that it
    wants to share, 0 for one of its own, None for whichever has room."""

    code: Annotated[str, Field(min_length=1, max_length=20)]
    seat: c.SeatSecret
    name: c.Name = ""
    number: Annotated[int, Field(ge=0, le=c.MAX_PUPILS)] | None = None


class SeatName(c.Wire):
    """Body of POST /api/seat."""

    name: c.Name


def add_classes(app: FastAPI, classes: Classes, collections: Collections) -> None:
    """Adds them."""
    app.state.classes = classes
    app.state.class_asks = Rates(Rate(*ASKED))
    _add_class(app, classes)
    _add_orders(app, classes)
    _add_collecting(app, classes, collections)
    _add_seats(app, classes)


def _add_class(app: FastAPI, classes: Classes) -> None:
    path = "/api/terrains/{terrain}/classes"

    @app.post(path, status_code=201)
    async def make(request: Request, terrain: str, link: OwnerLink, body: NewClass) -> dict[str, Any]:  # noqa: ARG001
        limited(request, app.state.new_terrains, "new terrains came")
        made = await classes.make(link, body.title, body.together, body.places, body.at, asker(request, link))
        return _answer(classes, made)

    @app.get(path)
    async def all_classes(terrain: str, link: OwnerLink) -> list[dict[str, Any]]:  # noqa: ARG001
        return [_answer(classes, each) for each in classes.store.of_terrain(link.terrain)]

    @app.delete(f"{path}/{{lesson}}")
    async def delete(request: Request, lesson: str, link: OwnerLink, at_once: bool = False) -> dict[str, Any]:
        limited(request, app.state.class_asks, "orders")
        found = classes.owned(link, lesson, ended=at_once)
        return {"id": lesson, "until": await classes.end(found, at_once, asker(request, link))}

    @app.post(f"{path}/{{lesson}}/restore")
    async def restore(lesson: str, link: OwnerLink) -> dict[str, Any]:
        await classes.bring_back(classes.owned(link, lesson, ended=True))
        return _answer(classes, classes.owned(link, lesson))

    @app.post(f"{path}/{{lesson}}/door")
    async def door(request: Request, lesson: str, link: OwnerLink, body: Door) -> dict[str, Any]:
        limited(request, app.state.new_codes, "join codes were made", link)
        return _answer(classes, await classes.door(classes.owned(link, lesson), body.open))


def _answer(classes: Classes, found: Class) -> dict[str, Any]:
    keys = ("id", "terrain", "title", "created", "clock", "together", "places", "ended")
    left = max(0.0, found.code_until - classes.store.now())
    pupils, copies = len(classes.store.pupils(found.id)), len(classes.store.copies(found.id))
    door = {"code": found.code if left else None, "expires_s": left if found.code else 0.0}
    return {key: getattr(found, key) for key in keys} | door | {"pupils": pupils, "copies": copies}


def _add_orders(app: FastAPI, classes: Classes) -> None:
    """What a teacher does to copies."""
    path = "/api/terrains/{terrain}/classes/{lesson}"

    @app.post(f"{path}/freeze")
    async def freeze(request: Request, lesson: str, link: OwnerLink, body: Freeze) -> dict[str, Any]:
        limited(request, app.state.class_asks, "orders")
        await classes.freeze(classes.owned(link, lesson), body.numbers, body.frozen)
        return {"frozen": body.frozen}

    @app.post(f"{path}/restart")
    async def restart(request: Request, lesson: str, link: OwnerLink, body: Chosen) -> dict[str, Any]:
        limited(request, app.state.class_asks, "orders")
        return {"changed": await classes.restart(classes.owned(link, lesson), body.numbers, asker(request, link))}

    @app.post(f"{path}/push")
    async def push(request: Request, lesson: str, link: OwnerLink) -> dict[str, Any]:
        limited(request, app.state.class_asks, "orders")
        return {"changed": await classes.push(classes.owned(link, lesson), asker(request, link))}

    @app.post(f"{path}/show")
    async def show(request: Request, lesson: str, link: OwnerLink, body: OneCopy) -> dict[str, Any]:
        limited(request, app.state.class_asks, "orders")
        await classes.show(classes.owned(link, lesson), body.number)
        return {"show": body.number}

    @app.post(f"{path}/open", status_code=201)
    async def open_copy(request: Request, lesson: str, link: OwnerLink, body: OneCopy) -> dict[str, Any]:
        limited(request, app.state.new_links, "new links came")
        if body.number is None:
            raise Cannot(400, "malformed", "Say which copy is to be opened.")
        terrain, secret = await classes.open(classes.owned(link, lesson), body.number, link)
        return {"id": terrain, "secret": secret, "role": "owner"}

    @app.post(f"{path}/together", status_code=201)
    async def together(request: Request, lesson: str, link: OwnerLink, body: Together) -> dict[str, Any]:
        limited(request, app.state.new_terrains, "new terrains came")
        found = classes.owned(link, lesson)
        born, secret = await classes.together(found, body.numbers, body.title, asker(request, link))
        return {"id": born.id, "title": born.settings.title, "secret": secret, "role": "owner"}


def _add_collecting(app: FastAPI, classes: Classes, collections: Collections) -> None:
    path = "/api/terrains/{terrain}/classes/{lesson}/collections"

    @app.post(path, status_code=202)
    async def begin(request: Request, lesson: str, link: OwnerLink) -> dict[str, Any]:
        limited(request, app.state.exports, "exports were asked for")
        return collections.begin(classes.owned(link, lesson), link, asker(request, link))

    @app.get(f"{path}/{{job}}")
    async def status(lesson: str, job: str, link: OwnerLink) -> dict[str, Any]:
        return collections.status(classes.owned(link, lesson), job)

    @app.get(f"{path}/{{job}}/file")
    async def file(lesson: str, job: str, link: OwnerLink) -> Response:
        made, name = collections.file(classes.owned(link, lesson), job)
        return Sent(classes.hub, link, made, "application/zip", name)


def _add_seats(app: FastAPI, classes: Classes) -> None:
    """For devices: coming in, and coming back."""

    @app.post("/api/classes/{lesson}/seats", status_code=201)
    async def sit(request: Request, lesson: str, body: NewSeat) -> dict[str, Any]:
        found = guess(request, lambda: classes.by_code(body.code), again=True)
        if found.id != lesson:
            raise Cannot(404, "bad_code", "This code opens another class. Type it again.")
        if classes.store.seated(body.seat) is None:
            limited(request, app.state.new_terrains, "new terrains came")
        return _seat(await classes.sit(found, body.seat, body.name.strip(), body.number, asker(request)))

    @app.get("/api/seat")
    async def seat(request: Request) -> dict[str, Any]:
        limited(request, app.state.code_tries, "seats were asked for")
        return _seat(classes.seat_of(secret_of(request)))

    @app.post("/api/seat")
    async def rename(request: Request, body: SeatName) -> dict[str, Any]:
        limited(request, app.state.code_tries, "seats were asked for")
        found = classes.seat_of(secret_of(request))
        await classes.rename(found, body.name.strip())
        return _seat(classes.seat_of(secret_of(request)))


def _seat(found: Seat) -> dict[str, Any]:
    return {
        "id": found.copy.terrain,
        "role": "edit",
        "class": found.lesson.id,
        "title": found.lesson.title,
        "number": found.copy.number,
        "name": found.pupil.name,
    }


def asked_in(classes: Classes, found: Class) -> dict[str, Any]:
    """What somebody is told who typed the code of a class, and has yet to say a name and to choose a group."""
    names: dict[int, list[str]] = {}
    for pupil in classes.store.pupils(found.id):
        names.setdefault(pupil.number, []).append(pupil.name)
    groups = [
        {"number": copy.number, "names": names.get(copy.number, [])}
        for copy in classes.store.copies(found.id)
        if len(names.get(copy.number, ())) < found.together
    ]
    return {
        "class": found.id,
        "title": found.title,
        "together": found.together,
        "groups": groups if found.together > 1 else [],
    }
