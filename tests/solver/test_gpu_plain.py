"""The fused kernels for GPUs against their plain twins (SPEC S2): a launch a stage, in global memory, to the bit."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from esker import grid
from esker.contract import CHEBYSHEV_SWEEPS
from esker.solve.opencl import device as devices
from esker.solve.opencl import gpu_program, program_text
from esker.solve.opencl.device import Device
from esker.solve.opencl.gpu_levels import BLOCK, GpuLauncher, GpuSystem, bottom_table
from esker.solve.reference import BOTTOM_LEVELS, chebyshev_weights
from tests.solver.twins import EPS, noise, stiffness, tile_device


@pytest.fixture(scope="module")
def tiles() -> Device:
    found = tile_device("full")
    if found is None:
        pytest.skip("no OpenCL device")
    return found


@pytest.fixture(scope="module")
def plain_launcher(tiles: Device) -> GpuLauncher:
    """Launches the plain kernels on the same queue."""
    assert tiles.plan is not None
    files = program_text.files()
    texts = [files[name] for name in ("gpu/level.cl", "gpu/setup.cl", "gpu/plain.cl")]
    source = program_text.defines(gpu_program.defines(tiles.plan)) + "\n".join(texts)
    return GpuLauncher(replace(tiles, program=devices._compile(tiles.context, source, tiles.plan)))


class Plain:
    """One stage after the other on the fields of a system."""

    def __init__(self, system: GpuSystem, launcher: GpuLauncher) -> None:
        self.s, self.run, self.table = system, launcher.run_once, bottom_table()[0]
        self.weights = chebyshev_weights().astype(np.float32)

    def layout(self, level: int) -> tuple[int, int, int, int]:
        """n, pitch, stride and beginning of a level, also below 0."""
        if level >= 0:
            shape = self.s.shapes[level]
            return shape.n, shape.pitch, shape.stride, 0
        at, n, pitch, _ = (int(v) for v in self.table[-level])
        return n, pitch, self.s.shapes[0].stride, at

    def launch(self, name: str, samples: int, *args: Any) -> None:
        groups = -(-samples // BLOCK[0]), -(-samples // BLOCK[1]), self.s.channels
        self.run(name, groups, (*BLOCK, 1), *(np.int32(a) if isinstance(a, int) else a for a in args))

    def field(self, name: str | None, level: int) -> Any:
        return None if name is None else self.s.fields[name, max(level, 0)]

    def relax(self, level: int, rhs: str, guess: str | None, correction: str | None, out: str) -> None:
        """out = sweeps of (guess + P correction); t is scratch."""
        n, pitch, stride, at = self.layout(level)
        _, pitch2, stride2, under = self.layout(level - 1)
        eps = np.float32(self.s.eps[0] * 4.0**-level if level < 0 else self.s.eps[level])
        b, d = self.field(rhs, level), self.field("d", level)
        u, v = self.s.launch.zeros(self.s.channels * stride), self.s.launch.zeros(self.s.channels * stride)
        self.launch(
            "plain_start", n, self.field(guess, level), self.field(correction, level - 1), b, d, u, n, pitch, stride,
            pitch2, stride2, at, under,
        )  # fmt: skip
        for k in range(CHEBYSHEV_SWEEPS):
            self.launch("plain_sweep", n, u, b, d, v, n, pitch, stride, at, eps, self.weights[k])
            u, v = v, u
        target = self.field(out, level)
        for c in range(self.s.channels):
            first, size = 4 * (at + c * stride), 4 * n * pitch
            queue = self.s.launch.queue
            self.s.launch.cl.enqueue_copy(queue, target, u, src_offset=first, dst_offset=first, byte_count=size)

    def residual(self, level: int, rhs: str, of: str, out: str) -> None:
        """out of level - 1 = R (rhs - A of)."""
        n, pitch, stride, at = self.layout(level)
        eps = np.float32(self.s.eps[0] * 4.0**-level if level < 0 else self.s.eps[level])
        r = self.s.launch.zeros(self.s.channels * stride)
        fields = (self.field(name, level) for name in (of, rhs, "d"))
        self.launch("plain_residual", n, *fields, r, n, pitch, stride, at, eps)
        self.restrict(level, r, self.field(out, level - 1))

    def restrict(self, level: int, fine: Any, coarse: Any) -> None:
        n, pitch, stride, at = self.layout(level)
        _, pitch2, stride2, under = self.layout(level - 1)
        self.launch("plain_restriction", n, fine, coarse, n, pitch, stride, pitch2, stride2, at, under)

    def v_cycle(self, rhs: str, out: str, first: bool) -> None:
        """One V-cycle on level 0; right-hand sides of the levels below in t, their corrections in ``out``."""
        if first:
            n, pitch, stride, _ = self.layout(0)
            args = (None, None, self.field(rhs, 0), self.field("d", 0), self.field(out, 0))
            self.launch("plain_start", n, *args, n, pitch, stride, pitch, stride, 0, 0)
        self.residual(0, rhs, out, "t")
        for level in range(-1, -BOTTOM_LEVELS, -1):
            self.restrict(level, self.field("t", 0), self.field("t", 0))
        n, pitch, stride, at = self.layout(-BOTTOM_LEVELS)
        self.launch("plain_coarsest", n, self.s.matrix, self.field("t", 0), self.field(out, 0), n, pitch, stride, at)
        for level in range(1 - BOTTOM_LEVELS, 0):
            self.relax(level, "t", None, out, out)
        self.relax(0, rhs, out, out, out)


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("units", [1, 1 << 20], ids=["wide", "small"])
@pytest.mark.parametrize("start", ["zero", "guess", "both"])
def test_visit(tiles: Device, plain_launcher: GpuLauncher, channels: int, units: int, start: str) -> None:
    level = 2
    assert tiles.plan is not None
    s = GpuSystem(GpuLauncher(replace(tiles, plan=replace(tiles.plan, units=units))), level, channels, "f")
    s.eps = {k: EPS * 4.0 ** (level - k) for k in range(level + 1)}
    n, m = grid.samples(level), grid.samples(level - 1)
    s.put("d", level, stiffness(n))
    s.put("f", level, noise((channels, n, n), 2))
    s.put("u", level, noise((channels, n, n), 3))
    s.put("e", level - 1, noise((channels, m, m), 4))
    guess = None if start == "zero" else "u"
    correction = None if start == "guess" else "e"
    s.visit(level, rhs="f", out="v", guess=guess, correction=correction, residual=True)
    fused = s.get("v", level), s.get("b", level - 1)
    plain = Plain(s, plain_launcher)
    plain.relax(level, "f", guess, correction, "v")
    plain.residual(level, "f", "v", "b")
    assert np.array_equal(s.get("v", level), fused[0])
    assert np.array_equal(s.get("b", level - 1), fused[1])
    assert np.abs(fused[1]).max() > 0


@pytest.mark.parametrize("channels", [1, 2])
def test_bottom(tiles: Device, plain_launcher: GpuLauncher, channels: int) -> None:
    s = GpuSystem(GpuLauncher(tiles), 1, channels, "f")
    n = grid.samples(1)
    s.put("d", 1, stiffness(n))
    s.put("f", 1, noise((channels, n, n), 2))
    s.coarsen(EPS)
    s.bottom(rhs="f", out="u", cycles=3)
    fused = s.get("u", 0)
    plain = Plain(s, plain_launcher)
    for cycle in range(3):
        plain.v_cycle("f", "e", first=cycle == 0)
    assert np.array_equal(s.get("e", 0), fused)
    assert np.abs(fused).max() > 0


def test_only_processors_compilers_meet_their_builtins(tiles: Device) -> None:
    """SPEC S580: NVIDIA's compiler refused ``__builtin_prefetch``, so each of its cards was left for NumPy."""
    files = program_text.files()
    elsewhere = {
        name: re.sub(r"#if defined\(__x86_64__\).*?\n(?:#else\n(.*?))?#endif", r"\1", text, flags=re.DOTALL)
        for name, text in files.items()
    }
    assert any(elsewhere[name] != text for name, text in files.items())
    for name, text in elsewhere.items():
        # Any clang shuffles vectors, whatever it compiles for.
        assert "__builtin" not in text.replace("__builtin_shufflevector", ""), name
        assert "#pragma clang" not in text, name
    source = program_text.source(None)
    for name, text in files.items():
        source = source.replace(text, elsewhere[name])
    assert "rasterise" in devices._compile(tiles.context, source, None).kernel_names
