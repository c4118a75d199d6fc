"""Addresses that are typed: the page for people, JSON for programs (SPEC P349)."""

from __future__ import annotations

import http.client
from pathlib import Path

import pytest

from tests.sync.harness import LiveServer

PERSON = "text/html,application/xhtml+xml,*/*;q=0.8"


@pytest.mark.parametrize(
    ("path", "accept", "status", "kind"),
    [
        ("/nope", PERSON, 404, "text/html"),
        ("/deep/er/nope", PERSON, 404, "text/html"),
        ("/server", PERSON, 200, "text/html"),
        ("/nope", "*/*", 404, "application/json"),
        ("/api/nope", PERSON, 404, "application/json"),
        ("/assets/nope.js", PERSON, 404, "application/json"),
        ("/licences.txt", PERSON, 200, "text/plain"),
    ],
)
def test_an_address_that_is_nothing_is_a_page(tmp_path: Path, path: str, accept: str, status: int, kind: str) -> None:
    page = tmp_path / "page"
    page.mkdir()
    (page / "index.html").write_text("<title>Esker</title>")
    (page / "licences.txt").write_text("Apache")
    with LiveServer(tmp_path / "data", page=page) as server:
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
        connection.request("GET", path, headers={"Accept": accept})
        answer = connection.getresponse()
        body = answer.read()
        connection.close()
    assert (answer.status, answer.headers.get_content_type()) == (status, kind)
    assert answer.headers["cache-control"] == "no-cache"
    if kind == "text/html":
        assert body == b"<title>Esker</title>"
