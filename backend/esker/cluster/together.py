"""Questions of many that go to the database as one, in the event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import Generic, TypeVar

K = TypeVar("K")
T = TypeVar("T")


class Together(Generic[K, T]):
    """While one question is on its way, all that is asked waits and makes up the next one.

    Who is alone waits for nobody. Of a crowd nobody waits for more than two questions, however many are in it.
    """

    def __init__(self, ask: Callable[[list[K]], Awaitable[Mapping[K, T]]]) -> None:
        """``ask``: asks for many at once, each of them once. What it raises all of them are told."""
        self._ask = ask
        self._waiting: dict[K, asyncio.Future[T | None]] = {}
        self._task: asyncio.Task[None] | None = None

    async def answer(self, key: K) -> T | None:
        """Returns what was answered for one; None where nothing was. Raises what ``ask`` raises."""
        waiting = self._waiting.get(key)
        if waiting is None:
            waiting = self._waiting[key] = asyncio.get_running_loop().create_future()
        if self._task is None:
            self._task = asyncio.create_task(self._run())
        return await asyncio.shield(waiting)  # who gives up does not take the answer from the others

    async def _run(self) -> None:
        while self._waiting:
            asked, self._waiting = self._waiting, {}
            try:
                found = await self._ask(list(asked))
            except Exception as error:
                for each in asked.values():
                    each.set_exception(error)
                    each.exception()  # who asked may be gone: then nobody is there to hear of it
            else:
                for key, each in asked.items():
                    each.set_result(found.get(key))
        self._task = None
