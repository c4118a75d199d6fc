"""Rasters: the stored form of an elevation grid, immutable and named by its content.

A raster is a grid of heights with its mipmap and the own errors of its patches: all that the patchwork needs and that
does not depend on where the grid lies. It is kept as a directory of plain .npy files, so that a grid of any size is
mapped into memory, not read.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esker import contract
from esker.patchwork.jit import read_only
from esker.patchwork.raster import errors, mipmaps, patches
from esker.patchwork.raster.outline import bent_edge
from esker.patchwork.raster.paging import let_go
from esker.patchwork.raster.patches import PatchErrors

Heights = NDArray[np.float32]
Progress = Callable[[str, float], None]

FORMAT: Final = 3
"""2: patches beyond the grid were flat, their errors others; 1: there was no rim, either."""
HEAD: Final = "raster.json"
HEIGHTS: Final = "heights.npy"
WARP: Final = "warp.npy"
RIM: Final = "rim.npy"
RIM_ERRORS: Final = "rim_errors.npy"
BLOCK_ROWS: Final = 256


class RasterError(ValueError):
    """A directory does not hold a raster, or heights cannot become one; the message says why."""


@dataclass(frozen=True, eq=False)
class Raster:
    """A grid of heights (rows, cols) float32, NaN = nodata, row 0 in the south, with what follows from it.

    ``mips[0]`` is ``heights``. ``warp``: control net (m, n, 2) float64 of displacements in lattice units, or None.
    ``digest``: sha256 of shape, heights and warp, ``contract.Layer.content``. Arrays are read-only, maybe mapped files.
    """

    heights: Heights
    mips: tuple[Heights, ...]
    warp: NDArray[np.float64] | None
    errors: PatchErrors
    digest: str
    low: float
    high: float
    valid: float

    def facts(self, **more: Any) -> contract.GridFacts:
        """Returns the facts of the grid that the document keeps; ``more``: fields that only the file knows (geo, crs,
        format, file)."""
        return contract.GridFacts(
            rows=self.heights.shape[0],
            cols=self.heights.shape[1],
            low_m=self.low,
            high_m=self.high,
            valid=self.valid,
            edge=bent_edge(self.heights.shape[0], self.heights.shape[1], self.warp),
            **more,
        )


def build(heights: NDArray[Any], warp: NDArray[np.float64] | None = None, progress: Progress | None = None) -> Raster:
    """Make a raster in memory from heights (rows, cols), any real dtype; NaN and infinity are nodata.

    ``progress(stage, share)`` with the stages "mipmaps" and "errors". Raises RasterError if the grid is smaller than
    ``contract.MIN_GRID_SIDE`` a side, larger than ``MAX_GRID_SAMPLES``, holds no valid sample, or the net is no net.
    """
    check_shape(heights.shape)
    return _finish(read_only(_clean(heights)), _net(warp), None, progress)


def build_out_of_core(
    heights: NDArray[np.float32],
    directory: Path,
    warp: NDArray[np.float64] | None = None,
    progress: Progress | None = None,
) -> Raster:
    """Make a raster in ``directory``, mapped: memory stays at some megabytes, pages of mapped files counted.

    ``heights``: float32, usually a memmap. If it maps ``directory``/heights.npy already, it is taken as it is (and
    infinities in it become NaN there), else it is copied block by block. Raises RasterError as :func:`build`.
    """
    check_shape(heights.shape)
    directory.mkdir(parents=True, exist_ok=True)
    _own_heights(heights, directory / HEIGHTS)
    mapped: Heights = np.load(directory / HEIGHTS, mmap_mode="r")
    raster = _finish(read_only(mapped), _net(warp), directory, progress)
    _write_rest(directory, raster)
    return raster


def write(raster_dir: Path, raster: Raster) -> None:
    """Write a raster to a directory, made if need be. The caller syncs and renames it."""
    raster_dir.mkdir(parents=True, exist_ok=True)
    for level, mip in enumerate(raster.mips):
        np.save(raster_dir / _mip_name(level), mip)
    _write_rest(raster_dir, raster)


def read(raster_dir: Path) -> Raster:
    """Open a raster: its arrays are mapped, read-only. Raises RasterError if anything in it is not as it must be."""
    try:
        head = json.loads((raster_dir / HEAD).read_text(encoding="utf-8"))
        if head["format"] not in (1, 2, FORMAT):
            raise RasterError(f"{raster_dir.name}: format {head['format']} of rasters is not known here")
        rows, cols = (int(side) for side in head["shape"])
        shapes = mipmaps.shapes(rows, cols)
        mips = tuple(_open(raster_dir / _mip_name(level), shape) for level, shape in enumerate(shapes))
        warp = np.load(raster_dir / WARP, allow_pickle=False) if head["warped"] else None
        net = _net(warp)
        if head["format"] == FORMAT:
            measured = _read_errors(raster_dir, len(mips), (rows, cols))
        else:
            measured = errors.measure(mips, net)
        return Raster(
            mips[0],
            mips,
            net,
            measured,
            str(head["digest"]),
            float(head["low"]),
            float(head["high"]),
            float(head["valid"]),
        )
    except (OSError, KeyError, TypeError, EOFError) as error:
        raise RasterError(f"{raster_dir.name}: not a whole raster ({error})") from error
    except ValueError as error:
        raise error if isinstance(error, RasterError) else RasterError(f"{raster_dir.name}: {error}") from error


def _read_errors(raster_dir: Path, levels: int, shape: tuple[int, int]) -> PatchErrors:
    """The errors that lie beside a grid of a shape."""
    tables = [
        np.load(raster_dir / _error_name(scale), allow_pickle=False) for scale in range(levels + patches.SMALL_SCALES)
    ]
    for scale, table in enumerate(tables):
        whole = patches.table_shape(*shape, scale)
        if table.dtype != np.float32 or table.shape not in (whole, (0, 0)):
            raise RasterError(f"{raster_dir.name}: its patch errors do not fit it")
    found, measured = np.load(raster_dir / RIM, allow_pickle=False), np.load(raster_dir / RIM_ERRORS)
    _check_rim(raster_dir, found, measured, shape)
    return PatchErrors(tuple(read_only(table) for table in tables), read_only(found), read_only(measured))


def _check_rim(raster_dir: Path, found: NDArray[Any], measured: NDArray[Any], shape: tuple[int, ...]) -> None:
    """Raise RasterError unless kernels (n, 4) of a rim lie in a grid of a shape and each has an error."""
    kinds = found.dtype == np.int32 and measured.dtype == np.float32
    if not kinds or found.shape != (len(measured), 4) or measured.ndim != 1:
        raise RasterError(f"{raster_dir.name}: the rim of its patches does not fit it")
    if (found < (0, 0, 1, 1)).any() or (found[:, :2] + found[:, 2:] > shape).any():
        raise RasterError(f"{raster_dir.name}: the rim of its patches does not lie in it")
    if (found[:, :2] // patches.SMALLEST_KERNEL != (found[:, :2] + found[:, 2:] - 1) // patches.SMALLEST_KERNEL).any():
        raise RasterError(f"{raster_dir.name}: the rim of its patches does not lie in its tiling")


def verify(raster: Raster) -> bool:
    """Returns whether the heights and the net still are what the digest says (reads all of them)."""
    return digest(raster.heights, raster.warp) == raster.digest


def digest(heights: Heights, warp: NDArray[np.float64] | None) -> str:
    """sha256, in hex, of shape, heights (little-endian float32, every NaN the same) and control net."""
    found = hashlib.sha256(f"esker raster {heights.shape[0]} {heights.shape[1]}\n".encode())
    for block in _blocks(heights):
        flat = np.ascontiguousarray(block, "<f4")
        holes = np.isnan(flat)
        if holes.any():
            flat = np.where(holes, np.float32(np.nan), flat)
        found.update(flat.data)
    if warp is not None:
        found.update(f"warp {warp.shape[0]} {warp.shape[1]}\n".encode())
        found.update(np.ascontiguousarray(warp, "<f8").data)
    return found.hexdigest()


def numbers(grid: ArrayLike) -> NDArray[Any]:
    """The heights (rows, cols) of a grid that somebody gives, any real dtype; NaN where it is masked, or has NaN.

    Raises RasterError for what is no grid of numbers, and for heights beyond the bound of all documents: as float32
    they would be infinite, and holes.
    """
    try:
        array = grid if isinstance(grid, np.ma.MaskedArray) else np.asarray(grid)
    except ValueError:  # rows of unequal lengths
        raise RasterError("a grid is a two-dimensional array of numbers; these rows are not equally long") from None
    if array.ndim != 2 or array.dtype.kind not in "iuf":
        raise RasterError(f"a grid is a two-dimensional array of numbers, not {array.dtype} of shape {array.shape}")
    if isinstance(array, np.ma.MaskedArray):
        array = np.ma.filled(array.astype(np.promote_types(array.dtype, np.float32)), np.nan)
    check_shape(array.shape)
    for row in range(0, array.shape[0], BLOCK_ROWS):
        block = array[row : row + BLOCK_ROWS]
        far = np.abs(block, where=np.isfinite(block), out=np.zeros(block.shape), dtype=np.float64).max(initial=0.0)
        if far > contract.ABSOLUTE_BOUND_M:
            raise RasterError(f"a height of this grid is {far:.6g} m from zero: these are no elevations in metres")
    return array


def check_shape(shape: tuple[int, ...]) -> None:
    """Raise RasterError unless a grid of this shape may become a raster."""
    if len(shape) != 2:
        raise RasterError(f"heights must be a grid of rows and columns, not an array of {len(shape)} dimensions")
    if min(shape) < contract.MIN_GRID_SIDE:
        raise RasterError(
            f"a grid needs at least {contract.MIN_GRID_SIDE} samples a side; this has {shape[0]} x {shape[1]}"
        )
    if shape[0] * shape[1] > MAX_SAMPLES:
        raise RasterError(f"{shape[0]} x {shape[1]} samples are more than the {MAX_SAMPLES:,} that are allowed")


MAX_SAMPLES: Final = 2 * contract.MAX_GRID_SAMPLES
"""Samples of a raster. Files may declare half of it (``contract.MAX_GRID_SAMPLES``); one's own arrays may be larger."""


def _finish(
    heights: Heights, warp: NDArray[np.float64] | None, directory: Path | None, progress: Progress | None
) -> Raster:
    say = progress or (lambda _stage, _share: None)
    low, high, valid = _bounds(heights)
    shapes = mipmaps.shapes(*heights.shape)

    def made(level: int, shape: tuple[int, int]) -> Heights:
        say("mipmaps", (level - 1) / max(1, len(shapes) - 1))
        if directory is None:
            return np.empty(shape, np.float32)
        return np.lib.format.open_memmap(directory / _mip_name(level), "w+", np.float32, shape)

    mips = tuple(read_only(mip) for mip in mipmaps.mipmaps(heights, made))
    say("mipmaps", 1.0)
    measured = errors.measure(mips, warp, lambda share: say("errors", share))
    return Raster(heights, mips, warp, measured, digest(heights, warp), low, high, valid)


def _bounds(heights: Heights) -> tuple[float, float, float]:
    """Lowest and highest valid sample, and the share of valid ones."""
    low, high, count = np.inf, -np.inf, 0
    for block in _blocks(heights):
        found = int(np.count_nonzero(~np.isnan(block)))
        if found:
            low, high = min(low, float(np.nanmin(block))), max(high, float(np.nanmax(block)))
            count += found
    if not count:
        raise RasterError("the grid holds no data: every sample is nodata")
    return low, high, count / heights.size


def _blocks(heights: Heights) -> Iterator[Heights]:
    """Blocks of rows; one is let go of when the next is asked for."""
    for row in range(0, heights.shape[0], BLOCK_ROWS):
        yield np.asarray(heights[row : row + BLOCK_ROWS])
        let_go(heights, row, row + BLOCK_ROWS)


def _clean(heights: NDArray[Any]) -> Heights:
    """A float32 copy with one kind of nodata."""
    if heights.dtype.kind not in "iuf":
        raise RasterError(f"heights must be numbers, not {heights.dtype}")
    with np.errstate(over="ignore"):
        copy = np.array(heights, np.float32, order="C")
    copy[~np.isfinite(copy)] = np.nan
    return copy


def _own_heights(heights: Heights, path: Path) -> None:
    """Make ``path`` hold ``heights``, with one kind of nodata."""
    same = (
        isinstance(heights, np.memmap)
        and heights.filename is not None
        and path.exists()
        and os.path.samefile(str(heights.filename), path)
    )
    if same:
        target: Heights = np.load(path, mmap_mode="r+")
    else:
        target = np.lib.format.open_memmap(path, "w+", np.float32, heights.shape)
    for row in range(0, heights.shape[0], BLOCK_ROWS):
        rows = slice(row, row + BLOCK_ROWS)
        block = np.array(heights[rows], np.float32)
        bad = np.isinf(block)
        if not same or bad.any():
            block[bad] = np.nan
            target[rows] = block
            let_go(target, row, row + BLOCK_ROWS)
        let_go(heights, row, row + BLOCK_ROWS)
    target.flush()  # type: ignore[attr-defined]


def _net(warp: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    if warp is None:
        return None
    net = np.array(warp, np.float64, order="C")
    if net.ndim != 3 or net.shape[2] != 2 or min(net.shape[:2]) < 2 or not np.isfinite(net).all():
        raise RasterError("a control net must have the shape (m, n, 2) with m, n >= 2 and hold numbers")
    net.flags.writeable = False
    return net


def _mip_name(level: int) -> str:
    return HEIGHTS if level == 0 else f"mip{level}.npy"


def _error_name(scale: int) -> str:
    return f"errors{scale}.npy"


def _open(path: Path, shape: tuple[int, int]) -> Heights:
    mapped = np.load(path, mmap_mode="r", allow_pickle=False)
    if mapped.shape != tuple(shape) or mapped.dtype != np.float32 or not mapped.flags.c_contiguous:
        raise RasterError(
            f"{path.parent.name}: {path.name} is {mapped.dtype} {mapped.shape}, not float32 {tuple(shape)}"
        )
    found: Heights = read_only(mapped)
    return found


def _write_rest(directory: Path, raster: Raster) -> None:
    """Write everything but the levels; the head comes last, so that a directory with a head is whole."""
    if raster.warp is not None:
        np.save(directory / WARP, raster.warp)
    for scale, table in enumerate(raster.errors.tables):
        np.save(directory / _error_name(scale), table)
    np.save(directory / RIM, raster.errors.rim)
    np.save(directory / RIM_ERRORS, raster.errors.rim_errors)
    head = {
        "format": FORMAT,
        "shape": list(raster.heights.shape),
        "warped": raster.warp is not None,
        "digest": raster.digest,
        "low": raster.low,
        "high": raster.high,
        "valid": raster.valid,
    }
    with contextlib.suppress(FileNotFoundError):
        (directory / HEAD).unlink()
    (directory / HEAD).write_text(json.dumps(head), encoding="utf-8")
