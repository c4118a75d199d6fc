"""Frames of rivers (SPEC W30 to W33)."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from esker import contract as c
from esker.contract import FrameKind, TerrainSettings
from esker.server.hydrology import Snapshot, frame_of
from esker.tiles.codec.frame import FrameError
from esker.tiles.codec.rivers import is_rivers, read_rivers, write_rivers
from esker.tiles.decoder import FrameDecoder

CASES: list[dict[str, Any]] = json.loads(
    (Path(__file__).parents[1] / "vectors" / "rivers.json").read_text(encoding="utf-8")
)["cases"]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_frames_are_read_or_refused_as_the_vectors_say(case: dict[str, Any]) -> None:
    """SPEC W30, W31."""
    frame = base64.b64decode(case["frame"])
    if "refused" in case:
        with pytest.raises(FrameError, match=case["refused"]):
            read_rivers(frame)
        return
    found = read_rivers(frame)
    assert (found.clock, found.level, found.settled) == (case["clock"], case["level"], case["settled"])
    assert [
        {"points": [list(p) for p in r.points], "areas": list(r.areas), "into": r.into} for r in found.rivers
    ] == case["rivers"]
    assert write_rivers(found.clock, found.level, found.settled, found.rivers) == frame


def test_who_decodes_tiles_passes_rivers_by() -> None:
    """SPEC W30: a program that draws no rivers loses nothing, and gives back their bytes."""
    frame = base64.b64decode(CASES[0]["frame"])
    decoder = FrameDecoder()
    found = decoder.decode(frame)
    assert is_rivers(frame)
    assert (found.kind, found.clock, found.bytes, found.tiles) == (FrameKind.RIVERS, 7, len(frame), {})
    with pytest.raises(FrameError):
        decoder.decode(frame[:-1])


@given(st.binary(max_size=60))
@settings(max_examples=300, deadline=None)
def test_any_bytes_are_a_frame_or_refused(tail: bytes) -> None:
    """SPEC W31."""
    head = base64.b64decode(CASES[0]["frame"])[: c.FRAME_HEADER.itemsize]
    try:
        found = read_rivers(head + tail)
    except FrameError:
        return
    assert read_rivers(write_rivers(found.clock, found.level, found.settled, found.rivers)) == found


def ground(rough_m: float) -> Snapshot:
    """A tilted plain of many valleys."""
    y, x = np.mgrid[0:257, 0:257].astype(np.float32)
    rough = np.random.default_rng(2).normal(0, rough_m, x.shape)
    return Snapshot(5, 2, (y * 3 + 20 * np.abs(np.sin(x / 9)) + rough).astype(np.float32))


@pytest.mark.parametrize("many", [0.5, 1.0, c.MAX_RIVERS])
def test_the_rivers_of_a_ground_fit_a_frame(many: float) -> None:
    """SPEC W32: they carry the clock of the ground that they were found on."""
    asked = TerrainSettings(rivers=many)
    found = read_rivers(frame_of(ground(0.0), asked, None, True))
    assert (found.clock, found.level, found.settled) == (5, 2, True)
    assert len(found.rivers) > 3
    assert frame_of(ground(0.0), asked, None, True) == frame_of(ground(0.0), asked, None, True)


def test_where_not_all_rivers_fit_the_largest_remain(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC W32."""
    asked = TerrainSettings(rivers=c.MAX_RIVERS)
    whole = read_rivers(frame_of(ground(2.0), asked, None, False))
    monkeypatch.setattr(c, "MAX_RIVER_BYTES", 600)
    frame = frame_of(ground(2.0), asked, None, False)
    fewer = read_rivers(frame)
    assert len(frame) <= 600
    assert 0 < len(fewer.rivers) < len(whole.rivers)
    assert max(r.areas[1] for r in fewer.rivers) == max(r.areas[1] for r in whole.rivers)
