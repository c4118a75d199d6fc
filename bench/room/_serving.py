"""A server process of its own for a benchmark, and the machine that it ran on."""

from __future__ import annotations

import json
import os
import platform
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil

from esker import contract as c
from esker.document import archive


def machine(device: str | None = None) -> dict[str, Any]:
    """Returns what the figures depend on: processor, cores, memory, Python, load before the run, solver device."""
    model = platform.processor()
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), model)
    return {
        "cpu": model,
        "cores": os.cpu_count(),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "python": platform.python_version(),
        "load_before": round(os.getloadavg()[0], 2),
    } | ({"device": device} if device else {})


@contextmanager
def server() -> Iterator[str]:
    """Runs ``esker serve`` on a free loopback port over an empty folder; gives its base address.

    Raises RuntimeError when it does not start.
    """
    with running() as (base, _):
        yield base


@contextmanager
def running(where: Path | None = None) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Runs a server as ``server`` does, and gives its process too.

    ``where``: the folder in which its data folder is made (default: the temporary one). Raises RuntimeError when the
    server does not start.
    """
    port = free_port()
    with tempfile.TemporaryDirectory(prefix="esker-bench-", dir=where) as folder:
        command = [sys.executable, "-m", "esker", "serve", "--port", str(port), "--data", folder]
        with subprocess.Popen([*command, "--log-level", "warning"], stdout=subprocess.DEVNULL) as process:
            base = f"http://127.0.0.1:{port}"
            try:
                wait(base, process)
                yield base, process
            finally:
                process.terminate()


def free_port() -> int:
    """A port of the loopback interface that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def post(url: str, body: dict[str, Any], secret: str = "") -> Any:
    """The JSON that answers a JSON body."""
    headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {secret}"} if secret else {})
    request = urllib.request.Request(url, json.dumps(body).encode(), headers, method="POST")
    with urllib.request.urlopen(request, timeout=10) as answer:
        return json.loads(answer.read())


def wait(base: str, process: subprocess.Popen[bytes]) -> None:
    """Returns when the server is ready. Raises RuntimeError when it ends, or is not within a minute."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and process.poll() is None:
        with suppress(OSError), urllib.request.urlopen(f"{base}/healthz", timeout=1):
            return
        time.sleep(0.1)
    raise RuntimeError("the server did not start")


def upload(base: str, document: c.Document) -> tuple[str, str]:
    """Makes a terrain of a document; its id and the owner's secret."""
    request = urllib.request.Request(f"{base}/api/terrains/import", archive.dumps(document), method="POST")
    with urllib.request.urlopen(request, timeout=30) as answer:
        made = json.loads(answer.read())
    return made["id"], made["secret"]
