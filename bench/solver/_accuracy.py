"""Accuracy and convergence on the gallery: previews, rest, the floor of float32, and how fast the cycle gets there.

Everything is compared with a float64 solution of both steps on the same float32 constraints (``_exact``), so a tie that
float32 decides another way than float64 is not an error here; ``tests/solver`` bounds those by themselves.
"""

from __future__ import annotations

import gc
import time
from typing import Any

import numpy as np
import scipy.sparse.linalg as spla
from numpy.typing import NDArray
from scipy import ndimage

from bench.solver import _exact
from esker import grid
from esker.contract import Document
from esker.events import Pause, Preview, Settled
from esker.solve import multigrid
from esker.solve.assembly import assemble
from esker.solve.constraints import raster_reference
from esker.solve.constraints.constraints import pack
from esker.solve.opencl.device import open_device
from esker.solve.solver import Solver
from esker.templates import gallery

Field = NDArray[np.float32]

CURVE_CYCLES = 12
PREVIEWS = ((1, 2), (1, 3), (2, 2), (2, 3))
"""Cycles of the finest level for gradients and heights whose error is listed beside that of the product's previews."""
MAP_SCENES = ("fifty", "figure-six")
MAP_LEVEL = 4
MAP_SAMPLES = 256
"""Side of the committed error maps: the largest error of each block, so that no spot is averaged away."""


TIES_LEVEL = 2
"""Ties are counted up to this level: the twins are NumPy."""
TIE_OF_RELIEF, TIE_OF_STIFFNESS, TIE_SAMPLES = 1e-5, 1e-3, 3


def significant(value: float, digits: int = 3) -> float:
    """Few enough digits that the results are readable."""
    return float(f"{value:.{digits}g}")


def product(solver: Solver, document: Document, level: int) -> tuple[Field, Field, int]:
    """(finest preview, settled heights, steps between them) as the server gets them."""
    preview = settled = None
    steps = 0
    for result in solver.steps(document.strokes, document.settings, level):
        if isinstance(result, Pause):
            steps += preview is not None
        elif isinstance(result, Preview | Settled) and result.level == level:
            if result.settled:
                settled = result.heights
            else:
                preview = result.heights
    if settled is None:
        raise RuntimeError("the solve did not settle")
    return settled if preview is None else preview, settled, steps


def two_steps(w: _exact.DeviceWorkspace, gradient_cycles: int, height_cycles: int) -> None:
    """Full multigrid of both steps and so many cycles of the finest level: previews without reading them."""
    _exact.full_multigrid(w.gradient)
    for _ in range(gradient_cycles):
        multigrid.cycle(w.gradient)
    for level in range(w.top + 1):
        w.guide(level)
    _exact.full_multigrid(w.height)
    for _ in range(height_cycles):
        multigrid.cycle(w.height)


def measure(
    w: _exact.DeviceWorkspace,
    document: Document,
    shown: tuple[Field, Field, int],
    maps: dict[str, Field] | None = None,
    previews: bool = True,
) -> dict[str, Any]:
    """One scene at the level of ``w``. ``shown``: see ``product``. Error maps are added to ``maps``; ``previews`` adds
    the errors of PREVIEWS."""
    settings = document.settings
    c = _exact.load(w, document.strokes, settings)
    exact = _exact.exact(w, c)
    quantum = grid.quantum(w.top, settings.size_m)
    preview, settled, steps = shown

    def off(heights: Field) -> float:
        return float(np.abs(heights - exact.heights).max())

    out: dict[str, Any] = {
        "measured": time.strftime("%Y-%m-%d %H:%M"),
        "strokes": len(document.strokes),
        "relief_m": significant(exact.relief, 4),
        "gradient_factor": round(_exact.factor(w.gradient, c.gradient_d), 3),
        "height_factor": round(_exact.factor(w.height, c.height_d), 3),
        "preview_of_relief": significant(off(preview) / exact.relief),
        "preview_rms_of_relief": significant(float(np.sqrt(np.mean((preview - exact.heights) ** 2))) / exact.relief),
        "rest_of_quantum": significant(off(settled) / quantum),
        "rest_of_relief": significant(off(settled) / exact.relief),
        "steps_to_rest": steps,
    }
    if maps is not None:
        maps |= {"heights": pooled(exact.heights, np.mean), "preview": pooled(np.abs(preview - exact.heights), np.max)}
        maps["settled"] = pooled(np.abs(settled - exact.heights), np.max)
    _exact.load(w, document.strokes, settings)
    two_steps(w, *PREVIEWS[0])
    out["preview_by_cycles"] = {}
    for g, h in PREVIEWS if previews else ():
        _exact.load(w, document.strokes, settings)
        two_steps(w, g, h)
        out["preview_by_cycles"][f"{g}+{h}"] = significant(off(w.read(w.top)) / exact.relief)
    w.height.put("f", w.top, exact.f[None])
    curve = [e / exact.relief for e in _exact.errors_per_cycle(w.height, exact.heights, CURVE_CYCLES)]
    return out | {"curve_of_relief": [significant(e) for e in curve], "floor_of_relief": significant(curve[-1])}


def ties(document: Document, c: _exact.Constraints, exact: _exact.Exact) -> dict[str, Any]:
    """Samples whose constraint float32 makes another than float64, and how far that moves the ground.

    Where two strokes, or two segments of one, are equally near, rounding decides which counts: a tie. The float64
    ground is a sparse direct solve of ``assemble``; ``elsewhere`` is farther than TIE_SAMPLES from every tie.
    """
    level, strokes, settings = c.level, document.strokes, document.settings
    twin = raster_reference.rasterise(pack(strokes, settings, level))
    a, b = assemble(strokes, settings, level)
    heights = spla.spsolve(a.tocsc(), b).reshape(exact.heights.shape)
    d, f = c.height_d.astype(np.float64), c.height_f.astype(np.float64)
    apart = np.abs(_target(d, f, c.screening) - _target(twin.height_d, twin.height_f, c.screening))
    tied = apart * np.where(d < 0, 1, np.minimum(d + c.screening, 1)) > TIE_OF_RELIEF * exact.relief
    tied |= np.abs(d - twin.height_d) > TIE_OF_STIFFNESS * (1 + np.abs(twin.height_d))
    tied |= np.abs(c.gradient_d - twin.gradient_d) > TIE_OF_STIFFNESS
    tied |= (np.abs(c.gradient_f - twin.gradient_f) > TIE_OF_STIFFNESS * max(1.0, np.abs(twin.gradient_f).max())).any(0)
    error = np.abs(heights - exact.heights) / exact.relief
    near = ndimage.binary_dilation(tied, iterations=TIE_SAMPLES) if tied.any() else tied
    return {
        "samples": int(tied.sum()),
        "error_of_relief": significant(float(error.max())),
        "error_elsewhere_of_relief": significant(float(error[~near].max())),
    }


def _target(d: NDArray[np.float64], f: NDArray[np.float64], screening: float) -> NDArray[np.float64]:
    """The height that a constraint asks for. A sample without a spring asks too: its screening pulls to what f says."""
    pull = np.maximum(d + screening, min(TIE_OF_STIFFNESS, screening or TIE_OF_STIFFNESS))
    return np.where(d < 0, f, f / pull)


def pooled(field: NDArray[Any], take: Any) -> Field:
    """MAP_SAMPLES blocks a side of an (n, n) field, the last row and column left out."""
    each = (field.shape[0] - 1) // MAP_SAMPLES
    blocks = field[:-1, :-1].reshape(MAP_SAMPLES, each, MAP_SAMPLES, each)
    return np.asarray(take(blocks, axis=(1, 3)), dtype=np.float32)


def run(
    names: tuple[str, ...], levels: range, say: Any, wanted: str | None = None
) -> tuple[dict[str, Any], dict[str, Field]]:
    """({scene: {samples: figures}}, error maps). Raises RuntimeError where there is no OpenCL device."""
    device = open_device(wanted)
    if device is None:
        raise RuntimeError("No OpenCL device: there is nothing to compare with the float64 twin.")
    out: dict[str, Any] = {name: {} for name in names}
    maps: dict[str, Field] = {}
    for level in levels:
        for name in names:
            document = gallery.load(name)
            shown = product(
                Solver(wanted, max_level=level), document, level
            )  # a solver of its own: its memory goes first
            gc.collect()
            here: dict[str, Field] | None = {} if level == MAP_LEVEL and name in MAP_SCENES else None
            figures = measure(_exact.workspace(device, level), document, shown, here)
            if level <= TIES_LEVEL:
                w = _exact.workspace(device, level)
                c = _exact.load(w, document.strokes, document.settings)
                figures["ties"] = ties(document, c, _exact.exact(w, c))
            gc.collect()
            out[name][str(grid.samples(level))] = figures
            maps |= {f"{name}.{key}": value for key, value in (here or {}).items()}
            say(
                f"accuracy {grid.samples(level)}² {name}: factors {figures['gradient_factor']:.2f} and "
                f"{figures['height_factor']:.2f}, preview {figures['preview_of_relief']:.1e} of the relief, "
                f"rest {figures['rest_of_quantum']:.2f} of a quantum"
            )
    return out, maps
