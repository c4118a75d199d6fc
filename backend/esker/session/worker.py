"""The solver's thread: one for each device, shared by all rooms (DESIGN 8, "Newest job wins").

A room's job is a snapshot of its strokes. A newer job replaces an older one at the next level boundary, except that a
preview pass runs through to its finest level when that level was last delivered more than ``FINEST_WITHIN`` seconds
ago: drawing without a pause must not starve the fine levels. Rooms take turns level by level.

Results are handed to ``deliver`` in this thread; it returns when the room has taken them, which bounds what is held.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

from esker import contract as c
from esker.session.ports import LevelResult, Solver, SolverFactory

log = logging.getLogger("esker.worker")

FINEST_WITHIN: Final = 0.150
MAX_FAILURES: Final = 3
"""Failed jobs in a row before the solver is replaced by the NumPy one."""
FALLBACK_DEVICE: Final = "numpy"


@dataclass(frozen=True)
class Job:
    """What to solve. ``clock`` is the document's."""

    clock: int
    strokes: tuple[c.Stroke, ...]
    settings: c.TerrainSettings


@dataclass(eq=False)
class Client:
    """A room as the worker sees it. The callbacks are called in the worker's thread."""

    levels: int
    deliver: Callable[[int, LevelResult], None]
    failed: Callable[[int, str], None]
    newest: Job | None = None
    running: Job | None = None
    steps: Iterator[LevelResult | None] | None = None
    previewing: bool = False
    finest_at: float = field(default=float("-inf"))


class Worker:
    """Owns the solver and the thread it runs in."""

    def __init__(
        self, factory: SolverFactory, device: str | None = None, now: Callable[[], float] = time.monotonic
    ) -> None:
        """Makes the solver in the new thread; ``start`` waits for it."""
        self._factory, self._device, self._now = factory, device, now
        self._changed = threading.Condition()
        self._clients: list[Client] = []
        self._leaving: list[Client] = []
        self._stopping = False
        self._failures = 0
        self._solver: Solver | None = None
        self._broken: Exception | None = None
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, name="solver", daemon=True)

    def start(self) -> None:
        """Starts the thread and waits until the solver is made. Raises what its making raised."""
        self._thread.start()
        self._ready.wait()
        if self._broken is not None:
            raise self._broken

    @property
    def device_name(self) -> str:
        """The device that the solver runs on."""
        return self._solver.device_name if self._solver is not None else "no solver"

    def add(
        self, levels: int, deliver: Callable[[int, LevelResult], None], failed: Callable[[int, str], None]
    ) -> Client:
        """A new room. ``deliver(clock, result)`` and ``failed(clock, sentence)`` are called in the worker's thread."""
        client = Client(levels, deliver, failed)
        with self._changed:
            self._clients.append(client)
        return client

    def request(self, client: Client, job: Job) -> None:
        """The newest job of a room; replaces one that waits or runs."""
        with self._changed:
            client.newest = job
            self._changed.notify()

    def remove(self, client: Client) -> None:
        """The room closes: whatever runs for it is dropped."""
        with self._changed:
            if client in self._clients:
                self._clients.remove(client)
                self._leaving.append(client)
            client.newest = None
            self._changed.notify()

    def stop(self) -> None:
        """Ends the thread at the next level boundary."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(timeout=10)

    # --- in the thread ------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._solver = self._factory(self._device)
        except Exception as error:
            self._broken = error
            return
        finally:
            self._ready.set()
        while True:
            with self._changed:
                while not self._stopping and not self._leaving and not any(map(_active, self._clients)):
                    self._changed.wait()
                if self._stopping:
                    return
                turn = [x for x in self._clients if _active(x)]
                leaving, self._leaving = self._leaving, []
            for client in leaving:  # a solve must end in the thread that began it
                _close(client.steps)
                client.steps = None
            for client in turn:
                if self._stopping:
                    return
                self._step(client)

    def _step(self, client: Client) -> None:
        """One level of one room, or a part of one that the solver can be left at."""
        self._maybe_restart(client)
        job, steps = client.running, client.steps
        if job is None or steps is None:
            return
        try:
            result = next(steps)
        except StopIteration:
            client.steps = None
            return
        except Exception as error:
            self._failed(client, job, error)
            return
        self._failures = 0
        if result is None:
            return
        if result.level >= client.levels:
            client.previewing = False
            client.finest_at = self._now()
        if client in self._clients:
            try:
                client.deliver(job.clock, result)
            except Exception:
                log.exception("level %d at clock %d could not be delivered", result.level, job.clock)

    def _maybe_restart(self, client: Client) -> None:
        with self._changed:
            if client.newest is None:
                return
            starving = self._now() - client.finest_at > FINEST_WITHIN
            if client.steps is not None and client.previewing and starving:
                return
            client.running, client.newest = client.newest, None
        _close(client.steps)
        job = client.running
        assert self._solver is not None
        client.previewing = True
        try:
            client.steps = iter(self._solver.steps(job.strokes, job.settings, client.levels))
        except Exception as error:
            self._failed(client, job, error)

    def _failed(self, client: Client, job: Job, error: Exception) -> None:
        log.error("solving at clock %d failed: %s: %s", job.clock, type(error).__name__, error)
        client.steps = None
        self._failures += 1
        note = "The ground could not be computed; it will be tried again with the next change."
        if self._failures >= MAX_FAILURES and self._device != FALLBACK_DEVICE:
            note = self._fall_back() or note
        client.failed(job.clock, note)

    def _fall_back(self) -> str | None:
        """Every room goes on with the NumPy solver; returns what to tell people, None when that cannot be made."""
        self._device, self._failures = FALLBACK_DEVICE, 0
        try:
            self._solver = self._factory(FALLBACK_DEVICE)
        except Exception:
            log.exception("the fallback solver could not be made")
            return None
        log.warning("the solver now runs on %s", self._solver.device_name)
        for other in self._clients:
            _close(other.steps)
            other.steps = None
            with self._changed:
                other.newest = other.newest or other.running
        return f"The solver now runs on {self._solver.device_name}: slower, but it goes on."


def _active(client: Client) -> bool:
    return client.newest is not None or client.steps is not None


def _close(steps: Iterator[LevelResult | None] | None) -> None:
    close = getattr(steps, "close", None)
    if close is not None:
        close()
