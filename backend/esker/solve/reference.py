"""NumPy float64 twins of every OpenCL kernel, and the back end that serves without OpenCL (DESIGN 5.3, 16).

Fields are (channels, n, n), row 0 south. Equations are per sample with mirrored borders: the row of a border sample
is the energy's (half control volume) doubled. Stiffness ``d`` excludes screening; it is HARD at fixed samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from esker.contract import (
    CHEBYSHEV_HIGH,
    CHEBYSHEV_LOW,
    CHEBYSHEV_SWEEPS,
    CREST_STIFFNESS,
    SATURATION,
    Stroke,
    TerrainSettings,
)
from esker.grid import samples
from esker.solve import reference_raster
from esker.solve.base import Base
from esker.solve.constraints import Packer
from esker.solve.tables import BIN, PINNED, PINNED_STIFFNESS, Window

if TYPE_CHECKING:
    from esker.solve.passes import Workspace

Field = NDArray[np.float64]

BOTTOM_LEVELS = 4
"""Levels below level 0 (33, 17, 9 and 5 samples a side) that ``bottom`` uses for itself."""
COARSEST_SWEEPS = 60
COARSEST_RELAXATION = 1.4


def chebyshev_weights(sweeps: int = CHEBYSHEV_SWEEPS) -> Field:
    """Relaxation of each Jacobi sweep: the Chebyshev polynomial on [CHEBYSHEV_LOW, CHEBYSHEV_HIGH]."""
    mid, half = (CHEBYSHEV_HIGH + CHEBYSHEV_LOW) / 2, (CHEBYSHEV_HIGH - CHEBYSHEV_LOW) / 2
    k = np.arange(sweeps)
    return np.asarray(1 / (mid + half * np.cos(np.pi * (2 * k + 1) / (2 * sweeps))))


def laplacian(u: Field) -> Field:
    """Sum over the four neighbours of (u_j - u_i), borders mirrored."""
    p = np.pad(u, ((0, 0), (1, 1), (1, 1)), mode="reflect")
    return (
        (p[:, :-2, 1:-1] - u) + (p[:, 2:, 1:-1] - u) + (p[:, 1:-1, :-2] - u) + (p[:, 1:-1, 2:] - u)
    )  # difference form: float32 keeps the small differences that a sum minus 4u would lose


def restriction(f: Field) -> Field:
    """R = P^T for mirrored borders: weights 1, 1/2, 1/4 over 3 x 3, so that a constant grows fourfold."""
    p = np.pad(f, ((0, 0), (1, 1), (1, 1)), mode="reflect")
    rows = p[:, :-2:2] / 2 + p[:, 1:-1:2] + p[:, 2::2] / 2
    return np.asarray(rows[:, :, :-2:2] / 2 + rows[:, :, 1:-1:2] + rows[:, :, 2::2] / 2)


def prolongation(c: Field) -> Field:
    """P: bilinear."""
    n = 2 * c.shape[1] - 1
    f = np.empty((len(c), n, n))
    f[:, ::2, ::2] = c
    f[:, ::2, 1::2] = (c[:, :, 1:] + c[:, :, :-1]) / 2
    f[:, 1::2] = (f[:, 2::2] + f[:, :-2:2]) / 2
    return f


def coarsen(d: Field, f: Field) -> tuple[Field, Field]:
    """Constraints one level coarser: springs summed by R, saturating like springs in series (DESIGN 5.3).

    d: (1, n, n); f: (channels, n, n), stiffness times target (the value itself where fixed). A pinned border is
    on every level: there it stays as good as fixed, at 0; with springs that saturate the cycle diverges.
    """
    hard = d < 0
    total = restriction(np.where(hard, CREST_STIFFNESS, d))
    pull = restriction(np.where(hard, CREST_STIFFNESS * f, f))
    k = 1 / (1 + SATURATION * total)
    centre = d[:, ::2, ::2]
    pinned = (centre <= PINNED) | (centre >= PINNED_STIFFNESS / 2)
    return np.where(pinned, PINNED_STIFFNESS, total * k), np.where(pinned, 0.0, pull * k)


def divergence(static: Field, d: Field, g: Field, spacing_m: float) -> Field:
    """Right-hand side of the height step: static part minus the divergence of the guidance (DESIGN 5.1).

    g: (2, n, n) gradient, metres per metre; the guidance on an edge is the mean of its ends times the spacing. At a
    border the row is doubled like the operator's. Fixed samples keep their value.
    """
    out = np.zeros_like(static)
    for axis, component in ((2, g[:1]), (1, g[1:])):
        c = np.moveaxis(component, axis, -1)
        part = np.empty_like(c)
        part[..., 1:-1] = -0.5 * (c[..., 2:] - c[..., :-2])
        part[..., 0] = -(c[..., 0] + c[..., 1])
        part[..., -1] = c[..., -1] + c[..., -2]
        out += np.moveaxis(part, -1, axis) * spacing_m
    return np.asarray(np.where(d < 0, static, static + out))


def held(u: Field, f: Field, d: Field) -> Field:
    """u, but f where fixed."""
    return np.asarray(np.where(d < 0, f, u))


def over_base(static: Field, d: Field, share: Field, target: Field, base: Field, slack: float) -> Field:
    """Static right-hand side of the height step over a base (docs/solver.md, "Over a base"), all (n, n).

    ``share`` of the guidance prescribes the ground itself: so that much of the base's own difference along each edge,
    with the mean share of its two ends, is taken off what lies above the base. Where a cliff of the base leaves a band
    that is too much or too little: then, to within ``slack`` metres, what the two ends' ``target`` differ by, with a
    share between those of the ends; between a fill and a cut it may be less than either. Borders are mirrored.
    """
    s, b, t = (np.pad(a, 1, mode="reflect") for a in (share, base, target))
    out = np.zeros_like(static)
    for rows, columns in ((slice(0, -2), slice(1, -1)), (slice(2, None), slice(1, -1)),
                          (slice(1, -1), slice(0, -2)), (slice(1, -1), slice(2, None))):  # fmt: skip
        step, fall = b[rows, columns] - base, target - t[rows, columns]
        low, high = np.sort([share * step, s[rows, columns] * step], axis=0)
        through = target * t[rows, columns] < 0
        low, high = np.where(through, np.minimum(low, 0), low), np.where(through, np.maximum(high, 0), high)
        mean = 0.5 * (share + s[rows, columns]) * step
        out += np.clip(np.clip(mean, fall - slack, fall + slack), low, high)
    return np.asarray(np.where(d < 0, static, static + out))


def residual(u: Field, rhs: Field, d: Field, screening: float) -> Field:
    """rhs - A u, zero at fixed samples."""
    return np.asarray(np.where(d < 0, 0.0, rhs + laplacian(u) - (d + screening) * u))


def sweeps(u: Field, rhs: Field, d: Field, screening: float) -> Field:
    """The Chebyshev-Jacobi sweeps."""
    q = np.where(d < 0, 0.0, 1 / (4 + screening + np.maximum(d, 0)))
    for w in chebyshev_weights():
        u = u + w * q * residual(u, rhs, d, screening)
    return u


def visit(guess: Field | None, correction: Field | None, rhs: Field, d: Field, screening: float) -> tuple[Field, Field]:
    """(S(guess + P correction), R(rhs - A of it)): see ``multigrid.System.visit``."""
    hard = d < 0
    u = np.where(hard, rhs, 0.0) if guess is None else guess
    if correction is not None:
        u = u + np.where(hard, 0.0, prolongation(correction))
    u = sweeps(u, rhs, d, screening)
    return u, restriction(residual(u, rhs, d, screening))


def bottom(rhs: Field, d: list[Field], screening: list[float], cycles: int, coarsest: Field) -> Field:
    """V-cycles from zero for rhs on a list of levels, finest first; ``coarsest``: see ``relaxation_matrix``."""

    def v_cycle(k: int, u: Field, b: Field) -> Field:
        if k == len(d) - 1:
            return np.asarray((b.reshape(len(b), -1) @ coarsest.T).reshape(b.shape))
        r = restriction(residual(u, b, d[k], screening[k]))
        e = v_cycle(k + 1, np.zeros_like(r), r)
        return sweeps(u + np.where(d[k] < 0, 0.0, prolongation(e)), b, d[k], screening[k])

    u = np.where(d[0] < 0, rhs, 0.0)
    for _ in range(cycles):
        u = v_cycle(0, u, rhs)
    return u


def relaxation_matrix(d: Field, screening: float) -> Field:
    """The linear map, b to u, of COARSEST_SWEEPS lexicographic over-relaxations from zero, shape (n*n, n*n)."""
    n = d.shape[1]
    mirror = np.abs(np.arange(-1, n + 1))
    mirror[-1] = n - 2
    b = np.eye(n * n).reshape(n * n, n, n)
    u = np.zeros_like(b)
    for _ in range(COARSEST_SWEEPS):
        for y in range(n):
            for x in range(n):
                around = u[:, mirror[y], x] + u[:, mirror[y + 2], x] + u[:, y, mirror[x]] + u[:, y, mirror[x + 2]]
                value = (b[:, y, x] + around) / (4 + d[0, y, x] + screening)
                u[:, y, x] += COARSEST_RELAXATION * (value - u[:, y, x])
    return u.reshape(n * n, n * n).T


class NumpySystem:
    """``multigrid.System`` in float64. Level ``top`` holds the fixed samples; ``screening`` is that of the top."""

    def __init__(self, d: Field, f: Field, screening: float, top: int) -> None:
        self.top = top
        self.d: dict[int, Field] = {top: d}
        self.static: dict[int, Field] = {top: f}
        self.eps = {level: screening * 4.0 ** (top - level) for level in range(top, -BOTTOM_LEVELS - 1, -1)}
        for level in range(top, -BOTTOM_LEVELS, -1):
            self.d[level - 1], self.static[level - 1] = coarsen(self.d[level], self.static[level])
        self.coarsest = relaxation_matrix(self.d[-BOTTOM_LEVELS], self.eps[-BOTTOM_LEVELS])
        self.fields: dict[tuple[str, int], Field] = {("f", level): a for level, a in self.static.items()}

    def visit(
        self, level: int, *, rhs: str, out: str, guess: str | None, correction: str | None, residual: bool
    ) -> None:
        new, coarse = visit(
            None if guess is None else self.fields[guess, level],
            None if correction is None else self.fields[correction, level - 1],
            self.fields[rhs, level],
            self.d[level],
            self.eps[level],
        )
        self.fields[out, level] = new
        if residual:
            self.fields["b", level - 1] = coarse

    def restrict(self, level: int) -> None:
        self.fields["b", level - 1] = restriction(self.fields["b", level])

    def bottom(self, *, rhs: str, out: str, cycles: int) -> None:
        levels = range(0, -BOTTOM_LEVELS - 1, -1)
        d, eps = [self.d[level] for level in levels], [self.eps[level] for level in levels]
        self.fields[out, 0] = bottom(self.fields[rhs, 0], d, eps, cycles, self.coarsest)

    def swap(self, level: int) -> None:
        self.fields["u", level], self.fields["v", level] = self.fields["v", level], self.fields["u", level]

    def hold(self) -> None:
        u, f = self.fields["u", self.top], self.fields["f", self.top]
        self.fields["u", self.top] = held(u, f, self.d[self.top])

    def change(self, old: str, new: str) -> float:
        return float(np.abs(self.fields[new, self.top] - self.fields[old, self.top]).max())


def within(
    window: Window, new: reference_raster.Constraints, old: reference_raster.Constraints | None
) -> reference_raster.Constraints:
    """The new constraints in the bins of ``window``, the old ones elsewhere: there the tables may lack strokes."""
    if old is None:
        return new
    inside = np.zeros(new.height_d.shape, dtype=np.bool_)
    for row, (west, east) in enumerate(window.spans, window.first):
        inside[row * BIN : (row + 1) * BIN, west * BIN : east * BIN] = True
    parts = {f.name: (getattr(new, f.name), getattr(old, f.name)) for f in fields(new)}
    return replace(new, **{name: np.where(inside, a, b) for name, (a, b) in parts.items() if isinstance(a, np.ndarray)})


class NumpyWorkspace:
    """``solver.Workspace`` in float64 NumPy: serves when there is no OpenCL device."""

    def __init__(self, top: int, based: bool = False) -> None:
        self.top, self.based = top, based
        self.scout: Workspace | None = None
        self.standing: object = None
        self._constraints: reference_raster.Constraints | None = None
        self.size_m = 1.0
        self.packer = Packer(top)
        self.gradient: NumpySystem
        self.height: NumpySystem

    def load(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None) -> None:
        """Rasterise and coarsen."""
        tables, window = self.packer.pack(strokes, settings, base)
        if window is None:
            return
        under = None if base is None else base.level(self.top).astype(np.float64)
        c = self._constraints = within(window, reference_raster.rasterise(tables, under), self._constraints)
        height_f = (
            c.height_f
            if under is None
            else over_base(c.height_f, c.height_d, c.share, c.target, under, tables.spacing_m)
        )
        self.size_m = tables.size_m
        before = [s.fields.get(("u", self.top)) for s in (self.gradient, self.height)] if self.standing else []
        self.gradient = NumpySystem(c.gradient_d[None], c.gradient_f, tables.screening, self.top)
        self.height = NumpySystem(c.height_d[None], height_f[None], tables.screening, self.top)
        for system, u in zip((self.gradient, self.height), before, strict=False):
            if u is not None:
                system.fields["u", self.top] = u

    def loading(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None) -> Iterator[None]:
        """The same, in one piece."""
        self.load(strokes, settings, base)
        yield

    def warm(self, heights: NDArray[np.float32]) -> None:
        """Start the height step from these heights of the finest level instead of from coarser levels."""
        h = self.height
        h.fields["u", self.top] = np.where(h.d[self.top] < 0, h.static[self.top], heights[None].astype(np.float64))

    def guide(self, level: int) -> None:
        """f of the height step at ``level`` from u of the gradient step."""
        h = self.height
        spacing = self.size_m / (samples(level) - 1)
        h.fields["f", level] = divergence(h.static[level], h.d[level], self.gradient.fields["u", level], spacing)

    def read(self, level: int) -> NDArray[np.float32]:
        """Heights of a level, metres."""
        return np.asarray(self.height.fields["u", level][0], dtype=np.float32)

    def read_gradient(self) -> NDArray[np.float32]:
        """Both gradient components of the finest level, (2, n, n), metres per metre."""
        return np.asarray(self.gradient.fields["u", self.top], dtype=np.float32)
