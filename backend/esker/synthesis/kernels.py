"""The rule as an OpenCL kernel (shaders/opencl/synthesis*.cl): a window of a level at a time, from its parent's.

Twin: ``subdivide``. The root is made in NumPy: 4,761 samples at most.
"""

from __future__ import annotations

import warnings
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import BASE_ROUGHNESS, BASE_SURVEY, emit
from esker.contract import fractal as f
from esker.resources import SHADERS
from esker.synthesis.interpolate import Window
from esker.synthesis.rules import RULES, gullies
from esker.synthesis.rules.targets import tie
from esker.synthesis.site import BASES, Biases, Site
from esker.synthesis.state import WORDS, pack, unpack
from esker.synthesis.subdivide import Samples, chain, root

SOURCES: Final = ("synthesis.cl", "synthesis_rules.cl")
GROUP: Final = 64
"""Work-groups are always full: what compilers do with the rest of a row may round differently."""
LAUNCH: Final = np.dtype(
    [(name, "<i4") for name in ("level", "rule", "cyclic", "own_guide", "surveyed", "eroded", "row", "col", "rows",
                                "cols", "parent_row", "parent_col", "parent_rows", "parent_cols")]
    + [("seed", "<u4"), ("sea", "<i4"), ("cells", "<i4"), ("shift", "<i4")]
    + [(name, "<f4") for name in ("spacing", "relief", "shore", "zero", "amplitude", "snow_line", "tree_line",
                                  "plants", "tie", "grain", "strength")]
    + [("gully_side", "<i4")]
    + [(name, "<f4") for name in ("erosion", "hold", "wave", "depth", "far", "margin")]
    + [("offset", "<i4", len(Biases._fields)), ("side", "<i4", len(Biases._fields))]
)  # fmt: skip
"""``Launch`` of synthesis.cl."""


class ClDevice(Protocol):
    """The part of an opened OpenCL device that the synthesis uses."""

    @property
    def context(self) -> Any: ...
    @property
    def queue(self) -> Any: ...


class Kernels:
    """Makes samples on an OpenCL device. Use it from the thread that uses the device's queue.

    Raises pyopencl errors for a device that compiles no kernel or has no memory left.
    """

    def __init__(self, device: ClDevice) -> None:
        import pyopencl as cl

        self._cl, self._context, self._queue = cl, device.context, device.queue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", cl.CompilerWarning)
            program = cl.Program(self._context, source()).build([])
        self._kernel = cl.Kernel(program, "synthesise")

    def detail(self, site: Site, window: Window) -> Samples:
        """Computes what ``subdivide.detail`` does, in float32."""
        cl, flags = self._cl, self._cl.mem_flags
        first, *rest = chain(window)
        samples = root(site, first)
        if not rest:
            return Samples(first, samples.guide.astype(np.float32), unpack(pack(samples.state), np.float32))
        grids, offsets, sides = _packed(site)
        channels = self._copy(grids)
        at, guide, state = first, self._copy(samples.guide.astype(np.float32)), self._copy(pack(samples.state))
        for w in rest:
            own = w.level <= site.solved
            count = w.shape[0] * w.shape[1]
            child = cl.Buffer(self._context, flags.READ_WRITE, size=4 * WORDS * count)
            heights = (
                self._copy(site.guide(w).astype(np.float32))
                if own
                else cl.Buffer(self._context, flags.READ_WRITE, size=4 * count)
            )
            launch = self._copy(_launch(site, at, w, offsets, sides))
            size = (GROUP * -(-w.shape[1] // GROUP), w.shape[0])
            self._kernel(self._queue, size, (GROUP, 1), launch, channels, guide, state, heights, child)
            at, guide, state = w, heights, child
        words = np.empty((*window.shape, WORDS), dtype=np.uint32)
        out = np.empty(window.shape, dtype=np.float32)
        cl.enqueue_copy(self._queue, words, state)
        cl.enqueue_copy(self._queue, out, guide)
        return Samples(window, out, unpack(words, np.float32))

    def _copy(self, array: NDArray[Any]) -> Any:
        flags = self._cl.mem_flags
        return self._cl.Buffer(
            self._context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=np.ascontiguousarray(array)
        )


def source() -> str:
    """The program's text: constants, then the rule."""
    folder = SHADERS / "opencl"
    texts = [(folder / name).read_text(encoding="utf-8") for name in SOURCES]
    bases = f"#define SYNTH_BASE_ROUGHNESS {BASE_ROUGHNESS!r}f\n#define SYNTH_BASE_SURVEY ({BASE_SURVEY!r}f)"
    defines = f"{bases}\n#define SYNTH_GROUP {GROUP}\n#define SYNTH_GRIDS {len(Biases._fields)}"
    return "\n".join([emit.shader("cl"), defines, *texts])


def _packed(site: Site) -> tuple[NDArray[np.float32], list[int], list[int]]:
    """All channels' grids in one array, where each starts, and samples along its side."""
    grids = [
        site.channels.get(name, np.full((2, 2), BASES.get(name, 0.0), dtype=np.float32)) for name in Biases._fields
    ]
    offsets = np.cumsum([0, *(g.size for g in grids)])[:-1]
    flat = np.concatenate([np.asarray(g, dtype=np.float32).ravel() for g in grids])
    return flat, offsets.tolist(), [len(g) for g in grids]


def _launch(site: Site, parent: Window, child: Window, offsets: list[int], sides: list[int]) -> NDArray[Any]:
    look, level = site.look_rule, child.level
    out = np.zeros(1, dtype=LAUNCH)
    values = {
        "level": level, "rule": list(RULES).index(site.rule), "cyclic": site.cyclic,
        "own_guide": level <= site.solved, "surveyed": site.surveyed, "row": child.r0, "col": child.c0,
        "rows": child.shape[0], "cols": child.shape[1], "parent_row": parent.r0, "parent_col": parent.c0,
        "parent_rows": parent.shape[0], "parent_cols": parent.shape[1],
        "seed": site.seed, "sea": site.sea_level_m is not None, "cells": grid.cells(level),
        "shift": grid.cells(level).bit_length() - 1,
        "spacing": site.spacing(parent.level), "relief": site.relief_m, "shore": site.shore_m,
        "zero": site.zero_m,
        "amplitude": site.amplitude_m, "snow_line": look.snow_line, "tree_line": look.tree_line,
        "plants": look.plants, "tie": tie(level),
        "grain": f.SMOOTHNESS_NOISE * 2.0 ** (-f.SMOOTHNESS_NOISE_DECAY * level),
        "strength": f.CHANNEL_NOISE * 2.0 ** (-f.CHANNEL_NOISE_DECAY * level),
        "eroded": site.eroded and level > 0, "gully_side": site.gully_side, "erosion": site.erosion, "hold": site.hold,
        "wave": gullies.wave_m(site, level), "depth": gullies.depth_m(site, level), "far": site.far_m,
        "margin": site.far_margin_m, "offset": offsets, "side": sides,
    }  # fmt: skip
    for name, value in values.items():
        out[name] = value
    return out
