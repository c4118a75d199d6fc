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
from esker.contract import Border, Document, Layer, TerrainSettings
from esker.document import archive
from esker.document.layers import span_m
from esker.document.maker import Stroke
from esker.document.strokes import misfit
from esker.patchwork.base import Base
from esker.patchwork.rasters import Raster
from esker.patchwork.trust import default_priority
from esker.solve.assembly import System, assemble
from esker.solve.detail import Settled, detailed, settle
from esker.solve.solver import Solver
from esker.synthesis.detailed import Detail, DetailedTerrain
from esker.synthesis.subdivide import finest_level
from esker.terrain_layers import Patchwork, Sample, imported, laid, unpacked

__all__ = ["HeightWindow", "Sample", "Stroke", "Terrain", "default_solver"]

Strokes = tuple[contract.Stroke, ...]

_solver: Solver | None = None


def default_solver() -> Solver:
    """The process's solver for offline terrains, opened at first use."""
    global _solver
    if _solver is None:
        _solver = Solver()
    return _solver


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
    """A terrain without a server. Heights are a pure function of ``strokes``, ``layers`` and ``settings``.

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
        self._patchwork = Patchwork(size)
        self._heights: dict[int, tuple[TerrainSettings, Strokes, Base | None, NDArray[np.float32]]] = {}
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
        others = sum(len(other.curve) for key, other in self._strokes.items() if key != stroke.id)
        if others + len(stroke.curve) > contract.MAX_POINTS_PER_TERRAIN:
            raise ValueError(f"the strokes of a terrain hold at most {contract.MAX_POINTS_PER_TERRAIN} points together")
        self._strokes[stroke.id] = stroke
        return stroke.id

    def remove(self, stroke_id: str) -> None:
        """Take a stroke away. Raises KeyError when there is none of this id."""
        del self._strokes[stroke_id]

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The elevation layers, oldest first."""
        return self._patchwork.layers

    @property
    def grids(self) -> Mapping[str, Raster]:
        """The grids of the layers, by ``Layer.content``."""
        return self._patchwork.grids

    def add_grid(
        self,
        grid: ArrayLike | str | Path,
        anchor: tuple[float, float] | None = None,
        rotation: float | None = None,
        spacing: float | tuple[float, float] | None = None,
        accuracy: float | None = None,
        priority: int | None = None,
        name: str = "",
        *,
        scale: float = 1.0,
        lift: float = 0.0,
        source: str = "",
        licence: str = "",
        answers: Mapping[str, str] | None = None,
    ) -> str:
        """Lay an elevation grid on the terrain; returns the layer's id. Nothing is resampled, nothing is rebuilt.

        ``grid``: an array (rows, cols) of heights, NaN where there are none, row 0 south; or the path of a file
        (docs/importing.md), whose own place counts where it has one. ``anchor``: world position of sample [0, 0],
        without which a grid lies in the middle; ``rotation``: degrees counter-clockwise; ``spacing``: metres, or
        (sX, sY); ``accuracy``: the largest error of the grid anywhere, metres, by default from its spacing;
        ``priority``: of layers that say different things the greater is believed, by default the one added last,
        unless it is coarser and less accurate than what it lies on;
        height = ``scale`` * sample + ``lift``. ``answers``: to what a file leaves open. Raises ValueError for a grid
        that cannot be laid, or a file that is refused or leaves something open; OSError.
        """
        more: dict[str, Any] = {"name": name, "scale": scale, "lift_m": lift, "source": source, "licence": licence}
        rank = 0 if priority is None else int(priority)
        if isinstance(grid, (str, Path)):
            layer, raster, place = imported(
                Path(grid), self.settings, anchor=anchor, rotation=rotation, spacing=spacing, accuracy=accuracy,
                priority=rank, answers=answers or {}, more=more,
            )  # fmt: skip
            if self.settings.place is None and place is not None:
                self.settings = self.settings.model_copy(update={"place": place})
        else:
            layer, raster = laid(
                grid, self.settings.size_m, anchor=anchor, rotation=rotation, spacing=spacing, accuracy=accuracy,
                priority=rank, more=more,
            )  # fmt: skip
        if priority is None:
            layer = layer.model_copy(update={"priority": default_priority(layer, self.layers)})
        self._patchwork.put(layer, raster)
        return layer.id

    def set_grid(self, layer_id: str, **fields: Any) -> Layer:
        """Move, turn, re-weight, hide or rename a layer: fields of ``contract.LayerFields``.

        Raises KeyError, ValueError.
        """
        return self._patchwork.change(layer_id, fields)

    def remove_grid(self, layer_id: str) -> None:
        """Take a layer away. Raises KeyError when there is none of this id."""
        self._patchwork.remove(layer_id)

    def sample(
        self, points: ArrayLike, tolerance: float = 0.0, derivatives: bool = False
    ) -> NDArray[np.float64] | Sample:
        """The ground of the elevation layers, without strokes, at places (n, 2), world metres; 0 without layers.

        ``tolerance``: the error that may be made, metres; 0 gives the data. Returns heights (n,), or with
        ``derivatives`` a ``Sample``: heights, gradient and curvature of the same, twice differentiable surface. Raises
        ValueError for points that are not finite (n, 2).
        """
        places = np.asarray(points, dtype=np.float64)
        if places.ndim != 2 or places.shape[1] != 2 or not np.isfinite(places).all():
            raise ValueError(f"points must be finite and of shape (n, 2); got {places.shape}")
        base, n = self._patchwork.base, len(places)
        if base is None:
            return Sample(np.zeros(n), np.zeros((n, 2)), np.zeros((n, 3))) if derivatives else np.zeros(n)
        found = base.sample(places, tolerance=float(tolerance), smooth=True, derivatives=derivatives)
        if found.gradient is None or found.hessian is None:
            return found.heights
        return Sample(found.heights, found.gradient, found.hessian)

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

        Strokes on the ground of the elevation layers. Without ``detail``, the solve with ``level`` as its finest. With
        it, what the page shows: heights as they come from a server that solves levels 0..``global_level`` as a whole
        and refines to ``refined_level``, and the detail synthesised on them (docs/synthesis.md); ``progress`` is told
        the share of that which is done. Raises ValueError
        for a level outside 0..MAX_LEVEL; ``window`` goes further.
        """
        if detail:
            return self._whole(level, global_level, refined_level, progress).heights
        strokes, base, held = self.strokes, self._patchwork.base, self._heights.get(level)
        if held is None or held[0] != self.settings or held[2] is not base or not _same(held[1], strokes):
            solver = self._solver or default_solver()
            ground = solver.solve(strokes, self.settings, level, base=base)[level]
            if base is not None:
                ground = ground + base.level(level, solver.device)
                ground.flags.writeable = False
            held = (self.settings, strokes, base, ground)
            self._heights[level] = held
        return held[3]

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
        settled, base = self._settle(solver, min(level, global_level)), self._patchwork.base
        ground = solver.refiner(settled.basis).window(level, rows, cols, progress)
        if base is not None:
            ground = ground + base.window(level, rows, cols, solver.device)
        return HeightWindow(ground, c0 * s, r0 * s, s)

    def export(
        self,
        path: str | Path,
        *,
        level: int | None = None,
        samples: int | None = None,
        detail: bool = True,
        window: tuple[float, float, float, float] | None = None,
        global_level: int = contract.DEFAULT_LEVEL,
        refined_level: int = contract.DEFAULT_REFINED_LEVEL,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        """Write the terrain for other programs, as the suffix of ``path`` says (docs/exporting.md): ``.png``, ``.r16``
        and ``.raw`` (heightmaps of 16 bits, the raw ones with a .json beside them), ``.tif`` (GeoTIFF), ``.npy``,
        ``.glb`` (a mesh with colours), ``.zip`` (masks of 8 bits).

        ``level``, or ``samples`` a side (one of EXPORT_LEVELS); ``window``: only the samples of ``level`` in this
        rectangle (x0, y0, x1, y1) of world metres. ``detail`` and the levels: as in ``heights``; masks and colours
        always come from the detail. ``progress`` is told the share that is done. Raises ValueError for what cannot be
        written so, OSError.
        """
        from esker.exports import formats  # not with this module: it brings pyproj
        from esker.exports.ground import Extent

        def step(stage: contract.ExportStage, share: float) -> None:
            if progress is not None:
                progress(formats.share_of(stage, share))

        where = Path(path)
        extent = Extent.of(level, samples, window)
        levels = {"global_level": global_level, "refined_level": refined_level}
        formats.export(self, where, formats.format_of(where), extent, detail=detail, step=step, **levels)

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
            held = self._detailed = (
                settled, refined_level, detailed(solver, settled, refined_level, span_m(self.layers))
            )  # fmt: skip
        return held[2]

    def _settle(self, solver: Solver, level: int) -> Settled:
        """What refinement and detail start from; that of the last time if nothing has changed."""
        strokes, base, held = self.strokes, self._patchwork.base, self._settled
        basis = None if held is None else held.basis
        if (
            held is None
            or basis is None
            or basis.level != level
            or basis.settings != self.settings
            or basis.base is not base
            or not _same(basis.strokes, strokes)
        ):
            held = self._settled = settle(solver, strokes, self.settings, level, base=base)
        return held

    def assemble(self, level: int) -> System:
        """(A, b): the float64 sparse system of the height step at ``level``, see ``esker.solve.assembly``.

        Its unknowns are heights above the ground of the elevation layers.
        """
        return assemble(self.strokes, self.settings, level, base=self._patchwork.base)

    @property
    def document(self) -> Document:
        """The terrain as a document."""
        return Document(id=self.id, settings=self.settings, strokes=self.strokes, layers=self.layers)

    @classmethod
    def from_document(
        cls, document: Document, grids: Mapping[str, Raster] | None = None, solver: Solver | None = None
    ) -> Terrain:
        """The terrain that a document describes.

        ``grids``: those of its elevation layers, by ``Layer.content``. Raises ValueError when one is missing.
        """
        out = cls(solver=solver)
        out.id, out.settings = document.id, document.settings
        out._patchwork = Patchwork(document.settings.size_m, document.layers, grids)
        out._strokes = {s.id: s for s in document.strokes}
        return out

    def save(self, path: str | Path) -> None:
        """Write an ``.esker`` file, with the grids of the layers. Raises ArchiveError for grids too large for one."""
        Path(path).write_bytes(archive.dumps(self.document, self.grids))

    @classmethod
    def load(cls, path: str | Path) -> Terrain:
        """Read an ``.esker`` file. Raises ArchiveError, OSError."""
        data = Path(path).read_bytes()
        return cls.from_document(archive.loads(data), unpacked(data))
