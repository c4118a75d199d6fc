"""Servers in processes that are forked from one that has loaded what all of them load.

A server takes two seconds of processor time until it serves: 1.4 for imports, half a one to load compiled loops. Tests
start a hundred of them. A fork runs the same command with arguments, environment and log of its own, and is killed,
stopped and waited for like any process. How a server starts from nothing has tests of its own (``tests/unit``:
``test_starting.py``, ``test_cli.py``).

``python -m tests.zygote SOCKET`` is the process that forks: for each connection it reads one line of JSON, answers with
the number of the fork, and when that has ended with its status.
"""

from __future__ import annotations

import atexit
import functools
import importlib
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from unittest import mock

ROOT = Path(__file__).resolve().parents[1]
LOADS_SECONDS = 300.0
"""The first process of a machine compiles the loops."""


LOADED = ("esker.cli.main", "esker.server.run", "tests.cluster.processes", "tests.sync.harness")
"""What forks import, or is imported by what they run."""


class Forked:
    """A process that was forked; offers what tests ask of ``subprocess.Popen``."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._lines = connection.makefile("r")
        self.pid = int(self._lines.readline())
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Returns the exit status, minus the signal that ended it, or None while the process runs."""
        with suppress(subprocess.TimeoutExpired):
            self.wait(0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Returns the exit status. Raises TimeoutExpired after so many seconds."""
        if self.returncode is None:
            if not select.select([self._connection], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0)
            self.returncode = int(self._lines.readline())
            self._lines.close()
            self._connection.close()
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Sends a signal to the process while it runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Ends the process at once while it runs."""
        self.send_signal(signal.SIGKILL)


Process = Forked | subprocess.Popen[bytes]


@dataclass(frozen=True)
class Command:
    """What a fork runs: ``python -m MODULE ARGUMENTS`` with this environment; what it says is added to ``log``."""

    module: str
    arguments: Sequence[str]
    environment: Mapping[str, str]
    log: str

    def run(self) -> None:
        """Does so in this process. Raises SystemExit with its status."""
        os.environ.clear()
        os.environ.update(self.environment)
        with open(self.log, "ab") as log, open(os.devnull, "rb") as nothing:
            for stream, number in ((nothing, 0), (log, 1), (log, 2)):
                os.dup2(stream.fileno(), number)
        sys.argv = [self.module, *self.arguments]
        runpy.run_module(self.module, run_name="__main__", alter_sys=True)


def start(module: str, arguments: Sequence[str], environment: Mapping[str, str], log: Path) -> Process:
    """Starts ``python -m MODULE ARGUMENTS`` in the root of the checkout, with what it says added to ``log``."""
    command = Command(module, list(arguments), {**os.environ, **environment}, str(log))
    if not hasattr(os, "fork"):
        with log.open("ab") as out:
            line = [sys.executable, "-m", module, *arguments]
            return subprocess.Popen(line, cwd=ROOT, env=command.environment, stdout=out, stderr=out)
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(_zygote())
    connection.sendall(json.dumps(asdict(command)).encode() + b"\n")
    return Forked(connection)


@functools.cache
def _zygote() -> str:
    """Returns where the process that forks listens; starts it when it is first asked for. It ends with this process."""
    folder = tempfile.TemporaryDirectory(prefix="esker-zygote-")
    path = str(Path(folder.name) / "socket")
    process = subprocess.Popen([sys.executable, "-m", "tests.zygote", path], cwd=ROOT, stdin=subprocess.PIPE)
    end = time.monotonic() + LOADS_SECONDS
    while not os.path.exists(path):
        if process.poll() is not None or time.monotonic() > end:
            raise RuntimeError("The process that forks servers did not begin.")
        time.sleep(0.02)
    atexit.register(folder.cleanup)
    atexit.register(process.communicate)
    return path


class _AtOnce(Executor):
    """Does what it is given in the thread that gives it."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        done: Future[Any] = Future()
        done.set_result(fn(*args, **kwargs))
        return done


def _load() -> None:
    """Imports what servers import, and runs their loops once. Raises RuntimeError where that has left a thread: forks
    have none of them."""
    from esker.process import caches, garbage

    caches.keep_in(Path(tempfile.gettempdir()))
    with garbage.importing():
        for module in LOADED:
            importlib.import_module(module)
        from esker.tiles import pyramid
        from esker.tiles.codec import coding
    with mock.patch.object(coding, "_second", _AtOnce()):
        pyramid.warm()
    if threading.active_count() > 1:
        raise RuntimeError(f"threads are left: {threading.enumerate()}")


def _forks(path: str) -> Command | None:
    """Forks until stdin is closed. Returns in each fork, with what it runs; None where it is closed."""
    wakes, woken = socket.socketpair()
    woken.setblocking(False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever asks for forks ends them, and closes stdin
    signal.set_wakeup_fd(woken.fileno(), warn_on_full_buffer=False)
    running: dict[int, socket.socket] = {}
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(f"{path}.bound")
        door.listen()
        os.rename(f"{path}.bound", path)
        while True:
            ready, _, _ = select.select([sys.stdin.fileno(), wakes.fileno(), door.fileno()], [], [])
            if sys.stdin.fileno() in ready:
                return None
            if wakes.fileno() in ready:
                wakes.recv(4096)
                _told(running)
            if door.fileno() in ready:
                connection, _ = door.accept()
                command = Command(**json.loads(connection.makefile("r").readline()))
                child = os.fork()
                if child == 0:
                    signal.set_wakeup_fd(-1)
                    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                    signal.signal(signal.SIGINT, signal.default_int_handler)
                    for each in (wakes, woken, connection, *running.values()):
                        each.close()
                    return command
                running[child] = connection
                connection.sendall(f"{child}\n".encode())


def _told(running: dict[int, socket.socket]) -> None:
    """Tells those who wait which forks have ended."""
    for child in list(running):
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            with running.pop(child) as connection, suppress(OSError):
                connection.sendall(f"{os.waitstatus_to_exitcode(status)}\n".encode())


def main() -> None:
    """The process that forks, and each of its forks."""
    _load()
    if (command := _forks(sys.argv[1])) is not None:
        command.run()


if __name__ == "__main__":
    main()
