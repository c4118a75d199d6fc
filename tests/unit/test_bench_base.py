"""The benchmark of base tiles measures what it says (DESIGN 15)."""

from __future__ import annotations

from bench.ground import base
from esker.contract import TILE_SAMPLES


def test_first_views_of_a_real_place_and_a_moved_layer() -> None:
    found = base.measure("helens")
    everything = found["everything"]
    assert everything["base_level_4"]["tiles"] == 256
    assert 500 < everything["base_level_4"]["bytes_per_tile"] < TILE_SAMPLES**2
    assert everything["offsets_bytes"] < 30 * 341, "offsets of untouched ground cost next to nothing"
    for view in ("first_view_whole", "first_view_near"):
        assert 0 < found[view]["bytes"] < everything["bytes"]
    assert 0 < found["layer_moved_whole"]["bytes"] < everything["bytes"] / 4, "only what the layer reaches"
