"""The solver's thread: one for each device, shared by all rooms (DESIGN 8, "Newest job wins").

A room's job is a snapshot of its strokes. A newer job replaces an older one wherever the solver can be left, except in
a preview pass that is about to end, or whose finest level was last delivered more than ``FINEST_WITHIN`` seconds ago:
drawing without a pause must not starve the fine levels. Whose turn it is says ``schedule.py``; what happens when a
device fails, ``recovery.py``.

Results are handed to ``deliver`` in this thread; it returns when the room has taken them, which bounds what is held.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from esker import contract as c
from esker.session.laying import blank_levels
from esker.session.ports import Base, LevelResult, Refinement, Solver, SolverFactory, Tidying
from esker.session.recovery import LAST_RESORT, Devices, Diagnose, Fault, unknown
from esker.session.schedule import Client, Deliver, Glimpsing, Job, Schedule

log = logging.getLogger("esker.worker")

__all__ = ["Client", "Job", "Worker"]

GROUND: Final = frozenset({c.Channel.BASE, c.Channel.SURVEY})
"""Channels of the elevation layers: no solve changes them."""
LULLS: Final = {False: 0.002, True: 0.020}
"""Seconds that a coarsest preview, and (True) a finest one, has to become frames before all cores compute what comes
next, unless something else waits."""
IDLE_CHECK: Final = 1.0
"""Seconds between looks at what may be tried again, when nothing else wakes the thread."""
TIDY_EVERY: Final = 30.0
"""Seconds between looks at what the solver keeps of rooms that have gone, on a server that is never idle."""
AGAIN_AFTER: Final = 3.0
"""Seconds until a job that failed for reasons unknown is tried again without a change."""
AGAIN: Final = "The ground could not be computed; it will be tried again soon."


class Worker:
    """Owns the solver and the thread it runs in."""

    def __init__(
        self,
        factory: SolverFactory,
        device: str | None = None,
        now: Callable[[], float] = time.monotonic,
        *,
        candidates: Callable[[], Sequence[str]] = lambda: [LAST_RESORT],
        diagnose: Diagnose = unknown,
        budget: int | None = None,
    ) -> None:
        """Makes the solver in the new thread; ``start`` waits for it.

        ``candidates``: names of devices for ``factory``, best first; ``diagnose`` says what an exception of the solver
        means; ``budget``: bytes that solves in progress may take together (default: ``schedule.BUDGET``).
        """
        self._factory, self._now, self._diagnose = factory, now, diagnose
        self._devices = Devices(device, candidates)
        self._changed = threading.Condition()
        self._schedule = Schedule(now) if budget is None else Schedule(now, budget)
        self._leaving: list[Client] = []
        self._stopping = False
        self._solver: Solver | None = None
        self._broken: Exception | None = None
        self._tidied = now()
        self._standing = ""
        """What is wrong with the device for as long as it lasts, told to every room once."""
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
        self,
        levels: int,
        deliver: Deliver,
        tell: Callable[[str], None],
        refinement: Refinement | None = None,
        limit: Callable[[int], None] | None = None,
        confirm: Callable[[int, int], None] | None = None,
    ) -> Client:
        """A new room. All callbacks are called in the worker's thread.

        ``deliver(clock, result, show)``: ``show`` False for a coarse preview that the finest will replace at once.
        ``tell(sentence)``: something went wrong, or right again. ``limit(top)``: from now on levels 0..top come, as
        finer ones do not fit the device, or fit it again. ``refinement``: who wants tiles above the global levels.
        ``confirm(clock, top)``: the heights that were delivered last are those of this job too; its channels have come.
        """
        client = Client(levels, deliver, tell, refinement, limit, confirm)
        with self._changed:
            self._schedule.clients.append(client)
        return client

    def request(self, client: Client, job: Job) -> None:
        """The newest job of a room; replaces one that waits or runs."""
        with self._changed:
            client.request(job, self._now())
            self._changed.notify()

    def nudge(self, client: Client) -> None:
        """The room may want other refined tiles than before."""
        with self._changed:
            client.refined.clear()
            client.looking = True
            self._changed.notify()

    def remove(self, client: Client) -> None:
        """The room closes: whatever runs for it is dropped."""
        with self._changed:
            if client in self._schedule.clients:
                self._schedule.clients.remove(client)
                self._leaving.append(client)
            client.newest = None
            self._changed.notify()

    def stop(self) -> None:
        """Ends the thread where the solver can next be left."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(timeout=10)

    # --- in the thread ------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._solver = self._factory(self._devices.preferred)
            self._devices.opened(self._solver.device_name, self._now())
            if self._devices.second_best:
                self._standing = f"The solver runs on {self._solver.device_name}: slower, but it goes on."
        except Exception as error:
            self._broken = error
            return
        finally:
            self._ready.set()
        while True:
            with self._changed:
                while (client := self._schedule.pick()) is None and not self._stopping and not self._leaving:
                    if not self._changed.wait(IDLE_CHECK):
                        break
                if self._stopping:
                    break
                leaving, self._leaving = self._leaving, []
            for gone in leaving:  # a solve must end in the thread that began it
                gone.drop()
            self._retry()
            self._tidy(idle=client is None)
            if client is not None and client not in leaving:
                self._step(client)
        for left in self._schedule.clients:
            left.drop()

    def _tidy(self, idle: bool) -> None:
        """Memory that nobody uses goes back while nothing is to be done, and where that never comes too."""
        now = self._now()
        if isinstance(self._solver, Tidying) and (idle or now - self._tidied >= TIDY_EVERY):
            self._tidied = now
            self._solver.tidy()

    def _step(self, client: Client) -> None:
        """One slice of one room: what the solver does until it can be left."""
        with self._changed:
            job = self._schedule.begin(client)
        if job is not None:
            self._open(client, job)
        if client.aside:
            self._aside(client)
        elif client.glimpse_due:
            self._glimpse(client)
        elif client.steps is not None:
            self._solve(client)
        elif client.refiner is not None:
            self._refine(client)
        self._schedule.ended(client)

    def _open(self, client: Client, job: Job) -> None:
        """Starts a solve; it takes memory of its own until it ends."""
        assert self._solver is not None
        if self._standing and client.told != self._standing:
            client.told = self._standing
            client.tell(self._standing)
        try:
            client.steps = self._channels(job, client.top) if client.light else self._steps(client, job)
        except Exception as error:
            self._failed(client, job, error)

    def _channels(self, job: Job, top: int) -> Iterator[LevelResult | None]:
        assert self._solver is not None
        based = {} if job.base is None else {"base": job.base}
        return iter(self._solver.channels(job.strokes, job.settings, top, **based))

    def _steps(self, client: Client, job: Job) -> Iterator[LevelResult | None]:
        """First the base, where another one was shown, then what is solved on it."""
        assert self._solver is not None
        more: dict[str, Any] = {} if job.base is None else {"base": job.base}
        if client.is_ahead(job):
            more["coarsest"] = False
        refines = client.refinement is not None
        solve = iter(self._solver.steps(job.strokes, job.settings, client.top, basis=refines, **more))
        if client.stands_on(job.base):
            return solve
        levels = blank_levels(client.top) if job.base is None else self._solver.base_levels(job.base, client.top)
        return self._laid(client, job.base, levels, solve)

    def _laid(
        self,
        client: Client,
        base: Base | None,
        levels: Iterator[LevelResult | None],
        solve: Iterator[LevelResult | None],
    ) -> Iterator[LevelResult | None]:
        top = client.top
        client.laid = (None, -2)  # until all is delivered it is neither the old base nor the new one
        try:
            yield from levels
            client.laid = (base, top)
            yield from solve
        finally:
            for work in (levels, solve):
                close = getattr(work, "close", None)
                if close is not None:
                    close()

    def _solve(self, client: Client) -> None:
        job, steps, client.stepped = client.running, client.steps, True
        assert job is not None
        assert steps is not None
        try:
            result = next(steps)
        except StopIteration:
            client.ended()
            if client.light:
                self._confirm(client, job)
                return
            self._devices.settled()
            if client.top == client.levels:
                client.backoff.clear()
            return
        except Exception as error:
            self._failed(client, job, error)
            return
        if result is not None:
            show = result.channel in GROUND or client.took(result, self._now())
            self._deliver(client, job, result, show)
            if result.channel == c.Channel.HEIGHT and not result.settled and result.level in (0, client.top):
                self._lull(client, LULLS[result.level == client.top])
            client.remains = None

    def _lull(self, client: Client, seconds: float) -> None:
        """Leaves the processor to those who bring people what was just delivered."""
        with self._changed:
            self._changed.wait_for(lambda: self._stopping or self._schedule.urges(client), seconds)

    def _aside(self, client: Client) -> None:
        """The channels of the newest job, while the running one goes on."""
        job = client.newest
        assert job is not None
        assert client.running is not None
        assert self._solver is not None
        client.aside_clock, client.aside_job, client.painted = job.clock, job, job.painted
        try:
            for result in self._channels(job, client.top):
                if result is not None:
                    self._deliver(client, job, result, show=True)
        except Exception as error:
            self._failed(client, client.running, error)

    def _glimpse(self, client: Client) -> None:
        """The coarsest preview of the newest job, while the pass of an older one goes on."""
        job, steps = client.newest, client.steps
        assert job is not None
        assert client.running is not None
        assert isinstance(steps, Glimpsing)
        client.glimpsed, client.ahead, client.stepped = job, False, False
        try:
            result = steps.glimpse(job.strokes, job.settings, job.base)
        except Exception as error:
            self._failed(client, client.running, error)
            return
        if result is not None:
            client.ahead = True
            self._deliver(client, job, result, show=True)

    def _confirm(self, client: Client, job: Job) -> None:
        client.light = False
        if client.confirm is not None and client in self._schedule.clients:
            client.confirm(job.clock, client.top)

    def _deliver(self, client: Client, job: Job, result: LevelResult, show: bool) -> None:
        if result.basis is not None and self._solver is not None:
            client.refiner, client.looking = self._solver.refiner(result.basis), True
        if client not in self._schedule.clients:
            return
        if result.channel != c.Channel.HEIGHT and result.channel not in GROUND and job.clock < client.aside_clock:
            return  # newer ones have come already
        try:
            client.deliver(job.clock, result, show)
        except Exception:
            log.exception("level %d at clock %d could not be delivered", result.level, job.clock)

    def _refine(self, client: Client) -> None:
        """One slice of refinement: at most one tile is finished."""
        job, refinement = client.running, client.refinement
        assert job is not None
        assert refinement is not None
        try:
            if client.tiles is None and not self._look(client, refinement):
                return
            assert client.tiles is not None
            tile = next(client.tiles)
        except StopIteration:
            client.tiles = None
            return
        except Exception as error:
            self._unrefined(client, job, error)
            return
        if tile is not None:
            client.refined.add(tile.key)
            refinement.deliver_tile(client.ground_clock, tile)

    def _unrefined(self, client: Client, job: Job, error: Exception) -> None:
        """Refining failed. The ground itself is there, so only a broken device is a reason to solve it again."""
        fault = self._diagnose(error)
        if fault == Fault.DEVICE:
            self._failed(client, job, error)
            return
        log.error("refining at clock %d failed (%s): %s: %s", job.clock, fault.value, type(error).__name__, error)
        ground = client.ground
        client.drop()
        client.ground = ground
        memory = f"{self.device_name} has too little memory for finer detail just now."
        client.tell(memory if fault == Fault.MEMORY else "Finer detail could not be computed here.")

    def _look(self, client: Client, refinement: Refinement) -> bool:
        """Starts on the tiles that are wanted now and were not made from this solve yet; False when there are none."""
        assert client.refiner is not None
        keys = [key for key in refinement.wanted() if key not in client.refined]
        client.looking = bool(keys)
        if keys:
            client.tiles = iter(client.refiner.tiles(keys, self._urgent))
        return bool(keys)

    def _urgent(self) -> bool:
        """Whether refinement is to be left for something else. Asked a thousand times a second, so without the lock."""
        return self._stopping or bool(self._leaving) or self._schedule.called

    # --- faults -------------------------------------------------------------------------------------------------

    def _failed(self, client: Client, job: Job, error: Exception) -> None:
        fault = self._diagnose(error)
        log.error("solving at clock %d failed (%s): %s: %s", job.clock, fault.value, type(error).__name__, error)
        client.drop()
        if fault == Fault.MEMORY and client.top > 0:
            self._coarser(client)
        elif fault == Fault.JOB:
            client.tell(str(error))
        elif not self._devices.blame(fault) or not self._next_device(error):
            client.again_at = self._now() + AGAIN_AFTER
            client.tell(AGAIN)

    def _coarser(self, client: Client) -> None:
        """The room goes on one level coarser, until there may be memory again."""
        client.top -= 1
        client.laid = (client.laid[0], min(client.laid[1], client.top))
        client.backoff.failed(self._now())
        client.tell(
            f"{self.device_name} has too little memory for level {client.top + 1}: "
            f"the ground is shown up to level {client.top} for now.",
        )
        self._limit(client)
        self._again(client)

    def _limit(self, client: Client) -> None:
        if client.limit is not None:
            client.limit(client.top)

    def _next_device(self, error: Exception) -> bool:
        """Every room goes on with the next device that works. False when none could be had."""
        left = self.device_name
        for name in self._devices.others():
            try:
                solver = self._factory(name)
            except Exception:
                log.exception("the device %s cannot be used either", name)
                continue
            log.warning("the solver now runs on %s", solver.device_name)
            self._solver = solver
            self._devices.left(name, self._now())
            why = str(error).strip().rstrip(".") or f"{left} failed"
            self._standing = f"{why}. The solver now runs on {solver.device_name} and goes on."
            for client in list(self._schedule.clients):
                client.drop()
                self._tell(client, self._standing)
                self._again(client)
            return True
        return False

    def _tell(self, client: Client, sentence: str) -> None:
        client.told = sentence
        client.tell(sentence)

    def _again(self, client: Client) -> None:
        with self._changed:
            client.again(self._now())

    def _retry(self) -> None:
        """Tries better devices, finer levels and failed jobs again when it is time."""
        now = self._now()
        if self._devices.backoff.due(now):
            self._better_device(now)
        for client in list(self._schedule.clients):
            if client.top < client.levels and client.backoff.due(now) and client.at_rest:
                client.top = client.levels
                self._limit(client)
                self._again(client)
            elif client.again_at <= now:
                self._again(client)

    def _better_device(self, now: float) -> None:
        """Solves in progress end where they began; the next ones use the better device."""
        for name in self._devices.better():
            try:
                solver = self._factory(name)
            except Exception as error:
                log.info("the device %s still does not work: %s", name, error)
                continue
            log.warning("the solver runs on %s again", solver.device_name)
            self._solver, self._standing = solver, ""
            self._devices.returned(name)
            for client in list(self._schedule.clients):
                if client.told:
                    client.tell(f"The solver runs on {solver.device_name} again.")
                client.told = ""
            break
        self._devices.backoff.failed(now)
