"""Who really asks, and whether a page of another site may (SPEC P294 to P296)."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.server.serving import front_of
from esker.server.settings import Settings
from esker.server.starting import CannotServe
from esker.server.wire.front import Front, Proxies, hosts
from tests.sync.harness import LiveServer, Peer


@pytest.mark.parametrize(
    ("trusted", "peer", "fields", "client"),
    [
        ("10.0.0.1", "10.0.0.1", ["1.1.1.1, 2.2.2.2"], "2.2.2.2"),
        ("10.0.0.1", "10.0.0.1", ["1.1.1.1", "2.2.2.2"], "2.2.2.2"),
        ("10.0.0.0/8", "10.0.0.1", ["1.1.1.1, 2.2.2.2, 10.9.9.9"], "2.2.2.2"),
        ("10.0.0.0/8", "10.0.0.1", ["10.7.7.7, 10.9.9.9"], "10.7.7.7"),
        ("10.0.0.1", "9.9.9.9", ["1.1.1.1"], "9.9.9.9"),
        ("*", "10.0.0.1", ["1.1.1.1, 2.2.2.2"], "2.2.2.2"),
        ("", "10.0.0.1", ["1.1.1.1"], "10.0.0.1"),
        ("10.0.0.1", "10.0.0.1", [], "10.0.0.1"),
        ("10.0.0.1", "10.0.0.1", ["1.1.1.1, me"], "10.0.0.1"),
        ("10.0.0.1", "10.0.0.1", ["2.2.2.2:443"], "2.2.2.2"),
        ("10.0.0.1", "10.0.0.1", ["[2001:db8::7]:443"], "2001:db8::7"),
        ("2001:db8::/32", "2001:db8::1", ["2001:db9::7"], "2001:db9::7"),
    ],
)
def test_the_last_entry_that_is_no_proxy_counts(trusted: str, peer: str, fields: list[str], client: str) -> None:
    """SPEC P294: whatever stands before it was written by who asks."""
    assert Proxies(trusted).client(peer, fields) == client


def test_a_proxy_that_is_no_address_is_refused_at_the_start() -> None:
    """SPEC P294."""
    with pytest.raises(CannotServe, match="ESKER_FORWARDED_ALLOW_IPS"):
        front_of(Settings(forwarded_allow_ips="caddy"), "127.0.0.1")


def _against(front: Front, **fields: str) -> str:
    found = front.against({"headers": [(k.replace("_", "-").encode(), v.encode()) for k, v in fields.items()]})
    return "" if found is None else found[1]


NEAR = Front(hosts=hosts({"pi.local"}, "https://terrain.example.org"), origin="https://terrain.example.org")


@pytest.mark.parametrize(
    ("fields", "code"),
    [
        ({"host": "127.0.0.1:8000"}, ""),
        ({"host": "localhost:8000"}, ""),
        ({"host": "[::1]:8000"}, ""),
        ({"host": "PI.local"}, ""),
        ({"host": "terrain.example.org"}, ""),
        ({"host": "evil.example.org:8000"}, "bad_host"),
        ({"host": "127.0.0.1.evil.example"}, "bad_host"),
        ({}, "bad_host"),
        ({"host": "localhost:8000", "origin": "http://localhost:8000"}, ""),
        ({"host": "localhost:8000", "origin": "http://localhost:9000"}, "bad_origin"),
        ({"host": "localhost:8000", "origin": "null"}, "bad_origin"),
        ({"host": "127.0.0.1:8000", "origin": "https://terrain.example.org"}, ""),
        ({"host": "localhost", "sec_fetch_site": "same-origin"}, ""),
        ({"host": "localhost", "sec_fetch_site": "none"}, ""),
        ({"host": "localhost", "sec_fetch_site": "same-site"}, "bad_origin"),
        ({"host": "localhost", "sec_fetch_site": "cross-site"}, "bad_origin"),
    ],
)
def test_what_a_page_of_another_site_may_not(fields: dict[str, str], code: str) -> None:
    """SPEC P295."""
    assert _against(NEAR, **fields) == code


def test_a_server_that_nobody_named_goes_by_any_name() -> None:
    """SPEC P295: but not for pages of other sites."""
    front = front_of(Settings(host="0.0.0.0"), "127.0.0.1")
    assert _against(front, host="anything.example") == ""
    assert _against(front, host="anything.example", origin="https://evil.example") == "bad_origin"
    assert _against(front_of(Settings(), "127.0.0.1"), host="anything.example") == "bad_host"
    assert _against(front_of(Settings(hosts="anything.example"), "127.0.0.1"), host="anything.example") == ""


def _ask(server: LiveServer, method: str, path: str, **fields: str) -> tuple[int, Any, Any]:
    body = b"{}" if method == "POST" else None
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}{path}", data=body, method=method)
    request.add_header("Content-Type", "application/json")
    for name, value in fields.items():
        request.add_header(name.replace("_", "-"), value)
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.status, json.loads(answer.read()), answer.headers
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read()), error.headers


def test_every_change_asks_and_reading_does_not(tmp_path: Path) -> None:
    """SPEC P295: over HTTP and on the socket."""
    with LiveServer(tmp_path) as server:
        for fields in ({"Host": "evil.example"}, {"Origin": "https://evil.example"}, {"Sec_Fetch_Site": "cross-site"}):
            for method, path in (
                ("POST", "/api/terrains"),
                ("POST", "/api/join"),
                ("DELETE", "/api/terrains/x/links/y"),
            ):
                status, error, headers = _ask(server, method, path, **fields)
                assert (status, error["code"]) in ((403, "bad_origin"), (421, "bad_host"))
                assert headers["X-Content-Type-Options"] == "nosniff"
            assert _ask(server, "GET", "/healthz", **fields)[0] == 200
            wire = {name.replace("_", "-"): value for name, value in fields.items()}
            if "Host" not in wire:
                peer = Peer(server.socket(additional_headers=wire))
                assert peer.closed()[0] == c.WS_CLOSE["bad_origin"]
        assert _ask(server, "POST", "/api/terrains", Origin=f"http://127.0.0.1:{server.port}")[0] == 201
        assert _ask(server, "POST", "/api/terrains", Sec_Fetch_Site="same-origin")[0] == 201


def test_rates_follow_who_really_asks(tmp_path: Path) -> None:
    """SPEC P294: inventing addresses before the proxy's own entry helps nobody."""
    with LiveServer(tmp_path) as server:
        codes = [
            _ask(server, "POST", "/api/terrains", X_Forwarded_For=f"198.51.100.{i}, 192.0.2.66")[0] for i in range(70)
        ]
        assert codes[0] == 201
        assert codes[-1] == 429
        assert _ask(server, "POST", "/api/terrains", X_Forwarded_For="192.0.2.7")[0] == 201


def test_https_only_where_its_certificate_is_trusted_by_itself(tmp_path: Path) -> None:
    """SPEC P296: behind a proxy with a name; never with the certificate of --lan, which it would make the only way."""
    with LiveServer(tmp_path / "a", public_url="https://terrain.example.org") as server:
        told = _ask(server, "GET", "/healthz", X_Forwarded_Proto="https")[2]
        assert told["Strict-Transport-Security"] == "max-age=31536000"
        assert _ask(server, "GET", "/healthz")[2]["Strict-Transport-Security"] is None
    with LiveServer(tmp_path / "b") as server:
        assert _ask(server, "GET", "/healthz", X_Forwarded_Proto="https")[2]["Strict-Transport-Security"] is None
    assert not front_of(Settings(lan=True, public_url="https://192.168.1.2:8000"), "192.168.1.2").strict
