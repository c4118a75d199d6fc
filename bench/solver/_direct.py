"""A scene solved directly, by sparse factors in float64, and how far the solver's own ground is from that.

Two things may differ, and are told apart: the *cycle* (settled heights against the direct solve of the very constraints
that the device made) and the *strokes* (that solve against the direct solve of the float64 twin's constraints).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from bench.solver._exact import Constraints
from esker import grid
from esker.contract import MAX_SLOPE_DEG, Flank, Stroke, TerrainSettings
from esker.contract.values import ABSOLUTE_BOUND_M
from esker.solve import reference
from esker.solve.assembly import system
from esker.solve.constraints import raster_reference
from esker.solve.constraints.computable import computable
from esker.solve.constraints.constraints import pack
from esker.solve.solver import Solver

Field = NDArray[np.float64]

QUANTUM_SHARE = 0.5
"""Error that settled ground may have, in quanta of its level."""
FLOOR = 1e-6
"""Error that settled ground may have, as a share of the highest height: float32 holds no more digits."""
WELL_HELD = 1e-4
"""Stiffness of all samples together. With less, without a fixed sample and without reach, what float32 rounds off the
slopes lifts the ground as a whole by more than half a quantum: such a scene is not compared."""


ROUNDED = 2.0**-23
"""Rounding of a stroke's numbers, as a share: twice that of float32, of which a kernel makes a dozen on the way."""
ROUNDINGS = 6
REFINED = 1e-10
"""Last correction of a refined solution, as a share of its largest value."""
SHRINKS = 0.25
"""Each correction is at most this share of the one before."""
MOST_CORRECTIONS = 12


@dataclass(frozen=True)
class Scene:
    """What is compared: strokes and settings, and the level that is solved as the finest."""

    strokes: tuple[Stroke, ...]
    settings: TerrainSettings
    level: int

    def document(self) -> dict[str, Any]:
        """The scene as JSON, without what is as it always is."""
        return {
            "level": self.level,
            "settings": self.settings.model_dump(mode="json", exclude_defaults=True),
            "strokes": [s.model_dump(mode="json", exclude_defaults=True) for s in self.strokes],
        }

    @classmethod
    def load(cls, document: dict[str, Any]) -> Scene:
        """The scene that ``document`` gave. Raises pydantic's ValidationError."""
        strokes = tuple(Stroke.model_validate(s, strict=False) for s in document["strokes"])
        return cls(strokes, TerrainSettings.model_validate(document["settings"], strict=False), document["level"])


def twin_constraints(scene: Scene) -> Constraints:
    """Returns what the float64 rasteriser makes of a scene."""
    tables = pack(scene.strokes, computable(scene.settings), scene.level)
    c = raster_reference.rasterise(tables)
    parts: Any = (c.gradient_d, c.gradient_f, c.height_d, c.height_f)
    return Constraints(scene.level, tables.spacing_m, tables.screening, *parts)


def device_constraints(solver: Solver, scene: Scene) -> Constraints:
    """Returns what the device of the solver made of a scene that it has just solved."""
    w: Any = solver._pool.idle[-1]
    top = w.top
    static = w.height.get(w.height.static, top)[0]
    fields = (w.gradient.get("d", top)[0], w.gradient.get("f", top), w.height.get("d", top)[0], static)
    return Constraints(top, grid.spacing(top, scene.settings.size_m), w.height.eps[top], *fields)


class Direct:
    """Both steps by sparse factors. The factors of the first constraints serve for others that hardly differ:
    their solution is refined until a correction is below REFINED of it. Where that fails they get factors of their own.
    """

    def __init__(self) -> None:
        self._factors: dict[str, spla.SuperLU] = {}

    def heights(self, c: Constraints) -> Field:
        """Returns the ground of these constraints, metres (n, n)."""
        d, f = c.height_d.astype(np.float64), c.height_f.astype(np.float64)
        stiff = c.gradient_d.astype(np.float64)
        gradient = self._solve("gradient", stiff, c.gradient_f.astype(np.float64), c.screening)
        right = reference.divergence(f[None], d[None], gradient, c.spacing_m)
        return np.asarray(self._solve("height", d, right, c.screening)[0])

    def _solve(self, step: str, d: Field, f: Field, screening: float) -> Field:
        """u (c, n, n) of A u = f, one matrix for all channels (``assembly.system``)."""
        if not ((d < 0).any() or (d > 0).any() or screening > 0):
            return np.zeros_like(f)  # nothing is asked of the ground
        parts = [system(d, channel, screening) for channel in f]
        a, right = parts[0][0].tocsc(), np.stack([b for _, b in parts], axis=1)
        known = self._factors.get(step)
        found = None if known is None else refined(known, a, right)
        if found is None:
            own = spla.splu(a, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
            self._factors.setdefault(step, own)
            found = own.solve(right)
        return np.asarray(found.T.reshape(f.shape))


def refined(near: spla.SuperLU, a: sp.csc_array, b: Field) -> Field | None:
    """x (n, c) of A x = b by the factors of a matrix near A; None where corrections do not shrink to REFINED of x."""
    x = near.solve(b)
    before = np.inf
    for _ in range(MOST_CORRECTIONS):
        correction = near.solve(b - a @ x)
        x += correction
        size = float(np.abs(correction).max())
        if size <= REFINED * float(np.abs(x).max()):
            return np.asarray(x)
        if not size < SHRINKS * before:
            return None
        before = size
    return None


def tolerance(exact: Field, scene: Scene) -> float:
    """Metres that the settled ground may be off."""
    return max(QUANTUM_SHARE * grid.quantum(scene.level, scene.settings.size_m), FLOOR * float(np.abs(exact).max()))


def measure(scene: Scene, solvers: dict[str, Solver]) -> dict[str, float]:
    """Returns how far the grounds of the solvers are from direct solves, in tolerances: 1 and less is right.

    ``NAME cycle`` and ``NAME strokes`` (see above) for every solver; NumPy's constraints are the twin's own.
    A ground that is no number counts as infinite. ``NAME strokes`` above 1 is divided by what ``rounding`` allows.
    Raises what ``Solver.solve`` raises.
    """
    twin = twin_constraints(scene)
    if not (twin.height_d < 0).any() and float((twin.height_d + twin.screening).sum()) < WELL_HELD:
        return {"hardly held": 0.0}
    direct = Direct()
    exact = direct.heights(twin)
    out: dict[str, float] = {}
    for name, solver in solvers.items():
        settled = solver.solve(scene.strokes, scene.settings, scene.level)[scene.level]
        own = exact
        if solver.device is not None:
            own = direct.heights(device_constraints(solver, scene))
            out |= judged(f"{name} strokes", off(own, exact, scene), scene, exact)
        out[f"{name} cycle"] = off(settled, own, scene)
    return out


def judged(name: str, found: float, scene: Scene, exact: Field) -> dict[str, float]:
    """How far the ground of a device's strokes is off. Where strokes say so much of a sample that rounding their own
    numbers moves the exact ground farther, no device of float32 can agree: that is told by itself, as ``rounding``."""
    if found <= 1:
        return {name: found}
    allowed = rounding(scene, exact)
    return {name: found} if found > allowed else {name: 1.0, "rounding": found, "rounding allows": allowed}


def rounding(scene: Scene, exact: Field) -> float:
    """How far, in tolerances, the exact ground moves where every number of every stroke is off by ROUNDED of itself, up
    or down: the farthest of ROUNDINGS."""
    rng = np.random.default_rng(0)
    grounds = (Direct().heights(twin_constraints(_rounded(scene, rng))) for _ in range(ROUNDINGS))
    return max(off(ground, exact, scene) for ground in grounds)


def _rounded(scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene with other last digits."""

    def number(value: float) -> float:
        return value * (1 + ROUNDED * float(rng.choice((-1, 1))))

    def side(flank: Flank | None) -> Flank | None:
        if flank is None:
            return None
        slope = None if flank.slope_deg is None else min(number(flank.slope_deg), MAX_SLOPE_DEG)
        return flank.model_copy(update={"slope_deg": slope, "extent_m": min(number(flank.extent_m), ABSOLUTE_BOUND_M)})

    def moved(stroke: Stroke) -> Stroke:
        heights = {name: (*getattr(stroke, name)[:2], number(getattr(stroke, name)[2])) for name in ("first", "last")}
        curve = tuple((u, number(z)) for u, z in stroke.curve) if stroke.kind == "profile" else stroke.curve
        radius = number(stroke.plateau_radius_m)
        sides = {"left": side(stroke.left), "right": side(stroke.right)}
        return stroke.model_copy(update={**heights, **sides, "curve": curve, "plateau_radius_m": radius})

    return replace(scene, strokes=tuple(moved(s) for s in scene.strokes))


def off(ground: NDArray[np.floating], exact: Field, scene: Scene) -> float:
    """Largest difference, in tolerances."""
    most = float(np.abs(ground - exact).max())
    return most / tolerance(exact, scene) if np.isfinite(most) else np.inf
