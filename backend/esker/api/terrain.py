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
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esker import contract, grid
from esker.api import arguments
from esker.api.heights import HeightCache, HeightWindow, Solved
from esker.api.layers import Patchwork, Sample, held_to, imported, laid, unpacked
from esker.api.strokes import Stroke
from esker.contract import Border, Document, Layer, TerrainSettings
from esker.document import archive
from esker.document.layers import span_m
from esker.document.ops import check_document, check_put
from esker.patchwork.lod.precedence import default_priority
from esker.patchwork.raster.rasters import Raster
from esker.solve.assembly import System, assemble
from esker.solve.detail import Settled, detailed, settle
from esker.solve.solver import Solver
from esker.synthesis.detailed import Detail, DetailedTerrain
from esker.synthesis.subdivide import finest_level

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
        size = arguments.number("size_m", size_m, contract.MIN_SIZE_M, contract.MAX_SIZE_M)
        if reach_m is None or reach_m == math.inf:
            reach: float | None = None
        elif isinstance(reach_m, str) and reach_m == "default":
            reach = size * contract.DEFAULT_REACH_FRACTION
        else:
            reach = arguments.number("reach_m", reach_m)
        self.id = secrets.token_hex(6)
        fields = {"size_m": size, "edition": contract.CURRENT_EDITION, "border": border, "reach_m": reach}
        self._settings = arguments.model(TerrainSettings, fields)
        self._strokes: dict[str, contract.Stroke] = {}
        self._solver = arguments.kind("solver", solver, Solver)
        self._patchwork = Patchwork(self.settings)
        self._heights = HeightCache()
        self._settled: Settled | None = None
        self._detailed: tuple[Settled, int, DetailedTerrain] | None = None
        self._detail: tuple[DetailedTerrain, int, Detail] | None = None

    @property
    def settings(self) -> TerrainSettings:
        """The settings; set others made with ``settings.model_copy(update=...)``. Raises ValueError for wrong ones, and
        for another size: that stays as it was at birth."""
        return self._settings

    @settings.setter
    def settings(self, settings: TerrainSettings) -> None:
        if not isinstance(settings, TerrainSettings):
            raise ValueError(f"settings must be TerrainSettings, not {arguments.shown(settings)}")
        found = arguments.model(TerrainSettings, settings.model_dump())
        if found.size_m != self._settings.size_m:
            raise ValueError(f"a terrain keeps its size of {self._settings.size_m:g} m: make another one")
        self._settings = found

    @property
    def strokes(self) -> Strokes:
        """The strokes, oldest first."""
        return tuple(self._strokes.values())

    def add(self, stroke: contract.Stroke) -> str:
        """Add a stroke, or replace the one of the same id; returns the id.

        Raises TypeError for what is no stroke, ValueError for one that a server would refuse: beyond its limits, too
        far outside, with fields that are not of its kind.
        """
        if not isinstance(stroke, contract.Stroke):
            raise TypeError(f"add takes a stroke, as Stroke.profile(...) makes one, not {type(stroke).__name__}")
        arguments.model(contract.Stroke, stroke.model_dump())  # it may be a copy with any fields
        held_to(lambda: check_put(stroke, self._strokes, self.settings.size_m))
        self._strokes[stroke.id] = stroke
        return stroke.id

    def remove(self, stroke_id: str) -> None:
        """Take a stroke away. Raises KeyError when there is none of this id."""
        if not isinstance(stroke_id, str) or stroke_id not in self._strokes:
            raise KeyError(f"There is no stroke {arguments.shown(stroke_id)} in this terrain.")
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

        ``grid``: an array (rows, cols) of heights, NaN or masked where there are none, row 0 south; or the path of a
        file (docs/importing.md), whose own place counts where it has one. ``anchor``: world position of sample [0, 0],
        without which a grid lies in the middle; ``rotation``: degrees counter-clockwise; ``spacing``: metres, or
        (sX, sY); ``accuracy``: the largest error of the grid anywhere, metres, by default from its spacing;
        ``priority``: of layers that say different things the greater is believed, by default the one added last,
        unless it is coarser and less accurate than what it lies on;
        height = ``scale`` * sample + ``lift``. ``answers``: to what a file leaves open. Raises ValueError for a grid
        that cannot be laid, or a file that is refused or leaves something open; OSError.
        """
        more: dict[str, Any] = {
            "name": name, "source": source, "licence": licence,
            "scale": arguments.number("scale", scale), "lift_m": arguments.number("lift", lift),
        }  # fmt: skip
        said = arguments.texts("answers", answers)
        rank = 0 if priority is None else arguments.whole("priority", priority, -(10**6), 10**6)
        rotation = None if rotation is None else arguments.number("rotation", rotation)
        accuracy = None if accuracy is None else arguments.number("accuracy", accuracy, 0.0)
        if isinstance(grid, (str, Path)):
            layer, raster, place = imported(
                Path(grid), self.settings, anchor=anchor, rotation=rotation, spacing=spacing, accuracy=accuracy,
                priority=rank, answers=said, more=more,
            )  # fmt: skip
            if self.settings.place is None and place is not None:
                self._settings = self.settings.model_copy(update={"place": place})
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
        places = arguments.points("points", points, (2,))
        tolerance = arguments.number("tolerance", tolerance, 0.0)
        derivatives = arguments.flag("derivatives", derivatives)
        base, n = self._patchwork.base, len(places)
        if base is None:
            return Sample(np.zeros(n), np.zeros((n, 2)), np.zeros((n, 3))) if derivatives else np.zeros(n)
        found = base.sample(places, tolerance=tolerance, smooth=True, derivatives=derivatives)
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
        level = arguments.whole("level", level, 0, contract.MAX_LEVEL)
        if arguments.detailed(detail, global_level, refined_level, progress):
            return self._whole(level, global_level, refined_level, progress).heights
        base = self._patchwork.base
        wanted = Solved.of(level, self.settings, self.strokes, base)
        ground = self._heights.find(wanted)
        if ground is None:
            solver = self._solver or default_solver()
            ground = solver.heights(self.strokes, self.settings, level, base=base)
            if base is not None:
                ground = ground + base.level(level, solver.device)
                ground.flags.writeable = False
            self._heights.put(wanted, ground)
        return ground

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
        level = arguments.whole("level", level, 0, contract.MAX_LEVEL)
        arguments.detailed(True, global_level, refined_level, progress)
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
        detail = arguments.detailed(detail, global_level, refined_level, progress)
        level = arguments.whole("level", level, 0, finest_level(size) if detail else contract.MAX_REFINED_LEVEL)
        corners = (
            arguments.number(name, x) for name, x in (("x0", x0), ("y0", y0), ("x1", x1), ("y1", y1))
        )  # fmt: skip
        r0, r1, c0, c1 = arguments.samples_inside(tuple(corners), level, size)
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
        weights: bool = False,
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
        always come from the detail. ``weights``: masks that sum to one, with one for bare ground. ``progress`` is told
        the share that is done. Raises ValueError for what cannot be written so, OSError.
        """
        from esker.exporting import formats  # not with this module: it brings pyproj
        from esker.exporting.ground import Extent

        def step(stage: contract.ExportStage, share: float) -> None:
            if progress is not None:
                progress(formats.share_of(stage, share))

        where = arguments.path("path", path)
        detail = arguments.detailed(detail, global_level, refined_level, progress)
        weights = arguments.flag("weights", weights)
        if level is not None:
            level = arguments.whole(
                "level", level, 0, contract.MAX_LEVEL if window is None else contract.MAX_SYNTHESIS_LEVEL
            )
        if window is not None:
            x0, y0, x1, y1 = arguments.numbers("window", window, 4)
            window = x0, y0, x1, y1
        extent = Extent.of(level, samples, window)
        levels = {"global_level": global_level, "refined_level": refined_level}
        formats.export(
            self, where, formats.format_of(where), extent, detail=detail, step=step, weights=weights, **levels
        )

    def _whole(
        self, level: int, global_level: int, refined_level: int, progress: Callable[[float], None] | None
    ) -> Detail:
        """A whole level with detail; that of the last time if nothing has changed."""
        terrain, held = self._with_detail(global_level, refined_level), self._detail
        if held is None or held[0] is not terrain or held[1] != level:
            every = slice(0, grid.samples(level))
            made = terrain.window(level, every, every, progress)
            for values in (made.heights, *made.attributes.values()):
                values.flags.writeable = False
            held = self._detail = (terrain, level, made)
        return held[2]

    def _with_detail(self, global_level: int, refined_level: int) -> DetailedTerrain:
        """Returns what makes detail. What was made last time serves again if nothing has changed."""
        solver = self._solver or default_solver()
        settled, held = self._settle(solver, global_level), self._detailed
        if held is None or held[0] is not settled or held[1] != refined_level:
            held = self._detailed = (
                settled, refined_level, detailed(solver, settled, refined_level, span_m(self.layers))
            )  # fmt: skip
        return held[2]

    def _settle(self, solver: Solver, level: int) -> Settled:
        """Returns what refinement and detail start from. What was solved last time serves again if nothing has
        changed."""
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
            if base is None:
                self._heights.put(Solved.of(level, self.settings, strokes, base), held.basis.heights)
        return held

    def assemble(self, level: int) -> System:
        """(A, b): the float64 sparse system of the height step at ``level``, see ``esker.solve.assembly``.

        Its unknowns are heights above the ground of the elevation layers. Raises ValueError for a level outside
        0..MAX_LEVEL: the next one would take many gigabytes.
        """
        level = arguments.whole("level", level, 0, contract.MAX_LEVEL)
        return assemble(self.strokes, self.settings, level, base=self._patchwork.base)

    @property
    def document(self) -> Document:
        """The terrain as a document."""
        return Document(id=self.id, settings=self.settings, strokes=self.strokes, layers=self.layers)

    @classmethod
    def from_document(
        cls,
        document: Document,
        grids: Mapping[str, Raster] | None = None,
        solver: Solver | None = None,
        *,
        trusted: bool = False,
    ) -> Terrain:
        """The terrain that a document describes.

        ``grids``: those of its elevation layers, by ``Layer.content``. ``trusted``: a server has it, which held it to
        the limits of its time. Raises ValueError when a grid is missing, and for a document that a server would refuse.
        """
        if not isinstance(document, Document):
            raise ValueError(f"document must be an esker.contract.Document, not {arguments.shown(document)}")
        if not trusted:
            held_to(lambda: check_document(document))
        out = cls(solver=solver)
        out.id, out._settings = document.id, document.settings
        out._patchwork = Patchwork(document.settings, document.layers, grids)
        out._strokes = {s.id: s for s in document.strokes}
        return out

    def save(self, path: str | Path) -> None:
        """Write an ``.esker`` file, with the grids of the layers. Raises ArchiveError for grids too large for one."""
        arguments.path("path", path).write_bytes(archive.dumps(self.document, self.grids))

    @classmethod
    def load(cls, path: str | Path) -> Terrain:
        """Read an ``.esker`` file. Raises ArchiveError, OSError, ValueError for a terrain beyond a server's limits."""
        data = arguments.path("path", path).read_bytes()
        return cls.from_document(archive.loads(data), unpacked(data))
