"""GDAL doing its nearest equivalent to the patchwork, through rasterio, for ``esker bench patchwork``.

``overviews``: gdaladdo (average, 2 to 64) of a GeoTIFF: mipmaps, without errors. ``mosaic``: a virtual raster of two
grids, one laid over the other, read at a quarter of the resolution by overviews: no blend, the last one wins, no
rotation. ``warp``: gdalwarp of a grid turned by 27 degrees into the lattice of the other, which is the price of a new
layer there.
"""

from __future__ import annotations

import math
import os
import time
import warnings
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Heights = NDArray[np.float32]
FACTORS: Final = (2, 4, 8, 16, 32, 64)
WINDOW: Final = 1025
CRS: Final = "EPSG:32610"


def measure(folder: Path, four: Heights, span_m: float, large: Path | None, quick: bool) -> dict[str, Any]:
    """Figures for the 4k grid, and overviews of the ``large`` one, a .npy."""
    import rasterio

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        one = _write(folder / "one.tif", four, span_m / (len(four) - 1), (0.0, span_m))
        out: dict[str, Any] = {
            "version": f"GDAL {rasterio.__gdal_version__} by rasterio {rasterio.__version__}",
            "overviews": {str(len(four)): _overviews(one)},
            "mosaic": _mosaic(folder, one, span_m, quick),
            "warp": _warp(four, span_m, quick),
        }
        if large is not None:
            heights = np.load(large, mmap_mode="r")
            path = _write(folder / "large.tif", heights, span_m / (len(heights) - 1), (0.0, span_m))
            out["overviews"][str(len(heights))] = _overviews(path)
            path.unlink()
    return out


def _write(path: Path, heights: Heights, step: float, corner: tuple[float, float]) -> Path:
    """A tiled GeoTIFF, north up, without compression. ``corner``: of the north-western sample."""
    import rasterio
    from rasterio.windows import Window

    rows, cols = heights.shape
    transform = rasterio.Affine(step, 0, corner[0] - step / 2, 0, -step, corner[1] + step / 2)
    with rasterio.open(
        path, "w", driver="GTiff", width=cols, height=rows, count=1, dtype="float32", crs=CRS, transform=transform,
        tiled=True, BIGTIFF="IF_SAFER",
    ) as out:  # fmt: skip
        for top in range(0, rows, 2048):
            block = np.asarray(heights[::-1][top : top + 2048])
            out.write(block, 1, window=Window(0, top, cols, len(block)))
    return path


def _overviews(path: Path) -> dict[str, float]:
    import rasterio
    from rasterio.enums import Resampling

    before = path.stat().st_size
    start = time.perf_counter()
    with rasterio.Env(GDAL_NUM_THREADS=str(os.cpu_count())), rasterio.open(path, "r+") as out:
        out.build_overviews(FACTORS, Resampling.average)
    return {"s": time.perf_counter() - start, "bytes_over": path.stat().st_size - before}


def _mosaic(folder: Path, one: Path, span_m: float, quick: bool) -> dict[str, float]:
    """A window of 1,025 samples of a virtual raster at a quarter of its resolution."""
    import rasterio
    from rasterio.enums import Resampling
    from rasterio.windows import Window

    with rasterio.open(one) as grid:
        side, step = grid.width, grid.transform.a
    y, x = np.mgrid[0:512, 0:512]
    other = _write(folder / "two.tif", (1500 + 300 * np.sin(x / 61) * np.cos(y / 47)).astype(np.float32), step,
                   (round(0.4 * side) * step, span_m - round(0.4 * side) * step))  # fmt: skip
    _overviews(other)
    at = round(0.4 * side)
    vrt = folder / "two.vrt"
    vrt.write_text(
        f'<VRTDataset rasterXSize="{side}" rasterYSize="{side}"><VRTRasterBand dataType="Float32" band="1">'
        + "".join(
            f'<SimpleSource><SourceFilename relativeToVRT="1">{name}</SourceFilename><SourceBand>1</SourceBand>'
            f'<SrcRect xOff="0" yOff="0" xSize="{n}" ySize="{n}"/>'
            f'<DstRect xOff="{k}" yOff="{k}" xSize="{n}" ySize="{n}"/>'
            "</SimpleSource>"
            for name, n, k in (("one.tif", side, 0), ("two.tif", 512, at))
        )
        + "</VRTRasterBand></VRTDataset>"
    )
    times = []
    span = min(4 * WINDOW, side)
    for _ in range(2 if quick else 10):
        start = time.perf_counter()
        with rasterio.open(vrt) as grid:
            grid.read(1, window=Window(0, 0, span, span), out_shape=(WINDOW, WINDOW), resampling=Resampling.bilinear)
        times.append(time.perf_counter() - start)
    return {"read_1025_at_a_quarter_ms": 1e3 * min(times)}


def _warp(four: Heights, span_m: float, quick: bool) -> dict[str, float]:
    """A turned grid of 512 x 512 at 10 m into the whole 4k lattice, and into one of 10 m around it."""
    import rasterio
    from rasterio.enums import Resampling
    from rasterio.warp import reproject

    y, x = np.mgrid[0:512, 0:512]
    heights = (1500 + 300 * np.sin(x / 61) * np.cos(y / 47)).astype(np.float32)
    a = math.radians(27)
    turned = rasterio.Affine(10 * math.cos(a), 10 * math.sin(a), 60_000, 10 * math.sin(a), -10 * math.cos(a), 90_000)
    step = span_m / (len(four) - 1)
    targets = {
        "into_4k": (len(four), rasterio.Affine(step, 0, 0, 0, -step, span_m)),
        "into_10m": (800, rasterio.Affine(10, 0, 59_500, 0, -10, 93_500)),
    }
    out = {}
    for name, (side, transform) in targets.items():
        for kind in (Resampling.bilinear, Resampling.cubic):
            times = []
            for _ in range(1 if quick else 3):
                target = np.full((side, side), np.nan, dtype=np.float32)
                start = time.perf_counter()
                reproject(
                    heights, target, src_transform=turned, src_crs=CRS, dst_transform=transform, dst_crs=CRS,
                    resampling=kind, dst_nodata=np.nan, num_threads=os.cpu_count(),
                )  # fmt: skip
                times.append(time.perf_counter() - start)
            out[f"{name}_{kind.name}_ms"] = 1e3 * min(times)
    return out
