"""A teacher whose servers are killed: classes are made, taken seats in and deleted, a lesson is switched."""

from __future__ import annotations

import json
import random
import secrets
import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, Final

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from bench.strangers._fault_run import PATIENCE, post, request
from esker import contract as c
from esker.store.access import hashed
from esker.store.upkeep.inspection import DATABASE_NAME

SWITCHES: Final = ("protect", "hide")
"""The number of a switch is written with these as its digits."""


class Teacher:
    """An owner of terrain "t", and what the servers answered."""

    def __init__(self, base: str, secret: str, seed: int) -> None:
        self._base, self._secret, self._rng = base, secret, random.Random(seed)
        self.classes: dict[str, dict[str, Any]] = {}
        """Classes that were made, and whose deletion nobody asked for, by id."""
        self.seats: dict[str, tuple[str, str]] = {}
        """Class and terrain of seats that were given, by their secret."""
        self.ended: list[str] = []
        """Classes whose deletion was answered."""
        self.asked = self.notified = 0
        """Numbers of the last switch that was asked for, and of the last that was told."""
        self.count = 0

    def begin(self, work: Callable[[], None]) -> threading.Thread:
        """Does this in a thread until the server is gone."""
        thread = threading.Thread(target=self._until_gone, args=(work,), daemon=True)
        thread.start()
        return thread

    def _until_gone(self, work: Callable[[], None]) -> None:
        try:
            while True:
                work()
                self.count += 1
        except (OSError, ValueError, WebSocketException):  # the server is gone, or its answer is cut off
            return

    def teach(self) -> None:
        """Makes a class, gives some seats in it, or deletes one at once. Raises OSError once the server is gone."""
        path = f"{self._base}/api/terrains/t/classes"
        if len(self.classes) > 3:
            gone = self._rng.choice(list(self.classes))
            del self.classes[gone]
            self.seats = {seat: where for seat, where in self.seats.items() if where[0] != gone}
            request(f"{path}/{gone}?at_once=true", "DELETE", None, self._secret)
            self.ended.append(gone)
            return
        if not self.classes or self._rng.random() < 0.5:
            made = post(path, b'{"together":2}', self._secret)
            self.classes[made["id"]] = made
        lesson = self.classes[self._rng.choice(list(self.classes))]
        for _ in range(3):
            seat = secrets.token_urlsafe(24)
            body = json.dumps({"code": lesson["code"], "seat": seat, "name": "Ada"}).encode()
            got = post(f"{self._base}/api/classes/{lesson['id']}/seats", body, "")
            self.seats[seat] = (lesson["id"], got["id"])

    def switch(self) -> None:
        """Switches the lesson until the server is gone. Raises what then is raised."""
        url = f"{self._base.replace('http', 'ws')}/ws"
        protocols: Any = [c.SUBPROTOCOL]
        with connect(url, subprotocols=protocols, max_size=None, proxy=None) as ws:
            client = secrets.token_hex(8)
            hello = {"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": "t", "secret": self._secret}
            ws.send(json.dumps(hello | {"client": client}))
            while True:
                self.asked += 1
                wanted = self._state(self.asked)
                ws.send(json.dumps({"type": "conduct"} | wanted))
                while True:
                    message = ws.recv(timeout=PATIENCE)
                    said = {} if isinstance(message, bytes) else json.loads(message)
                    if said.get("type") == "lesson" and {name: said[name] for name in SWITCHES} == wanted:
                        break
                self.notified = self.asked

    def _state(self, number: int) -> dict[str, bool]:
        return {name: bool(number >> place & 1) for place, name in enumerate(SWITCHES)}

    def problems(self, data: Path, *, at_rest: bool = False) -> list[str]:
        """What is not as it was told. ``at_rest``: also what is left of what was deleted."""
        out = []
        with closing(sqlite3.connect(data / DATABASE_NAME, timeout=30)) as db:
            row = db.execute("SELECT state FROM lessons WHERE terrain='t'").fetchone()
            state = json.loads(row[0]) if row is not None else {}
            found = {name: bool(state.get(name)) for name in SWITCHES}
            if found not in (self._state(self.notified), self._state(self.asked)):
                out.append(f"the lesson stands as {found}, and was told to be as {self._state(self.notified)}")
            self.notified = self.asked if found == self._state(self.asked) else self.notified
            there = {str(found[0]) for found in db.execute("SELECT id FROM classes WHERE ended IS NULL")}
            out += [f"class {lesson} was lost" for lesson in self.classes if lesson not in there]
            sql = (
                "SELECT p.class, c.terrain FROM links l JOIN pupils p ON p.link=l.id"
                " JOIN copies c ON c.class=p.class AND c.number=p.number"
                " JOIN snapshots s ON s.terrain=c.terrain AND s.clock=0 WHERE l.hash=? AND l.terrain=c.terrain"
            )
            out += [
                f"a seat in {where} was lost"
                for seat, where in self.seats.items()
                if db.execute(sql, (hashed(seat),)).fetchone() != where
            ]
            half = "SELECT count(*) FROM copies WHERE terrain NOT IN (SELECT id FROM terrains)"
            if (left := db.execute(half).fetchone()[0]) or (
                left := db.execute("SELECT count(*) FROM pupils WHERE link NOT IN (SELECT id FROM links)").fetchone()[0]
            ):
                out.append(f"{left} copies or seats are half there")
            for lesson in self.ended if at_rest else ():
                for table, column in (("classes", "id"), ("copies", "class"), ("pupils", "class")):
                    if db.execute(f"SELECT 1 FROM {table} WHERE {column}=?", (lesson,)).fetchone() is not None:
                        out.append(f"a deleted class is left in {table}")
        return out
