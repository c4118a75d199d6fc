"""Requests and walls that know their models kill nothing and are answered (SPEC P543)."""

from __future__ import annotations

import itertools
import json
import logging
import os
import random
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from bench.strangers._hostile_requests import Requests, routes_of, wall_texts
from esker import contract as c
from esker.fairness.shares import Rates
from tests.sync.harness import LiveServer
from tests.sync.test_classes import Pupil, Teacher

MADE_BY_PROCESSES = ("/api/terrains/import", "/api/terrains/from-grid")
"""Routes that begin a process for each body, which takes as much as a hundred other requests."""
MOST_PROCESSES = 250 if os.environ.get("ESKER_LONG") else 1
"""Requests to each of these routes, by each role."""
FINE = {200, 201, 202, 204, 400, 401, 403, 404, 405, 409, 410, 411, 413, 415, 421, 422, 429, 503, 507}


def test_all_routes_with_a_body_and_their_fields_are_drawn(server: LiveServer) -> None:
    """SPEC P543: those of classes among them."""
    routes = routes_of(server._server.config.app)
    paths = {route.path for route in routes}
    for name in ("freeze", "restart", "push", "show", "open", "together", "door", "collections", "restore"):
        assert f"/api/terrains/{{terrain}}/classes/{{lesson}}/{name}" in paths
    models = {route.model.__name__: route.model for route in routes if route.model is not None}
    assert {"NewClass", "Freeze", "Together", "NewSeat", "SeatName", "ExportRequest", "NewFork"} <= models.keys()
    drawn: dict[str, set[str]] = {}
    requests = Requests(random.Random(1), [route for route in routes if route.model is not None], {})
    for _, _, body in (next(requests) for _ in range(4_000)):
        try:
            found = json.loads(body)
        except (ValueError, RecursionError):
            continue
        for name, model in models.items():
            if isinstance(found, dict):
                drawn.setdefault(name, set()).update(found.keys() & model.model_fields.keys())
    assert all(drawn[name] == model.model_fields.keys() for name, model in models.items())
    assert next(Requests(random.Random(3), routes, {})) == next(Requests(random.Random(3), routes, {}))


@pytest.mark.parametrize("role", ["owner", "pupil", "viewer", "stranger"])
def test_hostile_requests_are_answered_and_break_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, role: str
) -> None:
    """SPEC P543: by an owner of a class, a pupil in a copy, who looks, and who has no link."""
    monkeypatch.setattr("esker.server.wire.pacing._debt", lambda _: 0.0)
    with LiveServer(tmp_path) as server, caplog.at_level(logging.INFO):
        app: Any = server._server.config.app
        for name, value in vars(app.state)["_state"].items():
            if isinstance(value, Rates):
                setattr(app.state, name, Rates())
        teacher = Teacher(server)
        ada = Pupil(teacher, "Ada")
        _, look = server.http("POST", f"/api/terrains/{teacher.terrain}/links", {"role": "view"}, teacher.secret)
        terrain = ada.terrain if role == "pupil" else teacher.terrain
        secret = {"owner": teacher.secret, "pupil": ada.seat, "viewer": look["secret"], "stranger": None}[role]
        known = {"terrain": terrain, "lesson": teacher.made["id"], "code": teacher.made["code"], "seat": "s" * 40}
        requests = Requests(random.Random(len(role)), routes_of(app), known)
        left = dict.fromkeys(MADE_BY_PROCESSES, MOST_PROCESSES)
        answers = []
        for method, path, body in itertools.islice(requests, 250):
            route = path.partition("?")[0]
            if left.get(route) == 0:
                continue
            if route in left:
                left[route] -= 1
            answers.append(server.raw(method, path, body, secret))
        assert all(left[name] < MOST_PROCESSES for name in MADE_BY_PROCESSES)
        assert {status for status, _, _ in answers} <= FINE
        for status, content, kind in answers:
            if status >= 400:
                assert kind.startswith("application/json")
                assert json.loads(content)["message"]
        assert server.http("GET", "/healthz")[0] == 200
    wrong = [r.getMessage() for r in caplog.records if r.exc_info or r.levelno >= logging.ERROR]
    assert wrong == []


def test_hostile_walls_are_closed_and_break_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """SPEC P543."""
    with LiveServer(tmp_path) as server, caplog.at_level(logging.INFO):
        teacher = Teacher(server)
        Pupil(teacher, "Ada")
        rng = random.Random(7)
        hello = {"type": "wall", "protocol": c.PROTOCOL_VERSION, "terrain": teacher.terrain, "secret": teacher.secret}
        for _ in range(60):
            ws = server.socket(path="/ws/wall")
            try:
                for text in wall_texts(rng, hello | {"lesson": teacher.made["id"]}):
                    ws.send(text)
                ws.recv(timeout=5)
            except (ConnectionClosed, TimeoutError):
                pass
            finally:
                ws.close()
        assert server.http("GET", "/healthz")[0] == 200
    wrong = [r.getMessage() for r in caplog.records if r.exc_info or r.levelno >= logging.ERROR]
    assert wrong == []
