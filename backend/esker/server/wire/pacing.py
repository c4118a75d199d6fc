"""Requests are paced by the processor time that they take, as ASGI middleware (SPEC P451).

What a request takes of the event loop is taken from whoever draws. It is measured step by step and paid by the address,
and a request of an address that has spent its share waits until it has some again. Long before that, requests of an
address that has asked for much come one after another, with rests in between: the event loop takes what waits in the
order in which it came, and a dozen requests at once lie before every tile on its way. What a request asks for does not
count: a page that is not there costs about as much as one that is.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine, Generator
from typing import Any, Final

from esker.fairness.laps import Laps
from esker.fairness.spending import MUCH, PAYS, Accounts, Purse
from esker.server.routes.answers import answer

REQUEST_SECONDS: Final = 0.0003
"""Processor time that a request costs at least, before and after the application has it; paid in advance."""
PATIENCE_SECONDS: Final = 10.0
"""A request that would wait for longer is refused then."""
PAUSE_SECONDS: Final = 0.25
"""The longest pause between two parts of an answer."""
_Pay = Callable[[float], None]
_Step = Callable[[float, float], None]
"""Hears of a step of the event loop: processor time, and how long others waited for its end. Requests of an address
follow each other by the latter, which is several times as long beside threads that compute."""
TOO_MUCH: Final = "Too much was asked for from your address. Wait a moment."


class Paced:
    """Runs requests at the pace of their addresses; sockets pay by themselves (``server/wire/websocket.py``)."""

    def __init__(self, app: Any, laps: Laps | None = None) -> None:
        """``laps``: those of the event loop, by which it knows whether people of other addresses are there."""
        self.app, self._accounts = app, Accounts(laps=laps)

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        caller = scope["client"][0] if scope.get("client") else ""
        purses, pace = self._accounts.asker(caller), self._accounts.pace(caller)
        took = REQUEST_SECONDS

        def pay(seconds: float) -> None:
            now = time.monotonic()
            for purse in purses:
                purse.pay(now, seconds)

        def step(seconds: float, held: float) -> None:  # threads that work for a request hold no other one up
            nonlocal took
            took += max(seconds, held)
            pay(seconds)

        pay(REQUEST_SECONDS)
        turn, counted = pace.begin(time.monotonic())
        wait = max(_debt(purses), turn if any(purse.share < MUCH for purse in purses) else 0.0)
        try:
            if wait > 0:
                await asyncio.sleep(min(wait, PATIENCE_SECONDS))
            if wait > PATIENCE_SECONDS:
                await answer(429, "rate_limited", TOO_MUCH, again=int(wait))(scope, receive, send)
            else:
                await self._run(scope, receive, send, purses, pay, step)
        finally:
            pace.end(time.monotonic(), counted, took)

    async def _run(
        self, scope: Any, receive: Any, send: Any, purses: tuple[Purse, ...], pay: _Pay, step: _Step
    ) -> None:
        async def paced(message: Any) -> None:
            await send(message)
            if message.get("more_body") and (behind := _debt(purses)) > 0:
                await asyncio.sleep(min(behind, PAUSE_SECONDS))

        token = PAYS.set(pay)
        try:
            await _Metered(self.app(scope, receive, paced), step)
        finally:
            PAYS.reset(token)


def _debt(purses: tuple[Purse, ...]) -> float:
    """Returns the seconds until all these purses are level."""
    return max((purse.debt for purse in purses), default=0.0)


class _Metered:
    """Runs a coroutine and tells what each of its steps took of this thread."""

    def __init__(self, steps: Coroutine[Any, Any, None], step: _Step) -> None:
        self._steps, self._step = steps, step

    def __await__(self) -> Generator[Any, Any, None]:
        steps = self._steps.__await__()
        value, error = None, None
        while True:
            began, since = time.thread_time(), time.monotonic()
            try:
                awaited = steps.send(value) if error is None else steps.throw(error)
            except StopIteration:
                return
            finally:
                self._step(time.thread_time() - began, time.monotonic() - since)
            value = error = None
            try:
                value = yield awaited
            except BaseException as thrown:  # a cancellation, or what the awaited raised: the coroutine's to handle
                error = thrown
