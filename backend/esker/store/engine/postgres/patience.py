"""How long somebody waits for a database that says nothing, and what happens then.

A database that is frozen, or a network that swallows everything, ends no connection. So a connection here counts the
seconds in which nothing came, and ends itself. The event loop waits half a second, once: from then on whoever reads is
refused at once, until a thread that keeps asking was answered (docs/decisions/0072-a-database-that-says-nothing.md).
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable
from typing import Any, Final, TypeVar

import psycopg
from psycopg.abc import PQGen

from esker.store.engine.ports import Unreachable

log = logging.getLogger("esker.postgres")
RV = TypeVar("RV")

LOOP_SECONDS: Final = 0.5
"""The event loop waits so long: everybody waits with it."""
SILENT_SECONDS: Final = 15.0
"""A thread waits so long for the next bytes: a slow statement is none that hangs."""
ASK_SECONDS: Final = 0.25
"""A database that said nothing is asked again after so long."""
SILENT: Final = "the database does not answer (it said nothing when it was asked last)"


class Silent(psycopg.OperationalError):
    """The database said nothing for too long. The connection is closed."""


def is_in_loop() -> bool:
    """Returns whether this thread runs an event loop at this moment."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


class Patient(psycopg.Connection[tuple[Any, ...]]):
    """A connection that ends itself when nothing comes for too long. Each wait raises Silent then."""

    patience: float = SILENT_SECONDS
    """Seconds that a thread waits without an event loop."""

    def wait(self, gen: PQGen[RV], *arguments: Any, **more: Any) -> RV:
        """Waits for what a generator of the driver wants. Raises Silent."""
        return super().wait(self._heard(gen, LOOP_SECONDS if is_in_loop() else self.patience), *arguments, **more)

    def _heard(self, gen: PQGen[RV], seconds: float) -> PQGen[RV]:
        """Passes on what the driver waits for, and looks at the clock where nothing came."""
        try:
            wanted = next(gen)
            heard = time.monotonic()
            while True:
                ready = yield wanted
                now = time.monotonic()
                if ready:
                    heard = now
                elif now - heard >= seconds:
                    gen.close()
                    self.close()  # a rollback, or the pool, would wait for the same silence
                    raise Silent(f"it said nothing for {seconds:g} seconds")
                wanted = gen.send(ready)
        except StopIteration as done:
            found: RV = done.value
            return found


class Watch:
    """Whether the database answers who reads. One that fell silent is asked by a thread until it answers."""

    def __init__(self, ask: Callable[[], object]) -> None:
        """``ask``: asks the database for a word. Raises Unreachable."""
        self._ask = ask
        self._lock, self._stop = threading.Lock(), threading.Event()
        self._silent = False

    @property
    def answers(self) -> bool:
        """Whether the database answered when it was asked last."""
        return not self._silent

    def demand(self) -> None:
        """Raises Unreachable at once while the database is silent."""
        if self._silent:
            raise Unreachable(SILENT)

    def fell_silent(self) -> None:
        """Somebody waited in vain."""
        with self._lock:
            if self._silent or self._stop.is_set():
                return
            self._silent = True
        log.error("the database says nothing: whoever reads is refused until it answers")
        threading.Thread(target=self._until_it_answers, name="database", daemon=True).start()

    def _until_it_answers(self) -> None:
        while not self._stop.is_set():
            try:
                self._ask()
            except Unreachable:
                self._stop.wait(ASK_SECONDS)
            else:
                log.warning("the database answers again")
                self._silent = False
                return

    def close(self) -> None:
        """Asks no more."""
        with self._lock:
            self._stop.set()
