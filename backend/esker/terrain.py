"""The offline Python API (DESIGN 5.7): strokes in, heights out, no server.

from esker import Terrain, Stroke
t = Terrain(size_m=4096)
t.add(Stroke.profile([(500, 2000, 0), (2000, 2200, 900), (3500, 2000, 0)], left=(35, 300), right=(50, 200)))
h = t.heights(level=4)          # float32 (1025, 1025), metres, row 0 south
"""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esker import contract, grid
from esker.contract import Border, Document, Flank, TerrainSettings, Vec3
from esker.document import archive
from esker.document.strokes import level_curve, misfit, profile_curve
from esker.solve.assembly import System, assemble
from esker.solve.detail import Settled, detailed, settle
from esker.solve.solver import Solver
from esker.synthesis.detailed import Detail, DetailedTerrain
from esker.synthesis.subdivide import finest_level

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
        first, last = _ends(p)
        return _stroke("level", first, last, level_curve(p, first, last), left, right, fields)

    @staticmethod
    def paint(
        points: ArrayLike,
        channel: contract.PaintChannel,
        value: float = 1.0,
        radius_m: float = contract.DEFAULT_SIZE_M / 50,
        **fields: Any,
    ) -> contract.Stroke:
        """A line of paint on the ground: points (n, 2), or (n, 3) whose heights do not matter.

        Within ``radius_m`` of it one channel of the detail is raised or lowered: "snow", "grass", "forest", "wetness",
        "roughness" or "amplitude", by ``value`` from -1 (none of it) to 1 (all of it). No height is constrained.
        """
        p = np.asarray(points, dtype=np.float64)
        p = _points(np.column_stack([p, np.zeros(len(p))]) if p.ndim == 2 and p.shape[1] == 2 else p)
        p[:, 2] = 0.0
        first, last = _ends(p)
        paint = contract.Paint(channel=channel, value=float(value), radius_m=float(radius_m))
        return _stroke("paint", first, last, level_curve(p, first, last), None, None, {**fields, "paint": paint})


def _ends(p: NDArray[np.float64]) -> tuple[Vec3, Vec3]:
    """Anchors of a level frame: the ends of the line, or of a loop its first point and the farthest from it."""
    steps = np.diff(p[:, :2], axis=0)
    length = float(np.hypot(steps[:, 0], steps[:, 1]).sum())
    gap = np.hypot(*(p[:, :2] - p[0, :2]).T)
    far = int(np.argmax(gap)) if gap[-1] < LOOP_FRACTION * length else -1
    return _vec(p[0]), _vec(p[far])


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
    (x_m, y_m), neighbours ``spacing_m`` apart. ``attributes``: with detail, what ``Terrain.attributes`` gives."""

    heights: NDArray[np.float32]
    x_m: float
    y_m: float
    spacing_m: float
    attributes: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)


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
        self._heights: dict[int, tuple[TerrainSettings, Strokes, NDArray[np.float32]]] = {}
        self._settled: Settled | None = None
        self._detailed: tuple[Settled, int, DetailedTerrain] | None = None
        self._detail: tuple[DetailedTerrain, int, Detail] | None = None

    @property
    def strokes(self) -> Strokes:
        """The strokes, oldest first."""
        return tuple(self._strokes.values())

    def add(self, stroke: contract.Stroke) -> str:
        """Add a stroke, or replace the one of the same id; returns the id.

        Raises ValueError beyond the limits, and for fields that are not of its kind.
        """
        wrong = misfit(stroke)
        if wrong is not None:
            raise ValueError(wrong)
        if stroke.id not in self._strokes and len(self._strokes) >= contract.MAX_STROKES:
            raise ValueError(f"a terrain holds at most {contract.MAX_STROKES} strokes")
        self._strokes[stroke.id] = stroke
        return stroke.id

    def remove(self, stroke_id: str) -> None:
        """Take a stroke away. Raises KeyError when there is none of this id."""
        del self._strokes[stroke_id]

    def heights(
        self,
        level: int = contract.DEFAULT_LEVEL,
        detail: bool = False,
        *,
        global_level: int = contract.DEFAULT_LEVEL,
        refined_level: int = contract.DEFAULT_REFINED_LEVEL,
        progress: Callable[[float], None] | None = None,
    ) -> NDArray[np.float32]:
        """Settled heights of a level: float32 (N, N), metres, row 0 south, read-only.

        Without ``detail``, the solve with ``level`` as its finest. With it, what the page shows: heights as they come
        from a server that solves levels 0..``global_level`` as a whole and refines to ``refined_level``, and the detail
        synthesised on them (docs/synthesis.md); ``progress`` is told the share of that which is done. Raises ValueError
        for a level outside 0..MAX_LEVEL; ``window`` goes further.
        """
        if detail:
            return self._whole(level, global_level, refined_level, progress).heights
        strokes, held = self.strokes, self._heights.get(level)
        if held is None or held[0] != self.settings or not _same(held[1], strokes):
            solver = self._solver or default_solver()
            held = (self.settings, strokes, solver.solve(strokes, self.settings, level)[level])
            self._heights[level] = held
        return held[2]

    def attributes(
        self,
        level: int = contract.DEFAULT_LEVEL,
        *,
        global_level: int = contract.DEFAULT_LEVEL,
        refined_level: int = contract.DEFAULT_REFINED_LEVEL,
        progress: Callable[[float], None] | None = None,
    ) -> dict[str, NDArray[np.float32]]:
        """Channels of the detail of a level, each float32 (N, N), row 0 south, read-only.

        ``detail`` (metres, part of ``heights(level, detail=True)``), ``smoothness`` (the fractal's exponent, 0..2),
        ``snow``, ``wetness``, ``grass``, ``forest``, ``foam`` (0..1). Raises ValueError as ``heights`` does.
        """
        return dict(self._whole(level, global_level, refined_level, progress).attributes)

    def window(
        self,
        level: int,
        x0: float,
        y0: float,
        x1: float,
        y1: float,
        detail: bool = False,
        *,
        global_level: int = contract.DEFAULT_LEVEL,
        refined_level: int = contract.DEFAULT_REFINED_LEVEL,
        progress: Callable[[float], None] | None = None,
    ) -> HeightWindow:
        """Settled heights of the samples of ``level`` inside a rectangle of world metres, at what the rectangle costs.

        Levels 0..``global_level`` are solved as a whole, those above, up to MAX_REFINED_LEVEL, are refined from them
        where they are looked at (DESIGN 5.6). With ``detail``, heights and attributes as the page shows them, down to
        cells of a centimetre: refined to ``refined_level`` as a server does, interpolated beyond. ``progress`` is told
        the share of the refinement, or of the detail, that is done. Raises ValueError for a level out of range and for
        a rectangle that holds no sample.
        """
        size = self.settings.size_m
        most = finest_level(size) if detail else contract.MAX_REFINED_LEVEL
        if not 0 <= level <= most:
            raise ValueError(f"level must be 0..{most}, not {level}")
        r0, r1, c0, c1 = grid.Rect(x0, y0, x1, y1).sample_window(level, size)
        if r0 >= r1 or c0 >= c1:
            raise ValueError(
                f"no sample of level {level} lies in ({x0}, {y0})..({x1}, {y1}); the terrain is {size} m wide"
            )
        s = grid.spacing(level, size)
        rows, cols = slice(r0, r1), slice(c0, c1)
        if detail:
            made = self._with_detail(global_level, refined_level).window(level, rows, cols, progress)
            return HeightWindow(made.heights, c0 * s, r0 * s, s, made.attributes)
        solver = self._solver or default_solver()
        refiner = solver.refiner(self._settle(solver, min(level, global_level)).basis)
        return HeightWindow(refiner.window(level, rows, cols, progress), c0 * s, r0 * s, s)

    def _whole(
        self, level: int, global_level: int, refined_level: int, progress: Callable[[float], None] | None
    ) -> Detail:
        """A whole level with detail; that of the last time if nothing has changed."""
        if not 0 <= level <= contract.MAX_LEVEL:
            raise ValueError(f"level must be 0..{contract.MAX_LEVEL}, not {level}")
        terrain, held = self._with_detail(global_level, refined_level), self._detail
        if held is None or held[0] is not terrain or held[1] != level:
            every = slice(0, grid.samples(level))
            made = terrain.window(level, every, every, progress)
            for values in (made.heights, *made.attributes.values()):
                values.flags.writeable = False
            held = self._detail = (terrain, level, made)
        return held[2]

    def _with_detail(self, global_level: int, refined_level: int) -> DetailedTerrain:
        """What makes detail; that of the last time if nothing has changed."""
        solver = self._solver or default_solver()
        settled, held = self._settle(solver, global_level), self._detailed
        if held is None or held[0] is not settled or held[1] != refined_level:
            held = self._detailed = (settled, refined_level, detailed(solver, settled, refined_level))
        return held[2]

    def _settle(self, solver: Solver, level: int) -> Settled:
        """What refinement and detail start from; that of the last time if nothing has changed."""
        strokes, held = self.strokes, self._settled
        basis = None if held is None else held.basis
        if (
            held is None
            or basis is None
            or basis.level != level
            or basis.settings != self.settings
            or not _same(basis.strokes, strokes)
        ):
            held = self._settled = settle(solver, strokes, self.settings, level)
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
