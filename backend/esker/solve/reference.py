"""NumPy float64 twins of every OpenCL kernel, and the back end that serves without OpenCL (DESIGN 5.3, 16).

Fields are (channels, n, n), row 0 south. Equations are per sample with mirrored borders: the row of a border sample
is the energy's (half control volume) doubled. Stiffness ``d`` excludes screening; it is HARD at fixed samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from functools import lru_cache
from typing import TYPE_CHECKING, TypeVar

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
from esker.grid import arena_bytes, samples
from esker.solve.base import Base
from esker.solve.constraints import raster_reference
from esker.solve.constraints.constraints import Packer
from esker.solve.constraints.tables import (
    BALANCE_M,
    BIN,
    FIRM_STIFFNESS,
    LINE_STIFFNESS,
    PINNED,
    PINNED_STIFFNESS,
    Window,
)

if TYPE_CHECKING:
    from esker.solve.passes import Workspace

Field = NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)

BOTTOM_LEVELS = 4
"""Levels below level 0 (33, 17, 9 and 5 samples a side) that ``bottom`` uses for itself."""
COARSEST_SWEEPS = 60
COARSEST_RELAXATION = 1.4
LEAST_HOLD = 1e-9
"""Stiffness, of springs and screening of all samples together, below which nothing holds the ground: its mean is then
that of the base. The widest band there can be has ten times as much."""


@lru_cache
def chebyshev_weights(sweeps: int = CHEBYSHEV_SWEEPS) -> Field:
    """Relaxation of each Jacobi sweep: the Chebyshev polynomial on [CHEBYSHEV_LOW, CHEBYSHEV_HIGH]."""
    mid, half = (CHEBYSHEV_HIGH + CHEBYSHEV_LOW) / 2, (CHEBYSHEV_HIGH - CHEBYSHEV_LOW) / 2
    k = np.arange(sweeps)
    return np.asarray(1 / (mid + half * np.cos(np.pi * (2 * k + 1) / (2 * sweeps))))


def mirrored(a: NDArray[Scalar]) -> NDArray[Scalar]:
    """(channels, n, m) with a ring of mirrored samples around: a quarter of the time of ``np.pad``."""
    channels, rows, columns = a.shape
    p = np.empty((channels, rows + 2, columns + 2), dtype=a.dtype)
    p[:, 1:-1, 1:-1] = a
    p[:, 0, 1:-1], p[:, -1, 1:-1] = a[:, 1], a[:, -2]
    p[:, :, 0], p[:, :, -1] = p[:, :, 2], p[:, :, -3]
    return p


def laplacian(u: Field) -> Field:
    """Sum over the four neighbours of (u_j - u_i), borders mirrored."""
    p = mirrored(u)
    out = p[:, :-2, 1:-1] - u  # differences: float32 keeps the small ones that a sum minus 4u would lose
    for side in (p[:, 2:, 1:-1], p[:, 1:-1, :-2], p[:, 1:-1, 2:]):
        out += side - u
    return np.asarray(out)


def restriction(f: Field) -> Field:
    """R = P^T for mirrored borders: weights 1, 1/2, 1/4 over 3 x 3, so that a constant grows fourfold."""
    p = mirrored(f)
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
    on every level: there it stays as good as fixed, at 0; with springs that saturate the cycle diverges. A crest along
    a line of the coarse level is there, too: ``on_lines``.
    """
    hard = d < 0
    total = restriction(np.where(hard, CREST_STIFFNESS, d))
    pull = restriction(np.where(hard, CREST_STIFFNESS * f, f))
    k = 1 / (1 + SATURATION * total)
    centre, target = d[:, ::2, ::2], np.where(hard, f, f / np.maximum(d, 1))[:, ::2, ::2]
    line = on_lines(d)
    pinned = (centre <= PINNED) | (centre >= PINNED_STIFFNESS / 2)
    coarse_d, coarse_f = np.where(line, LINE_STIFFNESS, total * k), np.where(line, LINE_STIFFNESS * target, pull * k)
    return np.where(pinned, PINNED_STIFFNESS, coarse_d), np.where(pinned, 0.0, coarse_f)


def on_lines(d: Field) -> NDArray[np.bool_]:
    """Coarse samples, of (1, n, n), that lie on a crest along one of the two lines of samples through them.

    So do those whose two neighbours on the line are fixed, or on a finer line, as they are; and those that are firm, as
    are these two, but neither of the other two.
    """

    def around(stiff: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], ...]:
        p = mirrored(stiff)
        sides = p[:, 1:-1, :-2], p[:, 1:-1, 2:], p[:, :-2, 1:-1], p[:, 2:, 1:-1], stiff
        return tuple(side[:, ::2, ::2] for side in sides)

    west, east, south, north, here = around((d < 0) | (d >= LINE_STIFFNESS / 2))
    strong = here & ((west & east) | (south & north))
    west, east, south, north, here = around((d < 0) | (d >= FIRM_STIFFNESS))
    lone = (west & east & ~south & ~north) | (south & north & ~west & ~east)
    return np.asarray(strong | (here & lone))


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
    share between those of the ends; between a fill and a cut, of BALANCE_M each, it may be less than either. Borders
    are mirrored.
    """
    s, b, t = (np.pad(a, 1, mode="reflect") for a in (share, base, target))
    out = np.zeros_like(static)
    for rows, columns in ((slice(0, -2), slice(1, -1)), (slice(2, None), slice(1, -1)),
                          (slice(1, -1), slice(0, -2)), (slice(1, -1), slice(2, None))):  # fmt: skip
        step, fall = b[rows, columns] - base, target - t[rows, columns]
        low, high = np.sort([share * step, s[rows, columns] * step], axis=0)
        lesser = np.minimum(np.abs(target), np.abs(t[rows, columns]))
        through = np.where(target * t[rows, columns] < 0, np.minimum(lesser / BALANCE_M, 1), 0)
        low, high = low - through * np.maximum(low, 0), high - through * np.minimum(high, 0)
        mean = 0.5 * (share + s[rows, columns]) * step
        out += np.clip(np.clip(mean, fall - slack, fall + slack), low, high)
    return np.asarray(np.where(d < 0, static, static + out))


def residual(u: Field, rhs: Field, d: Field, screening: float) -> Field:
    """rhs - A u, zero at fixed samples."""
    return np.asarray(np.where(d < 0, 0.0, rhs + laplacian(u) - (d + screening) * u))


def sweeps(u: Field, rhs: Field, d: Field, screening: float) -> Field:
    """The Chebyshev-Jacobi sweeps."""
    q = np.where(d < 0, 0.0, 1 / (4 + screening + np.maximum(d, 0)))
    stiffness = d + screening
    for w in chebyshev_weights():
        left = laplacian(u)  # a residual, which counts nowhere where a sample is fixed
        left += rhs
        left -= stiffness * u
        left *= w * q
        left += u
        u = left
    return u


def visit(guess: Field | None, correction: Field | None, rhs: Field, d: Field, screening: float) -> tuple[Field, Field]:
    """(S(guess + P correction), R(rhs - A of it)): see ``multigrid.System.visit``."""
    hard = d < 0
    u = np.where(hard, rhs, 0.0) if guess is None else guess
    if correction is not None:
        u = u + np.where(hard, 0.0, prolongation(correction))
    u = sweeps(u, rhs, d, screening)
    return u, restriction(residual(u, rhs, d, screening))


def bottom(
    rhs: Field, d: list[Field], screening: list[float], cycles: int, coarsest: Field, u: Field | None = None
) -> Field:
    """V-cycles from ``u``, or from zero, for rhs on a list of levels, finest first; ``coarsest``: see
    ``relaxation_matrix``."""

    def v_cycle(k: int, u: Field, b: Field) -> Field:
        if k == len(d) - 1:
            return np.asarray((b.reshape(len(b), -1) @ coarsest.T).reshape(b.shape))
        r = restriction(residual(u, b, d[k], screening[k]))
        e = v_cycle(k + 1, np.zeros_like(r), r)
        return sweeps(u + np.where(d[k] < 0, 0.0, prolongation(e)), b, d[k], screening[k])

    u = np.where(d[0] < 0, rhs, 0.0) if u is None else u
    for _ in range(cycles):
        u = v_cycle(0, u, rhs)
    return u


def relaxation_matrix(d: Field, screening: float) -> Field:
    """The linear map, b to u, of COARSEST_SWEEPS lexicographic over-relaxations, shape (n*n, n*n).

    They start from the constant that balances b: where the ground is held by weak springs alone, relaxations would take
    hundreds to find it. Where nothing holds it, the mean of u is zero.
    """
    n = d.shape[1]
    mirror = np.abs(np.arange(-1, n + 1))
    mirror[-1] = n - 2
    share = control_volumes(n)
    stiffness = float((share * (d[0] + screening)).sum())
    held = stiffness > LEAST_HOLD
    b = np.eye(n * n).reshape(n * n, n, n)
    u = np.zeros_like(b)
    if held:
        u += share.reshape(-1, 1, 1) / stiffness
    for _ in range(COARSEST_SWEEPS):
        for y in range(n):
            for x in range(n):
                around = u[:, mirror[y], x] + u[:, mirror[y + 2], x] + u[:, y, mirror[x]] + u[:, y, mirror[x + 2]]
                value = (b[:, y, x] + around) / (4 + d[0, y, x] + screening)
                u[:, y, x] += COARSEST_RELAXATION * (value - u[:, y, x])
    if not held:
        u -= ((u * share).sum(axis=(1, 2)) / share.sum())[:, None, None]
    return u.reshape(n * n, n * n).T


def control_volumes(n: int) -> Field:
    """Area of each sample's control volume, (n, n), in cells: 1, at borders 1/2, in corners 1/4."""
    share = np.ones(n)
    share[[0, -1]] = 0.5
    return np.outer(share, share)


class NumpySystem:
    """``multigrid.System`` in float64. Level ``top`` holds the fixed samples; ``screening`` is that of the top."""

    floor = 1e-13

    def __init__(self, d: Field, f: Field, screening: float, top: int) -> None:
        self.top = top
        self.d: dict[int, Field] = {top: d}
        self.static: dict[int, Field] = {top: f}
        self.eps = {level: screening * 4.0 ** (top - level) for level in range(top, -BOTTOM_LEVELS - 1, -1)}
        for level in range(top, -BOTTOM_LEVELS, -1):
            self.d[level - 1], self.static[level - 1] = coarsen(self.d[level], self.static[level])
        self.coarsest = relaxation_matrix(self.d[-BOTTOM_LEVELS], self.eps[-BOTTOM_LEVELS])
        self.fields: dict[tuple[str, int], Field] = {("f", level): a for level, a in self.static.items()}
        self._bottom: tuple[Field, int, Field] | None = None
        """Right-hand side, number of cycles and result of the last ``bottom``: more cycles go on from there."""

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
        f, done, u = self.fields[rhs, 0], 0, None
        if self._bottom is not None and self._bottom[0] is f and self._bottom[1] <= cycles:
            done, u = self._bottom[1:]
        self.fields[out, 0] = u = bottom(f, d, eps, cycles - done, self.coarsest, u)
        self._bottom = f, cycles, u

    def swap(self, level: int) -> None:
        self.fields["u", level], self.fields["v", level] = self.fields["v", level], self.fields["u", level]

    def hold(self) -> None:
        u, f = self.fields["u", self.top], self.fields["f", self.top]
        self.fields["u", self.top] = held(u, f, self.d[self.top])

    def change(self, old: str, new: str) -> float:
        return float(np.abs(self.fields[new, self.top] - self.fields[old, self.top]).max())

    def largest(self, name: str) -> float:
        return float(np.abs(self.fields[name, self.top]).max())


def within(
    window: Window, new: raster_reference.Constraints, old: raster_reference.Constraints | None
) -> raster_reference.Constraints:
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
        self.preview_workspace: Workspace | None = None
        self.solved_for: object = None
        self.relief_m = 1.0
        self._constraints: raster_reference.Constraints | None = None
        self.size_m = 1.0
        self.packer = Packer(top)
        self.gradient: NumpySystem
        self.height: NumpySystem

    @property
    def bytes(self) -> int:
        """What a device would take: of NumPy's own memory nothing is known."""
        return arena_bytes(self.top, self.based)

    def given(self, heights: NDArray[np.float32], gradient: NDArray[np.float32]) -> None:
        """See ``device_workspace.DeviceWorkspace``: nothing is ever parked here."""

    def rest(self) -> None:
        """See ``device_workspace.DeviceWorkspace``: nothing is ever parked here either."""

    def load(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None) -> None:
        """Rasterise and coarsen."""
        for _ in self.loading(strokes, settings, base):
            pass

    def loading(self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None) -> Iterator[None]:
        """Loads constraints as ``load`` does; the work may be left between strokes."""
        tables, window = yield from self.packer.packing(strokes, settings, base)
        if window is None:
            return
        under = None if base is None else base.level(self.top).astype(np.float64)
        c = self._constraints = within(window, raster_reference.rasterise(tables, under), self._constraints)
        height_f = (
            c.height_f
            if under is None
            else over_base(c.height_f, c.height_d, c.share, c.target, under, tables.spacing_m)
        )
        self.size_m = tables.size_m
        before = [s.fields.get(("u", self.top)) for s in (self.gradient, self.height)] if self.solved_for else []
        self.gradient = NumpySystem(c.gradient_d[None], c.gradient_f, tables.screening, self.top)
        self.height = NumpySystem(c.height_d[None], height_f[None], tables.screening, self.top)
        for system, u in zip((self.gradient, self.height), before, strict=False):
            if u is not None:
                system.fields["u", self.top] = u

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
