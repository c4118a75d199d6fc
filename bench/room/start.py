"""How a server starts: when its port answers, when it is ready, what shares the time and the memory.

``cold``: caches are empty, as at the first start after set-up; ``warm``: the next start. Seconds by the clock from the
start of the process; memory is the largest sum over the server and its children, shared pages counted once.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any, Final

import psutil

from bench.room import _serving
from esker.solve.opencl.pocl import home
from esker.version import VERSION

MOST: Final = {"cold": 20.0, "warm": 3.0, "memory_mb": 700}
"""What a start may take on two cores."""
LOOK: Final = 0.05


def measure(cache: Path, level: str | None) -> dict[str, Any]:
    """One start with what ``cache`` holds: seconds until it listens and is ready, by what it said, and memory.

    Raises RuntimeError when the server ends.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    with tempfile.TemporaryDirectory(prefix="esker-bench-") as folder:
        command = [sys.executable, "-m", "esker", "serve", "--port", str(port), "--data", folder]
        more = {home.ROOT: str(cache), "NUMBA_CACHE_DIR": str(cache / "numba"), home.LIMIT: level or ""}
        began = time.monotonic()
        with subprocess.Popen(
            [*command, "--log-level", "error"], stdout=subprocess.DEVNULL, env=os.environ | more
        ) as server:
            try:
                return _watched(server, port, began)
            finally:
                server.terminate()


def _watched(server: subprocess.Popen[bytes], port: int, began: float) -> dict[str, Any]:
    shares: dict[str, float] = {}
    listens, most, device, last = 0.0, 0, "", began
    while not device:
        if server.poll() is not None:
            raise RuntimeError(f"the server ended with {server.returncode}")
        said, device = _asked(port)
        now, most = time.monotonic(), max(most, _memory(server.pid))
        listens = listens or (now - began if said or device else 0.0)
        said = said or ("" if device else "Not listening")
        shares[said] = shares.get(said, 0.0) + now - last
        last = now
        time.sleep(LOOK)
    shares.pop("", None)
    return {
        "listens_s": round(listens, 2),
        "ready_s": round(last - began, 2),
        "memory_mb": round(most / 1e6),
        "shares_s": {said: round(seconds, 2) for said, seconds in shares.items()},
        "device": device,
    }


def _asked(port: int) -> tuple[str, str]:
    """Returns what the server says while it starts, and its device once it is ready."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=5) as answer:
            return "", str(json.loads(answer.read())["device"])
    except urllib.error.HTTPError as error:
        return str(json.loads(error.read())["starting"]["said"]), ""
    except OSError:
        return "", ""


def _memory(pid: int) -> int:
    total = 0
    try:
        process = psutil.Process(pid)
        family = [process, *process.children(recursive=True)]
    except psutil.Error:
        return 0
    for one in family:
        try:
            full = one.memory_full_info()
            total += int(getattr(full, "pss", full.uss))
        except psutil.Error:
            continue
    return total


def main(argv: list[str]) -> int:
    """``esker bench start [--json] [--rounds N] [--level NAME]``."""
    parser = argparse.ArgumentParser(prog="esker bench start", description=__doc__)
    parser.add_argument("--rounds", type=int, default=3, help="starts of each kind; the slowest counts")
    parser.add_argument("--level", help="the widest CPU level (ESKER_CPU_LEVEL)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    arguments = parser.parse_args(argv)
    runs: dict[str, list[dict[str, Any]]] = {"cold": [], "warm": []}
    before = _serving.machine()
    for _ in range(arguments.rounds):
        cache = Path(tempfile.mkdtemp(prefix="esker-bench-"))
        try:
            for kind in ("cold", "warm"):
                runs[kind].append(measure(cache, arguments.level))
        finally:
            shutil.rmtree(cache, ignore_errors=True)
    slowest = {kind: max(each, key=lambda run: float(run["ready_s"])) for kind, each in runs.items()}
    result = {
        "bench": "start",
        "version": VERSION,
        "machine": before | {"device": slowest["warm"].pop("device")},
        "level": arguments.level or "the processor's",
        "rounds": arguments.rounds,
        "bounds": MOST,
        "slowest": slowest,
        "ready_s": {kind: [run["ready_s"] for run in each] for kind, each in runs.items()},
        "memory_mb": max(run["memory_mb"] for each in runs.values() for run in each),
    }
    slowest["cold"].pop("device", None)
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
        return 0
    for kind, run in slowest.items():
        shares = ", ".join(f"{said}: {seconds} s" for said, seconds in run["shares_s"].items())
        sys.stdout.write(f"{kind}: listens after {run['listens_s']} s, ready after {run['ready_s']} s ({shares})\n")
    sys.stdout.write(f"most memory: {result['memory_mb']} MB\n")
    return 0
