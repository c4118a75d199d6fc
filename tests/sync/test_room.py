"""What the projector's page is told, and whom it tells nothing (SPEC L150 to L153)."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.fairness.shares import Rate, Rates
from esker.keeper.lesson import first_code, open_lesson
from esker.keeper.private import Private
from esker.store.access import CODE_LIFE_SECONDS, CODE_SECONDS, OwnCodes
from tests.sync.harness import LiveServer
from tests.sync.test_classes import Pupil, Teacher


def _ask(server: LiveServer, code: str) -> tuple[int, Any]:
    return server.http("POST", "/api/room", {"code": code})


def test_a_code_of_a_terrain_says_who_is_in_and_no_secret(server: LiveServer) -> None:
    """SPEC L150: people who own the terrain are not counted; two pages of one person are one."""
    terrain, owner = server.create(settings=c.TerrainSettings(title="Valley"))
    made = server.http("POST", f"/api/terrains/{terrain}/codes", {"role": "edit"}, owner)[1]
    status, told = _ask(server, made["code"].lower())
    assert (status, told["title"], told["here"], told["role"]) == (200, "Valley", 0, "edit")
    assert CODE_SECONDS - 60 < told["expires_s"] <= CODE_SECONDS
    teacher = server.join(terrain, owner, "room-t")
    joined = server.http("POST", "/api/join", {"code": made["code"]})[1]
    pupil = server.join(terrain, joined["secret"], "room-p", name="Anne")
    again = server.join(terrain, joined["secret"], "room-q", name="Anne", ticket=pupil.welcome["ticket"])
    told = _ask(server, made["code"])[1]
    assert told["here"] == 1
    assert set(told) == {"kind", "terrain", "role", "title", "here", "expires_s", "warned"}
    assert not any(secret in json.dumps(told) for secret in (owner, joined["secret"], "Anne"))
    again.close()
    pupil.close()
    teacher.close()


def test_a_code_of_a_class_counts_all_copies(server: LiveServer) -> None:
    """SPEC L150."""
    state: Any = server.state
    state.new_terrains, state.code_tries = Rates(), Rates()
    teacher = Teacher(server)
    peers = [Pupil(teacher, name).join(f"room{name}") for name in ("Ada", "Ben")]
    told = _ask(server, teacher.made["code"])[1]
    assert (told["kind"], told["title"], told["here"], told["terrain"]) == ("class", "Valley", 2, None)
    teacher.ask("door", {"open": False})
    assert _ask(server, teacher.made["code"])[1]["code"] == "bad_code"
    for peer in peers:
        peer.close()


def test_a_stranger_learns_nothing_and_is_slowed_down(server: LiveServer) -> None:
    """SPEC L151: wrong codes are guesses; a code that has ended with its link opens nothing here either."""
    state: Any = server.state
    terrain, owner = server.create()
    link = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, owner)[1]
    made = server.http("POST", f"/api/terrains/{terrain}/codes", {"role": "edit"}, link["secret"])[1]
    assert _ask(server, made["code"])[0] == 200
    server.http("DELETE", f"/api/terrains/{terrain}/links/{link['id']}", secret=owner)
    assert _ask(server, made["code"]) == _ask(server, "AAAAAA")
    state.code_tries, state.wrong_codes = Rates(Rate(0.01, 3)), Rates()
    answers = [_ask(server, f"BBBB{n}")[1]["code"] for n in range(5)]
    assert answers == ["bad_code"] * 3 + ["rate_limited"] * 2
    status, page = server.http("GET", f"/api/room?code={made['code']}")
    assert (status, page["code"]) == (405, "not_allowed"), "no code stands in an address"


def test_a_projector_that_asks_all_day_takes_no_guesses_from_its_class(server: LiveServer) -> None:
    """SPEC L151: one address has the whole class behind it."""
    state: Any = server.state
    terrain, owner = server.create()
    made = server.http("POST", f"/api/terrains/{terrain}/codes", {"role": "edit"}, owner)[1]
    state.code_tries = Rates(Rate(0.001, 2))
    assert [_ask(server, made["code"])[0] for _ in range(20)] == [200] * 20
    assert server.http("POST", "/api/join", {"code": made["code"]})[0] == 200
    state.room_asks = Rates(Rate(0.001, 2))
    assert [_ask(server, made["code"])[0] for _ in range(3)] == [200, 200, 429]


def test_a_start_has_a_code_for_a_day_at_school(tmp_path: Path) -> None:
    """SPEC L152: the code of ``--lan`` lives for ten hours, draws, and ends with the link that the start prints."""
    with LiveServer(tmp_path) as server:
        hub = server.assembly.hub
        content, _ = asyncio.run(open_lesson(hub, Private(tmp_path), "https://10.0.0.2:8000", False))
        code = first_code(hub, content)
        assert code is not None
        told = _ask(server, code)[1]
        assert CODE_LIFE_SECONDS - 60 < told["expires_s"] <= CODE_LIFE_SECONDS
        assert content.lesson is not None
        terrain, owner = content.lesson.terrain, content.lesson.owner
        assert (told["terrain"], told["role"]) == (terrain, "edit")
        links = server.http("GET", f"/api/terrains/{terrain}/links", secret=owner)[1]
        printed = next(each for each in links if each["role"] == "edit")
        server.http("DELETE", f"/api/terrains/{terrain}/links/{printed['id']}", secret=owner)
        assert _ask(server, code)[1]["code"] == "bad_code"


def test_prolonging_never_shortens() -> None:
    """SPEC L152."""
    now = [0.0]
    codes = OwnCodes(lambda: now[0])
    code = codes.make("t", "edit", "l", CODE_LIFE_SECONDS)
    assert codes.prolong("t", code, "l") == CODE_LIFE_SECONDS
    now[0] = CODE_LIFE_SECONDS - 60.0
    assert codes.prolong("t", code, "l") == 60.0
    short = codes.make("t", "edit", "l")
    assert codes.prolong("t", short, "l") == CODE_SECONDS


@pytest.mark.parametrize(
    ("path", "status"), [("/room", 200), ("/help/warning", 200), ("/help/devices", 200), ("/help/me", 404)]
)
def test_pages_in_words_are_there_without_a_link(tmp_path: Path, path: str, status: int) -> None:
    """SPEC L153."""
    page = tmp_path / "page"
    page.mkdir()
    (page / "index.html").write_text("<title>Esker</title>")
    with LiveServer(tmp_path / "data", page=page) as server:
        assert server.raw("GET", path)[0] == status
