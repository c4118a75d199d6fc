"""What a two-step solve asks of a GPU, by the byte model: launches, bytes, flops, and the floor that bandwidth sets.

A model, not a measurement: `python -m bench.solver.gpu_model` runs the solver's own cycles over systems that only
count. Launches are those of ``gpu_levels`` (a test holds them against the real ones); bytes are those of every field
that a kernel must read or write once, halos and caches left out.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from typing import Any

from bench.solver._kernels import Recorder
from esker import grid
from esker.contract import MAX_LEVEL
from esker.solve import multigrid
from esker.solve.opencl.gpu_levels import MOST_CHAINED
from esker.solve.solver import PREVIEW_GRADIENT_CYCLES, PREVIEW_HEIGHT_CYCLES

H100_BYTES = 3.3e12
"""Bytes a second of an H100's memory (SXM5, HBM3), as its maker states."""
GUIDE_FIELDS = 5
"""Fields of one level: two of the gradient, stiffness, static part, right-hand side."""


@dataclass
class Counter(Recorder):
    """Counts as ``gpu_levels`` launches: up to MOST_CHAINED restrictions behind each other at once."""

    chained: int = 0

    def restrict(self, level: int) -> None:
        """See ``multigrid.System``."""
        super().restrict(level)
        if 0 < self.chained < MOST_CHAINED:
            self.launches -= 1
        self.chained = self.chained % MOST_CHAINED + 1

    def visit(
        self, level: int, *, rhs: str, out: str, guess: str | None, correction: str | None, residual: bool
    ) -> None:
        """See ``multigrid.System``."""
        self.chained = 0
        super().visit(level, rhs=rhs, out=out, guess=guess, correction=correction, residual=residual)

    def bottom(self, *, rhs: str, out: str, cycles: int) -> None:
        """See ``multigrid.System``."""
        self.chained = 0
        super().bottom(rhs=rhs, out=out, cycles=cycles)


def two_step(top: int) -> dict[str, Any]:
    """All previews of levels 0..``top``, gradients and heights, from known constraints."""
    launches, moved, flops = 0, 0.0, 0.0
    for channels, cycles in ((2, PREVIEW_GRADIENT_CYCLES), (1, PREVIEW_HEIGHT_CYCLES)):
        system = Counter(top, channels)
        for level in range(top):
            multigrid.start(system, level)
            multigrid.finish(system, level)
        multigrid.start(system, top)
        for _ in range(cycles):
            multigrid.cycle(system)
        launches, moved, flops = launches + system.launches, moved + system.moved, flops + system.flops
    for level in range(top + 1):
        launches, moved = launches + 1, moved + 4 * GUIDE_FIELDS * grid.samples(level) ** 2
    return {
        "samples": grid.samples(top),
        "launches": launches,
        "gigabytes": round(moved / 1e9, 2),
        "gigaflops": round(flops / 1e9, 1),
        "floor_ms_at_h100_bandwidth": round(1e3 * moved / H100_BYTES, 2),
    }


def main() -> int:
    """The table of all levels as JSON."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    json.dump({"model": [two_step(level) for level in range(1, MAX_LEVEL + 1)]}, sys.stdout, indent=2)
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main())
