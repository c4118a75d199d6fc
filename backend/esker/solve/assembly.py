"""The height step as a sparse system in float64, for tests and for the curious (DESIGN 5.1, 5.7)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from esker import grid
from esker.contract import Stroke, TerrainSettings
from esker.solve import multigrid, reference, reference_raster
from esker.solve.constraints import pack

System = tuple[sp.csr_array, NDArray[np.float64]]
GRADIENT_CYCLES = 60
GRADIENT_TOLERANCE = 1e-11


def assemble(strokes: Sequence[Stroke], settings: TerrainSettings, level: int) -> System:
    """(A, b) of the height step: A csr float64 (N^2, N^2), symmetric positive definite; b (N^2,).

    Unknowns are the heights in row-major sample order, row 0 south. Rows are those of the energy (DESIGN 5.1), halved:
    edges along a border weigh 1/2, border samples 1/2, corners 1/4. Fixed samples (crests, a pinned border) are
    identity rows and are eliminated from the other rows. Raises ValueError for a level outside 0..6.
    """
    tables = pack(strokes, settings, level)
    c = reference_raster.rasterise(tables)
    gradient = reference.NumpySystem(c.gradient_d[None], c.gradient_f, tables.screening, level)
    _diffuse(gradient)
    f = reference.divergence(
        c.height_f[None], c.height_d[None], gradient.fields["u", level], grid.spacing(level, settings.size_m)
    )[0]
    return system(c.height_d, f, tables.screening)


def system(d: NDArray[np.float64], f: NDArray[np.float64], screening: float) -> System:
    """The symmetric sparse system of one step from its fields (see ``reference``), shape (N, N) each."""
    n = len(d)
    share = np.ones(n)
    share[[0, -1]] = 0.5
    weight = np.outer(share, share).ravel()
    fixed = (d < 0).ravel()
    a = _laplacian(n, share) + _diagonal(weight * (np.maximum(d, 0).ravel() + screening))
    free = _diagonal((~fixed).astype(np.float64))
    value = np.where(fixed, f.ravel(), 0.0)
    b = np.where(fixed, value, weight * f.ravel() - a @ value)
    out = sp.csr_array(free @ a @ free + _diagonal(fixed.astype(np.float64)))
    out.eliminate_zeros()
    return out, b


def _diagonal(values: NDArray[np.float64]) -> Any:
    return sp.diags_array(values, offsets=0, format="csr")


def _laplacian(n: int, share: NDArray[np.float64]) -> Any:
    """Sum of differences over the edges of an n x n grid; edges along a border count half."""
    degree = np.full(n, 2.0)
    degree[[0, -1]] = 1.0
    side: Any = [degree, -np.ones(n - 1), -np.ones(n - 1)]
    line: Any = sp.diags_array(side, offsets=[0, 1, -1], format="csr")
    half = _diagonal(share)
    return sp.csr_array(sp.kron(half, line) + sp.kron(line, half))


def _diffuse(gradient: reference.NumpySystem) -> None:
    """The gradient step to float64 rest."""
    for level in range(gradient.top):
        multigrid.start(gradient, level)
        multigrid.finish(gradient, level)
    multigrid.start(gradient, gradient.top)
    for _ in range(GRADIENT_CYCLES if gradient.top > 0 else 0):
        multigrid.cycle(gradient)
        if gradient.change("v", "u") < GRADIENT_TOLERANCE:
            return
