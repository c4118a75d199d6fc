"""What strokes want differently, from edition 3 on (SPEC S370 to S372): scenes that the search found."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bench.solver import _direct
from bench.solver._direct import Scene
from esker.api.terrain import Stroke as Make
from esker.contract import CURRENT_EDITION, Stroke
from esker.solve.constraints import raster_reference
from esker.solve.constraints.constraints import pack
from esker.solve.opencl.device import Device
from esker.solve.solver import Solver
from tests.solver.scenes import SETTINGS, flank
from tests.solver.test_ties import differences, kernels

__all__ = ["kernels"]

NEW = SETTINGS.model_copy(update={"edition": CURRENT_EDITION})
SCENES = json.loads((Path(__file__).parent / "found_scenes.json").read_text(encoding="utf-8"))


def scene(name: str, edition: int) -> Scene:
    """A scene that was found, by the rules of an edition."""
    loaded = Scene.load(SCENES[name])
    return Scene(loaded.strokes, loaded.settings.model_copy(update={"edition": edition}), loaded.level)


@pytest.mark.parametrize("name", SCENES)
def test_scenes_that_were_found(solver: Solver, name: str) -> None:
    """SPEC S370 to S372: OpenCL and NumPy want the same of every sample, and both settle on that."""
    found = _direct.measure(scene(name, CURRENT_EDITION), {"opencl": solver, "numpy": Solver("numpy")})
    assert max(found.values()) < 1, found


def test_high_plateaux_that_nearly_agree(kernels: Device) -> None:
    """SPEC S370: a variance of metres of ground that is 4 km high is lost where float32 takes it from squares."""
    strokes = [
        Make.level([(900, 900, 4096), (3100, 900, 4096)], left=flank(10, 3000), right=flank(10, 3000), id="a"),
        Make.level([(1000, 1300, 4090), (3000, 3100, 4090)], left=flank(12, 3000), right=flank(12, 3000), id="b"),
    ]
    assert differences(kernels, strokes, NEW, 1)["height_d"] < 2e-5
    assert differences(kernels, strokes, SETTINGS, 1)["height_d"] > 1e-4, "what the first edition does"


def test_a_stroke_that_hardly_counts_does_not_quarrel() -> None:
    """SPEC S371: a share of 10^-8 of the weight, at the very end of a band, made springs 200 times stiffer."""
    for edition, stiffer in ((1, True), (CURRENT_EDITION, False)):
        d = _direct.twin_constraints(scene("the end of a band over a low flank", edition)).height_d
        assert (d[29, 2] > 0.02) == stiffer


def crossing_the_base(z: float, shape: str) -> Stroke:
    """A ridge with a plateau that leaves the base at the middle of its line, there ``z`` above it."""
    points = [(512, 1024, -200), (1536, 1024, z), (2560, 1024, 200)]
    side = flank(40, 500, shape)  # type: ignore[arg-type]
    return Make.profile(points, left=side, right=side, plateau_radius_m=200, id="a")


@pytest.mark.parametrize("shape", ["convex", "concave", "straight"])
def test_a_plateau_where_its_crest_has_no_height(shape: str) -> None:
    """SPEC S372: how far a gradient follows the crest does not depend on whether a height is rounded to nothing."""
    column, row = 48, 33  # beside the crest, in the plateau
    wanted = []
    for z in (0.0, 1e-9, -1e-9, 1e-4):
        c = raster_reference.rasterise(pack([crossing_the_base(z, shape)], NEW, 1))
        wanted.append(c.gradient_f[0, row, column] / c.gradient_d[row, column])
    assert np.ptp(wanted) < 1e-5
    assert wanted[0] == pytest.approx(200 / 1024, rel=1e-3)


def test_the_first_edition_keeps_its_ground() -> None:
    """SPEC S204: nothing that is mended here moves a terrain that is there already."""
    strokes = [crossing_the_base(0.0, "convex"), Make.level([(900, 900, 300), (3000, 1500, 300)], id="b")]
    old, new = (raster_reference.rasterise(pack(strokes, settings, 1)).height_d for settings in (SETTINGS, NEW))
    assert not np.array_equal(old, new)
    assert float(old.sum()) == pytest.approx(OLD_STIFFNESS, rel=1e-12)


OLD_STIFFNESS = 18332.399289976696
"""Of all samples: what it was before there was a third edition."""
