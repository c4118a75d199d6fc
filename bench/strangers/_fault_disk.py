"""A disk that is really full under a running server: a small file system of its own where mounts are to be had."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
import urllib.error
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from bench.room import _serving
from bench.strangers._fault_checks import Checks, final
from bench.strangers._fault_people import Person, come_back_soon
from bench.strangers._fault_run import Life, Lives, grid_file, request
from esker import contract as c
from esker.document.birth import new_document
from esker.store.access import Access
from esker.store.journal import Journal

DISK_MB: Final = 64
NO_FLOOR: Final = -(1 << 40)
"""Bytes that stay free, so that the server asks for none and SQLite itself meets the end of the disk."""
LARGE_OPS: Final = 600
CURVE: Final = tuple((k / 900, float(k % 90)) for k in range(900))


@contextmanager
def small_disk() -> Iterator[Path | None]:
    """A folder on a file system of ``DISK_MB``; None where nobody may mount one."""
    with tempfile.TemporaryDirectory(prefix="esker-disk-") as folder:
        command = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m", "esker", folder]
        try:
            mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
        except OSError:
            mounted = False
        try:
            yield Path(folder) if mounted else None
        finally:
            if mounted:
                subprocess.run(["umount", folder], check=False)


def filled() -> dict[str, Any]:
    """With the part of the disk that a server leaves free, and without it, so that SQLite itself meets the end."""
    with small_disk() as disk:
        if disk is None:
            return {"skipped": "nobody may mount a small file system here"}
    come_back_soon()
    return {"with a floor": _filled(None), "without": _filled(NO_FLOOR)}


def _filled(floor: int | None) -> dict[str, Any]:
    with tempfile.TemporaryDirectory(prefix="esker-faults-") as work, small_disk() as disk:
        assert disk is not None
        log = Path(work) / "server.log"
        scene = _Scene(disk, Lives(log), floor)
        try:
            found = scene.play()
        finally:
            scene.close()
        text = log.read_text(encoding="utf-8", errors="replace") if log.exists() else ""
        return found | {"tracebacks": text.count("Traceback")}


class _Scene:
    """One server on the small disk and one person."""

    def __init__(self, disk: Path, lives: Lives, floor: int | None) -> None:
        self.data, self.ballast, self.lives, self.floor = disk / "data", disk / "ballast", lives, floor
        self.port = _serving.free_port()
        self.base = f"http://127.0.0.1:{self.port}"
        journal = Journal(self.data)
        journal.create(new_document().model_copy(update={"id": "t"})).result()
        self.secret = Access(journal).add("t", "owner", "o").result()[1]
        journal.close()
        self.person: Person | None = None

    def close(self) -> None:
        """Ends what it began."""
        if self.person is not None:
            self.person.live.close()
        self.lives.close()

    def play(self) -> dict[str, Any]:
        """The disk is filled, the server killed and started on it, and room is made again."""
        life = self._start()
        person = self.person = Person(f"{self.base}/t/t#{self.secret}", "p", 1)
        time.sleep(1.0)
        person.rest()
        person.settle()
        before = person.refused[:]
        self._fill()
        time.sleep(1.5)
        self._draw_much(person)
        full: dict[str, Any] = {"refused_with": sorted(set(person.refused[len(before) :])), "answers": self._answers()}
        life.end()
        life = self._start()
        full["starts_on_it"] = life.said[-1] == "ready"
        full["said"] = life.said[-1]
        self.ballast.unlink()
        time.sleep(1.5)
        if not full["starts_on_it"]:
            life = self._start()
        person.refused.clear()
        began = time.monotonic()
        for k in range(20):
            person.live.apply(c.SetTerrain(fields=c.TerrainFields(title=f"after {k}")))
        document = person.settle()
        full["refused_after"] = len(person.refused)
        full["saved_again"] = time.monotonic() - began < 30.0
        checks = Checks(self.data)
        checks.look([person.acked])
        life.end(signal.SIGTERM)
        found = final(self.data, "t", ())
        full["acknowledged"], full["lost"] = len(person.acked), len(checks.lost)
        full["same"] = document == found["document"]
        full["problems"] = found["problems"]
        return full

    def _start(self) -> Life:
        life = self.lives.begin("serve", self.data, self.port, self.floor)
        life.until("ready")
        return life

    def _fill(self) -> None:
        with self.ballast.open("wb", buffering=0) as file, suppress(OSError):
            for size in (1 << 20, 1 << 12, 1):
                with suppress(OSError):
                    while True:
                        file.write(bytes(size))
        assert os.statvfs(self.ballast).f_bavail == 0, "the disk is full"

    def _draw_much(self, person: Person) -> None:
        """More than the write-ahead log holds, unless it is refused."""
        ends: dict[str, Any] = {"first": (100.0, 200.0, 0.0), "last": (300.0, 200.0, 0.0)}
        with suppress(Exception):
            person.live.apply(c.BeginStroke(stroke=c.Stroke(id="large", kind="profile", curve=(), **ends)))
        person.settle()
        for k in range(LARGE_OPS):
            if person.refused:
                return
            curve = (*CURVE, (1.0, float(k)))
            with suppress(Exception):
                person.live.apply(c.SetStroke(stroke="large", fields=c.StrokeFields(curve=curve)))
            person.settle()

    def _answers(self) -> dict[str, str]:
        """What the server says to what would take room."""
        asked = {
            "a new terrain": ("POST", "/api/terrains", b"{}"),
            "an import": ("POST", "/api/terrains/t/imports?name=a.asc&client=z", grid_file(1)),
            "an archive": ("GET", "/api/terrains/t/archive", None),
            "the document": ("GET", "/api/terrains/t/document", None),
        }
        out = {}
        for name, (method, path, body) in asked.items():
            try:
                request(self.base + path, method, body, self.secret)
                out[name] = "200"
            except urllib.error.HTTPError as error:
                out[name] = f"{error.code} {error.read(300).decode('utf-8', 'replace')}"
            except (OSError, ValueError) as error:
                out[name] = f"{type(error).__name__}: {error}"
        return out
