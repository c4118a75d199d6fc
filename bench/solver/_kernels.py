"""The solver's times on one device: set-up, previews, settling, cycles and kernels, with bytes and flops by model.

Bytes are a model, the least that must move: a visit reads guess, right-hand side and stiffness and writes its result
once, and reads or writes a quarter of that for the coarser level; likewise the others. What a kernel moves again, in
rings of rows or halos, counts as time and not as bytes. Flops are counted in the difference form that the kernels use.
Shares are against a copy of COPY_BYTES on as many threads, and roofs against that and a chain of fused multiply-adds
on the same device, measured in the same run.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from bench.solver import _exact
from bench.solver._accuracy import significant, two_steps
from esker import grid
from esker.contract import CHEBYSHEV_SWEEPS, Stroke, TerrainSettings
from esker.events import Preview, Settled
from esker.process.system import processors
from esker.solve import multigrid
from esker.solve.opencl.device import Device, open_device
from esker.solve.solver import PREVIEW_GRADIENT_CYCLES, PREVIEW_HEIGHT_CYCLES, Solver
from esker.templates import gallery

RUNS = 7
COPY_BYTES = 256 * 1024 * 1024
"""Far above the last cache."""
COPIES = 20
"""Copies behind each other, enough that the cost of a launch does not count."""
TARGET = 1e-3
"""Share of the relief to which a preview must be right (DESIGN 5.3)."""
SWEEP_FLOPS = 14
"""Per sample: 4 differences and their sum 7, right-hand side 1, stiffness 2, relaxation 2 + 1, and the weight 1."""
FLOPS = {"prolong": 2, "sweeps": SWEEP_FLOPS * CHEBYSHEV_SWEEPS + 2, "residual": 10, "restrict": 2}


@dataclass
class Recorder:
    """A ``multigrid.System`` that only counts launches, bytes and flops by the model."""

    top: int
    channels: int
    moved: float = 0
    flops: float = 0
    launches: int = 0
    order: list[str] = field(default_factory=list)
    floor: float = 0.0

    def _count(self, level: int, floats: float, flops: float) -> None:
        samples = grid.samples(level) ** 2
        self.moved += 4 * floats * samples
        self.flops += self.channels * flops * samples
        self.launches += 1

    def visit(
        self, level: int, *, rhs: str, out: str, guess: str | None, correction: str | None, residual: bool
    ) -> None:
        self.order.append(f"{rhs}{out}{level}")
        # Guess, right-hand side and result per channel; the stiffness once; a quarter of a field per coarse transfer.
        fields = 2 + (guess is not None) + ((correction is not None) + residual) / 4
        flops = FLOPS["sweeps"]
        flops += FLOPS["prolong"] * (correction is not None) + (FLOPS["residual"] + FLOPS["restrict"]) * residual
        self._count(level, self.channels * fields + 1, flops)

    def restrict(self, level: int) -> None:
        self._count(level, self.channels * 1.25, FLOPS["restrict"])

    def bottom(self, *, rhs: str, out: str, cycles: int) -> None:
        self.order.append(f"{rhs}{out}0x{cycles}")
        # The levels below add a third.
        self._count(0, (3 * self.channels + 1) * cycles * 4 / 3, sum(FLOPS.values()) * cycles * 4 / 3)

    def swap(self, level: int) -> None:
        self.order.append(f"swap{level}")

    def hold(self) -> None:
        self._count(self.top, 2, 0)  # the stiffness is read; what is fixed is read and written, a field at most

    def change(self, old: str, new: str) -> float:
        """Counts the reads. A record has no values, so nothing changes: a settling solve is recorded up to its first
        look at what its last cycle did."""
        self.order.append(f"{old}{new}?")
        self._count(self.top, 2 * self.channels, 2)
        return 0.0

    def largest(self, name: str) -> float:
        """Counts the read; the largest value of a record is 0."""
        self.order.append(f"{name}?")
        self._count(self.top, self.channels, 1)
        return 0.0


def timed(work: Callable[[], object], runs: int = RUNS) -> dict[str, float]:
    """Milliseconds: least and median, after one run that does not count."""
    work()
    out = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        out.append(1e3 * (time.perf_counter() - start))
    return {"least": round(min(out), 3), "median": round(statistics.median(out), 3)}


def copy_bandwidth(threads: int) -> float:
    """Bytes read plus written per second by a copy, each thread a part, best of several."""
    a = np.ones(COPY_BYTES // 4, dtype=np.float32)
    b = np.zeros_like(a)
    parts = list(zip(np.array_split(a, threads), np.array_split(b, threads), strict=True))
    with ThreadPoolExecutor(threads) as pool:
        ms = timed(lambda: list(pool.map(lambda pair: np.copyto(pair[1], pair[0]), parts)), 2 * RUNS)["least"]
    return 2 * COPY_BYTES / (ms / 1e3)


def device_copy(device: Device) -> float:
    """Bytes read plus written per second by copies within the memory of a graphics card, of many behind each other."""
    import pyopencl as cl

    a, b = (cl.Buffer(device.context, cl.mem_flags.READ_WRITE, COPY_BYTES) for _ in range(2))
    cl.enqueue_fill_buffer(device.queue, a, np.ones(1, dtype=np.float32), 0, COPY_BYTES)

    def run() -> None:
        for _ in range(COPIES):
            cl.enqueue_copy(device.queue, b, a, byte_count=COPY_BYTES)
        device.queue.finish()

    return 2 * COPY_BYTES * COPIES / (timed(run)["least"] / 1e3)


PEAK_SOURCE = """
__kernel void chain(__global float *out, const float a, const float b, const int rounds) {
    float16 x0 = a, x1 = a + 1, x2 = a + 2, x3 = a + 3, x4 = a + 4, x5 = a + 5, x6 = a + 6, x7 = a + 7;
    float16 x8 = a + 8, x9 = a + 9;
    for (int k = 0; k < rounds; ++k) {
        x0 = mad(x0, b, a); x1 = mad(x1, b, a); x2 = mad(x2, b, a); x3 = mad(x3, b, a); x4 = mad(x4, b, a);
        x5 = mad(x5, b, a); x6 = mad(x6, b, a); x7 = mad(x7, b, a); x8 = mad(x8, b, a); x9 = mad(x9, b, a);
    }
    vstore16(x0 + x1 + x2 + x3 + x4 + x5 + x6 + x7 + x8 + x9, get_global_id(0), out);
}
"""


def peak_flops(device: Device) -> float:
    """Float operations per second of independent fused multiply-adds, all compute units busy."""
    import pyopencl as cl

    units = int(device.context.devices[0].max_compute_units)
    rounds, items, group = (100_000, 8 * units, 1) if device.plan is None else (4_000, 2048 * units, 256)
    kernel = cl.Program(device.context, PEAK_SOURCE).build(["-cl-mad-enable"]).chain
    out = cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, 64 * items)

    def run() -> None:
        kernel(device.queue, (items,), (group,), out, np.float32(0.5), np.float32(0.25), np.int32(rounds))
        device.queue.finish()

    return 2 * 10 * 16 * rounds * items / (timed(run, 5)["least"] / 1e3)


def stages(solver: Solver, strokes: Sequence[Stroke], settings: TerrainSettings, level: int) -> dict[str, float]:
    """Milliseconds with the raster known: to level 0, to the last preview, to the last settled level; least of RUNS."""
    best: dict[str, float] = {}
    for _ in range(RUNS):
        start = time.perf_counter()
        for result in solver.steps(strokes, settings, level):
            if not isinstance(result, Preview | Settled) or (result.settled and result.level < level):
                continue
            name = "settled" if result.settled else f"level_{result.level}"
            now = 1e3 * (time.perf_counter() - start)
            best[name] = round(min(best.get(name, 1e9), now), 2)
    return best


def edits(strokes: Sequence[Stroke]) -> list[list[Stroke]]:
    """The set with one stroke shortened, several times: what an append undoes."""
    out = []
    for k in range(0, len(strokes), max(1, len(strokes) // RUNS)):
        s = strokes[k]
        out.append([*strokes[:k], s.model_copy(update={"curve": s.curve[:-2]}), *strokes[k + 1 :]])
    return out


def after_edit(solver: Solver, strokes: Sequence[Stroke], settings: TerrainSettings, level: int) -> dict[str, float]:
    """Milliseconds from a one-stroke change to level 0 and to the finest preview, median over several strokes."""
    first, last = [], []
    for edited in edits(strokes):
        solver.solve(strokes, settings, level)
        start = time.perf_counter()
        for result in solver.steps(edited, settings, level):
            if not isinstance(result, Preview | Settled):
                continue
            now = 1e3 * (time.perf_counter() - start)
            if result.level == 0:
                first.append(now)
            if result.level == level:
                last.append(now)
                break
    return {"level_0": round(statistics.median(first), 2), f"level_{level}": round(statistics.median(last), 2)}


class Bench:
    """One scene on one workspace; every method leaves the queue empty."""

    def __init__(self, device: Device, level: int, scene: str, copy: float) -> None:
        self.w = _exact.workspace(device, level)
        self.document = gallery.load(scene)
        self.copy = copy
        self.queue = device.queue
        self.c = _exact.load(self.w, self.document.strokes, self.document.settings)
        self.exact = _exact.exact(self.w, self.c)

    def _ms(self, work: Callable[[], object], runs: int = RUNS) -> dict[str, float]:
        def run() -> None:
            work()
            self.queue.finish()

        return timed(run, runs)

    def _load(self) -> None:
        self.w.packer.forget()
        self.w.load(self.document.strokes, self.document.settings)

    def _heights(self, cycles: int) -> None:
        _exact.full_multigrid(self.w.height)
        for _ in range(cycles):
            multigrid.cycle(self.w.height)

    def _error(self) -> float:
        return float(np.abs(self.w.read(self.w.top) - self.exact.heights).max())

    def whole(self) -> dict[str, Any]:
        """Set-up, heights alone to 10^-3 and to rest, and both steps to 10^-3: kernels only, nothing read back."""
        w = self.w
        out: dict[str, Any] = {"set_up_ms": self._ms(self._load, 3)}
        out["coarsen_heights_ms"] = self._ms(lambda: w.height.coarsen(self.c.screening))
        g, h = PREVIEW_GRADIENT_CYCLES, PREVIEW_HEIGHT_CYCLES
        out["two_step"] = {"cycles": f"{g}+{h}", "ms": self._ms(lambda: two_steps(w, g, h))}
        out["two_step"]["error_of_relief"] = significant(self._error() / self.exact.relief)
        # The heights alone, with the exact gradient: the very system that the peers get.
        w.height.put("f", w.top, self.exact.f[None])
        rest = grid.quantum(w.top, self.document.settings.size_m) / 4
        for name, cycles in (
            ("heights_fmg_3", 3),
            ("heights_to_target", self._count(TARGET * self.exact.relief)),
            ("heights_to_rest", self._count(rest)),
        ):
            row = {"cycles": cycles, "ms": self._ms(partial(self._heights, cycles))}
            out[name] = row | {"error_m": significant(self._error())}
            out[name]["error_of_relief"] = significant(out[name]["error_m"] / self.exact.relief)
        return out

    def _count(self, bound: float) -> int:
        """Fewest cycles after the full multigrid that bring the error of the heights below ``bound`` metres."""
        for cycles, error in enumerate(_exact.errors_per_cycle(self.w.height, self.exact.heights, 20)):
            if error < bound:
                return cycles
        raise RuntimeError(f"20 cycles left an error above {bound:.1e} m")

    def cycles(self) -> dict[str, Any]:
        """One cycle of either step at the finest level."""
        out = {}
        for name, system in (("gradient", self.w.gradient), ("height", self.w.height)):
            model = Recorder(self.w.top, system.channels)
            multigrid.cycle(model)
            ms = self._ms(partial(multigrid.cycle, system))
            out[f"{name}_cycle"] = self._against(ms, model.moved, model.flops) | {"launches": model.launches}
        return out

    def _against(self, ms: dict[str, float], moved: float, flops: float) -> dict[str, Any]:
        seconds = ms["least"] / 1e3
        return {
            "ms": ms,
            "model_mb": round(moved / 1e6, 2),
            "gflop_per_s": round(flops / seconds / 1e9, 2),
            "flop_per_byte": round(flops / moved, 3),
            "share_of_copy": round(moved / seconds / self.copy, 3),
        }

    def kernels(self) -> dict[str, Any]:
        """Single launches at the finest level."""
        w, top = self.w, self.w.top
        n2 = grid.samples(top) ** 2
        work: dict[str, tuple[Callable[[], object], float, float]] = {}
        for name, system in (("gradient", w.gradient), ("height", w.height)):
            for call, options in (
                ("visit", {"guess": "u", "correction": "e", "residual": True}),
                ("first visit", {"guess": None, "correction": "e", "residual": True}),
            ):
                model = Recorder(top, system.channels)
                model.visit(top, rhs="f", out="v", **options)
                run = partial(system.visit, top, rhs="f", out="v", **options)
                work[f"{name} {call}"] = run, model.moved, model.flops
            model = Recorder(top, system.channels)
            model.bottom(rhs="b", out="e", cycles=2)
            work[f"{name} bottom"] = partial(system.bottom, rhs="b", out="e", cycles=2), model.moved, model.flops
        # d and static part of each, read, and a quarter of them and all below written: a third more in the end.
        work["height coarsen"] = lambda: w.height.coarsen(self.c.screening), 4 * n2 * 2 * 1.25 * 4 / 3, 12 * n2
        work["divergence"] = lambda: w.guide(top), 4 * n2 * 5, 5 * n2
        work["change"] = lambda: w.height.change("v", "u"), 4 * n2 * 2, 3 * n2
        return {name: self._against(self._ms(run), moved, flops) for name, (run, moved, flops) in work.items()}


def run(
    threads: int | None, levels: range, scenes: Sequence[str], say: Callable[[str], None], wanted: str | None = None
) -> dict[str, Any]:
    """All figures of a process with so many threads; None: those of the device, all processors for copies.

    ``wanted``: part of the device's name. Raises RuntimeError where there is no OpenCL device.
    """
    device = open_device(wanted, threads)
    if device is None:
        raise RuntimeError("No OpenCL device: NumPy is not worth timing.")
    copy = copy_bandwidth(threads or processors()) if device.plan is None else device_copy(device)
    out: dict[str, Any] = {
        "device": device.name,
        "copy_gb_per_s": round(copy / 1e9, 2),
        "peak_gflop_per_s": round(peak_flops(device) / 1e9, 1),
        "scenes": {name: {} for name in scenes},
    }
    for level in levels:
        for name in scenes:
            document = gallery.load(name)
            bench = Bench(device, level, name, copy)
            row = {"strokes": len(document.strokes), **bench.whole(), **bench.cycles(), "kernels": bench.kernels()}
            del bench
            solver = Solver(wanted, max_level=level)
            solver.solve(document.strokes, document.settings, level)
            row["from_rest_ms"] = stages(solver, document.strokes, document.settings, level)
            row["after_edit_ms"] = after_edit(solver, document.strokes, document.settings, level)
            del solver
            out["scenes"][name][str(grid.samples(level))] = row
            say(
                f"{device.name if threads is None else f'{threads} thread(s)'}, {grid.samples(level)}² {name}: "
                f"two steps {row['two_step']['ms']['least']:.1f} ms, settled {row['from_rest_ms']['settled']:.0f} ms"
            )
    return out
