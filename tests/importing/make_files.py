"""Elevation files of every format, and with every defect, from a formula: nothing is downloaded.

``python -m tests.importing.make_files FOLDER`` writes them all, to look at.
"""

from __future__ import annotations

import sys
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine

Grid = NDArray[Any]
Writer = Callable[[Path], None]

ROWS: Final = 60
COLS: Final = 48
STEP: Final = 1 / 1200
WEST: Final = -155.6
NORTH: Final = 19.9
UTM: Final = "EPSG:32605"
EAST_M: Final = 230_000.0
NORTH_M: Final = 2_190_000.0


def ground(rows: int = ROWS, cols: int = COLS) -> Grid:
    """Whole metres (rows, cols) int16, first row in the north: hills of 155 to about 3200 m without any symmetry."""
    r, q = np.mgrid[0:rows, 0:cols].astype(float)
    hills = 900 * np.sin(r / 9.0 + 0.4) * np.cos(q / 7.0) + 500 * np.sin(0.05 * (r - 2 * q)) + 11 * r + 6 * q
    return np.asarray(np.round(hills - hills.min() + 155), np.int16)


def geographic(step_y: float = -STEP, top: float = NORTH) -> Affine:
    """Geotransform in degrees of the outer corner."""
    return Affine(STEP, 0.0, WEST, 0.0, step_y, top)


def write(path: Path, data: Grid, driver: str = "GTiff", **profile: Any) -> None:
    """A raster through GDAL; ``data`` (rows, cols) or (bands, rows, cols)."""
    bands = data if data.ndim == 3 else data[None]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(
            path, "w", driver=driver, height=bands.shape[1], width=bands.shape[2], count=bands.shape[0],
            dtype=bands.dtype, **profile,
        ) as dataset:  # fmt: skip
            dataset.write(bands)


def _plain(**profile: Any) -> Writer:
    return lambda path: write(path, ground(), **({"crs": "EPSG:4326", "transform": geographic()} | profile))


# --- good files, all of the same ground --------------------------------------------------------------------------


def cog(path: Path) -> None:
    big = np.kron(ground(), np.ones((10, 10), np.int16))
    profile = {"crs": "EPSG:4326", "transform": geographic() @ Affine.scale(0.1)}
    write(path, big, "COG", blocksize=128, compress="DEFLATE", overview_resampling="nearest", **profile)


def south_up(path: Path) -> None:
    write(path, ground()[::-1], crs="EPSG:4326", transform=geographic(STEP, NORTH - ROWS * STEP))


def mirrored(path: Path) -> None:
    transform = Affine(-STEP, 0.0, WEST + COLS * STEP, 0.0, -STEP, NORTH)
    write(path, ground()[:, ::-1], crs="EPSG:4326", transform=transform)


def upside_down(path: Path) -> None:
    transform = Affine(-STEP, 0.0, WEST + COLS * STEP, 0.0, STEP, NORTH - ROWS * STEP)
    write(path, ground()[::-1, ::-1], crs="EPSG:4326", transform=transform)


def ascii_degrees(path: Path) -> None:
    south = NORTH - ROWS * STEP
    head = (
        f"ncols {COLS}\nnrows {ROWS}\nxllcorner {WEST!r}\nyllcorner {south!r}\ncellsize {STEP!r}\nNODATA_value -9999\n"
    )
    path.write_text(head + "\n".join(" ".join(map(str, row)) for row in ground().tolist()) + "\n")


def npz_axes(path: Path) -> None:
    lon, lat = WEST + STEP * (np.arange(COLS) + 0.5), NORTH - STEP * (np.arange(ROWS) + 0.5)
    np.savez(path, topo=ground()[::-1], longitude=lon + 360.0, latitude=lat[::-1])


def npz_extent(path: Path) -> None:
    south, east = NORTH - ROWS * STEP, WEST + COLS * STEP
    np.savez(path, elevation=ground(), dx=STEP, dy=STEP, xmin=WEST, xmax=east, ymin=NORTH, ymax=south)


def hgt(path: Path) -> None:
    path.write_bytes(ground(121, 121).astype(">i2").tobytes())


def hgt_zip(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("N19W156.hgt", ground(121, 121).astype(">i2").tobytes())
        archive.writestr("N19W156.hgt.aux.xml", "<PAMDataset/>")


def dted(path: Path) -> None:
    """DTED level 0: GDAL writes only whole degrees."""
    side = 121
    half = 0.5 / (side - 1)
    transform = Affine(1 / (side - 1), 0.0, -156.0 - half, 0.0, -1 / (side - 1), 20.0 + half)
    write(path, ground(side, side), "DTED", crs="EPSG:4326", transform=transform)


SAME: Final[dict[str, Writer]] = {
    "little.tif": _plain(),
    "big.tif": _plain(ENDIANNESS="BIG"),
    "bigtiff.tif": _plain(BIGTIFF="YES"),
    "tiled.tif": _plain(tiled=True, blockxsize=16, blockysize=16, compress="lzw", predictor=2),
    "float.tif": lambda path: write(
        path, ground().astype(np.float32), crs="EPSG:4326", transform=geographic(), compress="deflate", predictor=3
    ),
    "south_up.tif": south_up,
    "mirrored.tif": mirrored,
    "upside_down.tif": upside_down,
    "imagine.img": _plain(driver="HFA"),
    "degrees.asc": ascii_degrees,
    "axes.npz": npz_axes,
    "extent.npz": npz_extent,
}
"""All of these are ``ground()`` at the same place."""

# --- odd and broken files ----------------------------------------------------------------------------------------


def feet(path: Path) -> None:
    steps = np.round(ground() / 0.3048 / 0.5).astype(np.uint16)
    write(path, steps, crs="EPSG:4326", transform=geographic())
    with rasterio.open(path, "r+") as dataset:
        dataset.scales, dataset.offsets, dataset.units = (0.5,), (0.0,), ("ft",)


def rotated(path: Path) -> None:
    turn = Affine.translation(EAST_M, NORTH_M) @ Affine.rotation(-27.0) @ Affine.scale(63.0, -93.0)
    write(path, ground(), crs=UTM, transform=turn)


def sheared(path: Path) -> None:
    shear = Affine.translation(EAST_M, NORTH_M) @ Affine(60.0, 15.0, 0.0, 5.0, -90.0, 0.0)
    write(path, ground(), crs=UTM, transform=shear)


def nan_inf(path: Path) -> None:
    data = ground().astype(np.float32)
    data[20:25, 10:20] = np.nan
    data[3, 4], data[5, 6] = np.inf, -np.inf
    write(path, data, crs="EPSG:4326", transform=geographic())


def void_no_tag(path: Path) -> None:
    data = ground()
    data[30:34, 20:26] = -32768
    write(path, data, crs="EPSG:4326", transform=geographic())


def declared(path: Path) -> None:
    data = ground()
    data[30:34, 20:26] = -32768
    write(path, data, crs="EPSG:4326", transform=geographic(), nodata=-32768)


def mercator_wedges(path: Path) -> None:
    """As if warped to Web Mercator, with undeclared zeros in the corners."""
    data = ground().astype(np.float32) + 1200
    r, q = np.mgrid[0:ROWS, 0:COLS]
    data[(r + 3 * q < 20) | (r + 3 * q > ROWS + 3 * COLS - 25)] = 0.0
    transform = Affine(14.4614, 0.0, -13_602_000.0, 0.0, -14.4614, 5_814_000.0)
    write(path, data, crs="EPSG:3857", transform=transform)


def shade(path: Path) -> None:
    data = np.full((256, 256), 255, np.uint8)
    data[40:120, 60:150] = 0
    transform = Affine(9.55, 0.0, -11_854_000.0, 0.0, -9.55, 4_808_000.0)
    write(path, data, crs="EPSG:3857", transform=transform, nodata=255, tiled=True, blockxsize=256, blockysize=256)


def corrupt(path: Path) -> None:
    """A good header, broken tiles."""
    tiles: dict[str, Any] = {"tiled": True, "compress": "deflate", "blockxsize": 64, "blockysize": 64}
    write(path, ground(256, 256), crs="EPSG:4326", transform=geographic(), **tiles)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 400] = b"\xaa" * 400
    path.write_bytes(bytes(data))


def undeclared_9999(path: Path) -> None:
    data = ground(40, 40).astype(float)
    data[:, :2] = -9999.0
    head = "nrows 40\ncellsize 30.0\nxllcorner 0.0\nncols 40\nyllcorner 0.0\n"
    path.write_text(head + "\n".join(" ".join(f"{v:.18e}" for v in row) for row in data))


def sea(path: Path) -> None:
    data = np.maximum(ground().astype(np.int32) - 1200, 0).astype(np.int16)
    write(path, data, crs="EPSG:4326", transform=geographic())


def png16(path: Path) -> None:
    write(path, (ground() * 10).astype(np.uint16), "PNG")


def colours(encoding: str) -> Writer:
    """A picture with heights in its colours, as map tiles have."""

    def writer(path: Path) -> None:
        metres = ground(256, 256)[:256, :256].astype(float) * 0.1
        whole = np.round((metres + 32768) * 256) if encoding == "terrarium" else np.round((metres + 10000) * 10)
        code = whole.astype(np.int64)
        write(path, np.stack([code >> 16, code >> 8 & 255, code & 255]).astype(np.uint8), "PNG")

    return writer


def photograph(path: Path) -> None:
    rng = np.random.default_rng(3)
    write(path, rng.integers(0, 255, (3, 64, 64), dtype=np.uint8), "PNG")


def raw16(path: Path) -> None:
    path.write_bytes((ground(64, 96) * 10).astype("<u2").tobytes())


def sparse_legal(path: Path) -> None:
    """14,000 x 14,000 samples, nothing but header: legal, and large when read."""
    with rasterio.open(
        path, "w", driver="GTiff", height=14_000, width=14_000, count=1, dtype="int16", tiled=True, blockxsize=512,
        blockysize=512, sparse_ok=True, crs=UTM, transform=Affine(4, 0, EAST_M, 0, -4, NORTH_M),
    ):  # fmt: skip
        pass


ODD: Final[dict[str, Writer]] = {
    "cog.tif": cog,
    "feet.tif": feet,
    "rotated.tif": rotated,
    "sheared.tif": sheared,
    "nan_inf.tif": nan_inf,
    "void_no_tag.tif": void_no_tag,
    "declared.tif": declared,
    "mercator_wedges.tif": mercator_wedges,
    "shade.tif": shade,
    "corrupt.tif": corrupt,
    "undeclared_9999.asc": undeclared_9999,
    "no_crs.tif": _plain(crs=None),
    "sea.tif": sea,
    "heights16.png": png16,
    "terrarium.png": colours("terrarium"),
    "mapbox.png": colours("mapbox"),
    "photograph.png": photograph,
    "heights.r16": raw16,
    "N19W156.hgt": hgt,
    "N19W156.hgt.zip": hgt_zip,
    "n19_w156.dt0": dted,
}


def main(folder: str) -> None:
    """Writes all files."""
    for name, writer in (SAME | ODD).items():
        writer(Path(folder) / name)


if __name__ == "__main__":
    main(sys.argv[1])
