"""The height step as a sparse system in float64, for tests and for the curious (DESIGN 5.1, 5.7)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from esker import grid
from esker.contract import MAX_LEVEL, Stroke, TerrainSettings
from esker.solve import multigrid, reference
from esker.solve.base import Base
from esker.solve.constraints import raster_reference
from esker.solve.constraints.computable import computable
from esker.solve.constraints.constraints import pack

Field = NDArray[np.float64]
System = tuple[sp.csr_array, Field]
GRADIENT_TOLERANCE = 1e-11


def assemble(strokes: Sequence[Stroke], settings: TerrainSettings, level: int, base: Base | None = None) -> System:
    """(A, b) of the height step: A csr float64 (N^2, N^2), symmetric positive definite; b (N^2,).

    Unknowns are the heights, over ``base`` those above it, in row-major sample order, row 0 south. Rows are those of
    the energy (DESIGN 5.1), halved: edges along a border weigh 1/2, border samples 1/2, corners 1/4. Fixed samples
    (crests, a pinned border) are identity rows and are eliminated from the other rows. Raises ValueError for a level
    outside 0..6.
    """
    if not 0 <= level <= MAX_LEVEL:
        raise ValueError(f"level must be 0..{MAX_LEVEL}, not {level}")
    tables = pack(strokes, computable(settings), level, base=base)
    under = None if base is None else base.level(level).astype(np.float64)
    c = raster_reference.rasterise(tables, under)
    static = c.height_f
    if under is not None:
        static = reference.over_base(static, c.height_d, c.share, c.target, under, tables.spacing_m)
    gradient = reference.NumpySystem(c.gradient_d[None], c.gradient_f, tables.screening, level)
    _diffuse(gradient)
    f = reference.divergence(
        static[None], c.height_d[None], gradient.fields["u", level], grid.spacing(level, settings.size_m)
    )[0]
    return system(c.height_d, f, tables.screening)


def system(d: Field, f: Field, screening: float) -> System:
    """The symmetric sparse system of one step from its fields (see ``reference``), shape (N, N) each.

    Made of its five diagonals, so that 4097 samples a side take 2 GB, not ten.
    """
    n = len(d)
    share = np.ones(n)
    share[[0, -1]] = 0.5
    weight = np.outer(share, share)
    fixed = d < 0
    value = np.where(fixed, f, 0.0)
    diagonal = weight * (np.maximum(d, 0) + screening)
    b = weight * f
    offsets: dict[int, Field] = {}
    # Edges east and north: along a border they weigh half. (here, there) are the samples at their two ends.
    for offset, edge, here, there in (
        (1, np.broadcast_to(share[:, None], (n, n - 1)), np.s_[:, :-1], np.s_[:, 1:]),
        (n, np.broadcast_to(share[None, :], (n - 1, n)), np.s_[:-1], np.s_[1:]),
    ):
        for end, other in ((here, there), (there, here)):
            diagonal[end] += edge
            b[end] += edge * value[other]
        side = np.zeros((n, n))
        side[here] = np.where(fixed[here] | fixed[there], 0.0, -edge)
        offsets[offset] = side.ravel()[: n * n - offset]
    diagonal[fixed], b[fixed] = 1.0, value[fixed]
    bands: Any = [diagonal.ravel(), *(offsets[abs(k)] for k in (1, -1, n, -n))]
    out = sp.csr_array(sp.diags_array(bands, offsets=[0, 1, -1, n, -n], format="csr"))
    out.eliminate_zeros()
    return out, b.ravel()


def _diffuse(gradient: reference.NumpySystem) -> None:
    """The gradient step to float64 rest. Raises DivergedError."""
    for level in range(gradient.top):
        multigrid.start(gradient, level)
        multigrid.finish(gradient, level)
    multigrid.start(gradient, gradient.top)
    for _ in multigrid.converge(gradient, GRADIENT_TOLERANCE):
        pass
