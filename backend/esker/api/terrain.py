"""The offline Python API (DESIGN 5.7): strokes in, heights out, no server.

>>> from esker import Terrain, Stroke
>>> t = Terrain(size_m=4096)
>>> ridge = Stroke.profile([(500, 2000, 0), (2000, 2200, 900), (3500, 2000, 0)], left=(35, 300), right=(50, 200))
>>> _ = t.add(ridge)
>>> h = t.heights(level=2)
>>> h.shape, h.dtype.name, bool(880 < h.max() < 901)
((257, 257), 'float32', True)
"""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esker import contract, grid
from esker.api import arguments
from esker.api.heights import HeightCache, HeightWindow, KeptGround, Solved, Source
from esker.api.layers import Patchwork, Sample, held_to, unpacked
from esker.api.strokes import Stroke
from esker.api.terrain_layers import TerrainLayers
from esker.api.terrain_water import TerrainWater
from esker.contract import Border, Document, TerrainSettings
from esker.document import archive
from esker.document.layers import span_m
from esker.document.ops import check_document, check_put
from esker.patchwork.raster.rasters import Raster
from esker.solve.assembly import System, assemble
from esker.solve.solver import Solver
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


class Terrain(TerrainLayers, TerrainWater):
    """A terrain without a server. Heights are a pure function of ``strokes``, ``layers`` and ``settings``.

    Parameters
    ----------
    size_m: side of the square domain, metres.
    border: "free", or "pinned" to the base.
    reach_m: how far strokes are felt, metres (DESIGN 5.1); by default size / 32; None or infinity for pure diffusion.
    solver: what solves; by default one for the whole process, on the best device there is.

    Raises
    ------
    ValueError: a number is out of its range.

    Examples
    --------
    >>> from esker import Terrain
    >>> Terrain(size_m=1024, reach_m=64).settings.reach_m
    64.0
    >>> Terrain(size_m=-1)
    Traceback (most recent call last):
    ...
    ValueError: size_m ...
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
        born = {"erosion": contract.BORN_EROSION, "hold": contract.BORN_HOLD}
        fields = {"size_m": size, "edition": contract.CURRENT_EDITION, "border": border, "reach_m": reach, **born}
        self._settings = arguments.model(TerrainSettings, fields)
        self._strokes: dict[str, contract.Stroke] = {}
        self._solver = arguments.kind("solver", solver, Solver)
        self._patchwork = Patchwork(self.settings)
        self._heights = HeightCache()
        self._ground = KeptGround(self._heights)

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
        """Adds a stroke, or replaces the one of the same id; returns the id.

        Raises
        ------
        TypeError: ``stroke`` is none.
        ValueError: a server would refuse the stroke: it is beyond its limits, too far outside, or has fields that are
            not of its kind.

        Examples
        --------
        >>> from esker import Stroke, Terrain
        >>> t = Terrain()
        >>> t.add(Stroke.level([(1000, 1000, 120), (2000, 1200, 120)], plateau_radius_m=60, id="mesa"))
        'mesa'
        >>> [stroke.id for stroke in t.strokes]
        ['mesa']
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

    def heights(
        self,
        level: int = contract.DEFAULT_LEVEL,
        detail: bool = False,
        *,
        global_level: int = contract.DEFAULT_LEVEL,
        refined_level: int = contract.DEFAULT_REFINED_LEVEL,
        progress: Callable[[float], None] | None = None,
    ) -> NDArray[np.float32]:
        """Settled heights of a level: what strokes make of the ground of the elevation layers.

        Parameters
        ----------
        level: 0..6; a level has 64 * 2**level + 1 samples a side. ``window`` goes further.
        detail: False for the solve with ``level`` as its finest. True for what the page shows: a server solves levels
            0..``global_level`` as a whole, refines to ``refined_level``, and detail grows on that (docs/synthesis.md).
        progress: is told the share of the detail that is done, 0..1.

        Returns
        -------
        float32 (N, N), metres, row 0 south, read-only.

        Raises
        ------
        ValueError: there is no such level.

        Examples
        --------
        >>> from esker import Stroke, Terrain
        >>> t = Terrain()
        >>> _ = t.add(Stroke.profile([(900, 2000, 0), (2000, 2000, 700), (3200, 2000, 0)]))
        >>> coarse, fine = t.heights(level=0), t.heights(level=1)
        >>> coarse.shape, fine.shape
        ((65, 65), (129, 129))
        """
        level = arguments.whole("level", level, 0, contract.MAX_LEVEL)
        if arguments.detailed(detail, global_level, refined_level, progress):
            levels = global_level, refined_level
            return self._ground.whole(self._solving(), self._source(), level, levels, progress).heights
        base = self._patchwork.base
        wanted = Solved.of(level, self.settings, self.strokes, base)
        ground = self._heights.find(wanted)
        if ground is None:
            solver = self._solving()
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
        levels = global_level, refined_level
        return dict(self._ground.whole(self._solving(), self._source(), level, levels, progress).attributes)

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
        """Settled heights inside a rectangle, at what the rectangle costs (DESIGN 5.6).

        Parameters
        ----------
        level: whose samples are wanted. Levels 0..``global_level`` are solved as a whole; those above, up to
            MAX_REFINED_LEVEL, are refined from them where they are looked at.
        x0, y0, x1, y1: the rectangle, world metres.
        detail: whether heights and attributes are wanted as the page shows them, down to cells of a centimetre: refined
            to ``refined_level`` as a server does, interpolated beyond.
        progress: is told the share of the refinement, or of the detail, that is done, 0..1.

        Raises
        ------
        ValueError: there is no such level, or the rectangle holds no sample.

        Examples
        --------
        >>> from esker import Stroke, Terrain
        >>> t = Terrain()
        >>> _ = t.add(Stroke.profile([(900, 2000, 0), (2000, 2000, 700), (3200, 2000, 0)]))
        >>> near = t.window(4, 1900, 1900, 2100, 2100, global_level=2)
        >>> near.heights.shape, near.spacing_m
        ((51, 51), 4.0)
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
            maker = self._ground.detailed(self._solving(), self._source(), global_level, refined_level)
            made = maker.window(level, rows, cols, progress)
            return HeightWindow(made.heights, c0 * s, r0 * s, s, made.attributes)
        solver, source = self._solving(), self._source()
        settled, base = self._ground.settled(solver, source, min(level, global_level)), source.base
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
        paper: contract.PaperOptions | None = None,
        model: contract.ModelOptions | None = None,
        window: tuple[float, float, float, float] | None = None,
        global_level: int = contract.DEFAULT_LEVEL,
        refined_level: int = contract.DEFAULT_REFINED_LEVEL,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        """Write the terrain for other programs, as the suffix of ``path`` says (docs/exporting.md): ``.png``, ``.r16``
        and ``.raw`` (heightmaps of 16 bits, the raw ones with a .json beside them), ``.tif`` (GeoTIFF), ``.npy``,
        ``.glb`` (a mesh with colours), ``.zip`` (masks of 8 bits), ``.pdf`` and ``.svg`` (a contour map to scale),
        ``.stl`` (a solid for printers).

        ``level``, or ``samples`` a side (one of EXPORT_LEVELS); ``window``: only the samples of ``level`` in this
        rectangle (x0, y0, x1, y1) of world metres. ``detail``: as in ``heights``; without it levels above
        ``global_level`` are refined, as in ``window``. Masks and colours always come from the detail. ``weights``:
        masks that sum to one, with one for bare ground. ``paper``: paper, scale and interval of a contour map;
        ``model``: width, base and exaggeration of a solid. ``progress`` is told the share that is done. Raises
        ValueError for what cannot be written so, OSError.
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
            self, where, formats.format_of(where), extent, detail=detail, step=step, weights=weights,
            paper=paper, model=model, **levels,
        )  # fmt: skip

    def _source(self) -> Source:
        return Source(self.strokes, self.settings, self._patchwork.base, span_m(self.layers))

    def _solving(self) -> Solver:
        return self._solver or default_solver()

    def assemble(self, level: int) -> System:
        """(A, b): the sparse system of the height step at ``level``, float64; see ``esker.solve.assembly``.

        Its unknowns are heights above the ground of the elevation layers, in row-major order, row 0 south. Raises
        ValueError for a level outside 0..MAX_LEVEL: the next one would take many gigabytes.

        >>> from esker import Terrain
        >>> A, b = Terrain().assemble(level=0)
        >>> A.shape, b.shape
        ((4225, 4225), (4225,))
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
