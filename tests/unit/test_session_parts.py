"""Small parts of the room by themselves (SPEC P14, P25, P27, P53)."""

from __future__ import annotations

import json
from collections.abc import Sequence

from esker import contract as c
from esker.session.room.members import COLOURS, Member, Members
from esker.session.room.outbox import Outbox
from esker.session.room.replicas import recent as recent_ops


def test_recent_ops_are_bounded_in_number_and_size() -> None:
    recent = recent_ops.Recent()
    assert recent.after(0) is None
    for clock in range(1, recent_ops.RECENT_OPS + 11):
        recent.add(clock, str(clock))
    assert recent.after(9) is None
    assert recent.after(10) == [(k, str(k)) for k in range(11, recent_ops.RECENT_OPS + 11)]
    assert recent.after(recent_ops.RECENT_OPS + 10) == []
    half = recent_ops.RECENT_CHARACTERS // 2
    last = recent_ops.RECENT_OPS + 11
    recent.add(last, "x" * half)
    recent.add(last + 1, "y" * half)
    recent.add(last + 2, "z")
    assert recent.after(last - 1) is None
    assert [len(text) for _, text in recent.after(last) or ()] == [half, 1]


def test_an_outbox_that_overflows_closes_and_forgets() -> None:
    woken: list[None] = []
    outbox = Outbox(lambda: woken.append(None), limit=10)
    outbox.push("x" * 1000, counted=False)
    outbox.push("12345")
    outbox.push("12345")
    assert (outbox.backlog, outbox.closing) == (10, None)
    outbox.push("6")
    assert outbox.closing is not None
    assert outbox.closing[0] == "slow_client"
    assert (outbox.pop(), outbox.backlog) == (None, 0)
    outbox.push("late")
    outbox.close("revoked", "too late to change the reason")
    assert outbox.closing[0] == "slow_client"
    assert outbox.pop() is None
    assert len(woken) == 4


def test_an_outbox_gives_back_in_order_and_counts() -> None:
    outbox = Outbox(lambda: None)
    outbox.push("a")
    outbox.message(c.Pong(t=1.0))
    assert outbox.backlog == 1 + len('{"type":"pong","t":1.0}')
    assert outbox.pop() == "a"
    assert json.loads(str(outbox.pop() or "")) == {"type": "pong", "t": 1.0}
    assert (outbox.pop(), outbox.backlog) == (None, 0)


def test_what_goes_at_once_is_not_queued_and_passes_nothing_that_waits() -> None:
    gone: list[str] = []
    free = True

    def now(texts: Sequence[str]) -> bool:
        gone.extend(texts if free else ())
        return free

    woken: list[None] = []
    outbox = Outbox(lambda: woken.append(None), limit=10, now=now)
    outbox.push("x" * 40, "y")
    assert (gone, outbox.backlog, outbox.waits, woken) == (["x" * 40, "y"], 0, False, [])
    free = False
    outbox.push("a", "b")
    free = True
    outbox.push("c")
    assert gone[2:] == []
    assert [outbox.pop() for _ in range(4)] == ["a", "b", "c", None]
    outbox.push("d")
    assert gone[2:] == ["d"]
    outbox.close("revoked", "over")
    outbox.push("e")
    assert gone[2:] == ["d"]


def _member(members: Members, client: str, wanted: str | None = None) -> Member:
    member = Member(client, client, members.colour(wanted), "edit", "link", Outbox(lambda: None))
    members.add(member)
    return member


def test_colours_differ_while_there_are_some_left() -> None:
    members = Members()
    colours = [_member(members, f"m{i}").colour for i in range(len(COLOURS))]
    assert sorted(colours) == sorted(COLOURS)
    assert members.colour("#123456") == "#123456"


def test_a_client_that_lags_gets_the_list_but_no_cursors() -> None:
    members = Members()
    ada, slow = _member(members, "ada"), _member(members, "slow")
    slow.outbox.push("x" * 70_000)
    members.moved(ada, c.Presence(cursor=(1, 2, 3)))
    assert members.pending
    members.tick(0.0)
    assert not members.pending
    slow.outbox.pop()
    assert json.loads(str(slow.outbox.pop() or ""))["type"] == "members"
    assert slow.outbox.pop() is None
    assert json.loads(str(ada.outbox.pop() or ""))["type"] == "members"
    assert json.loads(str(ada.outbox.pop() or ""))["members"][0]["cursor"] == [1, 2, 3]


def test_who_left_is_not_removed_twice() -> None:
    members = Members()
    old = _member(members, "ada")
    new = _member(members, "ada")
    assert not members.remove(old), "a newer connection has taken its place"
    assert members.by_client["ada"] is new
    assert members.remove(new)
    assert not members.remove(new)
