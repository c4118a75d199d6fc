"""For how long a node may act as an owner, by a table and by any order of things (SPEC P572, P573)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from esker.cluster.tenure import Phase, Tenure
from esker.store.engine.leases import LEASE_SECONDS, RENEW_SECONDS, SHUT_SECONDS, SILENT_SECONDS

HELD, DOUBTFUL, SHUT = Phase.HELD, Phase.DOUBTFUL, Phase.SHUT
YES, NO = True, False

# A tenure whose lease was asked for at 0; answers as (asked at, renewed, came at); the phase at a time.
TABLE = [
    ("fresh", [], 0.0, HELD),
    ("just before doubt", [], 2.999, HELD),
    ("doubt", [], 3.0, DOUBTFUL),
    ("just before the end", [], 4.999, DOUBTFUL),
    ("the end", [], 5.0, SHUT),
    ("renewed in time", [(2.0, YES, 2.1)], 4.9, HELD),
    ("it counts from the question, not from the answer", [(2.0, YES, 4.9)], 4.95, HELD),
    ("a late answer of an early question", [(0.5, YES, 4.0)], 4.1, DOUBTFUL),
    ("doubt ends with an answer", [(2.0, YES, 3.5)], 3.6, HELD),
    ("the database says no", [(2.0, NO, 2.1)], 2.1, SHUT),
    ("no is for good", [(2.0, NO, 2.1), (2.2, YES, 2.3)], 2.4, SHUT),
    ("an answer after the end wakes nobody", [(4.0, YES, 6.0)], 6.0, SHUT),
    ("nor one that a frozen process finds", [(2.0, YES, 100.0)], 100.0, SHUT),
    ("answers that overtake each other", [(4.0, YES, 4.2), (2.0, YES, 4.3)], 6.5, HELD),
]


@pytest.mark.parametrize(("answers", "at", "phase"), [row[1:] for row in TABLE], ids=[row[0] for row in TABLE])
def test_table(answers: list[tuple[float, bool, float]], at: float, phase: Phase) -> None:
    """SPEC P572."""
    tenure = Tenure(0.0)
    for asked, renewed, came in answers:
        tenure = tenure.answered(asked, renewed, came)
    assert tenure.phase(at) is phase


def test_what_is_given_back_is_over() -> None:
    """SPEC P572."""
    assert Tenure(0.0).over().phase(0.0) is SHUT


def test_the_parts_of_a_lease() -> None:
    """SPEC P572: two renewals may go missing before the rooms are shut, and a second is left for clocks of another
    speed."""
    assert RENEW_SECONDS < SILENT_SECONDS < 2 * RENEW_SECONDS < SHUT_SECONDS < LEASE_SECONDS


PAUSE = st.floats(0, 4)
RENEWAL = st.tuples(PAUSE, PAUSE, PAUSE, st.booleans())
"""Seconds until the question is sent, until the database does it, until the answer comes; whether it ever comes."""


@given(st.lists(RENEWAL, max_size=12), st.floats(0.9, 1.1), st.lists(st.floats(0, 40), max_size=8))
def test_nobody_else_is_given_the_room_before_it_is_shut(
    renewals: list[tuple[float, float, float, bool]], speed: float, looks: list[float]
) -> None:
    """SPEC P573: a database whose seconds are a tenth longer or shorter, any delays, any lost answers. While the node
    may acknowledge or has its rooms open, the database has the lease as its own."""
    now, tenure, until = 0.0, Tenure(0.0), LEASE_SECONDS * speed
    spans = [(0.0, until)]
    answers: list[tuple[float, float, bool]] = []
    for before, there, back, comes in renewals:
        asked = now = now + before
        done = asked + there
        held = done < until
        if held:
            until = done + LEASE_SECONDS * speed
            spans.append((done, until))
        answers += [(asked, done + back, held)] if comes else []
        now = done
    moments = sorted([*looks, *(came for _, came, _ in answers)])
    for moment in moments:
        for asked, came, held in answers:
            if came == moment:
                tenure = tenure.answered(asked, held, moment)
        if tenure.phase(moment) is not SHUT:
            assert any(begin <= moment < end for begin, end in spans), (moment, spans, tenure)
