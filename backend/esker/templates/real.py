"""Cuts the two starting terrains of real ground out of public elevation data.

``python -m esker.templates.real FOLDER`` reads the files named below from a folder, lays them in the terrains' frames
by Esker's own import, and rewrites ``data/*.npz`` and the two JSON files. A test checks that what is committed goes
together; the originals are not in the repository (data/NOTICE says where they come from).
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import Document, GridFacts, Layer, Place, Stroke, TerrainSettings
from esker.importing.opening import open_source
from esker.importing.placement import fitting
from esker.importing.placement.georef import Georef
from esker.importing.source import Source
from esker.patchwork.raster import rasters
from esker.templates import FOLDER, survey
from esker.templates.pen import Pen

MARGIN_SAMPLES: Final = 40
"""Samples beyond the domain that are kept, so that the ground goes on across its border."""


@dataclass(frozen=True)
class Cut:
    """One layer: ``file`` of the folder, kept as ``name``.npz in steps of ``quantum_m``."""

    name: str
    file: str
    title: str
    quantum_m: float
    accuracy_m: float
    source: str
    licence: str = "Public domain (United States Government)"


def cut(spec: Cut, folder: Path, settings: TerrainSettings, work: Path) -> tuple[survey.Grid, fitting.Laid]:
    """The part of a file that lies on the terrain, turned as a layer wants it, and where it lies."""
    assert settings.place is not None
    source = open_source(folder / spec.file, spec.file, work, {}).source
    assert source.georef is not None
    heights = _heights(source)
    rows, cols = _window(source.georef, settings, heights.shape)
    heights = heights[rows, cols]
    georef = _moved(source.georef, rows.start, cols.start)
    laid = fitting.lay(fitting.on_frame(georef, settings.place, settings.size_m), *heights.shape)
    heights = heights[:: -1 if laid.flip_rows else 1, :: -1 if laid.flip_cols else 1]
    return survey.Grid(np.ascontiguousarray(heights), laid.warp), laid


def _heights(source: Source) -> NDArray[np.float32]:
    """All samples of a file in metres, NaN where it has none."""
    out = np.full((source.rows, source.cols), np.nan, dtype=np.float32)
    for piece in source.pieces():
        h, w = piece.values.shape
        metres = source.gain * piece.values + source.bias
        out[piece.row : piece.row + h, piece.col : piece.col + w] = np.where(piece.valid, metres, np.nan)
    return out


def _window(georef: Georef, settings: TerrainSettings, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Rows and columns of a file between the domain's edges and a margin beyond them."""
    assert settings.place is not None
    col, row = np.meshgrid(np.arange(shape[1], dtype=float), np.arange(shape[0], dtype=float))
    x, y = fitting.on_frame(georef, settings.place, settings.size_m)(col.ravel(), row.ravel())
    inside = ((x >= 0) & (x <= settings.size_m) & (y >= 0) & (y <= settings.size_m)).reshape(shape)
    spans = []
    for axis, n in ((1, shape[0]), (0, shape[1])):
        hit = np.flatnonzero(inside.any(axis=axis))
        spans.append(slice(max(0, int(hit[0]) - MARGIN_SAMPLES), min(n, int(hit[-1]) + 1 + MARGIN_SAMPLES)))
    return spans[0], spans[1]


def _moved(georef: Georef, row: int, col: int) -> Georef:
    """The georeference of a grid without its first rows and columns."""
    assert georef.affine is not None
    a, b, x, d, e, y = georef.affine
    return Georef(georef.crs, (a, b, x + a * col + b * row, d, e, y + d * col + e * row))


def layer_of(name: str, priority: int, spec: Cut, grid: survey.Grid, laid: fitting.Laid) -> Layer:
    """The layer that the document has. ``name``: of the terrain."""
    raster = rasters.build(grid.heights, grid.warp)
    facts: GridFacts = raster.facts(geo=True, file=spec.file, format="GeoTIFF")
    return Layer(
        id=f"{name}-{priority + 1}",
        content=raster.digest,
        facts=facts,
        author="Esker",
        name=spec.title,
        anchor=laid.anchor,
        rotation_deg=laid.rotation_deg,
        spacing_m=laid.spacing_m,
        accuracy_m=spec.accuracy_m,
        priority=priority,
        outline=0.0,
        source=spec.source,
        licence=spec.licence,
    )


USGS: Final = "U.S. Geological Survey, Cascades Volcano Observatory"
RAINIER: Final = (
    Cut("puget", "puget_1k_utm10_registered.tif", "Puget Sound, 160 m", 0.5, 20.0,
        "U.S. Geological Survey elevation data by way of the University of Washington and Georgia Tech"),
    Cut("rainier", "mt_rainier_90m.tif", "Mount Rainier, 3 arc seconds", 1.0, 9.0,
        "NASA Shuttle Radar Topography Mission, 3 arc seconds, tile N46W122"),
)  # fmt: skip
HELENS: Final = (
    Cut("helens-2000", "msh_2000_10m.tif", "2000, before the dome grew", 0.1, 5.0, f"{USGS}: survey of 2000, 10 m"),
    Cut("helens-2004-10-04", "msh_20041004_2m.tif", "4 October 2004", 0.05, 1.0, f"{USGS}: lidar, 4 October 2004, 2 m"),
    Cut("helens-2004-10-11", "msh_20041011_2m.tif", "11 October 2004", 0.05, 1.0,
        f"{USGS}: lidar, 11 October 2004, 2 m"),
)  # fmt: skip


def sound_strokes() -> tuple[Stroke, ...]:
    """The bed of Commencement Bay: the data know its surface alone."""
    pen = Pen("rainier", 1)
    bay = [(5056, 57000, -12), (4500, 58400, -70), (2900, 60000, -120), (2500, 61400, -130), (6300, 64600, -140)]
    pen.chain(bay, (5, 1600), (5, 1600), wobble=0.0, label="Commencement Bay")
    return tuple(pen.strokes)


@dataclass(frozen=True)
class Real:
    """One starting terrain."""

    id: str
    title: str
    description: str
    settings: TerrainSettings
    cuts: tuple[Cut, ...]
    strokes: tuple[Stroke, ...] = ()


def terrains() -> tuple[Real, ...]:
    """Both, without their ground."""
    sound = TerrainSettings(
        title="Rainier and the Sound", size_m=65536.0, place=Place(lat_deg=47.0560, lon_deg=-122.0720),
        reach_m=600.0, sea_level_m=3.0, sun_azimuth_deg=75.0, sun_elevation_deg=18.0,
    )  # fmt: skip
    helens = TerrainSettings(
        title="Mount St Helens", size_m=2944.0, place=Place(lat_deg=46.2017, lon_deg=-122.18734),
        reach_m=60.0, sun_azimuth_deg=112.0, sun_elevation_deg=28.0,
    )  # fmt: skip
    return (
        Real("rainier", "Rainier and the Sound",
             "Real ground: Puget Sound and Mount Rainier, two surveys of their own grain and angle, blended live.",
             sound, RAINIER, sound_strokes()),
        Real("helens", "Mount St Helens",
             "A crater in three surveys: 2000 and twice in October 2004. Hide a layer and watch the new dome go.",
             helens, HELENS),
    )  # fmt: skip


def build(folder: Path, out: Path = FOLDER) -> None:
    """Write grids and documents of both terrains."""
    for real in terrains():
        layers = []
        for priority, spec in enumerate(real.cuts):
            grid, laid = cut(spec, folder, real.settings, out)
            survey.write(out / "data" / f"{spec.name}.npz", grid, spec.quantum_m)
            kept = survey.read(out / "data" / f"{spec.name}.npz")
            layers.append(layer_of(real.id, priority, spec, kept, laid))
        document = Document(id=real.id, settings=real.settings, strokes=real.strokes, layers=tuple(layers))
        grids = {layer.content: spec.name for layer, spec in zip(layers, real.cuts, strict=True)}
        data: dict[str, Any] = {"id": real.id, "title": real.title, "description": real.description, "grids": grids}
        text = json.dumps(data | {"document": document.model_dump(mode="json")}, separators=(",", ":"))
        (out / f"{real.id}.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where the elevation files are")
    build(parser.parse_args().folder)
