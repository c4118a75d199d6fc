"""Puts the server together and runs it: journal, solver thread, tiles, HTTP (DESIGN 8)."""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

from esker.document.ops import Limits
from esker.exporting import run as exporting
from esker.importing import run as importing
from esker.jobs import Imports
from esker.jobs.exports import Exports, Plant
from esker.keeper.lesson import first_code, greeting, open_lesson
from esker.keeper.private import Key, Private
from esker.process import confinement, system
from esker.render.pictures.previews import Previews
from esker.server import first_build
from esker.server.app import create_app
from esker.server.elevation import Elevation
from esker.server.hydrology import Hydrology, Snapshot, snapshot
from esker.server.nodes import Member
from esker.server.routes.metrics import Gauges
from esker.server.routes.previews import Pictures
from esker.server.serving import HttpServer, configured, front_of
from esker.server.settings import Settings
from esker.server.starting import CannotServe, FrontDoor, Stopping, WaitingRoom
from esker.server.storing import Storing
from esker.server.wire.tls import CA_FILE
from esker.session.ground.ports import Solver, SolverFactory
from esker.session.ground.recovery import LAST_RESORT, Fault
from esker.session.ground.worker import Worker
from esker.session.room.hub import Hub
from esker.session.scoring import Scorer
from esker.solve.multigrid import DivergedError
from esker.solve.opencl import prepare
from esker.solve.opencl.device import candidates, ready
from esker.solve.opencl.faults import DeviceError, NoDeviceError, OutOfDeviceMemoryError
from esker.solve.solver import Solver as OpenClSolver
from esker.store.access import Access, TooManyLinks
from esker.store.claims import Claims, key_in
from esker.store.engine.ports import Engine
from esker.store.grids import FOLDER
from esker.store.journal import Journal, Unwritable
from esker.store.previews import PreviewTokens
from esker.store.upkeep.care import Care
from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.watcher import Watcher

log = logging.getLogger("esker")

SWITCH_SECONDS: Final = 0.0002
"""An append passes four threads on its way to the screen; at each Python would let the other go on for 5 ms first."""


FLAWS: Final = (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError)
"""Errors that Python and NumPy raise where a program is wrong about its numbers. No device is the reason for them."""


class _Tiles:
    """``session.ground.ports.Tiles`` and ``WateredTiles`` by the real tiles."""

    def __init__(self) -> None:
        self.hydrology = Hydrology(first_build.have_river_loops)
        self.scorer = Scorer()

    def snapshot(self, server: Any, level: int) -> Snapshot | None:
        return snapshot(server, level)

    def server(self, size_m: float, levels: int, finest: int) -> TileServer:
        return TileServer(size_m, levels, finest)

    def client(self, server: Any) -> ClientTiles:
        return ClientTiles(server)

    def watcher(self, server: Any, top: int) -> Watcher:
        return Watcher(server, top)


class Assembly:
    """A server put together but not yet running. ``close`` must be called, whatever happened."""

    def __init__(
        self,
        settings: Settings,
        make_solver: SolverFactory | None = None,
        door: FrontDoor | None = None,
        tell: Callable[[prepare.Step], None] = lambda _: None,
    ) -> None:
        """Takes the port, opens the journal, compiles what is not compiled, starts the solver's thread.

        ``make_solver``: another solver, for tests; ``door``: the port where it was taken already; ``tell``: called with
        how far it is. Raises CannotServe, store.journal.CorruptDatabase, OSError.
        """
        self.settings, self._tell = settings, tell
        door = door or FrontDoor(settings)
        self.address, self._listener, self._context = door.address, door.listener, door.context
        self.port = int(self._listener.getsockname()[1])
        self._worker: Worker | None = None
        self._tiles: _Tiles | None = None
        self._elevation: Elevation | None = None
        self._journal: Journal | None = None
        self._storing: Storing | None = None
        self._server: HttpServer | None = None
        """The HTTP server, while it runs."""
        self._care: Care | None = None
        self.member: Member | None = None
        """This server as a node, where several share the database."""
        self.imports: Imports | None = None
        self.exports: Exports | None = None
        try:
            self._open(make_solver or self._solver)
        except BaseException:
            self.close()
            raise

    @property
    def base(self) -> str:
        """The address at which people reach this server."""
        scheme = "https" if self._context else "http"
        return (self.settings.public_url or f"{scheme}://{self.address}:{self.port}").rstrip("/")

    def _open(self, make_solver: SolverFactory) -> None:
        settings = self.settings
        self._storing = Storing(settings, self._lost, self._join if settings.node else None)
        self._journal, self._grids = self._storing.journal, self._storing.grids
        member = self.member
        self.private = Private(settings.data)
        self._worker = Worker(
            make_solver, settings.device, candidates=lambda: candidates(settings.threads), diagnose=diagnose
        )
        self._compile(kernels=make_solver == self._solver)
        self._worker.start()
        log.info("solver: %s, levels 0 to %d", self._worker.device_name, settings.level)
        if not confinement.possible():
            log.warning("this system cannot keep readers of people's files from the data folder and the network")
        self._tiles = _Tiles()
        self._elevation = Elevation(self._grids, first_build.have_layer_loops)
        self._gauges = _gauges(settings)
        codes = None if member is None else member.codes(self._journal)
        self.hub = Hub(
            self._journal,
            Access(self._journal, self._journal.now, codes=codes),
            self._worker,
            self._tiles,
            levels=settings.level,
            finest=settings.refine,
            limits=Limits(settings.max_strokes, settings.max_points),
            max_members=settings.max_members,
            elevation=self._elevation,
            claims=Claims(key_in(settings.data) if member is None else member.claims, self._journal.now),
            tenancy=None if member is None else member.cluster,
            meter=self._gauges,
        )
        if member is not None:
            member.join(self.hub, self._worker)
        if self._gauges is not None:
            self._gauges.hub, self._gauges.worker = self.hub, self._worker
            self._gauges.cluster = None if member is None else member.cluster
        self._care = Care(self._journal, self.hub.deletion, self._grids, made=self._storing.made)

    def _join(self) -> tuple[Engine, Callable[[], float]]:
        """The database of this server as one of several, and the date that they have together. Raises CannotServe."""
        member = self.member = Member(self.settings)
        return member.engine, member.date

    def _compile(self, kernels: bool) -> None:
        """Compiles loops and kernels, each in a child process where they are not compiled yet, side by side."""
        stopped, compiling = threading.Event(), threading.Event()
        loops = threading.Thread(
            target=first_build.have_loops, args=[stopped, compiling], name="compiling", daemon=True
        )
        loops.start()
        try:
            if kernels and (self.settings.device or "").lower() != LAST_RESORT:
                with suppress(NoDeviceError):  # the solver will say what went wrong
                    ready(self.settings.device, self.settings.threads, self._tell, stopped)
            if compiling.is_set() and loops.is_alive():
                self._tell(prepare.Step("Compiling loops, once on this machine"))
            while loops.is_alive():
                loops.join(0.1)
            self._tell(prepare.Step("Opening the solver"))
        finally:
            stopped.set()
            loops.join()

    def _solver(self, device: str | None) -> Solver:
        return OpenClSolver(device=device, max_level=self.settings.level, threads=self.settings.threads)

    def server(self, announce: bool = True) -> HttpServer:
        """Returns the HTTP server, to be run with ``run``."""
        assert self._journal is not None, "an assembly is open until it is closed"
        assert self._storing is not None
        made = self._storing.made
        pictures = Pictures(
            Previews(
                self.settings.data / "previews",
                self.settings.device,
                grids=self.settings.data / FOLDER,
                fetch=self._grids.fetch_all,
                made=made,
                draws=self.settings.previews,
            ),
            PreviewTokens(self._journal),
            self.settings.public_url.rstrip("/") if self.settings.public_url else None,
        )
        self.imports = Imports(self.hub, self._grids, importing, quota_bytes=self.settings.grid_quota_mb << 20)
        settings = self.settings
        plant = Plant(settings.device, settings.threads, settings.level, settings.refine)
        folder, fetch = self._grids.folder, self._grids.fetch_all
        self.exports = Exports(
            self.hub, settings.data / "exports", folder, exporting.make, plant, fetch=fetch, made=made
        )
        if self.member is not None:
            self.private.write(self.private.open().model_copy(update={"key": self.member.keeper}))
        key = Key(self.private.open().key)
        front = front_of(settings, self.address)
        member, gauges = self.member, self._gauges
        app = create_app(
            self.hub,
            settings.page,
            settings.data,
            pictures,
            self._grids,
            self.imports,
            self.exports,
            key,
            front,
            member,
            gauges,
        )

        async def started() -> None:
            if announce and member is None:
                await _announce(self.hub, self.private, self.base, self.settings)
            elif announce:
                sys.stdout.write(f"\n  Node {settings.node} of Esker is ready: {self.base}\n\n")
                sys.stdout.flush()

        host = f"{self.address}:{self.port}"
        near = front.proxies.__contains__ if member is None else lambda who: who in front.proxies or member.knows(who)
        return HttpServer(configured(app, near, self._context), self.hub, self.imports, host, started, member)

    def run(self, server: HttpServer) -> None:
        """Serves until the server is told to stop."""
        self._server = server
        sys.setswitchinterval(SWITCH_SECONDS)
        server.collector.begin()
        system.give_memory_back()  # compiling took memory that is free now
        if self._care is not None:
            self._care.start()
        if threading.current_thread() is threading.main_thread():
            # The HTTP server raises the signal that stopped it once more when it is done; by then it has been obeyed.
            # A signal that comes before the server listens to signals itself is obeyed too.
            system.on_stop(lambda *_: setattr(server, "should_exit", True))
        try:
            server.run(sockets=[self._listener])
        finally:
            server.collector.end()

    def _lost(self) -> None:
        """Another server has the database."""
        if self._server is not None:
            self._server.should_exit = True

    def close(self) -> None:
        """Stops the threads, commits what is queued, frees the port."""
        if self._care is not None:
            self._care.stop()
        if self._elevation is not None:
            self._elevation.close()
        if self._worker is not None:
            self._worker.stop()
        if self._tiles is not None:
            self._tiles.hydrology.close()
            self._tiles.scorer.close()
        if self._storing is not None:
            self._storing.close()
        if self.member is not None:
            self.member.close()
        self._listener.close()


def serve(settings: Settings, door: FrontDoor, room: WaitingRoom, stopping: Stopping) -> None:
    """Runs until SIGINT or SIGTERM, once the waiting room has left the door to it.

    Raises CannotServe, store.journal.CorruptDatabase, OSError; starting.Interrupted before it serves.
    """

    def tell(step: prepare.Step) -> None:
        stopping.check()
        room.tell(step.said, step.done, step.of)

    stopping.check()
    system.share_heaps()
    assembly = Assembly(settings, door=door, tell=tell)
    try:
        server = assembly.server()
        stopping.check()
        room.leave()
        assembly.run(server)
    finally:
        assembly.close()
    log.info("stopped; everything is saved")


def diagnose(error: Exception) -> Fault:
    """Returns what an exception of the solver means for the worker."""
    if isinstance(error, (OutOfDeviceMemoryError, MemoryError)):
        return Fault.MEMORY
    if isinstance(error, DivergedError):
        return Fault.JOB
    if isinstance(error, DeviceError):
        return Fault.DEVICE
    return Fault.FLAW if isinstance(error, FLAWS) else Fault.UNKNOWN


def _gauges(settings: Settings) -> Gauges | None:
    """Returns what counts figures, where the settings let somebody read them. Raises CannotServe."""
    if not settings.metrics:
        return None
    try:
        return Gauges(settings.metrics)
    except ValueError as error:
        raise CannotServe(f"ESKER_METRICS: {error}.") from None


async def _announce(hub: Hub, private: Private, base: str, settings: Settings) -> None:
    """Opens the terrain of the last start, or a new one, and prints the way to it: secrets only on a terminal."""
    try:
        content, kept = await open_lesson(hub, private, base, settings.new_terrain)
    except (TooManyLinks, Unwritable, OSError) as error:
        log.error("no terrain can be printed: %s", error or type(error).__name__)
        sys.stdout.write(f"\n  Esker is ready: {base}\n\n")
    else:
        lan = f"{base}/{CA_FILE}" if settings.lan else None
        code = first_code(hub, content) if settings.lan and sys.stdout.isatty() else None
        sys.stdout.write(greeting(content, kept, settings.data, private=sys.stdout.isatty(), lan=lan, code=code))
    sys.stdout.flush()
