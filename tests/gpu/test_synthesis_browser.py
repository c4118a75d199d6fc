"""The page's synthesis passes in a real Chromium, on its software adapter (SPEC R26, R30)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from esker.contract.fractal import SNOW_EDGE, SNOW_NORTH
from tests.gpu.page import open_harness

# How steeply a channel can follow a slope: snow on its edge, a smoothstep in heights that aspect shifts.
STEEPEST = 1.5 * SNOW_NORTH / (SNOW_EDGE[1] - SNOW_EDGE[0])
VECTORS = Path(__file__).parents[1] / "vectors" / "synthesis.json"


def check(found: list[dict[str, Any]], vectors: dict[str, Any]) -> None:
    """Each place is within the vectors' tolerance, or within what float32 gives there."""
    assert len(found) == len(vectors["places"])
    # Slopes turn gullies, and what slopes are wrong by is rounding over the cell.
    worn = {site["name"] for site in vectors["sites"] if site["erosion"] > 0}
    highest: dict[str, float] = {}
    for place in found:
        highest[place["site"]] = max(highest.get(place["site"], 0.0), *map(abs, place["range"]))
    for place in found:
        metres = (3 if place["site"] in worn else 1) * vectors["metres"]
        # A few units in the last place of float32 heights, gathered over the levels above, which may be higher.
        rounding = 5 * 2.0**-23 * highest[place["site"]]
        assert place["ground"] <= max(vectors["metres"] * place["cellM"], rounding), place
        assert place["detail"] <= max(metres * place["cellM"], rounding), place
        # Rounding of heights over the cell is what slopes are wrong by.
        assert place["halves"] <= vectors["unorm"] + STEEPEST * 65535 * rounding / place["cellM"], place
        assert place["bounds"] == place["range"], place


def test_the_browser_makes_what_the_vectors_say() -> None:
    """R26, R30: every rule, channel and domain of the vectors, from the root to cells of 8 mm; bounds are read back.

    On a device of full WebGPU, and some of them on one of the compatibility kind.
    """
    vectors = json.loads(VECTORS.read_text())
    few = {**vectors, "places": vectors["places"][3::12]}
    assert len(few["places"]) > 10
    with open_harness() as page:
        run = "([vectors, kind]) => esker.synthesisVectors(vectors, kind)"
        check(page.evaluate(run, [vectors, "core"]), vectors)
        check(page.evaluate(run, [few, "compatibility"]), few)
