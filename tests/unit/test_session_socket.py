"""One socket's session: what goes at once and what waits, in order, on a transport that blocks (SPEC P23, P127)."""

from __future__ import annotations

import asyncio
import json
import random
import time
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Any

import pytest

from esker import contract as c
from esker.fairness.spending import Account
from esker.session.room import protocol
from esker.session.room.outbox import Outbox
from esker.session.room.socket import Session

LONG = 50


class Wire:
    """A transport that may have no room; texts of ``LONG`` characters and more go in two pieces."""

    def __init__(self) -> None:
        self.room = asyncio.Event()
        self.room.set()
        self.gone = False
        self.sent: list[str | bytes] = []
        self.at_once = 0
        self.listener: Callable[[str | bytes], None] | None = None

    def listen(self, listener: Callable[[str | bytes], None]) -> None:
        self.listener = listener

    def send_now(self, texts: Sequence[str]) -> bool:
        if not self.room.is_set() or any(len(text) >= LONG for text in texts):
            return False
        self._fail()
        self.sent += texts
        self.at_once += len(texts)
        return True

    async def send_text(self, text: str, went_on: Callable[[], None]) -> None:
        await self.room.wait()
        self._fail()
        if len(text) >= LONG:
            await asyncio.sleep(0)
            went_on()
            await self.room.wait()
        self.sent.append(text)

    async def send_bytes(self, data: bytes) -> None:
        await self.room.wait()
        self._fail()
        self.sent.append(data)

    async def close(self, code: int, reason: str) -> None:
        self.sent.append(f"close {code} {reason}")

    def abort(self) -> None:
        self.gone = True

    def charge(self, account: Account, broke: Callable[[], None]) -> None:
        self.account, self.broke = account, broke

    def pay(self, seconds: float) -> None:
        if not self.account.pay(0.0, seconds):
            self.broke()

    def _fail(self) -> None:
        if self.gone:
            raise ConnectionResetError("the peer is gone")


class Hall:
    """Hub, room and guest in one: notes what members say."""

    def __init__(self) -> None:
        self.events: list[Any] = []
        self.frames: list[bytes] = []
        self.outbox: Outbox | None = None
        self.inside = False

    async def enter(self, hello: c.Hello, outbox: Outbox, address: str) -> tuple[Any, Any]:
        assert (hello.client, address) == ("ada", "here")
        await asyncio.sleep(0)
        self.outbox, self.inside = outbox, True
        return self, self

    def receive(self, guest: Any, event: protocol.Event) -> None:
        assert guest is self
        assert self.inside
        self.events.append(event)
        if isinstance(event, protocol.Message) and isinstance(event.body, c.Rename):
            raise ValueError("this room does not rename")

    def frame(self, guest: Any) -> bytes | None:
        assert guest is self
        return self.frames.pop(0) if self.frames else None

    def leave(self, guest: Any) -> None:
        assert guest is self
        self.inside = False


class Call:
    """A session that is running, with its other ends."""

    def __init__(self) -> None:
        self.wire, self.hall = Wire(), Hall()
        self.session = Session(self.hall, self.wire, "here", c.SUBPROTOCOL)  # type: ignore[arg-type]
        self.incoming: asyncio.Queue[str | None] = asyncio.Queue()
        self.task = asyncio.create_task(self.session.run(self._messages()))

    async def _messages(self) -> AsyncIterator[str | bytes]:
        while (message := await self.incoming.get()) is not None:
            yield message

    async def greet(self) -> Outbox:
        hello = c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client="ada")
        self.incoming.put_nowait(hello.model_dump_json())
        await settle()
        assert self.hall.outbox is not None
        return self.hall.outbox

    async def end(self) -> None:
        self.incoming.put_nowait(None)
        await asyncio.wait_for(self.task, 60)


async def settle() -> None:
    for _ in range(12):
        await asyncio.sleep(0)


def test_who_sends_what_takes_long_leaves_turns_to_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P645: whatever came with a hello, and all behind it, was taken in one go: nobody else had a turn."""
    took, rests = iter((0.0, 0.001, 0.0, 0.05) * 3), list[float]()
    monkeypatch.setattr(time, "thread_time", lambda: next(took, 0.0))
    sleep = asyncio.sleep

    async def rest(seconds: float) -> None:
        rests.append(seconds)
        await sleep(0)

    monkeypatch.setattr("esker.session.room.socket.asyncio.sleep", rest)

    async def run() -> None:
        call = Call()
        for message in (
            c.Hello(protocol=c.PROTOCOL_VERSION, terrain="t", secret="s", client="ada"),
            *[c.Ping(t=1.0)] * 3,
        ):
            call.incoming.put_nowait(message.model_dump_json())
        others = 0
        while len(call.hall.events) < 3:
            await sleep(0)
            others += 1
        assert others >= 4
        monkeypatch.undo()
        await call.end()

    asyncio.run(run())
    assert [seconds for seconds in rests if 0 < seconds < 0.1] == [0.05, 0.05]


@pytest.mark.parametrize("seed", range(20))
def test_texts_leave_once_and_in_order_whatever_the_socket_has_room_for(seed: int) -> None:
    async def run() -> None:
        rng, call = random.Random(seed), Call()
        outbox = await call.greet()
        pushed: list[str] = []
        for number in range(200):
            for _ in range(rng.randrange(3)):
                texts = [f"{number}.{i}".ljust(rng.choice((1, 1, 1, LONG))) for i in range(rng.choice((1, 1, 2)))]
                pushed += texts
                outbox.push(*texts)
            if rng.random() < 0.2:
                call.hall.frames.append(bytes(3))
                outbox.notify()
            if rng.random() < 0.3:
                (call.wire.room.clear if call.wire.room.is_set() else call.wire.room.set)()
            for _ in range(rng.randrange(3)):
                await asyncio.sleep(0)
        call.wire.room.set()
        await settle()
        while outbox.waits or call.hall.frames:
            await asyncio.sleep(0)
        await settle()
        assert [text for text in call.wire.sent if isinstance(text, str)] == pushed
        before = call.wire.at_once
        outbox.push("at rest")
        assert (call.wire.sent[-1], call.wire.at_once) == ("at rest", before + 1)
        assert outbox.backlog == 0
        await call.end()

    asyncio.run(run())


def test_a_member_is_heard_without_a_task_until_it_leaves() -> None:
    async def run() -> None:
        call = Call()
        await call.greet()
        listener = call.wire.listener
        assert listener is not None
        listener(c.Ping(t=1.0).model_dump_json())
        assert isinstance(call.hall.events[0], protocol.Reply)
        listener(c.Credit(bytes=5).model_dump_json())
        assert call.hall.events[1] == protocol.Message(c.Credit(bytes=5))
        await call.end()
        assert not call.hall.inside
        listener(c.Credit(bytes=7).model_dump_json())
        assert len(call.hall.events) == 2, "nobody is there any more"

    asyncio.run(run())


@pytest.mark.parametrize(("said", "code"), [(b"\x00", "malformed"), ('{"type":"rename","name":"x"}', "server_error")])
def test_who_is_heard_without_a_task_is_closed_like_everybody(said: str | bytes, code: str) -> None:
    """SPEC H561: and has the time of a farewell to read it."""

    async def run() -> None:
        call = Call()
        await call.greet()
        assert call.wire.listener is not None
        call.wire.listener(said)
        await settle()
        error, closed = call.wire.sent[-2:]
        assert json.loads(error)["code"] == code
        assert str(closed).startswith(f"close {c.WS_CLOSE[code]}")
        await asyncio.wait_for(call.task, 60)
        assert not call.hall.inside
        assert not call.wire.gone, "the farewell may still be on its way"
        deadline = asyncio.get_running_loop().time() + 60
        while not call.wire.gone:
            assert asyncio.get_running_loop().time() < deadline
            await asyncio.sleep(0.01)

    asyncio.run(run())


def test_a_peer_that_is_gone_when_something_should_go_at_once_ends_the_session() -> None:
    async def run() -> None:
        call = Call()
        outbox = await call.greet()
        call.wire.gone = True
        outbox.push("late")  # must not raise: a room tells all its members in one go
        await asyncio.wait_for(call.task, 60)
        assert not call.hall.inside

    asyncio.run(run())


def test_who_asks_for_too_much_work_is_closed_and_may_come_back() -> None:
    async def run() -> None:
        call = Call()
        await call.greet()
        call.wire.pay(1000.0)
        await call.task
        texts = [m for m in call.wire.sent if isinstance(m, str)]
        assert json.loads(texts[-2])["code"] == "rate_limited"
        assert texts[-1].startswith(f"close {c.WS_CLOSE['rate_limited']} ")

    asyncio.run(run())
