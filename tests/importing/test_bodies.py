"""Systems that are not of the Earth's surface, and world files in archives (SPEC G380 to G382)."""

from __future__ import annotations

import math
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pyproj
import pytest
import rasterio
from affine import Affine
from rasterio.errors import NotGeoreferencedWarning

from esker.contract import ImportAnswers
from esker.importing.answers import MIDDLE
from esker.importing.refusal import ImportRefused
from tests.importing.conftest import SIZE_M, look, take
from tests.importing.make_files import COLS, EAST_M, NORTH_M, ROWS, UTM, ground, write

MOON_M, MARS_M = 1_737_400.0, 3_396_190.0
STEP_DEG = 1 / 512


def body(radius: float, name: str = "Moon") -> str:
    """Degrees of a body that is a sphere, as PDS and USGS write them."""
    return (
        f'GEOGCS["GCS_{name}_2000",DATUM["D_{name}_2000",SPHEROID["{name}_2000_IAU_IAG",{radius!r},0.0]],'
        'PRIMEM["Reference_Meridian",0.0],UNIT["Degree",0.0174532925199433]]'
    )


def degrees(path: Path, radius: float, lat: float, name: str = "Moon") -> Path:
    """A GeoTIFF in degrees of a body, its upper left corner at a latitude."""
    write(path, ground(), crs=body(radius, name), transform=Affine(STEP_DEG, 0.0, 10.0, 0.0, -STEP_DEG, lat))
    return path


@pytest.mark.parametrize(("name", "radius"), [("Moon", MOON_M), ("Mars", MARS_M)])
@pytest.mark.parametrize("lat", [0.1, 60.0])
def test_degrees_of_another_body_are_laid_by_its_size(tmp_path: Path, name: str, radius: float, lat: float) -> None:
    """SPEC G380: by hand, in the middle, each degree as long as it is on that body."""
    exam = look(degrees(tmp_path / "a.tif", radius, lat, name))
    (question,) = exam.report.questions
    assert question.id == "place"
    assert "is not of the Earth" in question.text
    laid = exam.placed.laid
    assert laid is not None
    degree = math.radians(radius)
    middle = math.radians(lat - 0.5 * ROWS * STEP_DEG)
    assert laid.spacing_m[1] == pytest.approx(STEP_DEG * degree, rel=2e-3)
    assert laid.spacing_m[0] == pytest.approx(STEP_DEG * degree * math.cos(middle), rel=2e-3)
    assert exam.report.at is None
    assert any(f"{degree / 1000:,.1f} km" in note for note in exam.report.notes)
    layer, raster = take(tmp_path / "a.tif", tmp_path / "raster", ImportAnswers(answers={"place": MIDDLE}))
    assert not layer.facts.geo
    assert np.array_equal(raster.heights, ground()[::-1].astype(np.float32))
    span = np.array([(COLS - 1) * layer.spacing_m[0], (ROWS - 1) * layer.spacing_m[1]])
    assert np.abs(np.array(layer.anchor) + 0.5 * span - 0.5 * SIZE_M).max() < 0.01 * span.max()


def test_degrees_at_a_pole_of_another_body_are_refused(tmp_path: Path) -> None:
    """SPEC G380."""
    with pytest.raises(ImportRefused, match="pole"):
        look(degrees(tmp_path / "a.tif", MOON_M, 90.0))


def geocentric(path: Path) -> Path:
    """A GeoTIFF whose X and Y are counted from the middle of the Earth."""
    write(path, ground(), crs="EPSG:4978", transform=Affine(30.0, 0.0, 3.9e6, 0.0, -30.0, 1.2e6))
    return path


def test_a_geocentric_file_is_asked_about(tmp_path: Path) -> None:
    """SPEC G381: its coordinates are taken for no place on a map; by hand it lies in the middle."""
    exam = look(geocentric(tmp_path / "a.tif"))
    (question,) = exam.report.questions
    assert question.id == "place"
    assert "middle of the Earth" in question.text
    assert exam.report.at is None
    layer, _ = take(tmp_path / "a.tif", tmp_path / "raster", ImportAnswers(answers={"place": MIDDLE}))
    assert layer.spacing_m == (30.0, 30.0)
    assert not layer.facts.geo


@pytest.mark.parametrize("answer", ["EPSG:4978", "EPSG:5703"])
def test_a_system_that_says_nothing_of_the_ground_is_no_answer(tmp_path: Path, answer: str) -> None:
    """SPEC G381: a geocentric or a vertical system."""
    with pytest.raises(ImportRefused, match="where on the ground"):
        look(geocentric(tmp_path / "a.tif"), {"place": answer})


# --- world files in archives ------------------------------------------------------------------------------------

WORLD = Affine(30.0, 0.5, EAST_M, -0.5, -30.0, NORTH_M)
"""Middles of samples of a grid that is turned a little."""


def bare(path: Path, driver: str = "GTiff") -> bytes:
    """A picture that does not say where it lies."""
    shape = {"width": COLS, "height": ROWS, "count": 1, "dtype": "uint16"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path, "w", driver=driver, **shape) as file:
            file.write(ground().astype(np.uint16), 1)
    return path.read_bytes()


def world_text(comma: bool = False) -> bytes:
    a, b, c, d, e, f = WORLD[:6]
    text = "\r\n".join(f"{value:.10f}" for value in (a, d, b, e, c, f)) + "\r\n"
    return text.replace(".", "," if comma else ".").encode()


def zipped(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return path


@pytest.mark.parametrize(
    ("driver", "grid", "world"),
    [("GTiff", "dem.tif", "dem.tfw"), ("GTiff", "DEM.TIF", "dem.TFW"), ("GTiff", "dem.tif", "dem.tifw"),
     ("GTiff", "dem.tiff", "dem.wld"), ("PNG", "dem.png", "dem.pgw")],
)  # fmt: skip
@pytest.mark.parametrize("comma", [False, True])
def test_a_world_file_in_a_zip_is_read(tmp_path: Path, driver: str, grid: str, world: str, comma: bool) -> None:
    """SPEC G382: with the .prj beside it the file lies by its place, without a question about it."""
    prj = pyproj.CRS(UTM).to_wkt().encode()
    members = {grid: bare(tmp_path / "bare", driver), world: world_text(comma), Path(grid).stem + ".prj": prj}
    exam = look(zipped(tmp_path / "a.zip", **members))
    assert "place" not in {question.id for question in exam.report.questions}
    georef = exam.source.georef
    assert georef is not None
    assert georef.affine is not None
    assert georef.affine == pytest.approx(WORLD[:6])
    laid = exam.placed.laid
    assert laid is not None
    assert laid.spacing_m == pytest.approx((30.0, 30.0), rel=5e-3)


def test_without_a_system_it_is_asked_for(tmp_path: Path) -> None:
    """SPEC G382."""
    exam = look(zipped(tmp_path / "a.zip", **{"a.tif": bare(tmp_path / "bare"), "a.tfw": world_text()}))
    assert "place" in {question.id for question in exam.report.questions}


def test_a_world_file_that_is_none_is_noted(tmp_path: Path) -> None:
    """SPEC G382: the grid is laid as one without a place, and a note says why."""
    for text in (b"five 1 2 3 4 5", b"1 2 3", b"", b"\xff\xfe", b"0 0 0 0 0 0", b"nan 0 0 1 2 3"):
        exam = look(zipped(tmp_path / "a.zip", **{"a.tif": bare(tmp_path / "bare"), "a.tfw": text}))
        assert exam.source.georef is None
        assert any("a.tfw is not used" in note for note in exam.report.notes)


def test_the_place_in_the_file_itself_counts(tmp_path: Path) -> None:
    """SPEC G382: a world file beside a file that says where it lies is not used, and a note says so."""
    write(tmp_path / "own.tif", ground(), crs=UTM, transform=Affine(30.0, 0.0, EAST_M, 0.0, -30.0, NORTH_M))
    own = (tmp_path / "own.tif").read_bytes()
    exam = look(zipped(tmp_path / "a.zip", **{"a.tif": own, "a.tfw": world_text()}))
    assert exam.source.georef is not None
    assert exam.source.georef.affine == pytest.approx((30.0, 0.0, EAST_M + 15.0, 0.0, -30.0, NORTH_M - 15.0))
    assert any("a.tfw is not used" in note for note in exam.report.notes)
