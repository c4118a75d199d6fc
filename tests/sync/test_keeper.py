"""The machine's owner: the last lesson, private links, the list (SPEC P342, P343, P344, P345, P346, P347)."""

from __future__ import annotations

import asyncio
import secrets
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from esker.cli import main
from esker.contract import TerrainSettings
from esker.keeper.lesson import greeting, open_lesson
from esker.keeper.private import Content, Lesson, Private
from esker.session.births import fresh_id
from esker.session.room.hub import Hub
from esker.store import kept
from esker.store.access import CODE_LIFE_SECONDS, CODE_SECONDS, Access
from tests.sync.harness import LiveServer


def _open(hub: Hub, data: Path, new: bool = False) -> Content:
    return asyncio.run(open_lesson(hub, Private(data), "https://10.0.0.2:8000", new))[0]


def _role(server: LiveServer, terrain: str, secret: str) -> Any:
    status, about = server.http("GET", f"/api/terrains/{terrain}", secret=secret)
    return about["role"] if status == 200 else about["code"]


def _roles(server: LiveServer, lesson: Lesson) -> tuple[Any, Any]:
    return _role(server, lesson.terrain, lesson.owner), _role(server, lesson.terrain, lesson.edit)


def test_a_start_opens_the_terrain_of_the_last_lesson_again(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        first = _open(server.assembly.hub, tmp_path).lesson
        assert first is not None
        assert (_role(server, first.terrain, first.owner), _role(server, first.terrain, first.edit)) == (
            "owner",
            "edit",
        )
    with LiveServer(tmp_path) as server:
        hub = server.assembly.hub
        assert _open(hub, tmp_path).lesson == first, "links too"
        links = server.http("GET", f"/api/terrains/{first.terrain}/links", secret=first.owner)[1]
        for link in reversed(links):
            if not link["own"]:
                server.http("DELETE", f"/api/terrains/{first.terrain}/links/{link['id']}", secret=first.owner)
            else:
                server.http("POST", f"/api/terrains/{first.terrain}/links/{link['id']}/rotate", secret=first.owner)
        again = _open(hub, tmp_path).lesson
        assert again is not None
        assert again.terrain == first.terrain
        assert again.owner != first.owner, "what no longer opens is made anew"
        assert again.edit != first.edit
        assert _roles(server, again) == ("owner", "edit")
        other = _open(hub, tmp_path, new=True).lesson
        assert other is not None
        assert other.terrain != first.terrain
        assert _open(hub, tmp_path).lesson == other


def test_the_private_file_is_readable_by_its_owner_alone(tmp_path: Path) -> None:
    private = Private(tmp_path)
    private.path.write_text("{damaged")
    private.path.chmod(0o644)
    content = private.open()
    assert private.path.stat().st_mode & 0o077 == 0
    assert len(content.key) >= 32
    assert private.open() == content
    private.write(content.model_copy(update={"base": "http://x"}))
    assert private.path.stat().st_mode & 0o077 == 0
    assert [path.name for path in tmp_path.iterdir()] == ["private.json"]


@pytest.mark.parametrize("lan", [None, "https://10.0.0.2:8000/esker-ca.pem"])
def test_what_a_start_prints(tmp_path: Path, lan: str | None) -> None:
    with LiveServer(tmp_path) as server:
        content, found = asyncio.run(
            open_lesson(server.assembly.hub, Private(tmp_path), "https://10.0.0.2:8000", False)
        )
    lesson = content.lesson
    assert lesson is not None
    shown = greeting(content, found, tmp_path, private=True, lan=lan)
    own = shown.index(lesson.owner)
    assert shown[:own].splitlines()[-2].strip().startswith("PRIVATE"), "the owner's link stands apart"
    assert shown.index("For everybody (can draw)") > own, "what is shown last is what the projector may show"
    assert ("█" in shown) == (lan is not None)
    if lan:
        import segno

        assert lan in shown
        code = segno.make(f"https://10.0.0.2:8000/t/{lesson.terrain}#{lesson.edit}", error="l")
        rows = [line for line in shown.splitlines() if "█" in line or "▀" in line or "▄" in line]
        assert len(rows) == (code.symbol_size(border=4)[1] + 1) // 2, "the QR code is that of the link to draw"
    quiet = greeting(content, found, tmp_path, private=False, lan=lan)
    for secret in (lesson.owner, lesson.edit, content.key):
        assert secret not in quiet, "a log holds no secret"
    assert "esker link" in quiet
    assert "█" not in quiet


def test_no_terrain_s_id_looks_like_an_option(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P344: of sixty-four terrains one could not be named to `esker link`."""
    drawn = iter(["-fpPkLzwr82f", "--PkLzwr82f", "fpPkLzwr82f-"])
    monkeypatch.setattr(secrets, "token_urlsafe", lambda _: next(drawn))
    assert fresh_id() == "fpPkLzwr82f-"


def test_list_and_link_beside_a_running_server(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with LiveServer(tmp_path) as server:
        lesson = _open(server.assembly.hub, tmp_path).lesson
        assert lesson is not None
        terrain, secret = server.create(settings=TerrainSettings(title="Tor"))
        peer = server.join(terrain, secret)
        peer.ops(("c1:1", {"type": "terrain.set", "fields": {"title": "The second name"}}))
        peer.wait("ack")
        peer.close()
        assert main.main(["list", "--data", str(tmp_path)]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0].startswith(terrain)
        assert "The second name" in lines[0]
        assert "1 change " in lines[0]
        assert lines[1].startswith(lesson.terrain)
        assert "printed at the start" in lines[1]
        assert main.main(["link", "--data", str(tmp_path)]) == 0
        out = capsys.readouterr().out
        assert f"/t/{lesson.terrain}#{lesson.owner}" in out
        assert "PRIVATE" in out
        assert main.main(["link", terrain, "--role", "view", "--data", str(tmp_path)]) == 0
        made = capsys.readouterr().out.strip()
        assert _role(server, terrain, made.split("#")[1]) == "view", "it works at once"
    assert main.main(["link", "nowhere", "--data", str(tmp_path)]) == 1
    assert "nowhere" in capsys.readouterr().err
    with closing(sqlite3.connect(tmp_path / "esker.db")) as db:
        db.execute("PRAGMA user_version=1")
    assert main.main(["list", "--data", str(tmp_path)]) == 1
    assert "start the server once" in capsys.readouterr().err
    assert main.main(["list", "--data", str(tmp_path / "none")]) == 1
    assert "no server has kept anything there" in capsys.readouterr().err


def test_only_the_key_lists_what_a_server_keeps(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    key = server.assembly.private.open().key
    server.create()
    terrain, owner = server.create(settings=TerrainSettings(title="Mine"))
    assert server.http("GET", "/api/server/terrains", secret=owner)[0] == 403, "no terrain's owner"
    assert server.http("GET", "/api/server/terrains")[0] == 403
    assert server.http("GET", "/api/server/terrains?skip=-1", secret=key)[0] == 400
    peer = server.join(terrain, owner)
    status, listed = server.http("GET", "/api/server/terrains", secret=key)
    assert status == 200
    mine = next(each for each in listed["terrains"] if each["id"] == terrain)
    assert (mine["title"], mine["here"], mine["links"], mine["clock"]) == ("Mine", 1, 1, 0)
    assert not any("secret" in field or "hash" in field for field in mine)
    peer.close()
    status, made = server.http("POST", f"/api/server/terrains/{terrain}/links", {"role": "owner"}, key)
    assert (status, _role(server, terrain, made["secret"])) == (201, "owner")
    assert server.http("POST", f"/api/server/terrains/{terrain}/links", {"role": "owner"}, owner)[0] == 403
    assert server.http("POST", "/api/server/terrains/none/links", {}, key)[0] == 404
    monkeypatch.setattr("esker.server.routes.keeper.MOST", 1)
    pages = [server.http("GET", f"/api/server/terrains?skip={skip}", secret=key)[1] for skip in range(2)]
    assert all(len(page["terrains"]) == 1 for page in pages)
    assert pages[0]["terrains"] != pages[1]["terrains"]
    for _ in range(40):
        status, error = server.http("GET", "/api/server/terrains", secret="x" * 32)
    assert (status, error["code"]) == (429, "rate_limited"), "keys are not guessed"


def test_a_title_in_a_group_counts_too() -> None:
    set_title = {"type": "terrain.set", "fields": {"title": "new"}}
    assert kept._title_of({"type": "group", "ops": [{"type": "stroke.delete", "stroke": "s"}, set_title]}) == "new"
    assert kept._title_of({"type": "terrain.set", "fields": {"sea_level_m": 3.0}}) is None


def test_replacing_an_owner_link_tells_the_other_owners(server: LiveServer) -> None:
    terrain, first = server.create()
    _, made = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "owner", "name": "Deputy"}, first)
    teacher, pupil = server.join(terrain, first, "teacher", name="Ada"), server.join(terrain, made["secret"], "deputy")
    links = server.http("GET", f"/api/terrains/{terrain}/links", secret=first)[1]
    own = next(link["id"] for link in links if link["own"])
    chosen = "k" * 16 + "A" * 16
    path = f"/api/terrains/{terrain}/links/{own}/rotate"
    status, answer = server.http("POST", path, {"secret": chosen, "client": "teacher"}, first)
    assert (status, answer["secret"]) == (200, chosen), "the page has the new secret even if this answer is lost"
    assert _role(server, terrain, chosen) == "owner"
    told = pupil.wait("error")
    assert not told["fatal"]
    assert "Ada replaced the owner link" in told["message"]
    _, closing = teacher.closed()
    assert closing is not None
    assert "replaced by Ada" in closing["message"]
    assert server.http("POST", path, {"secret": "short"}, chosen)[1]["code"] == "malformed"
    assert server.http("POST", path, {"secret": made["secret"]}, chosen)[1]["code"] == "secret_taken"
    pupil.close()


def test_codes_are_prolonged_by_who_made_them(server: LiveServer) -> None:
    terrain, owner = server.create()
    _, other = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, owner)
    code = server.http("POST", f"/api/terrains/{terrain}/codes", {"role": "edit"}, owner)[1]["code"]
    path = f"/api/terrains/{terrain}/codes/prolong"
    status, longer = server.http("POST", path, {"code": code.lower()}, owner)
    assert (status, round(longer["expires_s"])) == (200, CODE_SECONDS)
    assert server.http("POST", path, {"code": code}, other["secret"])[0] == 404
    assert server.http("POST", path, {"code": "AAAAAA"}, owner)[0] == 404


def test_a_code_lives_no_longer_than_a_day_at_school(server: LiveServer) -> None:
    now = 0.0
    access = Access(server.assembly.hub.journal, ticks=lambda: now)
    code = access.make_code("t", "edit", "link")
    while (left := access.prolong_code("t", code, "link")) is not None:
        assert left <= CODE_SECONDS
        assert access.open_code(code) is not None
        now += left - 1 if left > 1 else left
    assert CODE_LIFE_SECONDS - 2 <= now <= CODE_LIFE_SECONDS
    assert access.open_code(code) is None
