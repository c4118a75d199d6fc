"""The row-wise kernels by themselves, and their twins (SPEC S1, S2, S15); see ``test_every_kernel``."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import numpy as np
import pytest

from esker.solve import reference
from esker.solve.constraints import raster_reference
from esker.solve.constraints.constraints import Packer, bins, pack
from esker.solve.constraints.tables import STROKE_AT
from esker.solve.opencl import program_text
from esker.solve.opencl.device import Device
from esker.solve.opencl.levels import PAD, ClSystem, Launcher
from tests.solver.scenes import PINNED, SCENES, SETTINGS
from tests.solver.twins import EPS, LEVELS, Field, fill, noise


def system(
    device: Device, level: int, channels: int, launch: Launcher | None = None
) -> tuple[ClSystem, dict[str, Field]]:
    """A system of noise, and the same fields for the twin."""
    s = ClSystem(launch or Launcher(device, level), level, channels, "f")
    return s, fill(s)


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
    folder = program_text.shader_folder()
    source = "".join((folder / name).read_text() for name in ("rows.cl", "plain.cl"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)
        program = cl.Program(device.context, program_text.defines({}) + source).build(["-cl-mad-enable"])
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


def blocks(a: Field) -> Field:
    """Samples of 17 x 17 bins, bin by bin."""
    return a.reshape(17, 16, 17, 16).swapaxes(1, 2).reshape(-1, 16, 16)


def test_nearest_segment_is_that_of_a_full_search() -> None:
    """The candidates of a bin always hold the nearest segment of every sample."""
    tables = pack(SCENES["loops"], SETTINGS, 2)
    for k, (first, count, *_) in enumerate(tables.index):
        seg = tables.segments[:, first : first + count].astype(np.float64)
        y, x = np.mgrid[: bins(257) * 16 : 1, : bins(257) * 16 : 1].astype(float)
        near = raster_reference._nearest(tables, k, blocks(x), blocks(y))
        best = np.full(x.shape, 1e30)
        for j in range(count):
            best = np.minimum(best, raster_reference._distance2(seg[:, j], x, y))
        best = np.sqrt(blocks(best))
        within = best <= tables.strokes[k, STROKE_AT["reach"]]
        assert np.allclose(near.distance[within], best[within])


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
