"""Row-wise and tile kernels against their NumPy float64 twins (SPEC S2, S15): what holds for the one and the other."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from esker import grid
from esker.solve import reference
from esker.solve.constraints import raster_reference
from esker.solve.constraints.constraints import pack
from esker.solve.constraints.raster_reference import Constraints
from esker.solve.constraints.tables import LINE_STIFFNESS
from esker.solve.constraints.tables import PINNED as PINNED_SAMPLE
from esker.solve.opencl.device import Device
from esker.solve.reference import BOTTOM_LEVELS
from tests.solver.scenes import PINNED, SCENES, SETTINGS
from tests.solver.twins import (
    EPS,
    LEVELS,
    Field,
    close,
    edited,
    fill,
    new_system,
    new_workspace,
    noise,
    noise_fields,
    stiffness,
    tile_device,
)


@pytest.fixture(scope="module", params=["rows", "full", "smallest"])
def kernels(request: pytest.FixtureRequest, device: Device) -> Device:
    """A device with one kind of kernels: by rows, or by tiles as large or as small as they come."""
    found = device if request.param == "rows" else tile_device(request.param)
    assert found is not None, "the row-wise device is there"
    assert (found.plan is None) == (request.param == "rows")
    return found


@pytest.fixture(scope="module", params=["rows", "tiles"])
def rasteriser(request: pytest.FixtureRequest, device: Device) -> Device:
    """A device with one kind of kernels. What rasterises is the same for tiles of all sizes (``gpu_program``)."""
    found = device if request.param == "rows" else tile_device("full")
    assert found is not None
    return found


@cache
def twin_visit(level: int, channels: int, start: str) -> tuple[Field, Field]:
    """What the twin makes of the fields of noise, once for all kinds of kernels."""
    host = noise_fields(level, channels)
    return reference.visit(
        None if start == "zero" else host["u"], None if start == "guess" else host["e"], host["f"], host["d"], EPS
    )


@cache
def twin_raster(scene: str, pinned: bool, level: int) -> Constraints:
    """What the twin makes of a scene, once for all kinds of kernels."""
    return raster_reference.rasterise(pack(SCENES[scene], PINNED if pinned else SETTINGS, level))


@pytest.fixture(scope="module", autouse=True)
def _twins_go() -> Iterator[None]:
    """The twins' results, some hundred megabytes, go with the last test."""
    yield
    twin_visit.cache_clear()
    twin_raster.cache_clear()


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("start", ["zero", "guess", "both"])
def test_visit(kernels: Device, level: int, channels: int, start: str) -> None:
    s = new_system(kernels, level, channels)
    fill(s)
    guess = None if start == "zero" else "u"
    correction = None if start == "guess" else "e"
    s.visit(level, rhs="f", out="v", guess=guess, correction=correction, residual=True)
    u, coarse = twin_visit(level, channels, start)
    close(s.get("v", level), u)
    close(s.get("b", level - 1), coarse)


def test_visit_without_residual(kernels: Device) -> None:
    s = new_system(kernels, 2, 2)
    host = fill(s)
    b = noise(host["e"].shape, 8)
    s.put("b", 1, b)
    s.visit(2, rhs="f", out="v", guess="u", correction="e", residual=False)
    close(s.get("v", 2), reference.visit(host["u"], host["e"], host["f"], host["d"], EPS)[0])
    assert np.array_equal(s.get("b", 1), b), "nobody asked for it"


@pytest.mark.parametrize("level", LEVELS)
def test_restriction(kernels: Device, level: int) -> None:
    s = new_system(kernels, level + 1, 2)
    b = noise((2, grid.samples(level), grid.samples(level)), 7)
    s.put("b", level, b)
    s.restrict(level)
    close(s.get("b", level - 1), reference.restriction(b))


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("channels", [1, 2])
def test_coarsen(kernels: Device, level: int, channels: int) -> None:
    s = new_system(kernels, level, channels)
    host = fill(s)
    s.coarsen(EPS)
    d, f = host["d"], host["f"]
    for k in range(level - 1, -1, -1):
        d, f = reference.coarsen(d, f)
        close(s.get("d", k), d)
        close(s.get("f", k), f)


def crests(n: int) -> Field:
    """Crests along lines of samples, fixed and firm, alone and side by side, short and at borders; (1, n, n)."""
    d = np.zeros((n, n))
    d[n // 2, 8:-8] = d[8:-8, n // 4] = d[n // 8, 5:] = d[8:-8, n // 4 + 1] = -1
    d[0, 4:-9] = d[3:-3, -1] = -1
    d[5, 5:10] = 3.0
    d[6, 40:60] = d[7, 40:60] = 3.0
    d[30, 20:22] = -1
    return d[None]


@pytest.mark.parametrize("pinned", [False, True])
@pytest.mark.parametrize("channels", [1, 2])
def test_coarsen_crests_on_lines(kernels: Device, channels: int, pinned: bool) -> None:
    """SPEC S181."""
    level = 2
    s, d = new_system(kernels, level, channels), crests(grid.samples(level))
    if pinned:
        d[:, [0, -1]] = d[:, :, [0, -1]] = PINNED_SAMPLE
    f = noise((channels, *d.shape[1:]), 2) * (d < 0)
    s.put("d", level, d)
    s.put("f", level, f)
    s.coarsen(EPS)
    for k in range(level - 1, -1, -1):
        d, f = reference.coarsen(d, f)
        close(s.get("d", k), d)
        close(s.get("f", k), f)
        assert (d == LINE_STIFFNESS).sum() > 3 * (grid.samples(k) // 4), "crests are found"


@pytest.mark.parametrize("spring", [0.0, 1e-12, 1e-3])
def test_bottom_of_ground_that_hardly_anything_holds(kernels: Device, spring: float) -> None:
    """SPEC S183: weak springs set the mean height at once; where they are next to nothing it is that of the base."""
    s = new_system(kernels, 0, 1)
    d, f = np.zeros((1, 65, 65)), np.zeros((1, 65, 65))
    d[0, 20:24, 30:36] = spring
    f[0, 20:24, 30:36] = 100 * spring
    f[0, 10, 10:50], f[0, 12, 10:50] = 1.0, -1.0  # a slope
    s.put("d", 0, d)
    s.put("f", 0, f)
    s.coarsen(0.0)
    s.bottom(rhs="f", out="u", cycles=24)
    twin = reference.NumpySystem(d, f, 0.0, 0)
    twin.bottom(rhs="f", out="u", cycles=24)
    close(s.get("u", 0), twin.fields["u", 0])
    mean = float((reference.control_volumes(65) * s.get("u", 0)[0]).sum()) / 64**2
    assert mean == pytest.approx(100.0 if spring == 1e-3 else 0.0, abs=4.0)


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("cycles", [1, 3])
def test_bottom(kernels: Device, channels: int, cycles: int) -> None:
    s = new_system(kernels, 1, channels)
    host = fill(s)
    s.coarsen(EPS)
    twin = reference.NumpySystem(host["d"], host["f"], EPS, 1)
    s.bottom(rhs="f", out="u", cycles=cycles)
    twin.bottom(rhs="f", out="u", cycles=cycles)
    close(s.get("u", 0), twin.fields["u", 0], scale=10)
    assert len(twin.d) == 2 + BOTTOM_LEVELS


def test_lone_bottom_settles_fixed_samples(kernels: Device) -> None:
    """Level 0 as the finest level has fixed samples: the bottom cycles alone must settle it."""
    s = new_system(kernels, 0, 1)
    d, f = stiffness(65), noise((1, 65, 65))
    s.put("d", 0, d)
    s.put("f", 0, f)
    s.coarsen(EPS)
    s.bottom(rhs="f", out="u", cycles=24)
    u = s.get("u", 0).astype(np.float64)
    assert np.array_equal(u[d < 0], f[d < 0])
    assert np.abs(reference.residual(u, f, d, EPS)).max() < 1e-5


@pytest.mark.parametrize("level", LEVELS)
def test_divergence(kernels: Device, level: int) -> None:
    w = new_workspace(kernels, level)
    w.size_m = 1000.0
    n = grid.samples(level)
    d, f, g = stiffness(n), noise((1, n, n), 2), noise((2, n, n), 3)
    w.height.put("d", level, d)
    w.height.put("s", level, f)
    w.gradient.put("u", level, g)
    w.guide(level)
    close(w.height.get("f", level), reference.divergence(f, d, g, grid.spacing(level, 1000.0)))


def test_fixed_samples_are_held(kernels: Device) -> None:
    s = new_system(kernels, 2, 1)
    host = fill(s)
    s.hold()
    assert np.array_equal(s.get("u", 2), reference.held(host["u"], host["f"], host["d"]).astype(np.float32))


@pytest.mark.parametrize("scene", ["one", "cross", "loops", "fifty"])
@pytest.mark.parametrize("pinned", [False, True], ids=["free", "pinned"])
def test_rasterise(rasteriser: Device, scene: str, pinned: bool) -> None:
    """Float32 may pick the neighbouring segment within a few hundredths of a cell of a vertex, and see the slope of
    that one; the heights hardly differ. So: tight for nearly all samples, loose for the rest."""
    level = 3
    w = new_workspace(rasteriser, level)
    w.load(SCENES[scene], PINNED if pinned else SETTINGS)
    c = twin_raster(scene, pinned, level)
    pairs = (
        (w.height.get("d", level)[0], c.height_d, 2e-3),
        (w.height.get("s", level)[0], c.height_f, 2e-3),
        (w.gradient.get("d", level)[0], c.gradient_d, 2e-3),
        (w.gradient.get("f", level), c.gradient_f, 5e-2),
    )
    for actual, expected, loose in pairs:
        error = np.abs(actual - expected) / max(1.0, np.abs(expected).max())
        assert np.quantile(error, 0.97) < 1e-4
        assert (error > loose).mean() < 2e-2
    assert ((pairs[0][0] < 0) != (c.height_d < 0)).sum() <= 4


def test_a_dirty_window_gives_the_bits_of_a_full_raster(rasteriser: Device) -> None:
    """SPEC S15: rasterising only what changed changes nothing, on any level."""
    level, strokes = 3, SCENES["fifty"]
    w, fresh = new_workspace(rasteriser, level), new_workspace(rasteriser, level)
    w.load(strokes, SETTINGS)
    w.load(edited(strokes), SETTINGS)
    fresh.load(edited(strokes), SETTINGS)
    for a, b in ((w.height, fresh.height), (w.gradient, fresh.gradient)):
        for name in ("d", a.static):
            for k in range(level + 1):
                assert np.array_equal(a.get(name, k), b.get(name, k))
