"""What nodes show each other (SPEC P574 to P577)."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from esker.cluster.signing import (
    SESSIONS,
    WINDOW,
    NotSigned,
    Opened,
    Opening,
    Session,
    Sessions,
    Visit,
    Window,
    derived,
    made_key,
    opening,
)

KEY, OTHER = made_key("a key that all nodes of a cluster have"), made_key("another key, of somebody who listens in")
VISIT = Visit("203.0.113.7", "https", 1, "terrain")
ASKED = ("POST", "/api/terrains/terrain/links", "terrain.example.org")


def pair() -> tuple[Session, Sessions]:
    sessions, asked = Sessions(KEY), opening(KEY, "a")
    return Session(KEY, asked, sessions.open(asked)), sessions


def test_what_is_said_of_a_visitor_arrives() -> None:
    """SPEC P574."""
    session, sessions = pair()
    assert sessions.read(session.sign(VISIT, *ASKED), *ASKED) == VISIT
    about_none = Visit("2001:db8::7", "http")
    assert sessions.read(session.sign(about_none, *ASKED), *ASKED) == about_none


def test_whatever_is_changed_is_noticed() -> None:
    """SPEC P574: each word of the field, and each of what it is about."""
    session, sessions = pair()
    signed = session.sign(VISIT, *ASKED)
    words = signed.split(" ")
    for at in range(1, len(words)):
        changed = [*words[:at], "1" + words[at][1:] if words[at][0] != "1" else "2" + words[at][1:], *words[at + 1 :]]
        with pytest.raises(NotSigned):
            sessions.read(" ".join(changed), *ASKED)
    for at in range(3):
        other = list(ASKED)
        other[at] += "x"
        with pytest.raises(NotSigned):
            sessions.read(signed, *other)
    assert sessions.read(signed, *ASKED) == VISIT


@given(st.text(max_size=200))
def test_what_a_stranger_says_is_refused(field: str) -> None:
    """SPEC P574: by a sentence, and by nothing else."""
    _, sessions = pair()
    with pytest.raises(NotSigned):
        sessions.read(field, *ASKED)


def test_nothing_is_taken_twice() -> None:
    """SPEC P575: no clock is asked, so none can be wrong."""
    session, sessions = pair()
    signed = [session.sign(VISIT, *ASKED) for _ in range(3)]
    for field in (signed[2], signed[0], signed[1]):
        sessions.read(field, *ASKED)
    for field in signed:
        with pytest.raises(NotSigned, match="came before"):
            sessions.read(field, *ASKED)


@given(st.lists(st.integers(0, 3 * WINDOW), max_size=60))
def test_a_window_takes_each_count_once(counts: list[int]) -> None:
    """SPEC P575: what is older than the window is refused."""
    window, seen = Window(), set[int]()
    for count in counts:
        newest = max(seen, default=0)
        fresh = count >= 1 and count not in seen and count > newest - WINDOW
        assert window.take(count) == fresh
        if fresh:
            seen.add(count)


def test_who_lacks_the_key_opens_no_session_and_passes_for_no_node() -> None:
    """SPEC P576."""
    sessions, asked = Sessions(KEY), opening(KEY, "a")
    with pytest.raises(NotSigned):
        sessions.open(opening(OTHER, "a"))
    with pytest.raises(NotSigned):
        sessions.open(Opening("b", asked.nonce, asked.code))
    with pytest.raises(NotSigned):
        Session(KEY, asked, Opened("s", "00" * 16, "00" * 32))
    assert len(sessions) == 0


def test_a_recorded_opening_opens_nothing() -> None:
    """SPEC P576: whoever sends one again has a session whose key they lack, and it goes before any that is used."""
    sessions, asked = Sessions(KEY), opening(KEY, "a")
    used = Session(KEY, asked, sessions.open(asked))
    sessions.read(used.sign(VISIT, *ASKED), *ASKED)
    for _ in range(SESSIONS + 10):
        again = sessions.open(asked)
    assert len(sessions) == SESSIONS
    with pytest.raises(NotSigned):
        sessions.read(f"{again.session} 1 1 https 203.0.113.7 terrain {'0' * 64}", *ASKED)
    assert sessions.read(used.sign(VISIT, *ASKED), *ASKED) == VISIT


def test_a_node_that_was_started_anew_asks_for_another_session() -> None:
    """SPEC P576."""
    session, _ = pair()
    with pytest.raises(NotSigned) as refused:
        Sessions(KEY).read(session.sign(VISIT, *ASKED), *ASKED)
    assert refused.value.renew


def test_nothing_is_passed_on_twice() -> None:
    """SPEC P577."""
    session, sessions = pair()
    for hops in (0, 2, 9):
        with pytest.raises(NotSigned, match="too often"):
            sessions.read(session.sign(Visit("203.0.113.7", "https", hops), *ASKED), *ASKED)


def test_a_key_is_long_and_each_purpose_has_its_own() -> None:
    """SPEC P576."""
    with pytest.raises(ValueError, match="ESKER_CLUSTER_KEY"):
        made_key("x" * 31)
    made = [KEY, derived(KEY, "claims"), derived(KEY, "other"), derived(OTHER, "claims")]
    assert all(a != b for a, b in itertools.combinations(made, 2))
