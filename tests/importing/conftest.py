"""Files that the tests of imports read, written once, and ways to look at what becomes of them."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import contract as c
from esker.importing.convert import convert
from esker.importing.examine import Exam, examine
from esker.importing.placement.placing import Terrain
from esker.patchwork.raster import rasters
from tests.importing import make_files

HERE = Path(__file__).parent
KEPT = HERE / "files"
PLACE = c.Place(lat_deg=19.87, lon_deg=-155.58)
SIZE_M = 8192.0


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all files of ``make_files``."""
    folder = tmp_path_factory.mktemp("elevation")
    make_files.main(str(folder))
    return folder


def look(path: Path, answers: Mapping[str, str] | None = None, terrain: Terrain | None = None) -> Exam:
    """An examination in this process."""
    with tempfile.TemporaryDirectory() as workdir:
        return examine(path, path.name, Path(workdir), answers or {}, terrain, lambda _: None)


def take(
    path: Path, out: Path, answers: c.ImportAnswers | None = None, place: c.Place | None = PLACE, size_m: float = SIZE_M
) -> tuple[c.Layer, rasters.Raster]:
    """A conversion in this process: the layer and its raster."""
    workdir = out.with_name(out.name + ".work")
    workdir.mkdir(parents=True)
    given = answers or c.ImportAnswers()
    layer = convert(path, path.name, given, Terrain(place, size_m), out, workdir, lambda *_: None)
    return layer, rasters.read(out)


def world(layer: c.Layer, raster: rasters.Raster) -> NDArray[np.float64]:
    """World x, y (rows, cols, 2) of all samples of a stored raster, by the layer and its net (PATCHWORK: lattice)."""
    rows, cols = raster.heights.shape
    v, u = np.mgrid[0:rows, 0:cols].astype(float)
    if raster.warp is not None:
        m, n = raster.warp.shape[:2]
        a, b = v * (m - 1) / (rows - 1), u * (n - 1) / (cols - 1)
        i, j = np.minimum(a.astype(int), m - 2), np.minimum(b.astype(int), n - 2)
        fa, fb = (a - i)[..., None], (b - j)[..., None]
        w = raster.warp
        low, high = w[i, j] * (1 - fb) + w[i, j + 1] * fb, w[i + 1, j] * (1 - fb) + w[i + 1, j + 1] * fb
        moved = low * (1 - fa) + high * fa
        u, v = u + moved[..., 0], v + moved[..., 1]
    x, y = u * layer.spacing_m[0], v * layer.spacing_m[1]
    turn = np.radians(layer.rotation_deg)
    return np.stack(
        [
            layer.anchor[0] + np.cos(turn) * x - np.sin(turn) * y,
            layer.anchor[1] + np.sin(turn) * x + np.cos(turn) * y,
        ],
        axis=-1,
    )
