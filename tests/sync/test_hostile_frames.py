"""Frames that know the protocol kill nothing and hurt nobody (SPEC P403): the short form of ``esker bench frames``."""

from __future__ import annotations

import asyncio
import json
import logging
import random
from pathlib import Path
from typing import get_args

import psutil
import pytest

from bench.room import frames
from bench.strangers._attacks import frame
from bench.strangers._hostile_frames import KINDS, Frames, before_hello
from bench.strangers.siege import Server
from esker import contract as c
from tests.sync.harness import LiveServer


def sample(seed: int, count: int) -> list[bytes]:
    made = Frames(random.Random(seed), "me")
    return [next(made) for _ in range(count)]


def test_every_message_operation_and_field_of_the_contract_is_drawn() -> None:
    seen: set[str] = set()
    for data in sample(1, 4_000):
        text = frames._payload(data)
        try:
            message = json.loads(text or "")
        except (ValueError, RecursionError):
            continue
        if isinstance(message, dict):
            seen.add(str(message.get("type")))
            for item in message.get("ops") or () if isinstance(message.get("ops"), list) else ():
                op = item.get("op") if isinstance(item, dict) else None
                if isinstance(op, dict):
                    seen |= {str(op.get("type")), *(f"{op.get('type')}.{name}" for name in op)}
    for kind in KINDS:
        assert kind.model_fields["type"].default in seen
    for kind in get_args(get_args(c.Op)[0]):
        name = kind.model_fields["type"].default
        assert {f"{name}.{field}" for field in kind.model_fields} <= seen


def test_the_same_seed_gives_the_same_frames_and_some_of_each_sort() -> None:
    first = sample(3, 500)
    assert first == sample(3, 500)
    assert first != sample(4, 500)
    assert len(set(first)) < len(first), "some come twice"
    hello = frames.hello("t", "s", "me")
    read = [frames.until_closed(hello, sample(seed, 200)) for seed in range(40)]
    assert 20 < sum(read) / len(read) < 120, "most connections take many before one breaks them"
    rng = random.Random(5)
    assert len({before_hello(rng) for _ in range(50)}) > 40


def test_what_the_twin_reads_is_what_the_server_reads() -> None:
    """A frame after which the state machine closes counts, none after it."""
    good = frame(frames.PING)
    broken = frame(b"{")
    hello = frames.hello("t", "s", "me")
    assert frames.until_closed(hello, [good, broken, good]) == 2
    assert frames.until_closed(hello, [good, frame(b"x", opcode=2), good]) == 2
    assert frames.until_closed(hello, [good] * 5) == 5


@pytest.mark.parametrize("seed", [1, 2])
def test_hostile_frames_kill_nothing_and_hurt_nobody(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, seed: int
) -> None:
    """SPEC P403: 2,000 frames at a server beside somebody who draws."""
    with LiveServer(tmp_path) as live, caplog.at_level(logging.INFO):
        found = asyncio.run(frames.run(Server(live.base, psutil.Process(), tmp_path), 2_000, seed))
    assert found["frames"] >= 2_000
    assert found["healthy_after"]
    assert found["bystander"]["operations"] > 0
    assert found["bystander"]["hurt"] == 0
    assert set(found["ends"]) <= {"answered", "closed"}, found["ends"]
    wrong = [r.getMessage() for r in caplog.records if r.exc_info or r.levelno >= logging.ERROR]
    assert wrong == []
