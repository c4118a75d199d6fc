"""Links, roles, codes and the HTTP interface (SPEC P30 to P39)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.document import archive
from esker.store.access import CODE_SECONDS, Access, JoinCode
from esker.store.journal import Journal
from tests.sync.harness import LiveServer, Peer, set_op, stroke


def _link(server: LiveServer, terrain: str, owner: str, role: str, name: str = "") -> tuple[str, str]:
    status, made = server.http("POST", f"/api/terrains/{terrain}/links", {"role": role, "name": name}, owner)
    assert status == 201, made
    return made["id"], made["secret"]


def _denied(server: LiveServer, terrain: str, secret: str) -> str:
    peer = Peer(server.socket())
    peer.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client="denied")
    _, error = peer.closed()
    assert error is not None
    return str(error["code"])


def test_a_new_terrain_over_http(server: LiveServer) -> None:
    status, made = server.http("POST", "/api/terrains", {"title": "Tor", "size_m": 2048})
    assert status == 201
    assert made["role"] == "owner"
    assert made["title"] == "Tor"
    assert len(made["secret"]) >= 32
    peer = server.join(made["id"], made["secret"])
    settings = peer.welcome["document"]["settings"]
    assert (settings["size_m"], settings["reach_m"], settings["title"]) == (2048, 64, "Tor")
    peer.close()
    status, about = server.http("GET", f"/api/terrains/{made['id']}", secret=made["secret"])
    assert about == {"id": made["id"], "title": "Tor", "role": "owner", "clock": 0, "strokes": 0, "layers": 0}


def test_starting_terrains(server: LiveServer) -> None:
    status, listed = server.http("GET", "/api/templates")
    assert status == 200
    assert len(listed) == 9
    for template in listed:
        assert set(template) == {"id", "title", "description"}
        status, made = server.http("POST", "/api/terrains", {"template": template["id"]})
        assert status == 201
        status, about = server.http("GET", f"/api/terrains/{made['id']}", secret=made["secret"])
        assert about["strokes"] > 3 or about["layers"] > 1
    status, error = server.http("POST", "/api/terrains", {"template": "atlantis"})
    assert (status, error["code"]) == (404, "no_template")


def test_lessons_have_sheets_and_begin_with_their_tasks(server: LiveServer) -> None:
    """SPEC L132."""
    status, listed = server.http("GET", "/api/lessons")
    assert (status, len(listed)) == (200, 6)
    for lesson in listed:
        status, plan = server.http("GET", f"/api/lessons/{lesson['id']}")
        assert (status, plan["title"], plan["minutes"]) == (200, lesson["title"], lesson["minutes"])
        status, made = server.http("POST", "/api/terrains", {"template": lesson["id"]})
        assert status == 201
        document = server.http("GET", f"/api/terrains/{made['id']}/document", secret=made["secret"])[1]
        assert document["settings"]["task"]["text"] == plan["task"]
    status, error = server.http("GET", "/api/lessons/alchemy")
    assert (status, error["code"]) == (404, "no_lesson")


def test_an_archive_goes_out_and_comes_in(server: LiveServer) -> None:
    terrain, secret = server.create()
    peer = server.join(terrain, secret)
    peer.ops(("c1:1", stroke()))
    peer.wait("ack")
    peer.close()
    status, content, kind = server.raw("GET", f"/api/terrains/{terrain}/archive", secret=secret)
    assert (status, kind) == (200, "application/zip")
    status, made = server.http("POST", "/api/terrains/import", content)
    assert status == 201, made
    assert made["id"] != terrain
    status, about = server.http("GET", f"/api/terrains/{made['id']}", secret=made["secret"])
    assert (about["strokes"], about["clock"]) == (1, 0)
    status, error = server.http("POST", "/api/terrains/import", b"no archive")
    assert (status, error["code"]) == (400, "bad_archive")
    status, error = server.http("POST", "/api/terrains/import", content[: len(content) // 2])
    assert (status, error["code"]) == (400, "bad_archive")


def _archive(*strokes: c.Stroke) -> bytes:
    return archive.dumps(c.Document(id="t", strokes=strokes))


def test_an_archive_that_no_ops_could_have_made(server: LiveServer) -> None:
    point = c.Stroke(id="s", kind="level", first=(0, 0, 0), last=(9, 0, 0), curve=((0, 0),))
    far = point.model_copy(update={"curve": ((1e6, 0),)})
    many = [point.model_copy(update={"id": f"s{i}"}) for i in range(c.MAX_STROKES + 1)]
    for content, word in (
        (_archive(point, point), "same id"),
        (_archive(far), "farther"),
        (_archive(*many), "at most"),
    ):
        status, error = server.http("POST", "/api/terrains/import", content)
        assert (status, error["code"]) == (400, "bad_archive")
        assert word in error["message"]
    assert server.http("POST", "/api/terrains/import", _archive(*many[1:]))[0] == 201


def test_an_archive_that_eats_memory_or_time_is_stopped(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    terrain, secret = server.create()
    _, content, _ = server.raw("GET", f"/api/terrains/{terrain}/archive", secret=secret)
    monkeypatch.setattr("esker.server.upload.WALL_FACTOR", 0.001)
    status, error = server.http("POST", "/api/terrains/import", content)
    assert (status, error["code"]) == (400, "bad_archive")
    assert "too long" in error["message"]
    monkeypatch.undo()
    assert server.http("POST", "/api/terrains/import", content)[0] == 201


def test_too_large_an_archive(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("esker.server.routes.terrains.MAX_IMPORT_BYTES", 1 << 20)
    status, error = server.http("POST", "/api/terrains/import", bytes((1 << 20) + 1))
    assert (status, error["code"]) == (413, "too_large")


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"title": "x" * 81}, 400),
        ({"size_m": 1}, 400),
        ({"size_m": "4096"}, 400),
        ({"nonsense": 1}, 400),
        ({"template": "../../etc/passwd"}, 400),
        (b"{", 400),
        (b"", 400),
    ],
)
def test_bad_bodies(server: LiveServer, body: Any, status: int) -> None:
    answered, error = server.http("POST", "/api/terrains", body)
    assert (answered, error["code"]) == (status, "malformed")
    assert len(error["message"]) > 10


def test_viewers_look_and_cannot_draw(server: LiveServer) -> None:
    terrain, owner = server.create()
    _, secret = _link(server, terrain, owner, "view")
    viewer = server.join(terrain, secret, "v")
    assert viewer.welcome["role"] == "view"
    viewer.ops(("v:1", stroke()))
    assert viewer.wait("reject")["code"] == "view_only"
    editor = server.join(terrain, owner, "e")
    editor.ops(("e:1", stroke()))
    assert viewer.wait("ordered")["ops"][0]["id"] == "e:1"
    viewer.close()
    editor.close()


def test_only_owners_see_and_make_links(server: LiveServer) -> None:
    terrain, owner = server.create()
    _, edit = _link(server, terrain, owner, "edit", "Ada")
    for method, path in (("GET", "links"), ("POST", "links")):
        body = {"role": "owner"} if method == "POST" else None
        status, error = server.http(method, f"/api/terrains/{terrain}/{path}", body, edit)
        assert (status, error["code"]) == (403, "not_owner")
    status, links = server.http("GET", f"/api/terrains/{terrain}/links", secret=owner)
    assert [(x["role"], x["name"], x["revoked"]) for x in links] == [("owner", "Owner", None), ("edit", "Ada", None)]
    assert not any("secret" in x or "hash" in x for x in links)


@pytest.mark.parametrize("header", [None, "", "Basic abc", "Bearer", "Bearer " + "x" * 129])
def test_no_secret_no_answer(server: LiveServer, header: str | None) -> None:
    import urllib.error
    import urllib.request

    terrain, _ = server.create()
    request = urllib.request.Request(f"{server.base}/api/terrains/{terrain}")
    if header is not None:
        request.add_header("Authorization", header)
    with pytest.raises(urllib.error.HTTPError) as caught:
        urllib.request.urlopen(request)
    assert caught.value.code == 401
    caught.value.close()


def test_the_secret_of_another_terrain_opens_nothing(server: LiveServer) -> None:
    terrain, _ = server.create()
    _, other = server.create()
    status, error = server.http("GET", f"/api/terrains/{terrain}", secret=other)
    assert (status, error["code"]) == (403, "bad_secret")
    for name in ("nowhere", "%C3%A9", "%00", "%FF"):
        status, error = server.http("GET", f"/api/terrains/{name}", secret=other)
        assert (status, error["code"]) == (404, "no_terrain")


def test_revoking_closes_whoever_came_by_the_link(server: LiveServer) -> None:
    terrain, owner = server.create()
    link, secret = _link(server, terrain, owner, "edit")
    boss, guest = server.join(terrain, owner, "boss"), server.join(terrain, secret, "guest")
    assert server.raw("DELETE", f"/api/terrains/{terrain}/links/{link}", secret=owner)[0] == 204
    number, error = guest.closed()
    assert error is not None
    assert (number, error["code"]) == (c.WS_CLOSE["revoked"], "revoked")
    assert _denied(server, terrain, secret) == "revoked"
    boss.say("ping", t=1)
    boss.wait("pong")
    boss.close()
    status, _ = server.http("GET", f"/api/terrains/{terrain}", secret=secret)
    assert status == 403
    status, error = server.http("DELETE", f"/api/terrains/{terrain}/links/{link}", secret=owner)
    assert (status, error["code"]) == (404, "no_link")
    status, links = server.http("GET", f"/api/terrains/{terrain}/links", secret=owner)
    assert links[1]["revoked"] >= links[1]["created"]


def test_rotating_ends_the_old_secret(server: LiveServer) -> None:
    terrain, owner = server.create()
    link, secret = _link(server, terrain, owner, "edit")
    guest = server.join(terrain, secret, "guest")
    status, rotated = server.http("POST", f"/api/terrains/{terrain}/links/{link}/rotate", secret=owner)
    assert status == 200
    assert guest.closed()[0] == c.WS_CLOSE["revoked"]
    assert _denied(server, terrain, secret) == "bad_secret"
    server.join(terrain, rotated["secret"], "guest").close()


def test_an_owner_who_renews_the_own_link_may_come_back(server: LiveServer) -> None:
    terrain, owner = server.create()
    me = server.join(terrain, owner, "me")
    status, links = server.http("GET", f"/api/terrains/{terrain}/links", secret=owner)
    status, rotated = server.http("POST", f"/api/terrains/{terrain}/links/{links[0]['id']}/rotate", secret=owner)
    assert me.closed()[0] == c.WS_CLOSE["shutting_down"]
    server.join(terrain, rotated["secret"], "me").close()
    assert _denied(server, terrain, owner) == "bad_secret"
    status, error = server.http("DELETE", f"/api/terrains/{terrain}/links/{links[0]['id']}", secret=rotated["secret"])
    assert (status, error["code"]) == (409, "own_link")


def test_join_codes(server: LiveServer) -> None:
    terrain, owner = server.create()
    _, view = _link(server, terrain, owner, "view")
    _, edit = _link(server, terrain, owner, "edit")
    status, made = server.http("POST", f"/api/terrains/{terrain}/codes", {"role": "edit"}, edit)
    assert (status, made["expires_s"]) == (201, CODE_SECONDS)
    assert re.fullmatch(r"[A-Z2-9]{6}", made["code"])
    spoken = f" {made['code'][:3].lower()} {made['code'][3:]}"
    status, joined = server.http("POST", "/api/join", {"code": spoken})
    assert (status, joined["id"], joined["role"]) == (200, terrain, "edit")
    assert joined["secret"] not in (owner, edit, view)
    server.join(terrain, joined["secret"], "student").close()
    for secret, role in ((view, "view"), (edit, "owner")):
        status, error = server.http("POST", f"/api/terrains/{terrain}/codes", {"role": role}, secret)
        assert (status, error["code"]) == (403, "not_allowed")
    status, error = server.http("POST", "/api/join", {"code": "AAAAAA"})
    assert (status, error["code"]) == (404, "bad_code")


def test_codes_end_after_fifteen_minutes(tmp_path: Path) -> None:
    """SPEC P35, P129: by a clock that nobody sets."""
    ticks, date = [1000.0], [1e9]
    journal = Journal(tmp_path)
    access = Access(journal, lambda: date[0], lambda: ticks[0])
    code = access.make_code("t", "edit", "l")
    ticks[0] += CODE_SECONDS - 1
    date[0] += 3600
    assert access.open_code(code) == JoinCode("t", "edit", "l")
    date[0] -= 7200
    ticks[0] += 2
    assert access.open_code(code) is None
    journal.close()


def test_links_are_bounded(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("esker.store.access.MAX_LINKS", 2)
    terrain, owner = server.create()
    link, _ = _link(server, terrain, owner, "edit")
    status, error = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, owner)
    assert (status, error["code"]) == (409, "too_many_links")
    assert server.raw("DELETE", f"/api/terrains/{terrain}/links/{link}", secret=owner)[0] == 204
    _link(server, terrain, owner, "edit")


def test_of_revoked_links_only_the_last_are_remembered(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC A452: making and revoking links for hours filled the database and the list that owners read."""
    monkeypatch.setattr("esker.store.access.KEPT_REVOKED", 2)
    terrain, owner = server.create()
    secrets = []
    for _ in range(5):
        link, secret = _link(server, terrain, owner, "edit")
        assert server.raw("DELETE", f"/api/terrains/{terrain}/links/{link}", secret=owner)[0] == 204
        secrets.append(secret)
    listed = server.http("GET", f"/api/terrains/{terrain}/links", secret=owner)[1]
    assert len(listed) == 1 + 3, "the own one, and two that were there when the last was made"
    assert _denied(server, terrain, secrets[0]) == "bad_secret"
    assert _denied(server, terrain, secrets[-1]) == "revoked"


def test_codes_and_links_have_a_rate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC A452: thousands of live codes made everybody's codes longer."""
    monkeypatch.setattr("esker.server.app.NEW_CODES", (1e-6, 2))
    monkeypatch.setattr("esker.server.app.NEW_LINKS", (1e-6, 2))
    with LiveServer(tmp_path) as server:
        terrain, owner = server.create()
        for path in ("codes", "links"):
            body = {"role": "edit"}
            asked = [server.http("POST", f"/api/terrains/{terrain}/{path}", body, owner)[0] for _ in range(3)]
            assert asked == [201, 201, 429], path


def test_the_store_keeps_no_secret(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        _, secret = server.create()
    stored = b"".join(p.read_bytes() for p in tmp_path.rglob("*") if p.is_file())
    assert secret.encode() not in stored


def test_guessing_is_slowed_down(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is forgiven with time is forgiven more slowly here: on a busy machine a guess takes a second."""
    for name in ("CODE_TRIES", "NEW_TERRAINS"):
        monkeypatch.setattr(f"esker.server.app.{name}", (1e-3, 60))
    monkeypatch.setattr("esker.session.room.door.WRONG_SECRETS_PER_MINUTE", 3)
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        codes = [server.http("GET", f"/api/terrains/{terrain}", secret=f"wrong{i}")[1]["code"] for i in range(40)]
        assert codes[0] == "bad_secret"
        assert codes[-1] == "rate_limited"
        assert server.http("GET", f"/api/terrains/{terrain}", secret=secret)[0] == 200
        tries = [server.http("POST", "/api/join", {"code": "AAAAAA"})[0] for _ in range(80)]
        assert tries[0] == 404
        assert tries[-1] == 429
        made = [server.http("POST", "/api/terrains", {})[0] for _ in range(80)]
        assert made[0] == 201
        assert made[-1] == 429


def test_one_client_id_is_one_member(server: LiveServer) -> None:
    terrain, owner = server.create()
    _, edit = _link(server, terrain, owner, "edit")
    first = server.join(terrain, owner, "same")
    second = server.join(terrain, owner, "same")
    assert first.closed()[0] == c.WS_CLOSE["bad_hello"]
    thief = Peer(server.socket())
    thief.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=edit, client="same")
    assert thief.closed()[0] == c.WS_CLOSE["bad_hello"]
    second.ops(("same:1", stroke()), ("same:2", set_op(label="x")))
    assert second.wait("ack")["ids"] == ["same:1", "same:2"]
    second.close()


def test_security_headers_and_the_page(tmp_path: Path) -> None:
    page = tmp_path / "page"
    (page / "assets").mkdir(parents=True)
    (page / "index.html").write_text("<!doctype html><title>Esker</title>")
    (page / "assets" / "main-abc123.js").write_text("1")
    with LiveServer(tmp_path / "data", page=page) as server:
        import urllib.request

        for path in ("/", "/t/abc"):
            with urllib.request.urlopen(server.base + path) as answer:
                assert b"Esker" in answer.read()
                policy = answer.headers["Content-Security-Policy"]
                assert "script-src 'self';" in policy
                assert "unsafe-eval" not in policy
                assert answer.headers["Referrer-Policy"] == "no-referrer"
                assert answer.headers["Cache-Control"] == "no-cache"
        with urllib.request.urlopen(server.base + "/assets/main-abc123.js") as answer:
            assert "immutable" in answer.headers["Cache-Control"]
        for path in ("/assets/../../secret", "/%2e%2e/data/esker.db", "/esker.db", "/t/a/b", "/esker-ca.pem"):
            status, error = server.http("GET", path)
            assert (status, error["code"]) == (404, "not_found"), path


def test_without_a_page_it_says_how_to_build_it(server: LiveServer) -> None:
    status, error = server.http("GET", "/")
    assert (status, error["code"]) == (503, "no_page")
    assert "make run" in error["message"]


def test_healthz(server: LiveServer) -> None:
    status, health = server.http("GET", "/healthz")
    assert status == 200
    told = {"ok": True, "version": "0.1.0", "device": "arithmetic", "journal": "ok", "disk": "ok"}
    assert health.items() >= told.items()
    assert health.keys() == {*told, "waiting", "rooms"}


def test_a_link_to_look_takes_neither_what_was_deleted_nor_who_drew(server: LiveServer) -> None:
    """SPEC P297."""
    terrain, owner = server.create()
    _, view = _link(server, terrain, owner, "view")
    _, edit = _link(server, terrain, owner, "edit")
    peer = server.join(terrain, owner, "c1", name="Ada Lovelace")
    drawn = [stroke("s1"), stroke("s2")]
    for op in drawn:
        op["stroke"]["author"] = "Ada Lovelace"
    peer.ops(("c1:1", drawn[0]), ("c1:2", drawn[1]), ("c1:3", {"type": "stroke.delete", "stroke": "s1"}))
    while peer.wait("ack")["clocks"][-1] < 3:
        pass
    peer.close()
    for secret, deleted, author in ((view, 0, ""), (edit, 1, "Ada Lovelace"), (owner, 1, "Ada Lovelace")):
        _, content, _ = server.raw("GET", f"/api/terrains/{terrain}/archive", secret=secret)
        packed = archive.loads(content)
        _, told = server.http("GET", f"/api/terrains/{terrain}/document", secret=secret)
        assert (len(packed.deleted), len(told["deleted"])) == (deleted, deleted)
        assert (packed.strokes[0].author, told["strokes"][0]["author"]) == (author, author)
        _, earlier = server.http("GET", f"/api/terrains/{terrain}/document?at=2", secret=secret)
        assert {each["author"] for each in earlier["strokes"]} == {author}


def test_codes_are_longer_where_many_live(tmp_path: Path) -> None:
    """SPEC P298: a guess finds one of 10^8 at most."""
    journal = Journal(tmp_path)
    access = Access(journal)
    codes = [access.make_code("t", "edit", f"link{i}") for i in range(300)]
    assert len(codes[0]) == 6
    assert len(codes[-1]) == 8
    for live, code in enumerate(codes, 1):
        assert live * 10**8 <= 31 ** len(code)
    assert access.open_code(codes[-1].lower()) == JoinCode("t", "edit", "link299")
    journal.close()


def test_all_guessers_together_are_slowed_down(tmp_path: Path) -> None:
    """SPEC P298: however many addresses they have; what is right costs nothing."""
    import json
    import urllib.error
    import urllib.request

    def join(server: LiveServer, address: str, code: str) -> int:
        request = urllib.request.Request(f"{server.base}/api/join", json.dumps({"code": code}).encode())
        request.add_header("Content-Type", "application/json")
        request.add_header("X-Forwarded-For", address)
        try:
            with urllib.request.urlopen(request) as answer:
                return int(answer.status)
        except urllib.error.HTTPError as error:
            error.close()
            return error.code

    with LiveServer(tmp_path) as server:
        terrain, owner = server.create()
        code = server.http("POST", f"/api/terrains/{terrain}/codes", {}, owner)[1]["code"]
        assert [join(server, "192.0.2.7", code) for _ in range(20)] == [200] * 20
        tries = [join(server, f"198.51.{i // 250}.{i % 250}", "AAAAAA") for i in range(400)]
        assert tries[0] == 404
        assert 300 <= tries.count(404) < 330
        assert tries[-1] == 429
