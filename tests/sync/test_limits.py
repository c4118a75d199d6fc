"""Every limit of DESIGN 4, one by one, with its error (SPEC P13 to P19)."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.fairness.buckets import TokenBucket
from esker.fairness.shares import Rate, Rates, Who
from esker.server.settings import BadSetting, Settings, from_environment
from esker.session.room import protocol
from tests.sync.harness import LiveServer, Peer, set_op, stroke

HELLO = json.dumps({"type": "hello", "protocol": c.PROTOCOL_VERSION, "terrain": "t", "secret": "s", "client": "c"})


def _connection() -> protocol.Connection:
    connection = protocol.Connection(0.0, c.SUBPROTOCOL)
    assert connection.opened() == []
    [hi] = connection.text(HELLO, 0.0)
    assert isinstance(hi, protocol.Hi)
    return connection


def _ops(first: int, count: int, op: dict[str, Any] | None = None) -> str:
    body = op or {"type": "stroke.finish", "stroke": "s"}
    return json.dumps({"type": "ops", "ops": [{"id": f"c:{first + i}", "op": body} for i in range(count)]})


def test_ops_per_second() -> None:
    connection = _connection()
    events = connection.text(_ops(0, c.OPS_BURST), 0.0)
    assert [type(e) for e in events] == [protocol.Accepted]
    [refused] = connection.text(_ops(1000, 1), 0.0)
    assert isinstance(refused, protocol.Refused)
    assert (refused.id, refused.code) == ("c:1000", "rate_limited")
    # After a second the rate's worth is there again, and not one more.
    events = connection.text(_ops(2000, c.MAX_OPS_PER_SECOND + 1), 1.0)
    assert isinstance(events[0], protocol.Accepted)
    assert len(events[0].ops) == c.MAX_OPS_PER_SECOND
    assert isinstance(events[1], protocol.Refused)


def test_parts_of_a_group_count() -> None:
    connection = _connection()
    group = {"type": "group", "ops": [{"type": "stroke.finish", "stroke": "s"}] * c.MAX_OPS_PER_GROUP}
    accepted = 0
    for i in range(10):
        events = connection.text(_ops(i, 1, group), 0.0)
        accepted += isinstance(events[0], protocol.Accepted)
    assert accepted == c.OPS_BURST // c.MAX_OPS_PER_GROUP


def test_a_client_that_never_slows_down_is_closed() -> None:
    connection = _connection()
    events: list[protocol.Event] = []
    for i in range(20):
        events += connection.text(_ops(i * 256, 256), 0.0)
    assert isinstance(events[-1], protocol.Close)
    assert events[-1].code == "rate_limited"
    assert connection.text(_ops(9999, 1), 100.0) == [], "nothing is read after the close"


@pytest.mark.parametrize(
    ("message", "rate"),
    [
        ({"type": "presence"}, c.MAX_PRESENCE_PER_SECOND),
        ({"type": "view", "eye": [0, 0, 1], "target": [0, 0, 0]}, c.MAX_VIEWS_PER_SECOND),
    ],
)
def test_surplus_cursors_and_views_are_dropped_with_one_notice(message: dict[str, Any], rate: int) -> None:
    connection = _connection()
    events = [e for _ in range(rate + 50) for e in connection.text(json.dumps(message), 0.0)]
    assert len([e for e in events if isinstance(e, protocol.Message)]) == rate
    replies = [e for e in events if isinstance(e, protocol.Reply)]
    assert len(replies) == 1
    assert isinstance(replies[0].message, c.ErrorMessage)
    assert (replies[0].message.code, replies[0].message.fatal) == ("rate_limited", False)
    assert connection.text(json.dumps(message), 1.0) != []


def test_all_messages_together() -> None:
    connection = _connection()
    text = json.dumps({"type": "ping", "t": 1})
    events = [e for _ in range(protocol.MESSAGES_BURST + 5) for e in connection.text(text, 0.0)]
    assert isinstance(events[-1], protocol.Close)
    assert events[-1].code == "rate_limited"


def test_hello_must_come_in_time() -> None:
    connection = protocol.Connection(100.0, c.SUBPROTOCOL)
    assert connection.tick(100.0 + protocol.HELLO_SECONDS) == []
    [close] = connection.tick(100.1 + protocol.HELLO_SECONDS)
    assert isinstance(close, protocol.Close)
    assert close.code == "bad_hello"
    assert _connection().tick(1e6) == []


def test_message_size_to_the_byte() -> None:
    for size, kind in ((c.MAX_MESSAGE_BYTES, "malformed"), (c.MAX_MESSAGE_BYTES + 1, "too_large")):
        [close] = _connection().text("x" * size, 0.0)
        assert isinstance(close, protocol.Close)
        assert close.code == kind


def test_token_bucket() -> None:
    bucket = TokenBucket(rate=10, burst=5)
    assert [bucket.take(0.0) for _ in range(6)] == [True] * 5 + [False]
    assert bucket.take(0.1)
    assert not bucket.take(0.1)
    assert not bucket.take(-100.0), "a clock that runs backwards gives nothing"
    assert bucket.take(1000.0, 5)
    assert not bucket.take(1000.0)


def test_rates_by_address_forget_the_oldest() -> None:
    rates, (a, b, c_) = Rates(Rate(0.001, 1), most_keys=2), (Who(name) for name in "abc")
    assert rates.take(a, 0)
    assert not rates.take(a, 0)
    assert rates.take(b, 0)
    assert rates.take(c_, 0)
    assert rates.take(a, 0), "a was forgotten"


def test_members_per_room(tmp_path: Path) -> None:
    with LiveServer(tmp_path, max_members=3) as server:
        terrain, secret = server.create()
        members = [server.join(terrain, secret, f"m{i}") for i in range(3)]
        late = Peer(server.socket())
        late.say("hello", protocol=c.PROTOCOL_VERSION, terrain=terrain, secret=secret, client="late")
        number, error = late.closed()
        assert error is not None
        assert (number, error["code"]) == (c.WS_CLOSE["room_full"], "room_full")
        assert "3" in error["message"]
        members[0].close()
        deadline = time.monotonic() + 60
        while len(members[1].wait("members")["members"]) != 2:
            assert time.monotonic() < deadline
        server.join(terrain, secret, "late").close()
        for member in members[1:]:
            member.close()


def test_strokes_and_points(tmp_path: Path) -> None:
    with LiveServer(tmp_path, max_strokes=2, max_points=5) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        peer.ops(("c1:1", stroke("a")), ("c1:2", stroke("b")), ("c1:3", stroke("c")))
        assert peer.wait("reject")["code"] == "too_many_strokes"
        peer.ops(("c1:4", set_op("a", curve=[[0, 0]] * 6)))
        assert peer.wait("reject")["code"] == "too_many_points"
        peer.ops(("c1:5", {"type": "stroke.delete", "stroke": "a"}), ("c1:6", stroke("c")))
        peer.ops(("c1:7", {"type": "stroke.restore", "stroke": "a"}))
        assert peer.wait("reject")["code"] == "too_many_strokes"
        peer.close()


def test_settings_lower_limits_but_never_raise_them() -> None:
    for name, value in (
        ("max_members", 201),
        ("max_strokes", 5001),
        ("max_points", 4097),
        ("level", 7),
        ("port", 70000),
        ("threads", 0),
        ("log_level", "loud"),
    ):
        with pytest.raises(BadSetting, match=name):
            from_environment({}, **{name: value})


def test_settings_from_the_environment() -> None:
    found = from_environment(
        {"ESKER_PORT": "9", "ESKER_LAN": "true", "ESKER_THREADS": "2", "ESKER_DATA": "/x"}, port=10
    )
    assert found == Settings(port=10, lan=True, threads=2, data=Path("/x"))
    with pytest.raises(BadSetting, match="ESKER_PORT"):
        from_environment({"ESKER_PORT": "ninety"})
