"""By which rules ground follows from strokes: those of a terrain's birth (SPEC S203, S204)."""

from __future__ import annotations

import hashlib
from itertools import pairwise

import numpy as np
import pytest

from esker.api.terrain import Stroke as Make
from esker.api.terrain import Terrain
from esker.contract import CURRENT_EDITION, Document, Stroke, TerrainSettings
from esker.solve.constraints.constraints import pack
from esker.solve.opencl.device import Device
from esker.solve.opencl.levels import ClWorkspace
from esker.solve.solver import Solver
from tests.solver.scenes import SETTINGS

NEW = SETTINGS.model_copy(update={"edition": CURRENT_EDITION})


def jagged(ends: tuple[tuple[float, float], tuple[float, float]], seed: int = 3, back: bool = False) -> Stroke:
    """A drawn silhouette from one end, or from the other with its flanks swapped."""
    u = np.linspace(0, 1, 120)
    z = 300 + np.cumsum(np.random.default_rng(seed).normal(0, 25, 120))
    (ax, ay), (bx, by) = ends
    points = np.column_stack([ax + u * (bx - ax), ay + u * (by - ay), z])
    left, right = (35, 500), (50, 300)
    if back:
        return Make.profile(points[::-1], left=right, right=left, id="jagged")
    return Make.profile(points, left=left, right=right, id="jagged")


ENDS = [((700.0, 900.0), (3300.0, 2650.0)), ((512.3, 2048.0), (3001.7, 2048.0)), ((1500.0, 400.0), (1500.0, 3411.0))]


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("level", [1, 3])
def test_a_silhouette_is_the_same_from_its_other_end(
    solver: Solver, ends: tuple[tuple[float, float], tuple[float, float]], level: int
) -> None:
    """SPEC S203: 9.1 m, 1.3 % of the relief, apart where octaves count from the first end."""
    there, back = (solver.solve([jagged(ends, back=b)], NEW, level)[level] for b in (False, True))
    assert np.abs(there - back).max() < 1e-4 * np.ptp(there)
    there, back = (solver.solve([jagged(ends, back=b)], SETTINGS, level)[level] for b in (False, True))
    assert np.abs(there - back).max() > 1e-3 * np.ptp(there), "what the first edition does"


def test_terrains_keep_the_rules_of_their_birth() -> None:
    """SPEC S204: a document that says nothing has the first edition, and its tables the bits that they had."""
    assert Document.model_validate_json('{"id": "old", "settings": {"size_m": 4096.0}}').settings.edition == 1
    assert TerrainSettings().edition == 1
    assert Terrain(4096).settings.edition == CURRENT_EDITION
    tables = pack([jagged(ENDS[0])], SETTINGS, 2)
    digest = hashlib.sha256(tables.pieces.tobytes()).hexdigest()
    assert digest[:16] == "39febff339e35261"


@pytest.mark.parametrize("seed", range(3))
def test_edits_leave_the_bits_of_a_full_raster(device: Device, seed: int) -> None:
    """SPEC S41 in the second edition: the end drawn on in its plane moves the middle."""
    rng = np.random.default_rng(seed)
    whole = jagged(ENDS[0], seed)
    lengths = [60, 61, 90, 90, 120, 75]
    w, fresh = ClWorkspace(device, 2), ClWorkspace(device, 2)
    strokes = [whole.model_copy(update={"curve": whole.curve[:length]}) for length in lengths]
    strokes[3] = strokes[3].model_copy(
        update={
            "curve": tuple((u, h + (k in (40, 41)) * rng.normal(0, 20)) for k, (u, h) in enumerate(strokes[3].curve))
        }
    )
    for _, after in pairwise(strokes):
        w.load([after], NEW)
        fresh.packer.forget()
        fresh.load([after], NEW)
        for name in ("d", "s"):
            assert np.array_equal(w.height.get(name, 2), fresh.height.get(name, 2))
        assert np.array_equal(w.gradient.get("f", 2), fresh.gradient.get("f", 2))
