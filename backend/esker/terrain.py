"""The offline Python API (DESIGN 5.7): strokes in, heights out, no server.

from esker import Terrain, Stroke
t = Terrain(size_m=4096)
t.add(Stroke.profile([(500, 2000, 0), (2000, 2200, 900), (3500, 2000, 0)], left=(35, 300), right=(50, 200)))
h = t.heights(level=4)          # float32 (1025, 1025), metres, row 0 south
"""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esker import contract, grid
from esker.contract import Border, Document, Flank, TerrainSettings, Vec3
from esker.document import archive
from esker.document.strokes import level_curve, profile_curve
from esker.solve.assembly import System, assemble
from esker.solve.solver import Basis, Solver

FlankLike = tuple[float | None, float] | Flank | None
DEFAULT_FLANK: Flank = Flank()
LOOP_FRACTION = 0.25
"""A level stroke whose ends are nearer than this share of its length takes its farthest point as second anchor."""

Strokes = tuple[contract.Stroke, ...]

_solver: Solver | None = None


def default_solver() -> Solver:
    """The process's solver for offline terrains, opened at first use."""
    global _solver
    if _solver is None:
        _solver = Solver()
    return _solver


class Stroke:
    """Makes strokes from world points; what is made is a ``contract.Stroke``.

    left, right: (slope in degrees or None, extent in metres) for a straight flank, which has that slope from the crest
    to its end; a ``Flank`` for any other; or None for no flank on that side of the direction of travel. Other keywords:
    ``plateau_radius_m``, ``amplitude_m``, ``roughness``, ``id``, ``label``.
    Raises ValueError for points that are not finite (n, 3), or fields out of range.
    """

    @staticmethod
    def profile(
        points: ArrayLike, left: FlankLike = DEFAULT_FLANK, right: FlankLike = DEFAULT_FLANK, **fields: Any
    ) -> contract.Stroke:
        """A mountain or a crevice: points (n, 3), seen in the vertical plane through the first and the last."""
        p = _points(points)
        first, last = _vec(p[0]), _vec(p[-1])
        return _stroke("profile", first, last, profile_curve(p, first, last), left, right, fields)

    @staticmethod
    def level(
        points: ArrayLike, left: FlankLike = DEFAULT_FLANK, right: FlankLike = DEFAULT_FLANK, **fields: Any
    ) -> contract.Stroke:
        """A plateau outline or a level ridge: points (n, 3), all at the height of the first."""
        p = _points(points)
        p[:, 2] = p[0, 2]
        steps = np.diff(p[:, :2], axis=0)
        length = float(np.hypot(steps[:, 0], steps[:, 1]).sum())
        gap = np.hypot(*(p[:, :2] - p[0, :2]).T)
        far = int(np.argmax(gap)) if gap[-1] < LOOP_FRACTION * length else -1
        first, last = _vec(p[0]), _vec(p[far])
        return _stroke("level", first, last, level_curve(p, first, last), left, right, fields)


def _points(points: ArrayLike) -> NDArray[np.float64]:
    p = np.array(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or len(p) == 0 or not np.isfinite(p).all():
        raise ValueError(f"points must be finite and of shape (n, 3), n > 0; got {p.shape}")
    return p


def _vec(p: NDArray[np.float64]) -> Vec3:
    return float(p[0]), float(p[1]), float(p[2])


def _flank(side: FlankLike) -> Flank | None:
    if side is None or isinstance(side, Flank):
        return side
    slope, extent = side
    return Flank(slope_deg=None if slope is None else float(slope), extent_m=float(extent), shape="straight")


def _stroke(
    kind: contract.StrokeKind,
    first: Vec3,
    last: Vec3,
    curve: tuple[contract.CurvePoint, ...],
    left: FlankLike,
    right: FlankLike,
    fields: dict[str, Any],
) -> contract.Stroke:
    values = {"id": secrets.token_hex(6), "finished": True, **fields}
    for name in ("plateau_radius_m", "amplitude_m", "roughness"):
        if name in values:
            values[name] = float(values[name])
    return contract.Stroke(
        kind=kind, first=first, last=last, curve=curve, left=_flank(left), right=_flank(right), **values
    )


def _same(a: Strokes, b: Strokes) -> bool:
    """The very same values in the same order: strokes are immutable."""
    return len(a) == len(b) and all(x is y for x, y in zip(a, b, strict=True))


@dataclass(frozen=True)
class HeightWindow:
    """Heights of a rectangle. heights: (rows, columns) float32, metres, row 0 south; sample [0, 0] lies at world
    (x_m, y_m), neighbours ``spacing_m`` apart."""

    heights: NDArray[np.float32]
    x_m: float
    y_m: float
    spacing_m: float


class Terrain:
    """A terrain without a server. Heights are a pure function of ``strokes`` and ``settings``.

    size_m: side of the domain, metres; border: "free" or "pinned" to the base; reach_m: how far strokes are felt
    (DESIGN 5.1), default size / 32, None or infinity for pure diffusion. Raises ValueError out of range.
    """

    def __init__(
        self,
        size_m: float = contract.DEFAULT_SIZE_M,
        border: Border = "free",
        reach_m: float | str | None = "default",
        solver: Solver | None = None,
    ) -> None:
        size = float(size_m)
        if isinstance(reach_m, str):
            reach: float | None = size * contract.DEFAULT_REACH_FRACTION
        else:
            reach = None if reach_m is None or math.isinf(reach_m) else float(reach_m)
        self.id = secrets.token_hex(6)
        self.settings = TerrainSettings(size_m=size, border=border, reach_m=reach)
        self._strokes: dict[str, contract.Stroke] = {}
        self._solver = solver
        self._solved: dict[int, tuple[TerrainSettings, Strokes, NDArray[np.float32]]] = {}
        self._basis: Basis | None = None

    @property
    def strokes(self) -> Strokes:
        """The strokes, oldest first."""
        return tuple(self._strokes.values())

    def add(self, stroke: contract.Stroke) -> str:
        """Add a stroke, or replace the one of the same id; returns the id. Raises ValueError beyond the limits."""
        if stroke.id not in self._strokes and len(self._strokes) >= contract.MAX_STROKES:
            raise ValueError(f"a terrain holds at most {contract.MAX_STROKES} strokes")
        self._strokes[stroke.id] = stroke
        return stroke.id

    def remove(self, stroke_id: str) -> None:
        """Take a stroke away. Raises KeyError when there is none of this id."""
        del self._strokes[stroke_id]

    def heights(self, level: int = contract.DEFAULT_LEVEL) -> NDArray[np.float32]:
        """Settled heights with ``level`` as the finest level: float32 (N, N), metres, row 0 south, read-only.

        Raises ValueError for a level outside 0..MAX_LEVEL.
        """
        strokes, held = self.strokes, self._solved.get(level)
        if held is None or held[0] != self.settings or not _same(held[1], strokes):
            solver = self._solver or default_solver()
            held = (self.settings, strokes, solver.solve(strokes, self.settings, level)[level])
            self._solved[level] = held
        return held[2]

    def window(
        self,
        level: int,
        x0: float,
        y0: float,
        x1: float,
        y1: float,
        *,
        global_level: int = contract.DEFAULT_LEVEL,
        progress: Callable[[float], None] | None = None,
    ) -> HeightWindow:
        """Settled heights of the samples of ``level`` inside a rectangle of world metres, at what the rectangle costs.

        Levels 0..``global_level`` are solved as a whole, those above, up to MAX_REFINED_LEVEL, are refined from them
        where they are looked at (DESIGN 5.6). ``progress`` is told the share of the refinement that is done. Raises
        ValueError for a level out of range and for a rectangle that holds no sample.
        """
        if not 0 <= level <= contract.MAX_REFINED_LEVEL:
            raise ValueError(f"level must be 0..{contract.MAX_REFINED_LEVEL}, not {level}")
        size = self.settings.size_m
        r0, r1, c0, c1 = grid.Rect(x0, y0, x1, y1).sample_window(level, size)
        if r0 >= r1 or c0 >= c1:
            raise ValueError(
                f"no sample of level {level} lies in ({x0}, {y0})..({x1}, {y1}); the terrain is {size} m wide"
            )
        solver = self._solver or default_solver()
        refiner = solver.refiner(self._settled(solver, min(level, global_level)))
        s = grid.spacing(level, size)
        return HeightWindow(refiner.window(level, slice(r0, r1), slice(c0, c1), progress), c0 * s, r0 * s, s)

    def _settled(self, solver: Solver, level: int) -> Basis:
        """What refinement starts from; that of the last time if nothing has changed."""
        strokes, held = self.strokes, self._basis
        if held is None or held.level != level or held.settings != self.settings or not _same(held.strokes, strokes):
            for result in solver.steps(strokes, self.settings, level, basis=True):
                held = result.basis if result is not None and result.basis is not None else held
        assert held is not None, "a solve that is not stopped ends with its basis"
        self._basis = held
        return held

    def assemble(self, level: int) -> System:
        """(A, b): the float64 sparse system of the height step at ``level``, see ``esker.solve.assembly``."""
        return assemble(self.strokes, self.settings, level)

    @property
    def document(self) -> Document:
        """The terrain as a document."""
        return Document(id=self.id, settings=self.settings, strokes=self.strokes)

    @classmethod
    def from_document(cls, document: Document) -> Terrain:
        """The terrain that a document describes."""
        out = cls()
        out.id, out.settings = document.id, document.settings
        out._strokes = {s.id: s for s in document.strokes}
        return out

    def save(self, path: str | Path) -> None:
        """Write an ``.esker`` file."""
        Path(path).write_bytes(archive.dumps(self.document))

    @classmethod
    def load(cls, path: str | Path) -> Terrain:
        """Read an ``.esker`` file. Raises ArchiveError, OSError."""
        return cls.from_document(archive.loads(Path(path).read_bytes()))
