"""The frames' ends are where the library's parser finds them, however the bytes are cut (SPEC P530)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.frames import Frame, Opcode

from esker.server.wire.boundaries import END_OF_REQUEST, FrameBoundaries, measured

REQUEST = b"GET /ws HTTP/1.1\r\nHost: x" + END_OF_REQUEST


def written(kind: Opcode, size: int, fin: bool) -> bytes:
    """A client's frame as the library writes it."""
    return Frame(kind, bytes(size), fin).serialize(mask=True)


@st.composite
def streams(draw: st.DrawFn) -> tuple[bytes, set[int]]:
    """A stream of a client, and the places in it where a message may begin."""
    data = REQUEST
    between = {len(data)}
    for size in draw(st.lists(st.sampled_from((0, 1, 125, 126, 127, 300, 65_535, 65_536)), max_size=6)):
        parts = draw(st.integers(1, 3))
        for part in range(parts):
            if draw(st.booleans()):
                data += written(Opcode.PING, min(size, 125), True)
                between |= {len(data)} if part == 0 else set()
            data += written(Opcode.TEXT if part == 0 else Opcode.CONT, size, part == parts - 1)
        between.add(len(data))
    return data, between


@given(streams(), st.lists(st.integers(1, 40), min_size=1, max_size=60))
def test_a_message_may_begin_where_one_ended_and_nowhere_else(stream: tuple[bytes, set[int]], cuts: list[int]) -> None:
    data, between = stream
    boundaries, at, turn = FrameBoundaries(), 0, 0
    while at < len(data):
        # Long payloads are passed in one piece, so that the stream stays many pieces and not thousands.
        size = cuts[turn % len(cuts)] if turn % 7 else max(cuts) * 4_000
        boundaries.feed(data[at : at + size])
        at, turn = min(at + size, len(data)), turn + 1
        assert boundaries.is_between == (at in between), (at, sorted(between))


@pytest.mark.parametrize("size", [0, 125, 126, 65_535, 65_536])
def test_a_header_is_measured_when_it_is_whole_and_not_before(size: int) -> None:
    frame = written(Opcode.BINARY, size, True)
    length = len(frame) - size
    assert measured(frame) == measured(frame[:length]) == (length, size)
    assert all(measured(frame[:known]) is None for known in range(length))


def test_a_frame_without_a_mask_has_a_shorter_header() -> None:
    assert measured(b"\x81\x02ab") == (2, 2)


def test_nothing_begins_before_the_request_has_ended_whole() -> None:
    boundaries = FrameBoundaries()
    for place in range(len(REQUEST)):
        assert not boundaries.is_between
        boundaries.feed(REQUEST[place : place + 1])
    assert boundaries.is_between
