"""GeoTIFF / COG, ERDAS IMAGINE, DTED and PNG through rasterio, each with exactly one driver allowed."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyproj

os.environ.setdefault("PROJ_NETWORK", "OFF")
import rasterio
from rasterio._err import CPLE_BaseError
from rasterio.enums import ColorInterp, MaskFlags
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.windows import Window

from esker.importing.formats import colours
from esker.importing.limits import ALONE
from esker.importing.placement.georef import Georef, check_affine, from_corner, vertical_unit_m
from esker.importing.refusal import ImportRefused
from esker.importing.source import MAX_BLOCK_BYTES, PIECE_SAMPLES, Piece, Source, check_shape, integer_step

UNITS: Final = {
    "": None, "m": 1.0, "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0, "mm": 1e-3, "cm": 1e-2, "dm": 0.1,
    "km": 1e3, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "international foot": 0.3048, "us-ft": 1200 / 3937,
    "ftus": 1200 / 3937, "us survey foot": 1200 / 3937, "us_survey_foot": 1200 / 3937, "foot_us": 1200 / 3937,
}  # fmt: skip
FORMATS: Final = {"GTiff": "GeoTIFF", "HFA": "ERDAS IMAGINE", "DTED": "DTED", "PNG": "PNG"}
MAX_BANDS: Final = 64


@dataclass(eq=False)
class GdalSource(Source):
    """A raster that GDAL decodes. ``band``: the one taken, from 1; ``encoding``: how its colours hold heights."""

    dataset: Any = None
    band: int = 1
    encoding: colours.Encoding | None = None
    masked: bool = field(default=False)

    def pieces(self) -> Iterator[Piece]:
        """See ``Source.pieces``; what the file masks (nodata, alpha, mask band) is masked."""
        for window in self._windows():
            try:
                yield self._read(window)
            except (RasterioError, CPLE_BaseError, ValueError) as error:
                raise ImportRefused(
                    f"The file's data are broken at row {int(window.row_off)}: its header is good but its samples "
                    "cannot be read."
                ) from error

    def close(self) -> None:
        """Gives back GDAL's cache of blocks."""
        self.dataset.close()

    def _windows(self) -> Iterator[Any]:
        """Windows in an order that decodes no block twice: whole blocks, or bands of one that is large."""
        height, width = (min(*pair) for pair in zip(self._block(), (self.rows, self.cols), strict=True))
        across = min(self.cols, max(width, PIECE_SAMPLES // height // width * width))
        down = max(height, PIECE_SAMPLES // across // height * height)
        band = min(down, max(1, PIECE_SAMPLES // across))
        for row in range(0, self.rows, down):
            for col in range(0, self.cols, across):
                for part in range(row, min(row + down, self.rows), band):
                    stop = min(part + band, row + down, self.rows)
                    yield Window(col, part, min(across, self.cols - col), stop - part)

    def _block(self) -> tuple[int, int]:
        height, width = self.dataset.block_shapes[self.band - 1]
        return int(height), int(width)

    def _read(self, window: Any) -> Piece:
        row, col = int(window.row_off), int(window.col_off)
        if self.encoding is not None:
            bands = self.dataset.read((1, 2, 3), window=window)
            values = colours.decode(bands, self.encoding)
        else:
            with np.errstate(invalid="ignore"):  # signalling NaN
                values = self.dataset.read(self.band, window=window).astype(np.float64)
        valid = (
            self.dataset.read_masks(self.band, window=window) != 0 if self.masked else np.ones(values.shape, np.bool_)
        )
        return Piece(row, col, values, valid)


def open_raster(path: Path, driver: str, band: int = 1) -> GdalSource:
    """Opens one file with one driver; nothing beside it is looked at. Raises ImportRefused."""
    try:
        with warnings.catch_warnings(), rasterio.Env(**ALONE):
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            dataset = rasterio.open(path, driver=driver)
    except (RasterioError, CPLE_BaseError) as error:
        raise ImportRefused(
            f"It starts like {FORMATS[driver]} but cannot be opened: it is broken or cut off."
        ) from error
    check_shape(dataset.height, dataset.width)
    _check_layout(dataset, path)
    if not 1 <= band <= dataset.count:
        raise ImportRefused(f"It has no band {band}, only {dataset.count}.")
    dtype = np.dtype(dataset.dtypes[band - 1]) if "complex" not in dataset.dtypes[band - 1] else np.dtype(np.complex64)
    interpretation = _interpretation(dataset)
    colour = (
        dataset.count in (3, 4)
        and all(kind == "uint8" for kind in dataset.dtypes)
        and set(interpretation[:3])
        <= {ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.undefined, ColorInterp.gray}
    )
    source = GdalSource(
        format=FORMATS[driver],
        rows=dataset.height,
        cols=dataset.width,
        dtype=dataset.dtypes[band - 1],
        step=integer_step(dtype),
        nodata=dataset.nodatavals[band - 1],
        eight_bit=dtype.itemsize == 1,
        colour=colour,
        bands=1 if colour else sum(kind != ColorInterp.alpha for kind in interpretation),
        dataset=dataset,
        band=band,
        masked=MaskFlags.all_valid not in dataset.mask_flag_enums[band - 1],
        measured=driver != "PNG",
    )
    if interpretation[band - 1] == ColorInterp.palette:
        source.notes.append("Its samples are numbers of a colour table.")
    _place(source)
    _vertical(source)
    if len(dataset.subdatasets) > 1:
        source.notes.append(f"It holds {len(dataset.subdatasets)} grids; the first is taken.")
    if driver == "GTiff" and dataset.tags(ns="IMAGE_STRUCTURE").get("LAYOUT") == "COG":
        source.format = "GeoTIFF (COG)"
    return source


def _interpretation(dataset: Any) -> tuple[ColorInterp, ...]:
    """Returns the purpose of the bands; undefined where PROJ's complaint about an odd coordinate system comes up
    here."""
    try:
        return tuple(dataset.colorinterp)
    except CPLE_BaseError:
        return (ColorInterp.undefined,) * int(dataset.count)


def _check_layout(dataset: Any, path: Path) -> None:
    """Refuses blocks that do not fit in memory, and files that point at others."""
    outside = [name for name in dataset.files if os.path.abspath(name) != os.path.abspath(path)]
    if outside:
        raise ImportRefused("It points at other files that did not come with it. Save it as one file (GeoTIFF).")
    if dataset.count > MAX_BANDS:
        raise ImportRefused(f"It has {dataset.count} bands: an elevation grid has one.")
    height, width = dataset.block_shapes[0]
    size = height * width * np.dtype(dataset.dtypes[0].replace("complex_int16", "complex64")).itemsize
    if size > MAX_BLOCK_BYTES:
        raise ImportRefused(
            f"Its blocks are {size >> 20} MiB large. Save it in tiles first (gdal_translate -co TILED=YES)."
        )


def _place(source: GdalSource) -> None:
    dataset = source.dataset
    transform = dataset.transform
    if transform.is_identity and dataset.crs is None:
        if dataset.gcps[0]:
            source.notes.append("It is placed by control points only; they are not used.")
        return
    crs: pyproj.CRS | None = None
    if dataset.crs is not None:
        with suppress(pyproj.exceptions.CRSError):
            crs = pyproj.CRS.from_wkt(dataset.crs.to_wkt())
        if crs is None:
            source.notes.append("Its coordinate system cannot be used; it is laid by hand.")
    affine = from_corner(transform.a, transform.b, transform.c, transform.d, transform.e, transform.f)
    source.georef = Georef(crs, check_affine(affine))


def _vertical(source: GdalSource) -> None:
    """Scale, offset and unit of the samples. Raises ImportRefused for a unit that is no length."""
    dataset, index = source.dataset, source.band - 1
    scale, offset, unit = dataset.scales[index], dataset.offsets[index], (dataset.units[index] or "").strip()
    if not (np.isfinite(scale) and np.isfinite(offset)) or scale == 0.0:
        raise ImportRefused(f"Its scale {scale:g} and offset {offset:g} make no heights.")
    known = unit.lower() in UNITS
    metres = UNITS.get(unit.lower())
    crs = source.georef.crs if source.georef is not None else None
    if metres is None and crs is not None:
        metres = vertical_unit_m(crs)
    if not known:
        source.notes.append(f"Its unit {unit[:20]!r} is not known; its samples are taken for metres.")
    source.unit_m = metres
    source.gain, source.bias = scale * (metres or 1.0), offset * (metres or 1.0)
    if (scale, offset) != (1.0, 0.0):
        source.notes.append(f"Scale {scale:g} and offset {offset:g} of the file are applied.")
        source.measured = True
    if metres not in (None, 1.0):
        source.notes.append(f"Its heights are in {unit or 'units'} of {metres:.6g} m and become metres.")
        source.measured = True
