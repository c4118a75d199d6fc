"""Turns in the event loop: at most so many at a time, one address after another (``esker.fairness.shares.Line``)."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import ParamSpec, TypeVar

from esker.fairness.shares import Line, Who
from esker.fairness.spending import PAYS

P = ParamSpec("P")
T = TypeVar("T")

SERVER = Who("")
"""A name for the server itself, where it asks for a turn of its own."""


class Turn:
    """A turn that somebody has. Where ``rest`` is set, the next begins so many seconds after its end."""

    rest = 0.0


class Turns:
    """``async with turns.turn(who):`` holds a turn. Lives in one event loop."""

    def __init__(self, most: int, each: int | None = None, waiting: int | None = None) -> None:
        """Parameters are those of ``shares.Line``."""
        self._line: Line[asyncio.Future[None]] = Line(most, each, waiting)
        self._most = most

    def locked(self) -> bool:
        """Returns whether the next to come has to wait."""
        return self._line.running >= self._most

    @asynccontextmanager
    async def turn(self, who: Who) -> AsyncIterator[Turn]:
        """Waits for a turn. Raises Full when too many of this address wait already."""
        loop, key, turn = asyncio.get_running_loop(), who.site, Turn()
        mine = loop.create_future()
        self._line.join(key, mine)
        self._serve()
        try:
            await mine
            yield turn
        finally:
            if not self._line.leave(key, mine):
                if turn.rest > 0:
                    loop.call_later(turn.rest, self._over, key)
                else:
                    self._over(key)

    def _over(self, key: str) -> None:
        self._line.done(key)
        self._serve()

    def _serve(self) -> None:
        while (found := self._line.next()) is not None:
            if (
                not found.done()
            ):  # where the waiting task was cancelled just now, its turn ends when the task hears of that
                found.set_result(None)


class Turnstile:
    """Work in the event loop itself, one piece after another, addresses in turns. Lives in one event loop.

    A piece is followed by a rest as long as it took, in which the loop does what else there is: two hundred people who
    have waited for the same thing would else be let in by one turn of it.
    """

    def __init__(self) -> None:
        self._turns = Turns(1)

    async def run(self, who: Who, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Returns what ``work``, which waits for nothing, returns or raises."""
        async with self._turns.turn(who) as turn:
            began = time.monotonic()  # beside threads that compute, others wait for longer than it computes
            try:
                return work(*args, **kwargs)
            finally:
                turn.rest = time.monotonic() - began


class FairThreads:
    """Threads for work that blocks. One address has at most half of them at a time, in turns with the others."""

    def __init__(self, threads: int, name: str, waiting: int | None = None) -> None:
        self._turns = Turns(threads, max(1, threads // 2), waiting)
        self._executor = ThreadPoolExecutor(threads, thread_name_prefix=name)

    async def run(self, who: Who, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Returns what ``work`` returns or raises. Raises Full when too much of this address waits already.

        The turn lasts until the thread is done, also when nobody waits for it any more.
        """

        spent = [0.0]

        def paid() -> T:
            began = time.thread_time()
            try:
                return work(*args, **kwargs)
            finally:
                spent[0] = time.thread_time() - began

        async def turn() -> T:
            async with self._turns.turn(who):
                try:
                    return await asyncio.get_running_loop().run_in_executor(self._executor, paid)
                finally:
                    if (pay := PAYS.get()) is not None:
                        pay(spent[0])

        task = asyncio.ensure_future(turn())
        try:
            return await asyncio.shield(task)
        except asyncio.CancelledError:
            task.add_done_callback(lambda t: t.cancelled() or t.exception())
            raise

    def shutdown(self) -> None:
        """Begins no more work."""
        self._executor.shutdown(wait=False, cancel_futures=True)
