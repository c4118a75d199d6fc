"""Server processes for a benchmark: one over SQLite, or nodes over one PostgreSQL."""

from __future__ import annotations

import os
import secrets
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from bench.room._serving import free_port

START_SECONDS = 180.0


class Server:
    """One server process; ``name`` empty: a server that is alone over SQLite."""

    def __init__(self, folder: Path, name: str = "", database: str = "", key: str = "") -> None:
        self.name, self.folder, self.port = name, folder / (name or "alone"), free_port()
        self.base = f"http://127.0.0.1:{self.port}"
        self.socket = f"ws://127.0.0.1:{self.port}/ws"
        self._more = ["--node", name, "--advertise", self.base] if name else []
        self._environment = {"ESKER_DATABASE": database, "ESKER_CLUSTER_KEY": key} if name else {}
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Starts the process."""
        command = [sys.executable, "-m", "esker", "serve", "--port", str(self.port), "--data", str(self.folder)]
        with (self.folder.parent / f"{self.folder.name}.log").open("ab") as log:
            self.process = subprocess.Popen(
                [*command, "--log-level", "warning", *self._more],
                env={**os.environ, **self._environment},
                stdout=subprocess.DEVNULL,
                stderr=log,
            )

    def ready(self) -> None:
        """Waits until it takes people. Raises RuntimeError."""
        assert self.process is not None
        end = time.monotonic() + START_SECONDS
        while time.monotonic() < end and self.process.poll() is None:
            with suppress(OSError, urllib.error.URLError), urllib.request.urlopen(f"{self.base}/readyz", timeout=2):
                return
            time.sleep(0.1)
        raise RuntimeError((self.folder.parent / f"{self.folder.name}.log").read_text()[-2000:])

    def cpu(self) -> float:
        """Seconds of processor time that it has had."""
        assert self.process is not None
        times = psutil.Process(self.process.pid).cpu_times()
        return float(times.user + times.system)

    def end(self, number: int = signal.SIGTERM) -> None:
        """Ends the process."""
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(number)

    def gone(self) -> None:
        """Waits until it has ended."""
        if self.process is not None:
            try:
                self.process.wait(30)
            except subprocess.TimeoutExpired:
                self.process.kill()


@contextmanager
def alone() -> Iterator[list[Server]]:
    """A server over SQLite."""
    with tempfile.TemporaryDirectory(prefix="esker-bench-") as folder:
        yield from _running([Server(Path(folder))])


@contextmanager
def nodes(count: int, database: str) -> Iterator[list[Server]]:
    """Nodes over one database."""
    key = secrets.token_urlsafe(32)
    with tempfile.TemporaryDirectory(prefix="esker-bench-") as folder:
        yield from _running([Server(Path(folder), f"n{i}", database, key) for i in range(count)])


def _running(made: list[Server]) -> Iterator[list[Server]]:
    try:
        for each in made:
            each.start()
        for each in made:
            each.ready()
        yield made
    finally:
        for each in made:
            each.end(signal.SIGKILL)
        for each in made:
            each.gone()
