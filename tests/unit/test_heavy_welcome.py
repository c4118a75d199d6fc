"""A heavy document is encoded once for all who wait, and nobody who asks at the wrong moment stops the loop (SPEC A440,
A441)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from esker import contract as c
from esker.document.ops import StrokeSet
from esker.session.room.core import Denied
from esker.session.room.replicas.recent import Encoder

LOOKS = 1_000
"""Times that one may ask whether the document is ready; whoever asks more often never gives way."""


class Heavy:
    """A document that nobody can be welcomed to before it is encoded."""

    def __init__(self) -> None:
        self.document = StrokeSet.from_document(c.Document(id="x"))
        self.kept: list[int] = []
        self.looks = 0

    def ready(self, clock: int | None, view: bool = False, asked: int | None = None) -> bool:  # noqa: ARG002
        self.looks += 1
        assert self.looks < LOOKS, "somebody asks without end, and nobody else has a turn"
        return bool(self.kept)

    def keep(self, clock: int, body: bytes, view: bool = False) -> None:  # noqa: ARG002
        self.kept.append(clock)


async def slow(work: Callable[[], bytes]) -> bytes:
    """Another thread that takes five turns of the loop."""
    for _ in range(5):
        await asyncio.sleep(0)
    return work()


def test_who_comes_in_the_moment_in_which_a_document_is_encoded_does_not_stop_the_loop() -> None:
    """SPEC A440: with 200 who came to a heavy terrain one of them stopped the server for good."""

    async def run() -> tuple[list[int], Heavy]:
        core = Heavy()
        encoder, coming = Encoder(core), []
        for _ in range(20):  # one in each turn of the loop, also in that in which the encoding ends
            coming.append(asyncio.create_task(encoder.prepare(None, slow)))
            await asyncio.sleep(0)
        return await asyncio.gather(*coming), core

    asked, core = asyncio.run(run())
    assert asked == [0] * 20
    assert core.kept == [0], "encoded once for all of them"


def test_a_share_that_is_used_up_denies_only_its_owner() -> None:
    """SPEC A441: who waits for what somebody else asked for is not refused with that one."""

    async def refused(_: Callable[[], bytes]) -> bytes:
        await asyncio.sleep(0)
        raise Denied("rate_limited", "Too much was asked for from your address at once.")

    async def run() -> tuple[int | BaseException, int | BaseException]:
        encoder = Encoder(Heavy())
        return await asyncio.gather(encoder.prepare(None, refused), encoder.prepare(None, slow), return_exceptions=True)

    first, second = asyncio.run(run())
    assert isinstance(first, Denied)
    assert second == 0


def test_a_room_that_closes_meanwhile_is_not_waited_for() -> None:
    """SPEC A440."""
    core, closed = Heavy(), iter([False, True])
    core.keep = lambda *_: None  # type: ignore[method-assign]
    asyncio.run(asyncio.wait_for(Encoder(core).prepare(None, slow, over=lambda: next(closed)), 60))
    assert core.looks == 2
