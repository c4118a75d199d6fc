"""Frames against the committed vectors, and what is malformed (SPEC T4, T6). The page reads the same file."""

from __future__ import annotations

import base64
import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from esker.contract import (
    CHANNEL_LEVELS_BELOW,
    MAX_LEVEL,
    MAX_REFINED_LEVEL,
    Channel,
    Filter,
    FrameKind,
    Predictor,
)
from esker.tiles.codec.frame import GROUND, FrameError, FrameHead, read_frame, write_frame
from esker.tiles.decoder import FrameDecoder
from tests.vectors import make_tiles

VECTORS: dict[str, Any] = json.loads(make_tiles.PATH.read_text())
SESSION = [base64.b64decode(step["frame"]) for step in VECTORS["sessions"][0]["steps"]]


def opened() -> FrameDecoder:
    decoder = FrameDecoder()
    for frame in SESSION[:2]:
        decoder.decode(frame)
    return decoder


@pytest.mark.parametrize("session", VECTORS["sessions"], ids=lambda s: str(s["name"]))
def test_committed_frames_decode_to_what_they_say(session: dict[str, Any]) -> None:
    decoder = FrameDecoder()
    for step in session["steps"]:
        assert make_tiles.told(decoder, base64.b64decode(step["frame"])) == step["decoded"]


def test_regenerating_the_vectors_changes_no_sample() -> None:
    """Frames are compared by what they decode to: predictors are chosen by floating-point numbers."""
    new = make_tiles.build()
    for mine, theirs in zip(new["sessions"], VECTORS["sessions"], strict=True):
        assert [s["decoded"] for s in mine["steps"]] == [s["decoded"] for s in theirs["steps"]]
    assert [m["name"] for m in new["malformed"]] == [m["name"] for m in VECTORS["malformed"]]


def test_the_vectors_use_every_predictor_where_it_matters() -> None:
    kinds = {
        session["name"]: [{t.predictor for t in read_frame(base64.b64decode(s["frame"]))[2]} for s in session["steps"]]
        for session in VECTORS["sessions"]
    }
    assert set().union(*kinds["interrupted"]) == set(Predictor)
    assert kinds["confirmed"][-2:] == [{Predictor.PREVIOUS}, {Predictor.PREVIOUS}]
    assert kinds["confirmed"][3] == set()  # the LEVEL frame that confirms and carries nothing


def test_the_vectors_use_every_filter_and_coarse_steps() -> None:
    tiles = [
        tile
        for session in VECTORS["sessions"]
        for step in session["steps"]
        for tile in read_frame(base64.b64decode(step["frame"]))[2]
    ]
    assert {tile.filter for tile in tiles} == set(Filter)
    assert {0, 1} < {tile.shift for tile in tiles}


def test_the_vectors_have_every_channel_and_the_finest_default_level_but_one() -> None:
    """A change that leaves either out would leave the page's decoder untested."""
    heads = {
        session["name"]: [read_frame(base64.b64decode(s["frame"]))[0] for s in session["steps"]]
        for session in VECTORS["sessions"]
    }
    assert {h.channel for h in heads["channels"]} == set(Channel)
    fine = [h for h in heads["refined"] if h.level == 9]
    assert {h.kind for h in fine} == set(FrameKind) - {FrameKind.RIVERS}  # rivers.json has those
    assert all(h.settled for h in heads["refined"])


def test_levels_of_a_channel_end_below_those_of_the_heights() -> None:
    refined, below = MAX_REFINED_LEVEL, MAX_LEVEL - CHANNEL_LEVELS_BELOW
    for channel, finest in ((Channel.HEIGHT, refined), (Channel.BASE, refined), (Channel.SURVEY, below)):
        read_frame(write_frame(FrameHead(FrameKind.LEVEL, finest, 1, True, channel), [], []))
        with pytest.raises(FrameError, match="above"):
            read_frame(write_frame(FrameHead(FrameKind.LEVEL, finest + 1, 1, True, channel), [], []))


def test_channels_are_kept_apart() -> None:
    """A tile of one channel is never a parent, a base or a victim of another's (SPEC T23)."""
    decoder = FrameDecoder()
    for step in VECTORS["sessions"][4]["steps"]:
        decoder.decode(base64.b64decode(step["frame"]))
    sizes = {channel: len(held) for channel, held in decoder.channels.items()}
    assert sizes == {channel: 85 if channel in GROUND else 5 for channel in Channel}
    decoder.decode(write_frame(FrameHead(FrameKind.LEVEL, 0, 9, True, Channel.AMPLITUDE), [(0, 0)], []))
    assert {c: len(h) for c, h in decoder.channels.items()} == sizes | {Channel.AMPLITUDE: 0}


@pytest.mark.parametrize("case", VECTORS["malformed"], ids=lambda c: str(c["name"]))
def test_malformed_frames_are_refused_and_change_nothing(case: dict[str, str]) -> None:
    decoder = opened()
    before = {channel: dict(held) for channel, held in decoder.channels.items()}
    with pytest.raises(FrameError):
        decoder.decode(base64.b64decode(case["frame"]))
    assert decoder.channels == before
    decoder.decode(SESSION[2])


@given(st.integers(0, len(SESSION[2]) - 1))
@settings(max_examples=60, deadline=None)
def test_every_truncation_is_refused(length: int) -> None:
    with pytest.raises(FrameError):
        opened().decode(SESSION[2][:length])


@given(st.lists(st.tuples(st.integers(0, len(SESSION[2]) - 1), st.integers(0, 255)), min_size=1, max_size=6))
@settings(max_examples=100, deadline=None)
def test_damaged_frames_decode_or_raise_frame_error(damage: list[tuple[int, int]]) -> None:
    frame = bytearray(SESSION[2])
    for at, value in damage:
        frame[at] = value
    decoder = opened()
    try:
        decoder.decode(bytes(frame))
    except FrameError:
        assert len(decoder.held) == 5


def test_reset_forgets() -> None:
    decoder = opened()
    decoder.reset()
    with pytest.raises(FrameError, match="not held"):
        decoder.decode(SESSION[1])
