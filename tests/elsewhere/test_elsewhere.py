"""The server without what only POSIX systems have, in a process of its own (SPEC H160, H161)."""

from __future__ import annotations

import ast
import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from esker import Stroke, connect
from esker.keeper.private import Private
from esker.process import bounds

ROOT = Path(__file__).resolve().parents[2]
WITHOUT = Path(__file__).parent / "without"
NAME = "Größe, ₂ und 山"
POSIX = frozenset({"fcntl", "grp", "msvcrt", "posix", "pty", "pwd", "resource", "signal", "termios", "tty", "uvloop"})
CALLS = re.compile(
    r"os\.(fork|getloadavg|getpriority|get[eug]+id|kill|killpg|mkfifo|nice|pipe|pread|pwrite|sched_\w+|setpriority|setsid"
    r"|statvfs|sysconf|uname|wait\w*)|ctypes\.CDLL\(None\)|sys\.getwindowsversion"
)


def environment() -> dict[str, str]:
    """The environment of a process without POSIX whose system writes text in a code page of its own."""
    text = {"PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "ESKER_"))}
    return kept | text | {"PYTHONPATH": str(WITHOUT)}


@contextmanager
def serving(data: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """A server and the link that it printed."""
    command = [sys.executable, "-m", "esker", "serve", "--port", "0", "--level", "1", "--data", str(data)]
    with subprocess.Popen(
        command, cwd=data.parent, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        try:
            assert process.stdout is not None
            for line in process.stdout:
                if b"esker link" in line:
                    yield process, private_link(data)
                    break
            else:
                assert process.stderr is not None
                pytest.fail(process.stderr.read().decode("utf-8", "replace"))
        finally:
            process.kill()


def private_link(data: Path) -> str:
    """The owner's link of the terrain that a start named: no log has it."""
    content = Private(data).read()
    assert content is not None
    assert content.lesson is not None
    return f"{content.base}/t/{content.lesson.terrain}#{content.lesson.owner}"


def ask(link: str, path: str, body: Any, kind: str = "application/json") -> Any:
    base, _, secret = link.partition("#")
    request = urllib.request.Request(
        base.partition("/t/")[0] + path,
        body if isinstance(body, bytes) else None if body is None else json.dumps(body).encode(),
        {"Authorization": f"Bearer {secret}", "Content-Type": kind},
    )
    try:
        with urllib.request.urlopen(request, timeout=120) as response:
            return response.read()
    except urllib.error.HTTPError as error:
        pytest.fail(f"{path}: {error.read().decode()}")


def test_a_server_without_posix_draws_imports_exports_and_stops(tmp_path: Path) -> None:
    """SPEC H160."""
    with serving(tmp_path / "data") as (process, link):
        terrain = link.partition("/t/")[2].partition("#")[0]
        with connect(link, ground=True) as t:
            t.add(Stroke.profile([(800, 2000, 0), (2000, 2200, 600), (3200, 2000, 0)], left=(40, 900), right=(40, 900)))
            t.wait()
            t.ground.wait(120)
            assert t.ground.heights(1).max() > 200
            t.add_grid(np.full((40, 40), 70.0), (2000.0, 2000.0), 0.0, 10.0, name=NAME)  # a child with bounds reads it
            t.save(tmp_path / "a.esker")
        again = json.loads(ask(link, "/api/terrains/import", (tmp_path / "a.esker").read_bytes(), "application/zip"))
        assert again["id"] != terrain
        job = json.loads(
            ask(link, f"/api/terrains/{terrain}/exports", {"format": "npy", "samples": 257, "detail": False})
        )
        while (told := json.loads(ask(link, f"/api/terrains/{terrain}/exports/{job['id']}", None)))["stage"] != "done":
            assert told["stage"] in ("waiting", "solving", "detail", "writing"), told
            time.sleep(0.1)  # who asks without a pause keeps the server from what it is asked about
        second = subprocess.run(
            [sys.executable, "-m", "esker", "serve", "--port", "0", "--data", str(tmp_path / "data")],
            env=environment(), capture_output=True, timeout=60, check=False,
        )  # fmt: skip
        assert second.returncode == 1
        assert f"process {process.pid}".encode() in second.stderr, second.stderr
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        assert process.returncode == 0, errors
        assert b"Traceback" not in errors, errors
        assert b"everything is saved" in errors
    with serving(tmp_path / "data") as (process, link):
        process.terminate()
        assert process.wait(60) == 0


@pytest.mark.parametrize(
    ("bound", "work"),
    [
        ("memory_bytes=1 << 28", "held = [b'x' * (1 << 24) for _ in range(64)]; import time; time.sleep(60)"),
        ("cpu_seconds=1", "\nwhile True: sum(range(10000))"),
    ],
)
def test_a_watch_ends_what_no_kernel_bounds(bound: str, work: str) -> None:
    """SPEC H162."""
    code = f"from esker.process.bounds import Bounds; Bounds({bound}).apply(); {work}"
    done = subprocess.run([sys.executable, "-c", code], env=environment(), timeout=60, capture_output=True, check=False)
    assert done.returncode == bounds.ENDED, done.stderr


def of_a_module(node: ast.AST) -> bool:
    """Whether this is ``name.name`` or a call of it, as all is that ``CALLS`` may match. Text is dear to make."""
    found = node.func if isinstance(node, ast.Call) else node
    return isinstance(found, ast.Attribute) and isinstance(found.value, ast.Name)


def asked(path: Path) -> Iterator[str]:
    """What a file asks of the system by itself: modules, calls, and files that only Linux has."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    texts = {id(node.body[0].value) for node in nodes if isinstance(node, documented) and node.body
             and isinstance(node.body[0], ast.Expr)}  # fmt: skip
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.partition(".")[0] in POSIX)
        elif isinstance(node, ast.ImportFrom) and node.module in POSIX:
            yield str(node.module)
        elif of_a_module(node) and CALLS.fullmatch(ast.unparse(node)):
            yield ast.unparse(node)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in texts:
            yield from re.findall(r"^/(?:proc|sys|dev)/.*", node.value)


def test_one_room_alone_asks_the_system() -> None:
    """SPEC H161. Benchmarks that the product does not import may ask themselves."""
    package = ROOT / "backend" / "esker"
    rooms = (path for path in package.rglob("*.py") if path.relative_to(package).parts[0] not in ("process", "bench"))
    assert {str(path.relative_to(package)): found for path in rooms if (found := sorted(set(asked(path))))} == {}
    assert {*asked(package / "process" / "system.py")} >= {"fcntl", "signal", "os.nice", "/proc/self/oom_score_adj"}
