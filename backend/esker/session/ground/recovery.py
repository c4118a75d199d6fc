"""A policy for failures of the solver's device (DESIGN 8, 16): which device is next, and when to try a better one
again. It is pure, without threads or OpenCL: the worker tells it what happened, asks, and acts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

RETRY_SECONDS: Final = 60.0
"""A better device, or a finer level, is tried again so many seconds after a fault, then after twice as many, and so
on."""
RETRY_AT_MOST: Final = 960.0
MAX_FAILURES: Final = 3
"""A job that failed so often waits for a change. Where a solver cannot prove its device, so many jobs in a row that
fail for reasons unknown are taken for a fault of the device."""
LAST_RESORT: Final = "numpy"
"""Name of the solver that needs no device."""


class Fault(Enum):
    """The reason for which a solve failed."""

    MEMORY = "memory"
    """The level does not fit the device's memory; a coarser one may."""
    DEVICE = "device"
    """The device is lost, or does not work: it cannot be used for now."""
    JOB = "job"
    """The job itself failed: no device would do better, and trying again is in vain until the job changes."""
    FLAW = "flaw"
    """The program met numbers of the job that it cannot compute. The job may be tried again, on the same device."""
    UNKNOWN = "unknown"
    """Either the job or the device failed; nobody knows which."""


Diagnose = Callable[[Exception], Fault]


def unknown(_: Exception) -> Fault:
    """A diagnosis for solvers of which nothing is known."""
    return Fault.UNKNOWN


@dataclass
class Backoff:
    """When something is tried again: after ``RETRY_SECONDS``, doubling up to ``RETRY_AT_MOST`` while it keeps
    failing."""

    wait: float = RETRY_SECONDS
    at: float | None = None

    def failed(self, now: float) -> None:
        """Notes a failure, the first one or another."""
        self.wait = RETRY_SECONDS if self.at is None else min(2 * self.wait, RETRY_AT_MOST)
        self.at = now + self.wait

    def due(self, now: float) -> bool:
        """Returns whether it is time to try."""
        return self.at is not None and now >= self.at

    def clear(self) -> None:
        """Notes a success: nothing more is tried again."""
        self.at = None


@dataclass
class Devices:
    """The devices in order of preference, and the one in use.

    ``preferred``: the name that was asked for, None for the best there is. ``candidates`` lists the names of all, best
    first, LAST_RESORT last. ``current``: the name in use; None when it is not known under any.
    """

    preferred: str | None
    candidates: Callable[[], Sequence[str]]
    current: str | None = None
    failures: int = 0
    backoff: Backoff = field(default_factory=Backoff)

    def opened(self, device_name: str, now: float) -> None:
        """Notes that the solver that was asked for first runs on this device."""
        self.current = self.preferred
        if self.preferred is None:
            numpy = device_name.lower().startswith(LAST_RESORT)
            self.current = LAST_RESORT if numpy else next((x for x in self.candidates() if x == device_name), None)
        if self.better():
            self.backoff.failed(now)

    @property
    def second_best(self) -> bool:
        """Whether the device in use is a slower one than the first choice."""
        return bool(self.better()) or (self.current == LAST_RESORT and self.preferred is None)

    def better(self) -> list[str]:
        """Returns the devices that are preferred to the present one, best first."""
        listed = list(self.candidates())
        if self.preferred is not None:
            listed = [self.preferred, *(x for x in listed if x != self.preferred)]
        return listed[: listed.index(self.current)] if self.current in listed else []

    def others(self) -> list[str]:
        """Returns what to try when the present device has failed, best first; the last cannot fail."""
        listed = [x for x in self.candidates() if x not in (self.current, LAST_RESORT)]
        later = self.better()
        return [*(x for x in listed if x not in later), LAST_RESORT]

    def blame(self, fault: Fault) -> bool:
        """Counts a failed job. Returns True when the device should be left."""
        if fault in (Fault.JOB, Fault.FLAW):
            return False
        self.failures += 1
        return self.current != LAST_RESORT and (fault != Fault.UNKNOWN or self.failures >= MAX_FAILURES)

    def left(self, name: str, now: float) -> None:
        """Notes that the present device failed and ``name`` takes over."""
        self.current, self.failures = name, 0
        self.backoff.failed(now)

    def returned(self, name: str) -> None:
        """Notes that a better device is in use again. Once a solve has ``settled`` it counts as lasting."""
        self.current, self.failures = name, 0

    def settled(self) -> None:
        """Notes that a whole solve went through on the present device."""
        self.failures = 0
        if not self.better():
            self.backoff.clear()
