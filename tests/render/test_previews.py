"""Preview pictures and who may see them (SPEC V7 to V12)."""

from __future__ import annotations

import asyncio
import functools
import io
import logging
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from PIL import Image

from esker import contract as c
from esker.api.terrain import Terrain
from esker.fairness.shares import Who
from esker.patchwork.raster import rasters
from esker.render.pictures import previews as module
from esker.render.pictures.card import tags, with_tags
from esker.render.pictures.painting import picture
from esker.render.pictures.previews import Busy, CannotDraw, Previews
from tests.sync.harness import LiveServer

ROOT = Path(__file__).resolve().parents[2]


def document(terrain: str = "t1", clock: int = 1) -> c.Document:
    return c.Document(id=terrain, clock=clock)


class Painter:
    """Counts what it is asked for."""

    def __init__(self) -> None:
        self.seen: list[tuple[str, int]] = []
        self.fail: Exception | None = None

    def __call__(self, text: str, _device: str | None) -> bytes:
        asked = c.Document.model_validate_json(text)
        self.seen.append((asked.id, asked.clock))
        if self.fail is not None:
            raise self.fail
        return f"{asked.id} {asked.clock}".encode()


class Desk:
    """Previews over a painter in a thread, with a clock set by hand."""

    def __init__(self, folder: Path) -> None:
        self.painter, self.now = Painter(), 1000.0
        self.previews = Previews(
            folder, painter=self.painter, executor=lambda: ThreadPoolExecutor(1), now=lambda: self.now
        )

    def run(self, what: Callable[[], Any]) -> Any:
        async def go() -> Any:
            try:
                return await what()
            finally:
                await self.previews.close()

        return asyncio.run(go())


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path / "previews")


def test_terrains_whose_names_begin_alike_keep_their_own_pictures(desk: Desk) -> None:
    """V10: ids may hold dashes."""

    async def go() -> None:
        longer = await desk.previews.picture(document("t1-2", 7))
        assert desk.previews.held("t1") is None
        own = await desk.previews.picture(document("t1", 3))
        desk.previews.forget("t1")
        assert longer.exists()
        assert not own.exists()

    desk.run(go)


def test_a_picture_is_drawn_once_a_clock_and_not_too_often(desk: Desk) -> None:
    """V10."""

    async def go() -> None:
        first = await desk.previews.picture(document())
        assert first.read_bytes() == b"t1 1"
        assert await desk.previews.picture(document()) == first
        assert await desk.previews.picture(document(clock=2)) == first, "too soon: the old one"
        desk.now += module.AGAIN_SECONDS
        second = await desk.previews.picture(document(clock=3))
        assert second.read_bytes() == b"t1 3"
        assert desk.previews.held("t1") == second
        assert not first.exists()

    desk.run(go)
    assert desk.painter.seen == [("t1", 1), ("t1", 3)]


def test_those_who_ask_together_get_one_picture(desk: Desk) -> None:
    """V10."""

    async def go() -> None:
        found = await asyncio.gather(*(desk.previews.picture(document()) for _ in range(5)))
        assert len(set(found)) == 1

    desk.run(go)
    assert desk.painter.seen == [("t1", 1)]


def test_sixteen_wait_and_more_are_refused(desk: Desk) -> None:
    """V10."""

    async def go() -> None:
        asked = [desk.previews.picture(document(f"t{k}")) for k in range(module.WAITING + 1)]
        found = await asyncio.gather(*asked, return_exceptions=True)
        assert sum(isinstance(f, Busy) for f in found) == 1

    desk.run(go)
    assert len(desk.painter.seen) == module.WAITING


def test_one_address_does_not_take_all_places(desk: Desk) -> None:
    """SPEC P452: whoever asked for the pictures of sixteen terrains kept all others from being drawn."""

    async def go() -> None:
        stranger, other = Who("192.0.2.7"), Who("192.0.2.8")
        asked = [desk.previews.picture(document(f"t{k}"), stranger) for k in range(module.WAITING)]
        asked.append(desk.previews.picture(document("mine"), other))
        found = await asyncio.gather(*asked, return_exceptions=True)
        assert sum(isinstance(f, Busy) for f in found) == module.WAITING - 6
        assert not isinstance(found[-1], Exception)
        await desk.previews.picture(document("again"), stranger)  # places are given back

    desk.run(go)
    assert ("mine", 1) in desk.painter.seen


def test_what_was_asked_for_longest_ago_goes(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """V10."""
    monkeypatch.setattr(module, "KEPT", 2)

    async def go() -> None:
        for k in range(3):
            path = await desk.previews.picture(document(f"t{k}"))
            os.utime(path, (1000 + k, 1000 + k))
        await desk.previews.picture(document("t3"))

    desk.run(go)
    assert [desk.previews.held(f"t{k}") is not None for k in range(4)] == [False, False, True, True]


def test_nothing_can_be_drawn_is_said_once(desk: Desk, caplog: pytest.LogCaptureFixture) -> None:
    """V11."""
    desk.painter.fail = CannotDraw("Pictures need OpenGL 4.3 by EGL, and there is none here.")

    async def go() -> None:
        for _ in range(3):
            with pytest.raises(CannotDraw):
                await desk.previews.picture(document())
        desk.previews.begin(document("t2"))

    with caplog.at_level(logging.WARNING):
        desk.run(go)
    assert [r.message for r in caplog.records] == [f"no preview pictures: {desk.painter.fail}"]
    assert not desk.previews.available
    assert len(desk.painter.seen) == 1


def die(_text: str, _device: str | None) -> bytes:
    os._exit(3)


def small(text: str, device: str | None) -> bytes:
    return picture(c.Document.model_validate_json(text), None, device, (96, 64), 1, 80)


def test_a_process_that_dies_is_followed_by_another(tmp_path: Path) -> None:
    """V12."""
    previews = Previews(tmp_path, "numpy", painter=die)

    async def go() -> bytes:
        with pytest.raises(Busy):
            await previews.picture(document())
        assert previews.available
        previews._painter = small
        path = await previews.picture(document())
        await previews.close()
        return path.read_bytes()

    with Image.open(io.BytesIO(asyncio.run(go()))) as made:
        assert made.size == (96, 64)


DRAWING = """
import os, sys, time
from esker.render.pictures.previews import DrawingProcess
if __name__ == "__main__":
    process = DrawingProcess()
    print(process.submit(os.getpid).result(), flush=True)
    if sys.argv[1] == "busy":
        process.submit(time.sleep, 600)
    time.sleep(600)
"""


@pytest.mark.parametrize("how", ["idle", "busy"])
def test_the_drawing_process_ends_with_a_server_that_is_killed(how: str, tmp_path: Path) -> None:
    """SPEC P411: it holds both ends of the pipe on which it waits for work, and would wait there for ever."""
    script = tmp_path / "server.py"
    script.write_text(DRAWING)
    command = [sys.executable, str(script), how]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=ROOT) as server:
        assert server.stdout is not None
        child = psutil.Process(int(server.stdout.readline()))
        family = psutil.Process(server.pid).children(recursive=True)
        assert child in family
        server.kill()
    assert psutil.wait_procs(family, timeout=30)[1] == []


def test_a_server_that_stops_does_not_wait_for_a_picture() -> None:
    """SPEC P411: and Ctrl-C in the terminal, which reaches the child too, says nothing there."""
    process = module.DrawingProcess()
    child = psutil.Process(process.submit(os.getpid).result())
    child.send_signal(signal.SIGINT)
    picture = process.submit(time.sleep, 600)
    process.shutdown(wait=True)
    assert not child.is_running()
    assert isinstance(picture.exception(), BrokenProcessPool)


SMALL = {"LEVEL": 1, "WIDTH": 240, "HEIGHT": 126}
"""A picture of another size takes a processor ten seconds less. The wheel's server draws one of the real size."""


def test_the_picture_has_the_size_that_cards_want(monkeypatch: pytest.MonkeyPatch) -> None:
    """V8."""
    assert (module.WIDTH, module.HEIGHT) == (1200, 630)
    for name, small in SMALL.items():
        monkeypatch.setattr(module, name, small)
    with Image.open(io.BytesIO(module.paint(document().model_dump_json(), "numpy"))) as made:
        assert (made.size, made.format) == ((module.WIDTH, module.HEIGHT), "JPEG")


def test_elevation_layers_are_in_the_picture(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """V8: their grids come from the folder of the server; a layer whose grid is missing is left out."""
    for name, small in SMALL.items():
        monkeypatch.setattr(module, name, small)
    terrain = Terrain(1024.0)
    y, x = np.mgrid[0:60, 0:60]
    terrain.add_grid(300 * np.exp(-(((x - 30) / 9) ** 2) - ((y - 30) / 9) ** 2), spacing=18.0, accuracy=1.0)
    (layer,) = terrain.layers
    rasters.write(tmp_path / "grids" / layer.content, terrain.grids[layer.content])
    text = terrain.document.model_dump_json()
    shown, bare = (module.paint(text, "numpy", tmp_path / name) for name in ("grids", "none"))
    difference = np.asarray(Image.open(io.BytesIO(shown)), dtype=int) - np.asarray(Image.open(io.BytesIO(bare)))
    assert np.mean(np.abs(difference).max(axis=-1) > 30) > 0.1


# --- over HTTP


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveServer]:
    made = functools.partial(Previews, painter=Painter(), executor=lambda: ThreadPoolExecutor(1))
    monkeypatch.setattr("esker.server.run.Previews", made)
    page = tmp_path / "page"
    page.mkdir()
    (page / "index.html").write_text("<!doctype html><html><head><title>Esker</title></head><body></body></html>")
    with LiveServer(tmp_path / "data", page=page) as running:
        yield running


def test_a_token_opens_the_picture_and_nothing_else(server: LiveServer) -> None:
    """V7."""
    terrain, secret = server.create()
    other, _ = server.create()
    assert server.http("GET", f"/api/terrains/{terrain}/preview")[0] == 401
    status, answer = server.http("GET", f"/api/terrains/{terrain}/preview", secret=secret)
    assert (status, answer["shown"], answer["available"]) == (200, True, True)
    token = answer["token"]
    assert server.http("GET", f"/api/terrains/{terrain}/preview", secret=secret)[1]["token"] == token
    assert server.raw("GET", f"/preview/{token}.jpg")[:2] == (200, f"{terrain} 0".encode())
    for guess in (terrain, other, secret, "x", token[:-1]):
        assert server.raw("GET", f"/preview/{guess}.jpg")[0] == 404
    for path in ("", "/archive", "/preview"):
        assert server.http("GET", f"/api/terrains/{terrain}{path}", secret=token)[0] in (401, 403)


def test_a_server_that_shall_not_draw_shows_none(server: LiveServer, tmp_path: Path) -> None:
    """V20."""
    with LiveServer(tmp_path / "silent", previews=False, page=server.assembly.settings.page) as silent:
        terrain, secret = silent.create()
        status, answer = silent.http("GET", f"/api/terrains/{terrain}/preview", secret=secret)
        assert (status, answer["shown"], answer["available"]) == (200, True, False)
        assert silent.raw("GET", f"/preview/{answer['token']}.jpg")[0] == 404
        page = silent.raw("GET", f"/t/{terrain}?p={answer['token']}")[1].decode()
        assert "</html>" in page
        assert "og:" not in page


def test_the_page_names_the_picture(server: LiveServer) -> None:
    """V8."""
    title = '"Ridge" <b> & co'
    terrain, secret = server.create(settings=c.TerrainSettings(title=title))
    other, _ = server.create()
    token = server.http("GET", f"/api/terrains/{terrain}/preview", secret=secret)[1]["token"]
    page = server.raw("GET", f"/t/{terrain}?p={token}")[1].decode()
    assert f'property="og:image" content="{server.base}/preview/{token}.jpg?v=0"' in page
    assert 'property="og:title" content="&quot;Ridge&quot; &lt;b&gt; &amp; co"' in page
    assert 'name="twitter:card" content="summary_large_image"' in page
    assert page.index("og:image") < page.index("</head>")
    for path in (f"/t/{terrain}", f"/t/{other}?p={token}", f"/t/{terrain}?p=x", f"/t/{terrain}?p=", "/"):
        assert "og:" not in server.raw("GET", path)[1].decode()


def test_owners_hide_and_renew(server: LiveServer) -> None:
    """V9."""
    terrain, secret = server.create()
    guest = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, secret)[1]["secret"]
    address = f"/api/terrains/{terrain}/preview"
    token = server.http("GET", address, secret=guest)[1]["token"]
    assert server.raw("GET", f"/preview/{token}.jpg")[0] == 200
    assert server.http("POST", address, {"shown": False}, guest)[0] == 403
    assert server.http("POST", address, {"shown": False}, secret)[1]["shown"] is False
    assert server.raw("GET", f"/preview/{token}.jpg")[0] == 404
    assert "og:" not in server.raw("GET", f"/t/{terrain}?p={token}")[1].decode()
    assert list((server.assembly.settings.data / "previews").glob("*.jpg")) == []
    renewed = server.http("POST", address, {"shown": True, "renew": True}, secret)[1]
    assert renewed["shown"] is True
    assert renewed["token"] != token
    assert server.raw("GET", f"/preview/{token}.jpg")[0] == 404
    assert server.raw("GET", f"/preview/{renewed['token']}.jpg")[0] == 200


def test_tags_are_escaped_and_stand_in_the_head() -> None:
    """V8."""
    made = tags("https://x/t/1", '"><script>', "https://x/p.jpg", (2, 1), "a")
    assert "<script>" not in made
    assert with_tags("<p>no head</p>", made) == "<p>no head</p>"
    assert re.search(r"og:image:width\" content=\"2\"", with_tags("<head></head>", made))
