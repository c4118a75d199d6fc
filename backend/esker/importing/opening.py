"""Opens a file in the format that its first bytes show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

import pyproj

from esker.importing.formats import arrays, ascii_grid, colours, zipped
from esker.importing.formats.gdal_source import GdalSource, open_raster
from esker.importing.formats.own_png import recognise
from esker.importing.formats.zipped import Unpacked
from esker.importing.placement.georef import Georef, parse_crs, world_affine
from esker.importing.refusal import ImportRefused
from esker.importing.source import Source

TIFF: Final = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
PNG: Final = b"\x89PNG\r\n\x1a\n"
HFA: Final = b"EHFA_HEADER_TAG"
KNOWN_BUT_NOT_TAKEN: Final = (
    (b"\xff\xd8\xff", "It is a JPEG picture: elevations do not survive that."),
    (b"GIF8", "It is a GIF picture, no elevation grid."),
    (b"%PDF", "It is a PDF document, no elevation grid."),
    (b"CDF", "NetCDF is not taken; save it as GeoTIFF (gdal_translate)."),
    (b"\x89HDF", "HDF5 / NetCDF is not taken; save it as GeoTIFF (gdal_translate)."),
    (b"<VRTDataset", "A VRT file only points at others; save it as GeoTIFF (gdal_translate)."),
    (b"\x1f\x8b", "It is compressed with gzip: unpack it first."),
)
FORMATS: Final = (
    "GeoTIFF or COG, HGT (also zipped), Esri ASCII, ERDAS IMAGINE, DTED, 16-bit PNG, RAW / R16, NPY / NPZ, "
    "Terrarium or Mapbox RGB PNG"
)


@dataclass(eq=False)
class Opened:
    """A source, and what its container leaves open: types and shapes that a headless file could have."""

    source: Source
    name: str
    types: tuple[str, ...] = ()
    shapes: tuple[str, ...] = ()


def open_source(path: Path, name: str, workdir: Path, answers: Mapping[str, str]) -> Opened:
    """Opens an elevation file. ``name``: as its owner called it; ``workdir``: where archives are unpacked.

    ``answers``: by question id: "type", "shape", "rows", "band", "encoding" change how it is read.
    Raises ImportRefused.
    """
    size = path.stat().st_size
    if size == 0:
        raise ImportRefused("It is empty.")
    with path.open("rb") as file:
        head = file.read(4096)
    beside: Unpacked | None = None
    if head.startswith(b"PK"):
        with zipped.open_zip(path) as archive:
            if not zipped.is_npz(archive):
                beside = zipped.unpack(archive, workdir)
                path, name = beside.path, beside.name
                with path.open("rb") as file:
                    head = file.read(4096)
                if head.startswith(b"PK"):
                    raise ImportRefused("A zip file inside a zip file is not opened.")
    opened = _open(path, name, head, workdir, answers)
    if beside is not None:
        _take_beside(opened.source, beside)
    return opened


def _take_beside(source: Source, beside: Unpacked) -> None:
    """What the files beside a zipped grid say of its place, where the grid itself says nothing of it."""
    if beside.world is not None:
        name, text = beside.world
        affine = world_affine(text)
        if source.georef is not None or source.own is not None:
            source.notes.append(f"{name[:40]} is not used: the file itself says where it lies.")
        elif affine is None:
            source.notes.append(f"{name[:40]} is not used: it does not hold the six numbers of a world file.")
        else:
            source.georef, source.row_order_known = Georef(None, affine), True
    if beside.prj is not None and source.georef is not None and source.georef.crs is None:
        source.georef = source.georef.with_crs(_prj(beside.prj))


def _prj(text: str) -> pyproj.CRS | None:
    try:
        return parse_crs(text)
    except ImportRefused:
        return None


def _open(path: Path, name: str, head: bytes, workdir: Path, answers: Mapping[str, str]) -> Opened:
    suffix = PurePosixPath(name).suffix.lower()
    rows = answers.get("rows")
    if head.startswith(TIFF):
        return Opened(_raster(path, "GTiff", answers), name)
    if head.startswith(PNG):
        picture = _raster(path, "PNG", answers)
        recognise(picture, path)
        return Opened(picture, name)
    if head.startswith(HFA):
        return Opened(_raster(path, "HFA", answers), name)
    if head.startswith((b"UHL1", b"HDR1", b"VOL1")):
        return Opened(_raster(path, "DTED", answers), name)
    if head.startswith(b"\x93NUMPY"):
        return Opened(arrays.open_npy(path, rows), name)
    if head.startswith(b"PK"):
        return Opened(arrays.open_npz(path, workdir, rows), name)
    for magic, sentence in KNOWN_BUT_NOT_TAKEN:
        if head.lstrip().startswith(magic):
            raise ImportRefused(sentence)
    if suffix == ".hgt":
        return Opened(arrays.open_hgt(path, name), name)
    if suffix in arrays.RAW_DEFAULT:
        source, types, shapes = arrays.open_raw(path, suffix, answers.get("type"), answers.get("shape"))
        return Opened(source, name, tuple(types), tuple(shapes))
    if _ascii(head):
        return Opened(ascii_grid.open_ascii(path), name)
    raise ImportRefused(f"It is in no format that can be read. There are: {FORMATS}.")


def _ascii(head: bytes) -> bool:
    text = head.removeprefix(ascii_grid.BOM).lstrip()[:16].lower()
    return text.startswith(tuple(key.encode() for key in ascii_grid.KEYS))


def _raster(path: Path, driver: str, answers: Mapping[str, str]) -> GdalSource:
    band = answers.get("band", "1")
    if not band.isdecimal() or len(band) > 4:
        raise ImportRefused(f"{band[:20]!r} is no number of a band.")
    source = open_raster(path, driver, int(band))
    encoding = answers.get("encoding")
    if encoding in colours.ENCODINGS:
        set_encoding(source, encoding)
    return source


def set_encoding(source: GdalSource, encoding: colours.Encoding) -> None:
    """Reads the colours of a source as heights in metres from now on. Raises ImportRefused when it has none."""
    if not source.colour:
        raise ImportRefused("It has no colours that could hold heights.")
    source.encoding, source.measured = encoding, True
    source.gain, source.bias, source.step = 1.0, 0.0, colours.STEP_M[encoding]
    source.eight_bit = False
