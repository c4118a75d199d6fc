"""A server that starts listens at once, says how far it is and can be stopped (SPEC P140 to P142)."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import os
import re
import signal
import socket
import ssl
import subprocess
import sys
import time
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from esker.process.child_process import ORPHANED
from esker.process.interrupt import STOPPED
from esker.server.starting import Progress, WaitingRoom, _Line, answer, listen
from esker.server.wire.tls import CA_FILE, server_context
from esker.solve.opencl.pocl import home

ROOT = Path(__file__).resolve().parents[2]
HALF = Progress("Compiling kernels", 9, 18)


def split(reply: bytes) -> tuple[int, dict[str, str], str]:
    """Status, headers and body of an answer."""
    head, _, body = reply.partition(b"\r\n\r\n")
    first, *lines = head.decode().split("\r\n")
    return int(first.split()[1]), dict(line.split(": ", 1) for line in lines), body.decode()


def test_health_says_how_far_it_is() -> None:
    """SPEC P140."""
    status, headers, body = split(answer(b"GET /healthz HTTP/1.1\r\nAccept: text/html\r\n\r\n", HALF))
    assert status == 503
    assert headers["Content-Type"] == "application/json"
    assert headers["Retry-After"] == "1"
    assert json.loads(body)["starting"] == {"said": "Compiling kernels", "done": 9, "of": 18}


def test_people_get_a_page_that_goes_on_by_itself() -> None:
    """SPEC P140: its one script is the one that its policy allows."""
    status, headers, body = split(answer(b"GET /t/abc HTTP/1.1\r\naccept: text/html,*/*\r\n\r\n", HALF))
    assert status == 503
    assert "Compiling kernels ..." in body
    script = re.search(r"<script>(.*?)</script>", body, re.S)
    assert script is not None
    assert base64.b64encode(hashlib.sha256(script[1].encode()).digest()).decode() in headers["Content-Security-Policy"]
    assert "location.reload()" in script[1]
    assert int(headers["Content-Length"]) == len(body.encode())


@pytest.mark.parametrize("first", [b"POST /api/terrains HTTP/1.1\r\nAccept: text/html", b"", b"\xff "])
def test_programs_get_a_sentence(first: bytes) -> None:
    status, _, body = split(answer(first + b"\r\n\r\n", HALF))
    assert status == 503
    assert json.loads(body) == {"code": "starting", "message": "Esker is starting: Compiling kernels."}


def test_head_has_no_body() -> None:
    assert split(answer(b"HEAD / HTTP/1.1\r\n\r\n", HALF))[2] == ""


def ask(port: int) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=30) as peer:
        peer.sendall(b"GET /healthz HTTP/1.1\r\n\r\n")
        return b"".join(iter(lambda: peer.recv(4096), b""))


def test_the_socket_is_handed_over() -> None:
    """SPEC P140: who comes in between waits, and nobody is refused."""
    listener = listen("127.0.0.1", 0)
    port = listener.getsockname()[1]
    with WaitingRoom(listener, None, None) as room:
        room.tell("Opening the solver")
        assert b"Opening the solver" in ask(port)
        silent = socket.create_connection(("127.0.0.1", port), timeout=30)
        room.leave()
    with socket.create_connection(("127.0.0.1", port), timeout=30) as between:
        between.sendall(b"hello")
        served, _ = listener.accept()
        assert served.recv(5) == b"hello"
        served.close()
    silent.close()
    listener.close()


def test_it_waits_behind_tls_too(tmp_path: Path) -> None:
    """SPEC P140: with --lan the page says over https how far it is; who speaks plain HTTP keeps nobody waiting."""
    listener = listen("127.0.0.1", 0)
    port = listener.getsockname()[1]
    offered = server_context(tmp_path, "127.0.0.1")
    trusted = ssl.create_default_context(cafile=str(next(tmp_path.rglob(CA_FILE))))
    with WaitingRoom(listener, offered, None) as room, socket.create_connection(("127.0.0.1", port), 30) as plain:
        room.tell("Compiling kernels", 3, 18)
        plain.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        asked = urllib.request.Request(f"https://127.0.0.1:{port}/t/abc", headers={"Accept": "text/html"})
        with pytest.raises(urllib.error.HTTPError) as told:
            urllib.request.urlopen(asked, timeout=30, context=trusted)
        assert told.value.status == 503
        assert b"Compiling kernels" in told.value.read()
        with suppress(ConnectionError):
            assert not plain.recv(4096).startswith(b"HTTP"), "nothing in clear"
        room.leave()
    # Who comes in between is served by what takes over, TLS and all.
    with ThreadPoolExecutor(1) as pool:
        between = pool.submit(lambda: trusted.wrap_socket(socket.create_connection(("127.0.0.1", port), 30),
                                                          server_hostname="127.0.0.1"))  # fmt: skip
        listener.setblocking(True)  # the room's handle of it was not
        served, _ = listener.accept()
        served.settimeout(30)
        with offered.wrap_socket(served, server_side=True) as ours, between.result(30) as theirs:
            theirs.sendall(b"hello")
            assert ours.recv(5) == b"hello"
    listener.close()


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_line_moves_on_a_terminal_and_nowhere_else() -> None:
    """SPEC P141."""
    for out, moves in ((Terminal(), True), (io.StringIO(), False)):
        line = _Line(out)
        for progress in (HALF, Progress(HALF.said, 10, 18), Progress("Opening the solver")):
            line.show(progress)
            line.tick()
        line.clear()
        line.tick()
        text = out.getvalue()
        if moves:
            assert "(9 of 18)" in text
            assert "(10 of 18)" in text
            assert text.endswith("\r\x1b[2K"), "the line is taken away"
            assert "\n" not in text
        else:
            assert text == "  Compiling kernels\n  Opening the solver\n"


def told(port: int) -> str:
    """What a starting server says, "" before it listens."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=10):
            return "ready"
    except urllib.error.HTTPError as error:
        return str(json.loads(error.read())["starting"]["said"])
    except OSError:
        return ""


INTERRUPTED = """
import os, runpy, signal, sys
at, _, seen = sys.argv.pop().partition(" ")
class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == at:
            sys.meta_path.remove(self)
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except BaseException:
                if not seen:
                    raise
                if seen == "turned":
                    raise ValueError("not a model")
sys.meta_path.insert(0, CtrlC())
runpy.run_module("esker", run_name="__main__", alter_sys=True)
"""
"""``esker`` with Ctrl-C while a module is imported: a moment that nobody can hit from outside."""


@pytest.mark.parametrize(
    ("module", "status"),
    [
        ("esker.cli.main", -signal.SIGINT),
        ("pydantic", -signal.SIGINT),
        ("esker.server.settings", STOPPED),
        ("esker.server.starting", STOPPED),
        ("uvicorn", 0),
        ("uvicorn turned", 0),
        ("uvicorn dropped", 0),
    ],
)
def test_ctrl_c_in_the_first_moments_shows_no_traceback(module: str, status: int, tmp_path: Path) -> None:
    """SPEC P410: before anything is begun it ends by the signal, or as shells say of that; then as P142 says.

    Then also where a library turns what the handler raised into an error of its own, or drops it. CI met the first:
    pydantic made a model just then.
    """
    command = [sys.executable, "-c", INTERRUPTED, "serve", "--port", "0", "--data", str(tmp_path / "data"), module]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == status, done.stderr
    assert done.stderr == ("esker: stopped before it was ready\n" if status == 0 else "")


HELD = """
import os, signal, sys
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
os.kill(os.getpid(), signal.SIGINT)
os.execv(sys.executable, [sys.executable, "-m", "esker", *sys.argv[1:]])
"""
"""``esker`` with Ctrl-C before Python has started: held back, as `make run` does (``env --block-signal=INT``)."""


def test_ctrl_c_before_python_has_started_is_obeyed_in_our_first_line(tmp_path: Path) -> None:
    """SPEC P410."""
    command = [sys.executable, "-c", HELD, "serve", "--port", "0", "--data", str(tmp_path / "data")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")
    recipe = subprocess.run(["make", "-n", "run"], cwd=ROOT, capture_output=True, text=True, timeout=120, check=True)
    possible = subprocess.run(["env", "--block-signal=INT", "true"], capture_output=True, check=False).returncode == 0
    assert ("env --block-signal=INT" in recipe.stdout) == possible


@pytest.mark.parametrize(
    ("moment", "number"), [("Opening", signal.SIGINT), ("Compiling", signal.SIGINT), ("Compiling", signal.SIGTERM)]
)
def test_it_stops_at_every_moment(moment: str, number: signal.Signals, tmp_path: Path) -> None:
    """SPEC P142: while it is imported and while a child compiles, and leaves nobody behind.

    The signal goes to all processes of the command, as a terminal sends Ctrl-C; SIGTERM to the server alone.
    """
    if home.site() is None:
        pytest.skip("nothing is compiled")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "esker", "serve", "--port", str(port), "--data", str(tmp_path / "data")]
    env = os.environ | {"ESKER_CACHE_DIR": str(tmp_path / "cache"), "ESKER_CPU_LEVEL": ""}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=ROOT, env=env, stdout=pipe, stderr=pipe, process_group=0) as server:
        try:
            deadline = time.monotonic() + 120
            while moment not in (said := told(port)):
                assert server.poll() is None
                assert said != "ready"
                assert time.monotonic() < deadline
                time.sleep(0.02)
            children = psutil.Process(server.pid).children(recursive=True)
            if number == signal.SIGINT:
                os.killpg(server.pid, number)
            else:
                server.send_signal(number)
            _, errors = server.communicate(timeout=60)
        finally:
            server.kill()
    assert server.returncode == 0, errors
    assert b"stopped before it was ready" in errors
    assert b"Traceback" not in errors
    assert psutil.wait_procs(children, timeout=10)[1] == []
    assert list((tmp_path / "cache").rglob("failed-*")) == [], "nothing was found out about this level"


@pytest.mark.parametrize("module", ["esker.server.first_build", "esker.server.upload"])
def test_children_end_when_nobody_holds_their_input_any_more(module: str, tmp_path: Path) -> None:
    """SPEC P411: as it is where a server was killed, on every system."""
    os.mkfifo(tmp_path / "never")
    given = {
        "esker.server.first_build": ["loops"],
        "esker.server.upload": [str(tmp_path / "never"), str(tmp_path), "kept"],
    }[module]
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}  # compiling takes it longer than this test
    command, pipe = [sys.executable, "-m", module, *given], subprocess.PIPE
    with subprocess.Popen(command, cwd=ROOT, env=env, stdin=pipe, stdout=pipe, stderr=pipe) as child:
        assert child.stdin is not None
        child.stdin.close()
        try:
            assert child.wait(60) == ORPHANED
        finally:
            child.kill()
