"""Every OpenCL kernel against its NumPy float64 twin (SPEC S1, S2)."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import grid
from esker.solve import device as device_module
from esker.solve import reference, reference_raster
from esker.solve.constraints import Packer, bins, pack
from esker.solve.device import Device
from esker.solve.levels import PAD, ClSystem, ClWorkspace, Launcher
from esker.solve.reference import BOTTOM_LEVELS
from esker.solve.tables import STROKE_AT
from tests.solver.scenes import PINNED, SCENES, SETTINGS

Field = NDArray[np.float64]
LEVELS = (1, 2, 3)
EPS = 0.01


def noise(shape: tuple[int, ...], seed: int = 0) -> Field:
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32).astype(np.float64)


def stiffness(n: int, seed: int = 1) -> Field:
    """Free, sprung and fixed samples, shape (1, n, n)."""
    rng = np.random.default_rng(seed)
    d = np.where(rng.random((1, n, n)) < 0.3, rng.random((1, n, n)), 0.0)
    return np.where(rng.random((1, n, n)) < 0.05, -1.0, d).astype(np.float32).astype(np.float64)


def close(actual: NDArray[np.float32], expected: Field, scale: float = 1.0) -> None:
    assert actual.shape == expected.shape
    assert np.abs(actual - expected).max() < 2e-5 * scale * max(1.0, np.abs(expected).max())


def system(
    device: Device, level: int, channels: int, launch: Launcher | None = None
) -> tuple[ClSystem, dict[str, Field]]:
    """A system whose fields of ``level`` and ``level - 1`` are noise, and the same fields for the twin."""
    n, m = grid.samples(level), grid.samples(level - 1)
    s = ClSystem(launch or Launcher(device, level), level, channels, "f")
    s.eps = {k: EPS * 4.0 ** (level - k) for k in range(level + 1)}
    host = {"d": stiffness(n), "f": noise((channels, n, n), 2), "u": noise((channels, n, n), 3)}
    host["e"] = noise((channels, m, m), 4)
    for name in ("d", "f", "u"):
        s.put(name, level, host[name])
    s.put("e", level - 1, host["e"])
    return s, host


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("start", ["zero", "guess", "both", "refresh"])
def test_visit(device: Device, level: int, channels: int, start: str) -> None:
    s, host = system(device, level, channels)
    guess = None if start == "zero" else "u"
    correction = None if start in ("guess", "refresh") else "e"
    s.visit(level, rhs="f", out="v", guess=guess, correction=correction, residual=True)
    u, coarse = reference.visit(
        host["u"] if guess else None, host["e"] if correction else None, host["f"], host["d"], EPS
    )
    close(s.get("v", level), u)
    close(s.get("b", level - 1), coarse)


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("strips", [1, 2, 5])
def test_visit_does_not_depend_on_the_strips(device: Device, strips: int, channels: int) -> None:
    """SPEC S15: the number of threads changes not one bit."""
    s, _ = system(device, 3, channels)
    s.visit(3, rhs="f", out="v", guess="u", correction="e", residual=True)
    one = dataclasses.replace(device, strips=strips)
    t = ClSystem(Launcher(one, 3), 3, channels, "f")
    t.eps = s.eps
    t.fields = s.fields | {("v", 3): t.fields["v", 3], ("b", 2): t.fields["b", 2]}
    t.visit(3, rhs="f", out="v", guess="u", correction="e", residual=True)
    assert np.array_equal(s.get("v", 3), t.get("v", 3))
    assert np.array_equal(s.get("b", 2), t.get("b", 2))


@pytest.fixture(scope="module")
def plain(device: Device) -> dict[str, Any]:
    """The kernels of plain.cl, which the product does not use."""
    cl = pytest.importorskip("pyopencl")
    folder = device_module.shader_folder()
    source = "".join((folder / name).read_text() for name in ("rows.cl", "plain.cl"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)
        program = cl.Program(device.context, device_module._defines({}) + source).build(["-cl-mad-enable"])
    return {kernel.function_name.removeprefix("plain_"): kernel for kernel in program.all_kernels()}


@pytest.mark.parametrize("level", [*LEVELS, 4])
@pytest.mark.parametrize("start", ["zero", "guess", "both"])
def test_visit_has_the_bits_of_its_steps(device: Device, plain: dict[str, Any], level: int, start: str) -> None:
    """The fused kernel against its plain twin, with several strips and blocks."""
    launch = Launcher(dataclasses.replace(device, strips=3), level)
    s, _ = system(device, level, 1, launch)
    n, m = s.shapes[level], s.shapes[level - 1]
    guess, correction = None if start == "zero" else "u", None if start == "guess" else "e"
    s.visit(level, rhs="f", out="v", guess=guess, correction=correction, residual=True)
    fields, queue = s.fields, device.queue
    pair = [launch.zeros(n.stride + PAD) for _ in range(2)]
    coarse = launch.zeros(m.stride + PAD)
    i, eps, f, d = np.int32, np.float32(EPS), fields["f", level], fields["d", level]
    plain["start"](
        queue, (n.n, n.n), None, fields[guess, level] if guess else None,
        fields[correction, level - 1] if correction else None, f, d, pair[0], i(n.pitch), i(m.pitch),
    )  # fmt: skip
    for w in reference.chebyshev_weights().astype(np.float32):
        plain["sweep"](queue, (n.n, n.n), None, pair[0], f, d, pair[1], i(n.n), i(n.pitch), eps, w)
        pair.reverse()
    plain["residual"](queue, (n.n, n.n), None, pair[0], f, d, pair[1], i(n.n), i(n.pitch), eps)
    plain["restriction"](queue, (m.n, m.n), None, pair[1], coarse, i(n.n), i(n.pitch), i(m.pitch))
    s.fields["plain", level], s.fields["plain", level - 1] = pair[0], coarse
    assert np.array_equal(s.get("v", level), s.get("plain", level))
    assert np.array_equal(s.get("b", level - 1), s.get("plain", level - 1))


@pytest.mark.parametrize("level", LEVELS)
def test_restriction(device: Device, level: int) -> None:
    s, _ = system(device, level + 1, 2)
    b = noise((2, grid.samples(level), grid.samples(level)), 7)
    s.put("b", level, b)
    s.restrict(level)
    close(s.get("b", level - 1), reference.restriction(b))


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("channels", [1, 2])
def test_coarsen(device: Device, level: int, channels: int) -> None:
    s, host = system(device, level, channels)
    s.coarsen(EPS)
    d, f = host["d"], host["f"]
    for k in range(level - 1, -1, -1):
        d, f = reference.coarsen(d, f)
        close(s.get("d", k), d)
        close(s.get("f", k), f)


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("cycles", [1, 3])
def test_bottom(device: Device, channels: int, cycles: int) -> None:
    s, host = system(device, 1, channels)
    s.coarsen(EPS)
    twin = reference.NumpySystem(host["d"], host["f"], EPS, 1)
    s.bottom(rhs="f", out="u", cycles=cycles)
    twin.bottom(rhs="f", out="u", cycles=cycles)
    close(s.get("u", 0), twin.fields["u", 0], scale=10)
    assert len(twin.d) == 2 + BOTTOM_LEVELS


def test_lone_bottom_settles_fixed_samples(device: Device) -> None:
    """Level 0 as the finest level has fixed samples: the bottom cycles alone must settle it."""
    s = ClSystem(Launcher(device, 0), 0, 1, "f")
    d, f = stiffness(65), noise((1, 65, 65))
    s.put("d", 0, d)
    s.put("f", 0, f)
    s.coarsen(EPS)
    s.bottom(rhs="f", out="u", cycles=24)
    u = s.get("u", 0).astype(np.float64)
    assert np.array_equal(u[d < 0], f[d < 0])
    assert np.abs(reference.residual(u, f, d, EPS)).max() < 1e-5


@pytest.mark.parametrize("level", LEVELS)
def test_divergence(device: Device, level: int) -> None:
    w = ClWorkspace(device, level)
    w.size_m = 1000.0
    n = grid.samples(level)
    d, f, g = stiffness(n), noise((1, n, n), 2), noise((2, n, n), 3)
    w.height.put("d", level, d)
    w.height.put("s", level, f)
    w.gradient.put("u", level, g)
    w.guide(level)
    close(w.height.get("f", level), reference.divergence(f, d, g, grid.spacing(level, 1000.0)))


def test_divergence_is_that_of_the_energy() -> None:
    """Half control volumes: weighted by them the divergence of any field sums to zero."""
    n = 17
    out = reference.divergence(np.zeros((1, n, n)), np.zeros((1, n, n)), noise((2, n, n)), 3.0)
    share = np.ones(n)
    share[[0, -1]] = 0.5
    assert abs((out[0] * np.outer(share, share)).sum()) < 1e-9


def test_change(device: Device) -> None:
    s, host = system(device, 2, 2)
    s.put("v", 2, noise(host["u"].shape, 9))
    assert s.change("u", "v") == pytest.approx(np.abs(host["u"] - noise(host["u"].shape, 9)).max(), rel=1e-6)


@pytest.mark.parametrize("strips", [1, 3])
@pytest.mark.parametrize("channels", [1, 2])
def test_a_visit_finds_the_change_on_its_way(device: Device, channels: int, strips: int) -> None:
    """What a settling visit says of itself is what a pass over both fields says."""
    s, _ = system(device, 3, channels, Launcher(dataclasses.replace(device, strips=strips), 3))
    s.change("u", "v")
    s.visit(3, rhs="f", out="v", guess="u", correction="e", residual=True)
    s.swap(3)
    assert s.changed == (s.fields["v", 3], s.fields["u", 3])
    on_its_way = s.change("v", "u")
    assert on_its_way == np.abs(s.get("u", 3) - s.get("v", 3)).max() > 0
    s.put("v", 3, s.get("u", 3))
    assert s.change("v", "u") == 0


def test_restriction_is_the_transpose_of_prolongation() -> None:
    """SPEC S1, in the inner product of the half control volumes of each grid."""
    n, m = 17, 9
    f, c = noise((1, n, n)), noise((1, m, m), 1)
    fine, coarse = np.ones(n), np.ones(m)
    fine[[0, -1]] = coarse[[0, -1]] = 0.5
    left = (reference.prolongation(c)[0] * f[0] * np.outer(fine, fine)).sum()
    right = (c[0] * reference.restriction(f)[0] * np.outer(coarse, coarse)).sum()
    assert left == pytest.approx(right, rel=1e-12)


@pytest.mark.parametrize("scene", ["one", "cross", "loops", "fifty"])
@pytest.mark.parametrize("settings", [SETTINGS, PINNED], ids=["free", "pinned"])
def test_rasterise(device: Device, scene: str, settings: object) -> None:
    """Float32 may pick the neighbouring segment within a few hundredths of a cell of a vertex, and see the slope of
    that one; the heights hardly differ. So: tight for nearly all samples, loose for the rest."""
    level = 3
    assert isinstance(settings, type(SETTINGS))
    tables = pack(SCENES[scene], settings, level)
    w = ClWorkspace(device, level)
    w.load(SCENES[scene], settings)
    c = reference_raster.rasterise(tables)
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
    fixed, twin = pairs[0][0] < 0, c.height_d < 0
    assert (fixed != twin).sum() <= 4


def blocks(a: Field) -> Field:
    """Samples of 17 x 17 bins, bin by bin."""
    return a.reshape(17, 16, 17, 16).swapaxes(1, 2).reshape(-1, 16, 16)


def test_nearest_segment_is_that_of_a_full_search() -> None:
    """The candidates of a bin always hold the nearest segment of every sample."""
    tables = pack(SCENES["loops"], SETTINGS, 2)
    for k, (first, count, *_) in enumerate(tables.index):
        seg = tables.segments[:, first : first + count]
        y, x = np.mgrid[: bins(257) * 16 : 1, : bins(257) * 16 : 1].astype(float)
        near = reference_raster._nearest(tables, k, blocks(x), blocks(y))
        best = np.full(x.shape, 1e30)
        for j in range(count):
            best = np.minimum(best, reference_raster._distance2(seg[:, j], x, y))
        best = np.sqrt(blocks(best))
        within = best <= tables.strokes[k, STROKE_AT["reach"]]
        assert np.allclose(near.distance[within], best[within])


def test_a_dirty_window_gives_the_bits_of_a_full_raster(device: Device) -> None:
    """SPEC S15: rasterising only what changed changes nothing."""
    level, strokes = 3, SCENES["fifty"]
    edited = [*strokes[:20], strokes[20].model_copy(update={"plateau_radius_m": 90.0}), *strokes[21:-3]]
    w, fresh = ClWorkspace(device, level), ClWorkspace(device, level)
    w.load(strokes, SETTINGS)
    w.load(edited, SETTINGS)
    fresh.load(edited, SETTINGS)
    for a, b in ((w.height, fresh.height), (w.gradient, fresh.gradient)):
        for name in ("d", a.static):
            assert np.array_equal(a.get(name, level), b.get(name, level))


def test_packer_finds_what_changed() -> None:
    p = Packer(3)
    strokes = SCENES["five"]
    whole = p.pack(strokes, SETTINGS)[1]
    assert whole is not None
    assert whole.width == len(whole.spans) == bins(513)
    assert p.pack(strokes, SETTINGS)[1] is None
    assert p.pack([s.model_copy(deep=True) for s in strokes], SETTINGS)[1] is None
    part = p.pack(strokes[1:], SETTINGS)[1]
    assert part is not None
    assert 0 < (part.spans[:, 1] - part.spans[:, 0]).sum() < bins(513) ** 2 / 2
    pinned = p.pack(strokes[1:], PINNED)[1]
    assert pinned is not None
    assert pinned.width == bins(513)
