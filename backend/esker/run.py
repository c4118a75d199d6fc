"""Puts the server together and runs it: journal, solver thread, tiles, HTTP (DESIGN 8)."""

from __future__ import annotations

import asyncio
import gc
import logging
import signal
import socket
import ssl
import sys
import threading
import time
from collections.abc import Awaitable, Callable
from typing import Any, Final

import segno
import uvicorn

from esker import contract as c
from esker.document.ops import Limits
from esker.elevation import Elevation
from esker.exports import run as exporting
from esker.exports.service import Exports, Plant
from esker.http_protocol import HttpProtocol
from esker.importing import run as importing
from esker.imports import Imports
from esker.render.previews import Previews
from esker.server import Pictures, create_app
from esker.session.hub import Hub
from esker.session.ports import Solver, SolverFactory
from esker.session.recovery import Fault
from esker.session.worker import Worker
from esker.settings import Settings
from esker.solve.device import candidates
from esker.solve.faults import DeviceError, OutOfDeviceMemoryError
from esker.solve.multigrid import DivergedError
from esker.solve.solver import Solver as OpenClSolver
from esker.store.access import Access
from esker.store.grids import FOLDER, GridStore
from esker.store.journal import Journal
from esker.store.lock import DataLock, InUse
from esker.store.previews import PreviewTokens
from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.pyramid import warm
from esker.tls import CA_FILE, lan_address, server_context
from esker.websocket_protocol import WebSocketProtocol

log = logging.getLogger("esker")

BACKUP_SECONDS: Final = 3600.0
GOODBYE_SECONDS: Final = 0.3
"""Time for the farewells to leave before the sockets are closed."""
HARD_MESSAGE_LIMIT: Final = 4 * c.MAX_MESSAGE_BYTES
"""Above ``MAX_MESSAGE_BYTES`` a client gets a sentence (4007); above this the websocket library hangs up (1009)."""
PING_SECONDS, PONG_SECONDS = 20.0, 20.0
"""A websocket is asked so often whether its peer is there, and dropped without an answer in so long."""
SEND_BUFFER: Final = 256 * 1024
"""The kernel would queue megabytes for a client that does not read, and show it old tiles when it does."""


SWITCH_SECONDS: Final = 0.0002
"""An append passes four threads on its way to the screen; at each Python would let the other go on for 5 ms first."""


GARBAGE_OBJECTS: Final = 10_000
"""Objects made before the collector looks at them. It never looks at what is there at the start, modules and compiled
code, which made all threads wait for 100 ms now and then."""


class CannotServe(Exception):
    """The server cannot start; the message says why in one sentence."""


class _Tiles:
    """``session.ports.Tiles`` by the real tiles."""

    def server(self, size_m: float, levels: int, finest: int) -> TileServer:
        return TileServer(size_m, levels, finest)

    def client(self, server: Any) -> ClientTiles:
        return ClientTiles(server)


class _Server(uvicorn.Server):
    """Says goodbye to the members of all rooms before the sockets are closed."""

    def __init__(
        self, config: uvicorn.Config, hub: Hub, imports: Imports, started: Callable[[], Awaitable[None]]
    ) -> None:
        super().__init__(config)
        self._hub, self._imports, self._announce = hub, imports, started

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            await self._announce()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        await self._imports.close()
        await self._hub.close()
        await asyncio.sleep(GOODBYE_SECONDS)
        await super().shutdown(sockets)


class Assembly:
    """A server put together but not yet running. ``close`` must be called, whatever happened."""

    def __init__(self, settings: Settings, make_solver: SolverFactory | None = None) -> None:
        """Takes the port, opens the journal, starts the solver's thread.

        ``make_solver``: another solver, for tests. Raises CannotServe, store.journal.CorruptDatabase, OSError.
        """
        self.settings = settings
        host = "0.0.0.0" if settings.lan and settings.host == "127.0.0.1" else settings.host
        self.address = lan_address() if settings.lan else ("127.0.0.1" if host in ("0.0.0.0", "::") else host)
        self._listener = _listen(host, settings.port)
        self.port = int(self._listener.getsockname()[1])
        self._context: ssl.SSLContext | None = None
        self._worker: Worker | None = None
        self._journal: Journal | None = None
        self._lock: DataLock | None = None
        self._backups: _Backups | None = None
        self.imports: Imports | None = None
        """Once there is a server."""
        self.exports: Exports | None = None
        try:
            self._open(make_solver or self._solver)
        except BaseException:
            self.close()
            raise

    @property
    def base(self) -> str:
        """Where people reach this server."""
        scheme = "https" if self._context else "http"
        return (self.settings.public_url or f"{scheme}://{self.address}:{self.port}").rstrip("/")

    def _open(self, make_solver: SolverFactory) -> None:
        settings = self.settings
        try:
            self._lock = DataLock(settings.data)
        except InUse as error:
            raise CannotServe(str(error)) from None
        self._context = server_context(settings.data, self.address) if settings.lan else None
        self._journal = Journal(settings.data)
        self._grids = GridStore(settings.data)
        self._grids.sweep(self._journal.grids())
        self._worker = Worker(
            make_solver, settings.device, candidates=lambda: candidates(settings.threads), diagnose=diagnose
        )
        compiling = threading.Thread(target=warm, name="compiling", daemon=True)
        compiling.start()  # beside the device's own kernels
        self._worker.start()
        compiling.join()
        log.info("solver: %s, levels 0 to %d", self._worker.device_name, settings.level)
        self.hub = Hub(
            self._journal,
            Access(self._journal),
            self._worker,
            _Tiles(),
            levels=settings.level,
            finest=settings.refine,
            limits=Limits(settings.max_strokes, settings.max_points),
            max_members=settings.max_members,
            elevation=Elevation(self._grids),
        )
        self._backups = _Backups(self._journal)

    def _solver(self, device: str | None) -> Solver:
        return OpenClSolver(device=device, max_level=self.settings.level, threads=self.settings.threads)

    def server(self, announce: bool = True) -> _Server:
        """The HTTP server, to be run with ``run``."""
        assert self._journal is not None, "an assembly is open until it is closed"
        pictures = Pictures(
            Previews(self.settings.data / "previews", self.settings.device, grids=self.settings.data / FOLDER),
            PreviewTokens(self._journal),
            self.settings.public_url.rstrip("/") if self.settings.public_url else None,
        )
        self.imports = Imports(self.hub, self._grids, importing, quota_bytes=self.settings.grid_quota_mb << 20)
        settings = self.settings
        plant = Plant(settings.device, settings.threads, settings.level, settings.refine)
        self.exports = Exports(self.hub, settings.data / "exports", self._grids.folder, exporting.make, plant)
        app = create_app(self.hub, settings.page, settings.data, pictures, self._grids, self.imports, self.exports)

        async def started() -> None:
            if announce:
                await _announce(self.hub, self.base, self.settings)

        return _Server(_config(app, self.settings, self._context), self.hub, self.imports, started)

    def run(self, server: _Server) -> None:
        """Serves until the server is told to stop."""
        sys.setswitchinterval(SWITCH_SECONDS)
        gc.collect()
        gc.freeze()
        gc.set_threshold(GARBAGE_OBJECTS)
        if self._backups is not None:
            self._backups.start()
        if threading.current_thread() is threading.main_thread():
            # The HTTP server raises the signal that stopped it once more when it is done; by then it has been obeyed.
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, lambda *_: None)
        server.run(sockets=[self._listener])

    def close(self) -> None:
        """Stops the threads, commits what is queued, frees the port."""
        if self._backups is not None:
            self._backups.stop()
        if self._worker is not None:
            self._worker.stop()
        if self._journal is not None:
            self._journal.close()
        if self._lock is not None:
            self._lock.release()
        self._listener.close()


def serve(settings: Settings) -> None:
    """Runs until SIGINT or SIGTERM. Raises CannotServe, store.journal.CorruptDatabase, OSError."""
    assembly = Assembly(settings)
    try:
        assembly.run(assembly.server())
    finally:
        assembly.close()
    log.info("stopped; everything is saved")


def diagnose(error: Exception) -> Fault:
    """What an exception of the solver means for the worker."""
    if isinstance(error, (OutOfDeviceMemoryError, MemoryError)):
        return Fault.MEMORY
    if isinstance(error, DivergedError):
        return Fault.JOB
    return Fault.DEVICE if isinstance(error, DeviceError) else Fault.UNKNOWN


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)  # accepted sockets inherit it
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        hint = "Another program uses it; choose another one with --port." if error.errno == 98 else str(error)
        raise CannotServe(f"Cannot listen on {host}, port {port}. {hint}") from error
    return listener


def _config(app: Any, settings: Settings, context: ssl.SSLContext | None) -> uvicorn.Config:
    config = uvicorn.Config(
        app,
        ws=WebSocketProtocol,
        ws_max_size=HARD_MESSAGE_LIMIT,
        # Tiles are deflated already, and control texts are small: a second deflate costs more than it saves.
        ws_per_message_deflate=False,
        ws_ping_interval=PING_SECONDS,
        ws_ping_timeout=PONG_SECONDS,
        http=HttpProtocol,
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=5,
        forwarded_allow_ips=settings.forwarded_allow_ips,
    )
    config.load()
    config.ssl = context
    return config


async def _announce(hub: Hub, base: str, settings: Settings) -> None:
    """Makes a terrain and prints how to reach it."""
    born, _, secret = await hub.create(c.Document(id="new"))
    link = f"{base}/t/{born.id}#{secret}"
    lines = ["", f"  Esker is ready: {base}", f"  A new terrain:  {link}"]
    if settings.lan:
        lines.append(f"  To have no warning, trust this certificate once on each device: {base}/{CA_FILE}")
    sys.stdout.write("\n".join(lines) + "\n\n")
    if settings.lan:
        segno.make(link, error="l").terminal(out=sys.stdout, compact=True)
    sys.stdout.flush()


class _Backups:
    """Copies the database at the start and every hour, in a thread of its own."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="backup", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout=60)

    def _run(self) -> None:
        while True:
            started = time.monotonic()
            try:
                path = self._journal.backup()
                log.debug("backup %s in %.1f s", path, time.monotonic() - started)
            except Exception as error:
                log.error("the backup failed: %s", error)
            if self._stop.wait(BACKUP_SECONDS):
                return
