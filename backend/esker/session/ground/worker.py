"""The solver's thread: one for each device, shared by all rooms (DESIGN 8, "Newest job wins").

It carries out what ``machine.py`` and ``schedule.py`` say, and decides nothing: a room's events go into the machine,
the effects that come out are done here. What happens when a solve fails say ``repairs.py`` and ``recovery.py``.

Results are handed to ``deliver`` in this thread; it returns when the room has taken them, which bounds what is held.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Hashable, Sequence
from typing import Final, TypeVar

from esker.events import Level, Preview
from esker.session.ground import effects as does
from esker.session.ground import machine, schedule, states
from esker.session.ground.client import Client, Deliver
from esker.session.ground.effects import Effect, Event
from esker.session.ground.jobs import Job
from esker.session.ground.ports import Refinement, Solver, SolverFactory, Tidying
from esker.session.ground.recovery import LAST_RESORT, Devices, Diagnose, unknown
from esker.session.ground.repairs import Repairs
from esker.session.ground.states import Ground
from esker.session.ground.tally import Tally

log = logging.getLogger("esker.worker")

L = TypeVar("L", bound=Level)

__all__ = ["Client", "Job", "Worker"]

IDLE_CHECK: Final = 1.0
"""The thread looks this often at failures that may be tried again, when nothing else wakes it."""
TIDY_EVERY: Final = 5.0
"""The thread looks this often at what the solver keeps that nobody uses, on a server that is never idle."""


class Worker:
    """The solver, and the thread that it runs in."""

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
        self._now = now
        self._changed = threading.Condition()
        self._grounds: dict[Client, Ground] = {}
        """The grounds of all rooms. Access to them, to ``_tally`` and to the flags below needs the lock."""
        self._tally: Tally[Client] = Tally(schedule.default_budget() if budget is None else budget)
        self._leaving: list[Client] = []
        self._stopping = False
        devices = Devices(device, candidates)
        self._repairs = Repairs(factory, devices, self._rooms, diagnose, now, self._happen)
        self._broken: Exception | None = None
        self._tidied = now()
        self.spent = 0.0
        """Seconds that slices of solves took, of all rooms since the start."""
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
        return self._repairs.name

    @property
    def _solver(self) -> Solver:
        assert self._repairs.solver is not None
        return self._repairs.solver

    def add(
        self,
        levels: int,
        deliver: Deliver,
        tell: Callable[[str], None],
        refinement: Refinement | None = None,
        limit: Callable[[int], None] | None = None,
        confirm: Callable[[int, int], None] | None = None,
        note: Callable[[int, Preview], None] | None = None,
        home: Hashable = None,
    ) -> Client:
        """A new room. All callbacks are called in the worker's thread.

        ``deliver(clock, level)``: to be shown. ``note(clock, preview)``: not to be shown, as the finest follows soon.
        ``tell(sentence)``: something went wrong, or right again. ``limit(top)``: from now on levels 0..top come, as
        finer ones do not fit the device, or fit it again. ``refinement``: who wants tiles above the global levels.
        ``confirm(clock, top)``: the heights that were delivered last are those of this job too; its channels have come.
        ``home``: for whom the room's work is done (``tally.py``).
        """
        client = Client(levels, deliver, tell, refinement, limit, confirm, note)
        with self._changed:
            self._grounds[client] = client.ground
            self._tally = self._tally.opened(client, home)
        return client

    def move(self, client: Client, home: Hashable) -> None:
        """From now on the room's work is done for another home."""
        with self._changed:
            self._tally = self._tally.moved(client, home)

    def attend(self, client: Client, by_somebody: bool) -> None:
        """From now on somebody is in the room, or nobody: the work of such a room is done behind that of others."""
        with self._changed:
            self._tally = self._tally.attended(client, by_somebody)

    def request(self, client: Client, job: Job) -> None:
        """Takes the newest job of a room. It replaces the job that waits or runs."""
        self._happen(client, does.Requested(job))

    def nudge(self, client: Client) -> None:
        """Says that the room may want other refined tiles than before."""
        with self._changed:
            client.work.refined.clear()
            self._happen(client, does.Nudged())

    def remove(self, client: Client) -> None:
        """Drops whatever runs for a room that closes."""
        with self._changed:
            if self._grounds.pop(client, None) is not None:
                self._tally = self._tally.closed(client)
                self._leaving.append(client)
            self._changed.notify()

    def stop(self) -> None:
        """Ends the thread at the next place where the solver can be left."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(timeout=10)

    # --- in the thread ----------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._repairs.open()
        except Exception as error:
            self._broken = error
            return
        finally:
            self._ready.set()
        while True:
            with self._changed:
                while (client := self._choose()) is None and not self._stopping and not self._leaving:
                    rest = schedule.rested_in(self._grounds, self._now())
                    if not self._changed.wait(IDLE_CHECK if rest is None else rest) and rest is None:
                        break
                if self._stopping:
                    break
            self._let_go()
            self._repairs.retry()
            self._tidy(idle=client is None)
            if client is not None:
                self._step(client)  # one that left meanwhile has no slice
        for left in self._rooms():
            left.work.drop()

    def _let_go(self) -> None:
        """Ends the solves of rooms that left, which must happen in the thread that began them.

        Nothing here may know such a room afterwards: while this thread waits, that would keep all of its ground.
        """
        with self._changed:
            leaving, self._leaving = self._leaving, []
        for gone in leaving:
            gone.work.drop()

    def _rooms(self) -> list[Client]:
        return list(self._grounds)

    def _choose(self) -> Client | None:
        client, self._tally = schedule.choose(self._grounds, self._now(), self._tally)
        return client

    def _tidy(self, idle: bool) -> None:
        """Gives back memory that nobody uses: while nothing is to be done, and now and then on a server that is never
        idle."""
        now = self._now()
        if isinstance(self._solver, Tidying) and (idle or now - self._tidied >= TIDY_EVERY):
            self._tidied = now
            self._solver.tidy()

    def _step(self, client: Client) -> None:
        """Runs one slice of one room: the solver works until it can be left."""
        with self._changed:
            if client not in self._grounds:
                return
            began = self._now()
            begins, gone, self._tally = schedule.begin(client, self._grounds, began, self._tally)
        for other in gone:
            other.work.drop()
            self._happen(other, does.Dropped())
            self._happen(other, does.Again())
        self._happen(client, does.Turn(begins))
        with self._changed:
            ended = self._now()
            self._tally = self._tally.ended(client, ended)
            self.spent += ended - began

    def _happen(self, client: Client, event: Event) -> None:
        """Puts an event into the machine of a room and carries its effects out, unless the room has closed."""
        with self._changed:
            before, now = client.ground, self._now()
            client.ground, effects = machine.next(before, event, now)
            if client in self._grounds:
                self._grounds[client] = client.ground
                if states.is_at_rest(before) and not states.is_at_rest(client.ground):
                    self._tally = self._tally.noted(client, ran_at=now)
            self._changed.notify()
        for effect in effects:
            if not self._do(client, effect):
                break

    def _do(self, client: Client, effect: Effect) -> bool:
        """Carries out an effect. Returns False when the solver failed at it."""
        match effect:
            case does.Deliver(job, level):
                self._deliver(client, job, level, client.deliver)
            case does.Note(job, preview):
                self._deliver(client, job, preview, client.note)
            case does.Confirm(job, top):
                if client.confirm is not None and client in self._grounds:
                    client.confirm(job.clock, top)
            case does.Yield(seconds):
                with self._changed:
                    self._changed.wait_for(
                        lambda: self._stopping or schedule.has_something_else(client, self._grounds), seconds
                    )
            case does.GiveBack():
                client.work.retained = None
            case does.NoteSolved():
                self._repairs.solved(client)
            case does.Apologise(again):
                self._repairs.apologise(client, again)
            case does.Refine():
                self._refine(client)
            case _:
                try:
                    event = self._compute(client, effect)
                except Exception as error:
                    self._repairs.failed(client, error)
                    return False
                if event is not None:
                    self._happen(client, event)
        return True

    def _compute(self, client: Client, effect: Effect) -> Event | None:
        """Carries out an effect that needs the solver. Returns the event that came of it."""
        work = client.work
        match effect:
            case does.Leave(keeps):
                work.leave(keeps)
            case does.OpenSolve():
                self._repairs.inform(client)
                return does.Opened(work.open_solve(self._solver, effect, basis=client.refinement is not None))
            case does.OpenChannels(job, top, beside):
                if not beside:
                    self._repairs.inform(client)
                work.open_channels(self._solver, job, top, beside=beside)
            case does.AdoptChannels():
                self._repairs.inform(client)
                work.adopt_channels()
            case does.OpenRefinement(basis):
                work.refiner = self._solver.refiner(basis)
            case does.Step():
                event = work.step()
                if isinstance(event, does.BaseShown):
                    self._happen(client, event)
                    return work.step()
                return event
            case does.StepBeside():
                return does.Beside(work.step_beside())
            case does.PreviewEarly(job):
                return does.EarlyMade(job, work.preview_early(job))
        return None

    def _deliver(self, client: Client, job: Job, level: L, to: Callable[[int, L], None] | None) -> None:
        if client not in self._grounds or to is None:
            return
        try:
            to(job.clock, level)
        except Exception:
            log.exception("level %d at clock %d could not be delivered", level.level, job.clock)

    def _refine(self, client: Client) -> None:
        """Runs one slice of refinement: at most one tile is finished."""
        refinement = client.refinement
        assert refinement is not None
        try:
            if not client.work.looks(refinement, self._is_urgent):
                self._happen(client, does.NothingRequested())
                return
            tile = client.work.refine()
        except Exception as error:
            self._repairs.unrefined(client, error)
            return
        if tile is not None:
            refinement.deliver_tile(client.ground.shown.clock, tile)

    def _is_urgent(self) -> bool:
        """Returns whether refinement is to be left for something else.

        It is asked a thousand times a second, so it takes no lock.
        """
        called = any(ground.jobs.wanted is not None for ground in tuple(self._grounds.values()))
        return self._stopping or bool(self._leaving) or called
