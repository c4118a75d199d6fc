"""Starts lives of ``_fault_lives``, ends them, and speaks to their servers."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np

PATIENCE: Final = 90.0


class Life:
    """One fork of ``_fault_lives``."""

    def __init__(self, lines: queue.Queue[str], pid: int, early: list[str]) -> None:
        """``early``: what it said already."""
        self._lines, self.pid, self._early = lines, pid, early
        self.said: list[str] = []

    def until(self, *wanted: str, timeout: float = PATIENCE) -> str:
        """The next of these lines, "gone", or "" after so long."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            with suppress(queue.Empty):
                line = self._early.pop(0) if self._early else self._lines.get(timeout=0.5)
                self.said.append(line)
                if line in wanted or line == "gone":
                    return line
        return ""

    def end(self, number: int = signal.SIGKILL) -> None:
        """Kills it, and reads all that it said."""
        if self.said[-1:] == ["gone"]:
            return
        with suppress(ProcessLookupError):
            os.kill(self.pid, number)
        self.until("gone")


class Lives:
    """The process that forks servers."""

    def __init__(self, log: Path) -> None:
        command = [sys.executable, "-m", "bench.strangers._fault_lives", str(log)]
        self._process = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._lines: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line.rstrip("\n"))

    def begin(self, what: str, data: Path, port: int = 0, floor: int | None = None) -> Life:
        """Another life."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"what": what, "data": str(data), "port": port, "floor": floor}) + "\n")
        self._process.stdin.flush()
        early: list[str] = []
        while not (line := self._lines.get(timeout=PATIENCE)).startswith("pid "):
            early.append(line)  # of a fork that was faster than who made it
        return Life(self._lines, int(line.split()[1]), early)

    def close(self) -> None:
        """Ends it."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        self._process.stdout.close()


def grid_file(seed: int) -> bytes:
    """A small grid of heights as an ESRI ASCII file, which leaves nothing open."""
    heights = np.random.default_rng(seed).uniform(0, 100, (40, 50))
    head = "ncols 50\nnrows 40\nxllcorner 0\nyllcorner 0\ncellsize 30\n"
    return (head + "\n".join(" ".join(f"{height:.2f}" for height in row) for row in heights) + "\n").encode()


def post(url: str, body: bytes, secret: str) -> Any:
    """The JSON that answers."""
    return request(url, "POST", body, secret)


def request(url: str, method: str, body: bytes | None, secret: str) -> Any:
    """The JSON that answers. Raises OSError."""
    kind = "application/json" if body is not None and body.startswith(b"{") else "application/octet-stream"
    headers = {"Authorization": f"Bearer {secret}", "Content-Type": kind}
    with urllib.request.urlopen(urllib.request.Request(url, body, headers, method=method), timeout=20) as answer:
        return json.loads(answer.read() or b"null")


def bring_in(base: str, secret: str, seed: int, *, answer: bool = True) -> None:
    """Uploads a grid to terrain "t", and answers what the import asks. Raises OSError."""
    url = f"{base}/api/terrains/t/imports"
    job = post(f"{url}?name=a.asc&client=i{seed}", grid_file(seed), secret)
    deadline = time.monotonic() + PATIENCE
    while answer and job["stage"] != "question" and time.monotonic() < deadline:
        time.sleep(0.05)
        job = request(f"{url}/{job['id']}", "GET", None, secret)
    if answer:
        post(f"{url}/{job['id']}/answers", b'{"answers":{"place":"middle"}}', secret)
