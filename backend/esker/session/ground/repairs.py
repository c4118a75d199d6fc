"""Ways on for the solver's thread when a solve fails: again, coarser, later, or on another device (DESIGN 8, 16).

A device is left only when it fails on a scene of the solver's own: one terrain must not take it from all others. What
cannot be computed is a fault of its job, which is tried again twice and then waits for a change of its document.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Final

from esker.session.ground import effects as does
from esker.session.ground import states
from esker.session.ground.client import Client
from esker.session.ground.effects import Event
from esker.session.ground.ports import Proving, Solver, SolverFactory
from esker.session.ground.recovery import LAST_RESORT, Devices, Diagnose, Fault
from esker.session.ground.states import Failed

log = logging.getLogger("esker.worker")

PROVE_EVERY: Final = 2.0
"""A device that was found in order counts as in order for so many seconds: failed jobs ask for no more than this."""
AGAIN: Final = "The ground could not be computed; it will be tried again soon."
GIVEN_UP: Final = "The ground could not be computed, and waits for the next change."


class Repairs:
    """The solver, the devices that it may run on, and how rooms go on after a failure. Belongs to the worker's thread.

    ``solver`` None: it was not made yet. ``notice``: what is wrong with the device for as long as it lasts, told to
    every room once.
    """

    solver: Solver | None = None
    notice: str = ""

    def __init__(
        self,
        factory: SolverFactory,
        devices: Devices,
        rooms: Callable[[], list[Client]],
        diagnose: Diagnose,
        now: Callable[[], float],
        happen: Callable[[Client, Event], None],
    ) -> None:
        """``rooms()`` are all that are open; ``happen`` tells the ground of one what has happened."""
        self._factory, self.devices, self._rooms = factory, devices, rooms
        self._diagnose, self._now, self._happen = diagnose, now, happen
        self._proved = -math.inf

    def open(self) -> None:
        """Makes the first solver. Raises what its making raises."""
        self.solver = self._factory(self.devices.preferred)
        self.devices.opened(self.solver.device_name, self._now())
        if self.devices.second_best:
            self.notice = f"The solver runs on {self.solver.device_name}: slower, but it goes on."

    @property
    def name(self) -> str:
        """The device that the solver runs on."""
        return self.solver.device_name if self.solver is not None else "no solver"

    def inform(self, client: Client) -> None:
        """Tells a room what is wrong with the device, once."""
        if self.notice and client.notified != self.notice:
            self._tell(client, self.notice)

    # --- a failure ----------------------------------------------------------------------------------------------

    def failed(self, client: Client, error: Exception) -> None:
        """Drops what runs for a room whose solve failed, and has the room go on."""
        fault = self._diagnose(error)
        log.error("solving at %s failed (%s): %s: %s", _clock(client), fault.value, type(error).__name__, error)
        self._drop(client)
        if fault == Fault.MEMORY and client.ground.top > 0:
            self._coarser(client)
        elif fault == Fault.JOB:
            client.tell(str(error))
            self._happen(client, does.Unsolvable())
        elif fault == Fault.FLAW or not self._ails(fault) or not self._next_device(error):
            self._happen(client, does.Unsolved())

    def unrefined(self, client: Client, error: Exception) -> None:
        """Deals with refining that failed.

        The ground itself is there, so only a broken device is a reason to solve it again.
        """
        fault = self._diagnose(error)
        if fault == Fault.DEVICE:
            self.failed(client, error)
            return
        log.error("refining at %s failed (%s): %s: %s", _clock(client), fault.value, type(error).__name__, error)
        self._drop(client, settled=True)
        memory = f"{self.name} has too little memory for finer detail just now."
        client.tell(memory if fault == Fault.MEMORY else "Finer detail could not be computed here.")

    def apologise(self, client: Client, again: bool) -> None:
        """Tells a room that its job could not be computed, and whether that is tried again."""
        client.tell(AGAIN if again else GIVEN_UP)

    def solved(self, client: Client) -> None:
        """Notes that a whole solve went through."""
        self.devices.settled()
        if client.ground.top == client.levels:
            client.backoff.clear()

    def _drop(self, client: Client, settled: bool = False) -> None:
        client.work.drop()
        self._happen(client, does.Dropped(settled))

    def _ails(self, fault: Fault) -> bool:
        """Returns whether the present device is broken: it does not do a scene that is known to work, opened anew
        neither."""
        if self.devices.current == LAST_RESORT:
            return False
        now = self._now()
        if now - self._proved < PROVE_EVERY:
            return False
        if not isinstance(self.solver, Proving):
            return self.devices.blame(fault)
        try:
            self.solver.prove()
        except Exception as error:
            log.warning("%s fails on a scene that is known to work: %s", self.name, error)
            if not self._reopened():
                return True
        self._proved = now
        return False

    def _reopened(self) -> bool:
        """Returns whether the device works under a new context: what one job has broken need not be lost to all."""
        try:
            solver = self._factory(self.devices.current)
        except Exception as error:
            log.warning("%s cannot be opened again: %s", self.name, error)
            return False
        if solver.device_name != self.name:
            return False
        self.solver = solver
        for client in self._rooms():
            if states.holds_device(client.ground):
                self._drop(client)
                self._happen(client, does.Again())
        return True

    def _coarser(self, client: Client) -> None:
        """Has the room go on one level coarser, until there may be memory again."""
        top = client.ground.top - 1
        client.backoff.failed(self._now())
        client.tell(
            f"{self.name} has too little memory for level {top + 1}: the ground is shown up to level {top} for now."
        )
        self._limit(client, top)
        self._happen(client, does.Coarser())

    def _limit(self, client: Client, top: int) -> None:
        if client.limit is not None:
            client.limit(top)

    def _next_device(self, error: Exception) -> bool:
        """Has every room go on with the next device that works. Returns False when none works."""
        left = self.name
        for name in self.devices.others():
            try:
                solver = self._factory(name)
            except Exception:
                log.exception("the device %s cannot be used either", name)
                continue
            log.warning("the solver now runs on %s", solver.device_name)
            self.solver = solver
            self.devices.left(name, self._now())
            why = str(error).strip().rstrip(".") or f"{left} failed"
            self.notice = f"{why}. The solver now runs on {solver.device_name} and goes on."
            for client in self._rooms():
                self._drop(client)
                self._tell(client, self.notice)
                self._happen(client, does.Again())
            return True
        return False

    def _tell(self, client: Client, sentence: str) -> None:
        client.notified = sentence
        client.tell(sentence)

    # --- later --------------------------------------------------------------------------------------------------

    def retry(self) -> None:
        """Tries better devices, finer levels and failed jobs again when it is time."""
        now = self._now()
        if self.devices.backoff.due(now):
            self._better_device(now)
        for client in self._rooms():
            state, coarser = client.ground.state, client.ground.top < client.levels
            if coarser and client.backoff.due(now) and states.is_at_rest(client.ground):
                self._limit(client, client.levels)
                self._happen(client, does.Finer(client.levels))
            elif isinstance(state, Failed) and state.retry_at <= now:
                self._happen(client, does.Again())

    def _better_device(self, now: float) -> None:
        """Goes over to a better device. Solves in progress end where they began; the next ones use it."""
        for name in self.devices.better():
            try:
                solver = self._factory(name)
            except Exception as error:
                log.info("the device %s still does not work: %s", name, error)
                continue
            log.warning("the solver runs on %s again", solver.device_name)
            self.solver, self.notice = solver, ""
            self.devices.returned(name)
            for client in self._rooms():
                if client.notified:
                    client.tell(f"The solver runs on {solver.device_name} again.")
                client.notified = ""
            break
        self.devices.backoff.failed(now)


def _clock(client: Client) -> str:
    begun = client.ground.jobs.begun
    return "no clock" if begun is None else f"clock {begun.job.clock}"
