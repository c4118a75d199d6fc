"""Grids that lie in a file as plain arrays: HGT, RAW / R16 / R32, NPY and NPZ. Nothing is unpickled."""

from __future__ import annotations

import math
import re
import zipfile
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyproj
from numpy.lib import format as npy
from numpy.typing import NDArray

from esker.importing.formats.zipped import extract
from esker.importing.placement.georef import Affine6, Georef, check_affine
from esker.importing.refusal import ImportRefused
from esker.importing.source import ArraySource, check_shape, integer_step

HGT_VOID: Final = -32768
RAW_TYPES: Final[dict[str, str]] = {
    "uint16 little-endian": "<u2",
    "uint16 big-endian": ">u2",
    "int16 little-endian": "<i2",
    "float32 little-endian": "<f4",
    "float32 big-endian": ">f4",
    "uint8": "u1",
}
RAW_DEFAULT: Final = {".r16": "uint16 little-endian", ".raw": "uint16 little-endian", ".r8": "uint8",
                      ".r32": "float32 little-endian", ".f32": "float32 little-endian"}  # fmt: skip
MAX_ASPECT: Final = 8
SHAPES_OFFERED: Final = 6
AXIS_NAMES: Final = (
    (("longitude", "latitude"), True), (("lon", "lat"), True), (("lons", "lats"), True),
    (("x", "y"), False), (("xs", "ys"), False), (("X", "Y"), False), (("easting", "northing"), False),
)  # fmt: skip
MAX_NPZ_MEMBERS: Final = 64
MAX_ARRAY_BYTES: Final = 8 * 200_000_000


# --- HGT --------------------------------------------------------------------------------------------------------


def open_hgt(path: Path, name: str) -> ArraySource:
    """An SRTM tile: big-endian int16, north row first, its south-west corner in its name. Raises ImportRefused."""
    samples, odd = divmod(path.stat().st_size, 2)
    side = math.isqrt(samples)
    if not odd and side * side == samples and side > 1:
        rows, cols = side, side
    elif not odd and samples == 3601 * 1801:
        rows, cols = 3601, 1801
    else:
        raise ImportRefused(f"An HGT tile is a square of 16-bit samples; {path.stat().st_size:,} bytes make none.")
    check_shape(rows, cols)
    match = re.search(r"([NSns])(\d{1,2})([EWew])(\d{1,3})", name)
    georef = None
    if match is not None:
        south = int(match.group(2)) * (-1 if match.group(1) in "Ss" else 1)
        west = int(match.group(4)) * (-1 if match.group(3) in "Ww" else 1)
        affine = (1.0 / (cols - 1), 0.0, float(west), 0.0, -1.0 / (rows - 1), south + 1.0)
        georef = Georef(pyproj.CRS.from_epsg(4326), affine)
    source = ArraySource(
        "HGT", rows, cols, "int16", georef, step=1.0, nodata=HGT_VOID, array=_map(path, ">i2", rows, cols)
    )
    if georef is None:
        source.notes.append("Its name does not say where it lies (as N46W122.hgt does).")
    return source


def _map(path: Path, dtype: Any, rows: int, cols: int, offset: int = 0, order: str = "C") -> NDArray[Any]:
    return np.memmap(path, dtype=dtype, mode="r", offset=offset, shape=(rows, cols), order=order)  # type: ignore[call-overload, no-any-return]


# --- RAW --------------------------------------------------------------------------------------------------------


def raw_shapes(path: Path, dtype: np.dtype[Any]) -> list[tuple[int, int]]:
    """Shapes (rows, cols) that the file could have, the most likely first: where rows are alike their neighbours."""
    count, rest = divmod(path.stat().st_size, dtype.itemsize)
    if rest or count == 0:
        return []
    root = math.isqrt(count)
    pairs = [
        (rows, cols)
        for small in range(max(1, math.isqrt(count // MAX_ASPECT)), root + 1)
        if count % small == 0
        for rows, cols in {(small, count // small), (count // small, small)}
        if max(rows, cols) <= MAX_ASPECT * min(rows, cols) and min(rows, cols) > 1
    ]
    with np.errstate(all="ignore"):  # bytes of another type make any kind of number
        head = np.memmap(path, dtype=dtype, mode="r", shape=(min(count, 1 << 20),)).astype(np.float64)
        head[~np.isfinite(head) | (np.abs(head) > 1e30)] = 0.0

    def unlike(shape: tuple[int, int]) -> tuple[float, int]:
        cols = shape[1]
        step = np.abs(head[cols:] - head[:-cols]).mean() if head.size > cols else math.inf
        return float(step), abs(shape[0] - shape[1])

    return sorted(pairs, key=unlike)


def open_raw(
    path: Path, suffix: str, type_name: str | None, shape: str | None
) -> tuple[ArraySource, list[str], list[str]]:
    """A headless file, with the names of the types and the shapes ("cols x rows") that it could have, best first.

    Raises ImportRefused when no shape fits its bytes.
    """
    default = RAW_DEFAULT[suffix]
    fitting = [name for name in RAW_TYPES if raw_shapes(path, np.dtype(RAW_TYPES[name]))]
    types = sorted(fitting, key=lambda name: (name != default, list(RAW_TYPES).index(name)))
    if not types:
        raise ImportRefused(f"Its {path.stat().st_size:,} bytes make no grid of samples without a header.")
    chosen = type_name or types[0]
    if chosen not in RAW_TYPES:
        raise ImportRefused(f"{chosen!r} is no type of samples; there are: {', '.join(RAW_TYPES)}.")
    dtype = np.dtype(RAW_TYPES[chosen])
    shapes = raw_shapes(path, dtype)
    rows, cols = parse_shape(shape) if shape else shapes[0] if shapes else (0, 0)
    if rows * cols * dtype.itemsize != path.stat().st_size:
        raise ImportRefused(
            f"{cols} x {rows} samples of {chosen} are not the {path.stat().st_size:,} bytes of the file."
        )
    check_shape(rows, cols)
    source = ArraySource(
        "RAW", rows, cols, chosen, None, measured=False, step=integer_step(dtype), array=_map(path, dtype, rows, cols),
        eight_bit=dtype.itemsize == 1,
    )  # fmt: skip
    return source, types, [f"{c} x {r}" for r, c in shapes[:SHAPES_OFFERED]]


def parse_shape(text: str) -> tuple[int, int]:
    """(rows, cols) from "cols x rows". Raises ImportRefused."""
    match = re.fullmatch(r"\s*(\d{1,9})\s*[x×*,]\s*(\d{1,9})\s*", text)
    if match is None:
        raise ImportRefused(f"{text[:40]!r} is no shape; write columns x rows, for instance 1024 x 512.")
    return int(match.group(2)), int(match.group(1))


# --- NPY, NPZ ---------------------------------------------------------------------------------------------------


def _npy_header(path: Path) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Shape, Fortran order, type and offset of the data. Raises ImportRefused."""
    try:
        with path.open("rb") as file:
            version = npy.read_magic(file)
            read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
            shape, fortran, dtype = read(file)
            offset = file.tell()
    except (ValueError, EOFError, SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise ImportRefused("It starts like a NumPy file but its header is broken.") from error
    if dtype.hasobject:
        raise ImportRefused("It holds pickled Python objects, which are not read. Save plain numbers.")
    return shape, fortran, dtype, offset


def _load(path: Path) -> NDArray[Any]:
    """A memory map of an NPY file of one or two dimensions. Raises ImportRefused."""
    shape, fortran, dtype, offset = _npy_header(path)
    size = math.prod(shape) * dtype.itemsize
    if offset + size > path.stat().st_size:
        raise ImportRefused("It ends early: its header declares more samples than it holds.")
    if size == 0:
        return np.zeros(shape, dtype)
    return np.memmap(path, dtype=dtype, mode="r", offset=offset, shape=shape, order="F" if fortran else "C")


def open_npy(path: Path, rows_answer: str | None) -> ArraySource:
    """A two-dimensional array of numbers. Raises ImportRefused."""
    shape, _, dtype, _ = _npy_header(path)
    if len(shape) != 2:
        raise ImportRefused(f"It holds an array of {len(shape)} dimensions: a grid has two.")
    check_shape(*shape)
    return _array_source("NPY", _load(path), dtype, rows_answer)


def _array_source(name: str, array: NDArray[Any], dtype: np.dtype[Any], rows_answer: str | None) -> ArraySource:
    rows, cols = array.shape
    source = ArraySource(name, rows, cols, str(dtype.newbyteorder("=")), step=integer_step(dtype), array=array)
    source.row_order_known = False
    if rows_answer == "south first":
        source.array = array[::-1]
    return source


def open_npz(path: Path, workdir: Path, rows_answer: str | None) -> ArraySource:
    """The two-dimensional array of an NPZ file, placed by the other arrays beside it if they say where.

    Axes: ``lon``/``lat``, ``longitude``/``latitude``, ``x``/``y``, one value a column and a row; or ``xmin``, ``xmax``,
    ``ymin``, ``ymax`` (with or without ``dx``, ``dy``), as matplotlib's sample data have. Raises ImportRefused.
    """
    arrays = {}
    with zipfile.ZipFile(path) as archive:
        members = [info for info in archive.infolist() if info.filename.endswith(".npy")]
        if len(members) > MAX_NPZ_MEMBERS:
            raise ImportRefused(f"It holds {len(members)} arrays: at most {MAX_NPZ_MEMBERS} are looked at.")
        for number, info in enumerate(members):
            member = extract(archive, info, workdir / f"array{number}.npy", MAX_ARRAY_BYTES)
            shape, _, _, _ = _npy_header(member)
            if len(shape) == 2:
                check_shape(*shape)
            arrays[info.filename.removesuffix(".npy")] = _load(member)
    grids = [name for name, array in arrays.items() if array.ndim == 2 and array.dtype.kind in "iuf"]
    if len(grids) != 1:
        have = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())[:120]
        raise ImportRefused(f"It must hold exactly one two-dimensional array of numbers; it holds {have or 'nothing'}.")
    grid = arrays.pop(grids[0])
    source = _array_source("NPZ", grid, grid.dtype, rows_answer)
    _place(source, {name: array for name, array in arrays.items() if array.dtype.kind in "iuf"})
    return source


def _place(source: ArraySource, arrays: dict[str, NDArray[Any]]) -> None:
    for (along, up), degrees in AXIS_NAMES:
        if (
            along in arrays
            and up in arrays
            and arrays[along].shape == (source.cols,)
            and arrays[up].shape == (source.rows,)
        ):
            xs, ys = (np.asarray(arrays[name], np.float64) for name in (along, up))
            _check_axis(xs, along)
            _check_axis(ys, up)
            source.georef = Georef(pyproj.CRS.from_epsg(4326) if degrees else None, None, xs, ys)
            source.array, source.row_order_known = _undo_order(source), True
            return
    names = ("xmin", "xmax", "ymin", "ymax")
    if all(name in arrays and arrays[name].size == 1 for name in names):
        west, east, low, high = (float(arrays[name].reshape(-1)[0]) for name in names)
        steps = [
            float(arrays[name].reshape(-1)[0]) if name in arrays and arrays[name].size == 1 else None
            for name in ("dx", "dy")
        ]
        if low > high:
            source.notes.append("Its ymin is greater than its ymax: the first row is taken for the northern one.")
            source.array, source.row_order_known = _undo_order(source), True
            low, high = high, low
        source.georef = Georef(None, _extent(source, (west, east, low, high), steps))


def _undo_order(source: ArraySource) -> NDArray[Any]:
    """The array in the file's own order, whatever was answered about it."""
    array = source.array
    return array[::-1] if array.strides[0] < 0 else array


def _check_axis(axis: NDArray[np.float64], name: str) -> None:
    steps = np.diff(axis)
    if not np.all(np.isfinite(axis)) or not (np.all(steps > 0) or np.all(steps < 0)):
        raise ImportRefused(f"Its axis {name!r} neither rises nor falls all along.")


def _extent(source: ArraySource, extent: tuple[float, float, float, float], steps: list[float | None]) -> Affine6:
    """Affine with the first row in the north. A span of n steps is of cells with outer borders, of n - 1 of samples."""
    west, east, south, north = extent
    spans = ((east - west, source.cols, steps[0]), (north - south, source.rows, steps[1]))
    cells = all(step is None or abs(span / step - n) < 0.5 for span, n, step in spans if step != 0.0)
    (span_x, cols, _), (span_y, rows, _) = spans
    if cells and steps != [None, None]:
        a, e = span_x / cols, -span_y / rows
        return check_affine((a, 0.0, west + 0.5 * a, 0.0, e, north + 0.5 * e))
    a, e = span_x / (cols - 1), -span_y / (rows - 1)
    return check_affine((a, 0.0, west, 0.0, e, north))
