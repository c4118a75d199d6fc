"""Exports and pictures in a store of objects: what one server made, another gives out (SPEC P636, P637)."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bench.cluster._objects import ObjectServer
from esker.document.birth import new_document
from esker.jobs.exports import Exports
from esker.render.pictures.previews import Previews
from esker.store.engine import made as made_module
from esker.store.engine.made import EXPORTS, Made
from esker.store.engine.objects import Objects
from tests.store.engines import Database
from tests.sync.harness import LiveServer
from tests.sync.scripted_maker import CONTENT, WANTED, Maker


@pytest.fixture(scope="module")
def server() -> Iterator[ObjectServer]:
    made = ObjectServer()
    with made.environment():
        yield made
    made.close()


def until(holds: Any) -> Any:
    """Waits until something is true, and returns it."""
    end = time.monotonic() + 30
    while not (found := holds()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return found


def exports_of(live: LiveServer) -> Exports:
    """What a server exports."""
    found = live.assembly.exports
    assert found is not None
    return found


def exported(live: LiveServer, terrain: str, secret: str) -> str:
    """The path of an export that is done, and that others have."""
    job = live.http("POST", f"/api/terrains/{terrain}/exports", WANTED, secret)[1]["id"]
    path = f"/api/terrains/{terrain}/exports/{job}"
    until(lambda: live.http("GET", path, secret=secret)[1]["stage"] == "done")
    until(lambda: exports_of(live)._jobs[job].is_shared)
    return path


def test_an_export_is_found_on_another_server(
    database: Database, server: ObjectServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P636: also when the one that made it is gone; for as long as it was kept, and as the link lives."""
    monkeypatch.setattr("esker.server.run.exporting", SimpleNamespace(make=Maker().make))
    url, blobs = database.new(), f"{server.url}/{tmp_path.name}"
    with LiveServer(tmp_path / "a", database=url, blobs=blobs) as one:
        terrain, owner = one.create()
        link = one.http("POST", f"/api/terrains/{terrain}/links", {"role": "view"}, owner)[1]
        stays, late, revoked = (exported(one, terrain, secret) for secret in (owner, owner, link["secret"]))
        assert not exports_of(one).has(terrain), "the terrain may move: nothing is lost with this server"
    with LiveServer(tmp_path / "b", database=url, blobs=blobs) as other:
        status, found = other.http("GET", stays, secret=owner)
        assert (status, found["stage"], found["file"]) == (200, "done", "a.npy")
        for _ in range(2):
            assert other.raw("GET", f"{stays}/file", secret=owner) == (200, CONTENT, "application/octet-stream")
        assert other.http("GET", f"{stays}x", secret=owner)[0] == 404
        assert other.http("GET", revoked, secret=link["secret"])[0] == 200
        exports_of(other)._jobs.clear()
        other.http("DELETE", f"/api/terrains/{terrain}/links/{link['id']}", secret=owner)
        assert other.http("GET", revoked, secret=owner)[0] == 404, "it was made for a link that has ended"
        date = exports_of(other)._kept._date
        exports_of(other)._kept._date = lambda: date() + 700.0
        assert other.http("GET", late, secret=owner)[0] == 404
        exports_of(other)._kept._date = date
        assert other.http("DELETE", late, secret=owner)[0] == 204
        objects = Objects(blobs)
        until(lambda: {name.split("/")[2] for name, _ in objects.ages(EXPORTS)} == {stays.rsplit("/", 1)[1]})


def test_a_picture_is_drawn_once_for_all(server: ObjectServer, tmp_path: Path) -> None:
    """SPEC P637: other servers take it from the store, of the same clock only; one that is hidden is gone for all."""
    made = Made(Objects(f"{server.url}/{tmp_path.name}"))
    drawn: list[str] = []

    def painter(_document: str, _device: str | None) -> bytes:
        drawn.append("x")
        return b"jpeg"

    def server_of(name: str) -> Previews:
        return Previews(tmp_path / name, made=made, painter=painter, executor=lambda: ThreadPoolExecutor(1))

    async def all_of_it() -> None:
        one, other = server_of("a"), server_of("b")
        document = new_document()
        await one.picture(document)
        assert (await other.picture(document)).read_bytes() == b"jpeg"
        assert len(drawn) == 1
        await other.picture(document.model_copy(update={"clock": document.clock + 1}))
        assert len(drawn) == 2
        other.forget(document.id)
        await asyncio.sleep(0.5)
        third = server_of("c")
        await third.picture(document)
        assert len(drawn) == 3
        for each in (one, other, third):
            await each.close()

    asyncio.run(all_of_it())


def test_a_store_that_is_gone_refuses_nothing(server: ObjectServer, tmp_path: Path) -> None:
    """SPEC P637: it is asked once in half a minute; what was made is given out where it was made."""
    now = 0.0
    made = Made(Objects(f"{server.url}/{tmp_path.name}", 0.1), lambda: now)
    path = tmp_path / "file"
    path.write_bytes(b"x")
    server.stop()
    try:
        assert not made.give("exports/t/1/file", path)
        began = time.monotonic()
        assert not made.give("exports/t/1/file", path)
        assert time.monotonic() - began < 0.1
    finally:
        server.start()
    assert not made.fetch("exports/t/1/file", tmp_path / "other"), "it is not asked yet"
    now = made_module.AWAY_SECONDS + 1.0
    assert made.give("exports/t/1/file", path)
    assert made.fetch("exports/t/1/file", tmp_path / "other")
    assert not (tmp_path / "other.part").exists()


def test_a_server_without_a_store_keeps_what_it_made() -> None:
    """SPEC P636: nothing is given, nothing is found."""
    made = Made()
    assert not made.is_shared
    assert not made.say("exports/t/1/status", "x")
    assert made.said("exports/t/1/status") is None
    made.throw_old()
