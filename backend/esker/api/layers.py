"""Elevation layers of a terrain without a server (DESIGN 11): what ``Terrain.add_grid`` and its like do.

``Patchwork`` keeps layers, their rasters and the ground that they make together; ``laid`` makes a layer of an array,
``imported`` one of a file.
"""

from __future__ import annotations

import asyncio
import atexit
import math
import secrets
import shutil
import tempfile
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esker import contract
from esker.api import arguments
from esker.contract import ImportAnswers, Layer, LayerFields, Place, TerrainSettings
from esker.document import archive
from esker.document.layers import check_layer
from esker.document.refusal import Refusal
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Model, Placed
from esker.patchwork.raster import rasters
from esker.patchwork.raster.rasters import Raster

Spacing = float | tuple[float, float]


class Sample(NamedTuple):
    """Ground at n places. ``heights`` (n,), metres; ``gradient`` (n, 2), d/dx and d/dy, metres per metre; ``hessian``
    (n, 3), xx, xy and yy, 1/m; all float64."""

    heights: NDArray[np.float64]
    gradient: NDArray[np.float64]
    hessian: NDArray[np.float64]

    @property
    def slope_deg(self) -> NDArray[np.float64]:
        """(n,) steepness, degrees from level."""
        return np.degrees(np.arctan(np.hypot(self.gradient[:, 0], self.gradient[:, 1])))

    @property
    def aspect_deg(self) -> NDArray[np.float64]:
        """(n,) the way the ground falls, degrees clockwise from north; NaN where it is level."""
        p, q = self.gradient.T
        level = (p == 0) & (q == 0)
        return np.asarray(np.where(level, np.nan, np.degrees(np.arctan2(-p, -q)) % 360.0))

    @property
    def mean_curvature(self) -> NDArray[np.float64]:
        """(n,) of the surface, 1/m, positive in hollows (Evans 1980; do Carmo, Differential Geometry, 3-3)."""
        (p, q), (r, s, t) = self.gradient.T, self.hessian.T
        return np.asarray(((1 + q * q) * r - 2 * p * q * s + (1 + p * p) * t) / (2 * (1 + p * p + q * q) ** 1.5))

    @property
    def gaussian_curvature(self) -> NDArray[np.float64]:
        """(n,) of the surface, 1/m^2: positive on domes and bowls, negative on saddles."""
        (p, q), (r, s, t) = self.gradient.T, self.hessian.T
        return np.asarray((r * t - s * s) / (1 + p * p + q * q) ** 2)


def held_to(check: Callable[[], None]) -> None:
    """A server's refusal as a ValueError: one set of limits, one set of sentences."""
    try:
        check()
    except Refusal as refusal:
        raise ValueError(refusal.message) from None


class Patchwork:
    """The elevation layers of one terrain with their rasters, and the ground that they make. Not thread-safe."""

    def __init__(
        self, settings: TerrainSettings, layers: tuple[Layer, ...] = (), grids: Mapping[str, Raster] | None = None
    ) -> None:
        """``grids``: rasters by content. Raises ValueError when that of a layer is not among them."""
        self.size_m, self._edition = settings.size_m, settings.edition
        self._layers: dict[str, Layer] = {}
        self._rasters: dict[str, Raster] = {}
        self._model: Model | None = None
        self._base: Base | None = None
        self._key: tuple[object, ...] = ()
        for layer in layers:
            if grids is None or layer.content not in grids:
                raise ValueError(f"The grid of layer '{layer.name or layer.id}' ({layer.content[:12]}) is not at hand.")
            self._put(layer, grids[layer.content])

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The layers, in the order in which they came."""
        return tuple(self._layers.values())

    @property
    def grids(self) -> dict[str, Raster]:
        """The rasters of the layers, by content."""
        return {layer.content: self._rasters[layer.content] for layer in self.layers}

    def put(self, layer: Layer, raster: Raster) -> None:
        """Add a layer, or replace the one of the same id. Raises ValueError beyond the limits."""
        self._check(layer)
        if layer.id not in self._layers and len(self._layers) >= contract.MAX_LAYERS:
            raise ValueError(f"a terrain holds at most {contract.MAX_LAYERS} elevation layers")
        self._put(layer, raster)

    def _put(self, layer: Layer, raster: Raster) -> None:
        if raster.digest != layer.content:
            raise ValueError("the layer names another grid than this")
        self._rasters[raster.digest] = raster
        self._layers[layer.id] = layer

    def change(self, layer_id: str, fields: Mapping[str, Any]) -> Layer:
        """Change fields of a layer (``contract.LayerFields``). Raises KeyError, ValueError."""
        layer = self._held(layer_id)
        changes = arguments.model(LayerFields, fields).model_dump(exclude_unset=True)
        if None in changes.values():
            raise ValueError("fields of a layer have values")
        changed = arguments.model(Layer, layer.model_dump() | changes)
        self._check(changed)
        self._layers[layer_id] = changed
        return changed

    def remove(self, layer_id: str) -> None:
        """Take a layer away. Raises KeyError when there is none of this id."""
        layer = self._held(layer_id)
        del self._layers[layer_id]
        if all(other.content != layer.content for other in self._layers.values()):
            del self._rasters[layer.content]

    def _held(self, layer_id: str) -> Layer:
        if not isinstance(layer_id, str) or layer_id not in self._layers:
            raise KeyError(f"There is no elevation layer {arguments.shown(layer_id)} in this terrain.")
        return self._layers[layer_id]

    def _check(self, layer: Layer) -> None:
        held_to(lambda: check_layer(layer, self.size_m))

    @property
    def base(self) -> Base | None:
        """The ground of the visible layers; None where none is visible. That of the last time if nothing changed."""
        visible = [layer for layer in self.layers if not layer.hidden]
        key = tuple(_matters(layer) for layer in visible)
        if key != self._key:
            placed = [Placed(layer, self._rasters[layer.content]) for layer in visible]
            self._model = space.build(placed, self._model) if placed else None
            self._base = None if self._model is None else Base(self._model, self.size_m, self._base, self._edition)
            self._key = key
        return self._base


def _matters(layer: Layer) -> Layer:
    """A layer without what its ground does not follow from."""
    return layer.model_copy(update={"name": "", "author": "", "outline": 0.0, "source": "", "licence": ""})


def unpacked(data: bytes) -> dict[str, Raster]:
    """The grids in the bytes of an ``.esker`` file, by content. Raises ArchiveError."""
    grids = {}
    for content, grid in archive.load_grids(data).items():
        grids[content] = rasters.build(grid.heights, grid.warp)
        if grids[content].digest != content:
            raise archive.ArchiveError("An elevation grid in this file is not the one that its terrain names.")
    return grids


def laid(
    heights: ArrayLike,
    size_m: float,
    *,
    anchor: tuple[float, float] | None,
    rotation: float | None,
    spacing: Spacing | None,
    accuracy: float | None,
    priority: int,
    more: Mapping[str, Any],
) -> tuple[Layer, Raster]:
    """A layer of an array (rows, cols), row 0 south at rotation 0, NaN where there are no data.

    ``anchor``: world position of sample [0, 0], metres; without one the grid lies in the middle of the domain. Raises
    ValueError for what is no grid or has no place.
    """
    if spacing is None:
        raise ValueError("an array does not say how far its samples are apart: give spacing=metres or (sX, sY)")
    steps, turn = _steps(spacing), 0.0 if rotation is None else arguments.number("rotation", rotation)
    raster = rasters.build(rasters.numbers(heights))
    rows, cols = raster.heights.shape
    layer = layer_of(
        content=raster.digest,
        facts=raster.facts(format="array"),
        anchor=centred(size_m, rows, cols, steps, turn) if anchor is None else arguments.pair("anchor", anchor),
        rotation_deg=turn,
        spacing_m=steps,
        accuracy_m=_likely_error(steps, raster, more) if accuracy is None else accuracy,
        priority=priority,
        **more,
    )
    return layer, raster


def centred(size_m: float, rows: int, cols: int, spacing: tuple[float, float], rotation: float) -> tuple[float, float]:
    """The anchor of a grid whose middle lies in that of the domain."""
    a = math.radians(rotation)
    x, y = 0.5 * (cols - 1) * spacing[0], 0.5 * (rows - 1) * spacing[1]
    half = 0.5 * size_m
    return half - (x * math.cos(a) - y * math.sin(a)), half - (x * math.sin(a) + y * math.cos(a))


def layer_of(**fields: Any) -> Layer:
    """A layer with a new id unless it is given. Raises ValueError that names the first field that is wrong."""
    return arguments.model(Layer, {"id": secrets.token_hex(6)} | fields)


def _likely_error(steps: tuple[float, float], raster: Raster, more: Mapping[str, Any]) -> float:
    """Returns the error of a grid of which nobody says how good it is, by the rule for files."""
    from esker.importing.questions import accuracy_m

    whole = all(bool((block == np.rint(block))[~np.isnan(block)].all()) for block in raster.heights)
    return accuracy_m(steps, 1.0 if whole else None) * max(1.0, abs(float(more["scale"])))


def _steps(spacing: Spacing) -> tuple[float, float]:
    steps = arguments.real_array("spacing", spacing)
    if steps.shape not in {(), (2,)}:
        raise ValueError("spacing is one number or two: (sX, sY)")
    x, y = np.broadcast_to(steps, 2).tolist()
    return x, y


def imported(
    path: Path,
    settings: contract.TerrainSettings,
    *,
    anchor: tuple[float, float] | None,
    rotation: float | None,
    spacing: Spacing | None,
    accuracy: float | None,
    priority: int,
    answers: Mapping[str, str],
    more: Mapping[str, Any],
) -> tuple[Layer, Raster, Place | None]:
    """A layer of a file, read by a process of its own (docs/importing.md), and the place on Earth that the terrain then
    has. What is None is as the file says. Raises ValueError with a sentence, OSError."""
    if not path.is_file():
        raise FileNotFoundError(f"There is no file {path}.")
    given = _answered(
        answers=dict(answers),
        anchor=None if anchor is None else arguments.pair("anchor", anchor),
        rotation_deg=rotation,
        spacing_m=None if spacing is None else _steps(spacing),
        scale=more["scale"],
        lift_m=more["lift_m"],
        accuracy_m=accuracy,
        name=more["name"] or None,
        source=more["source"] or None,
        licence=more["licence"] or None,
    )
    # A thread of its own: the caller may be inside an event loop already, as in a notebook.
    with ThreadPoolExecutor(1) as pool:
        layer, folder, place = pool.submit(asyncio.run, _convert(path, settings, given)).result()
    made = layer.model_copy(update={"id": secrets.token_hex(6), "priority": priority})
    return made, rasters.read(folder), place


def _answered(**fields: Any) -> ImportAnswers:
    return arguments.model(ImportAnswers, fields)


async def _convert(
    path: Path, settings: contract.TerrainSettings, given: ImportAnswers
) -> tuple[Layer, Path, Place | None]:
    from esker.importing import run  # not with this module: it brings pyproj

    report = await run.inspect(path, path.name, answers=given, place=settings.place, size_m=settings.size_m)
    if report.verdict == "refused":
        raise ValueError(f"{path.name}: {report.refusal}")
    if report.verdict == "ask":
        asked = " ".join(f"{q.text} (answers={{{q.id!r}: {q.default!r}}}, for instance)" for q in report.questions)
        raise ValueError(f"{path.name} leaves something open. {asked}")
    place = settings.place or run.suggest_place(report)
    folder = _folder() / secrets.token_hex(8)
    return await run.convert(path, given, place, settings.size_m, folder), folder, place


@cache
def _folder() -> Path:
    """Returns the folder in which this process keeps the grids that it made of files. It is removed when the process
    ends."""
    folder = Path(tempfile.mkdtemp(prefix="esker-grids-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
