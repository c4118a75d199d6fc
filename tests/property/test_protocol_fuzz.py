"""Whatever a client sends, the protocol answers with events, never with an exception (SPEC P3, P4, P12)."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings

from esker import contract as c
from esker.session.room import protocol
from tests.vectors import make

HELLO = json.dumps({"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": "t", "secret": "s", "client": "c1"})
VECTORS = Path(make.__file__).parent / "messages.json"
ACCEPTED = [x["text"] for x in json.loads(VECTORS.read_text(encoding="utf-8"))["cases"] if x["accept"]]

keys = st.sampled_from(("type", "ops", "id", "op", "stroke", "points", "fields", "eye", "bytes", "t", "first", "x"))
words = st.sampled_from(("hello", "ops", "view", "presence", "stroke.set", "group", "c1:1", "c1", "", "NaN"))
leaves = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), words, st.text(max_size=8))
documents = st.recursive(leaves, lambda x: st.one_of(st.lists(x, max_size=4), st.dictionaries(keys, x, max_size=5)))


def _greeted() -> protocol.Connection:
    connection = protocol.Connection(0.0, c.SUBPROTOCOL)
    connection.text(HELLO, 0.0)
    return connection


def _sound(events: list[protocol.Event]) -> None:
    for event in events:
        if isinstance(event, protocol.Close | protocol.Refused):
            assert len(event.message) > 5
            assert len(event.message.encode()) < 2000
    assert not any(isinstance(e, protocol.Close) for e in events[:-1]), "nothing follows a close"


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None, max_examples=300)
@given(document=documents, greeted=st.booleans())
def test_any_json(document: Any, greeted: bool) -> None:
    connection = _greeted() if greeted else protocol.Connection(0.0, c.SUBPROTOCOL)
    _sound(connection.text(json.dumps(document), 0.0))


@given(text=st.text(max_size=200))
def test_any_text(text: str) -> None:
    [event] = _greeted().text(text, 0.0)
    assert isinstance(event, protocol.Close) or not text.startswith("{")


@pytest.mark.parametrize("seed", range(5))
def test_damaged_messages(seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(400):
        text = list(rng.choice(ACCEPTED))
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(text))
            damage = rng.randrange(4)
            if damage == 0:
                text[at] = chr(rng.randrange(32, 127))
            elif damage == 1:
                del text[at : at + rng.randrange(1, 30)]
            elif damage == 2:
                text.insert(at, rng.choice(["9" * 400, "[" * 200, "null", "-", "\ud800", "\x00", '"', "1e999"]))
            else:
                text[at:at] = text[rng.randrange(len(text)) :][:50]
            if not text:
                text = ["{"]
        _sound(_greeted().text("".join(text), 0.0))
