"""From a file's coordinates to the terrain's frame (SPEC G20 to G25)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyproj
import pytest

from esker import contract as c
from esker.importing.placement import fitting
from esker.importing.placement.fitting import Laid, net_at
from esker.importing.placement.georef import Georef, check_affine
from esker.importing.placement.placing import Terrain
from esker.importing.refusal import ImportRefused
from tests.importing.conftest import look, take, world
from tests.importing.make_files import COLS, EAST_M, NORTH_M, ROWS, UTM, ground

SIZE_M = 40_000.0


def _error(laid: Laid, locate: fitting.Locate, rows: int, cols: int) -> float:
    """Largest distance in metres between where samples are laid, net and all, and where ``locate`` has them."""
    v, u = (a.reshape(-1).astype(float) for a in np.mgrid[0:rows, 0:cols])
    moved = np.stack([u, v], -1) + (net_at(laid.warp, u, v, rows, cols) if laid.warp is not None else 0.0)
    turn = np.radians(laid.rotation_deg)
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    there = np.array(laid.anchor) + (moved * laid.spacing_m) @ matrix.T
    col, row = cols - 1 - u if laid.flip_cols else u, rows - 1 - v if laid.flip_rows else v
    return float(np.hypot(*(there - np.stack(locate(col, row), -1)).T).max())


@pytest.mark.parametrize("lat", [-60.0, 0.5, 46.5, 71.0])
def test_degree_tiles_within_a_twentieth(lat: float) -> None:
    """SPEC G20: whole degrees at 3", from the equator to the north, checked at every sample."""
    rows = cols = 301
    georef = Georef(pyproj.CRS.from_epsg(4326), (1 / 300, 0.0, -121.0, 0.0, -1 / 300, lat + 0.5))
    locate = fitting.on_frame(georef, c.Place(lat_deg=lat + 0.2, lon_deg=-120.2), SIZE_M)
    laid = fitting.lay(locate, rows, cols)
    assert laid.warp is not None
    assert _error(laid, locate, rows, cols) <= min(laid.spacing_m) / 20
    assert (laid.flip_rows, laid.flip_cols) == (True, False)


def test_the_edge_of_a_bent_grid_is_where_its_samples_are(tmp_path: Path) -> None:
    """SPEC G26: the outline that pages draw, within an eighth of a step of the outermost samples."""
    path, cols, rows = tmp_path / "a.npz", 321, 161
    lon, lat = np.linspace(-122.0, -121.0, cols), np.linspace(46.6, 47.0, rows)
    np.savez(path, z=np.hypot(*np.meshgrid(lon, lat)) * 10, longitude=lon, latitude=lat)
    layer, raster = take(path, tmp_path / "raster", place=c.Place(lat_deg=46.8, lon_deg=-121.5), size_m=65_536.0)
    at = world(layer, raster)
    bend = np.array(layer.facts.edge)
    assert bend.shape == (c.EDGE_POINTS, 2)
    assert np.abs(bend).max() > 0.5
    # The same edge as pages take it: corners by the layer's affine, and the points between them moved.
    u = np.concatenate(
        [np.linspace(0, cols - 1, 9)[:8], np.full(8, cols - 1), np.linspace(cols - 1, 0, 9)[:8], np.zeros(8)]
    )
    v = np.concatenate(
        [np.zeros(8), np.linspace(0, rows - 1, 9)[:8], np.full(8, rows - 1), np.linspace(rows - 1, 0, 9)[:8]]
    )
    moved = (np.stack([u, v], -1) + bend) * layer.spacing_m
    turn = np.radians(layer.rotation_deg)
    there = np.array(layer.anchor) + moved @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    true = at[v.astype(int), u.astype(int)]
    assert np.hypot(*(there - true).T).max() < min(layer.spacing_m) / 100
    straight = np.array(layer.anchor) + (np.stack([u, v], -1) * layer.spacing_m) @ np.array(
        [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    )
    assert np.hypot(*(straight - true).T).max() > 0.5 * min(layer.spacing_m)
    assert take(path, tmp_path / "b", c.ImportAnswers(), c.Place(lat_deg=46.8, lon_deg=-121.5))[0].facts.edge


def test_straight_grids_have_no_edge_of_their_own(files: Path, tmp_path: Path) -> None:
    """SPEC G26."""
    middle = c.ImportAnswers(answers={"place": "middle"})
    assert take(files / "rotated.tif", tmp_path / "raster", middle)[0].facts.edge == ()


@pytest.mark.parametrize("degrees", [0.0, 27.0, -63.5, 90.0, 135.0, 180.0, -45.0])
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_any_turn(degrees: float, mirror: float) -> None:
    """SPEC G21, G22: exact without a net, right-handed, turned by no more than needed."""
    turn = np.radians(degrees)
    a, d = 20 * np.cos(turn), 20 * np.sin(turn)
    b, e = -10 * mirror * np.sin(turn), 10 * mirror * np.cos(turn)
    locate = fitting.locally(Georef(None, (a, b, 500.0, d, e, -300.0)), 1.0)
    laid = fitting.lay(locate, 40, 30)
    assert laid.warp is None
    assert laid.spacing_m == pytest.approx((20.0, 10.0))
    assert _error(laid, locate, 40, 30) < 1e-3
    assert abs(laid.rotation_deg) <= 90.0 + 1e-9
    assert abs((laid.rotation_deg - degrees + 90) % 180 - 90) < 1e-6 or abs(abs(laid.rotation_deg) - 90) < 1e-6


def test_shear_goes_into_the_net() -> None:
    """SPEC G22: four control points hold it exactly."""
    locate = fitting.locally(Georef(None, (60.0, 15.0, 0.0, 5.0, -90.0, 0.0)), 1.0)
    laid = fitting.lay(locate, 60, 48)
    assert laid.warp is not None
    assert laid.warp.shape == (2, 2, 2)
    assert _error(laid, locate, 60, 48) < 0.01


def test_rotated_file(files: Path, tmp_path: Path) -> None:
    """SPEC G20, G22: the paper's case, 27 degrees and cells of 63 x 93 m, against PROJ."""
    place = c.Place(lat_deg=19.76, lon_deg=-155.57)
    layer, raster = take(files / "rotated.tif", tmp_path / "raster", place=place, size_m=SIZE_M)
    frame = f"+proj=tmerc +lat_0=19.76 +lon_0=-155.57 +x_0={SIZE_M / 2} +y_0={SIZE_M / 2} +datum=WGS84"
    to_frame = pyproj.Transformer.from_crs(UTM, frame, always_xy=True)
    row, col = np.mgrid[0:ROWS, 0:COLS] + 0.5
    turn = np.radians(-27.0)
    x = EAST_M + np.cos(turn) * 63 * col + np.sin(turn) * 93 * row
    y = NORTH_M + np.sin(turn) * 63 * col - np.cos(turn) * 93 * row
    true = np.stack(to_frame.transform(x, y), -1)[::-1]
    assert np.hypot(*np.moveaxis(world(layer, raster) - true, -1, 0)).max() <= 63 / 20
    assert np.array_equal(raster.heights, ground()[::-1])
    assert layer.spacing_m == pytest.approx((63.0, 93.0), rel=2e-3)


def test_axes_beyond_180_degrees() -> None:
    """SPEC G20: longitudes from 0 to 360 are the same places."""
    lon, lat = np.linspace(234.0, 235.0, 30), np.linspace(48.0, 49.0, 40)
    crs = pyproj.CRS.from_epsg(4326)
    place = c.Place(lat_deg=48.5, lon_deg=-125.5)
    east = fitting.lay(fitting.on_frame(Georef(crs, None, lon, lat), place, SIZE_M), 40, 30)
    west = fitting.lay(fitting.on_frame(Georef(crs, None, lon - 360, lat), place, SIZE_M), 40, 30)
    assert (east.anchor, east.spacing_m) == (west.anchor, west.spacing_m)


def test_uneven_axes() -> None:
    """SPEC G20: rows that are spaced as in a Mercator chart go into the net."""
    lon = np.linspace(-126.0, -122.0, 120)
    lat = np.degrees(
        np.arctan(np.sinh(np.linspace(np.arcsinh(np.tan(np.radians(48))), np.arcsinh(np.tan(np.radians(50))), 91)))
    )
    georef = Georef(pyproj.CRS.from_epsg(4326), None, lon, lat)
    locate = fitting.on_frame(georef, c.Place(lat_deg=49.0, lon_deg=-124.0), SIZE_M)
    laid = fitting.lay(locate, 91, 120)
    assert _error(laid, locate, 91, 120) <= min(laid.spacing_m) / 20


@pytest.mark.parametrize(
    "affine",
    [
        (1.0, 0.0, -180.0, 0.0, -1.0, 90.0),  # the whole Earth
        (0.5, 0.0, -100.0, 0.0, -0.2, 89.9),  # a pole's cap
    ],
)
def test_too_much_of_the_earth(affine: tuple[float, float, float, float, float, float]) -> None:
    """SPEC G24."""
    locate = fitting.on_frame(Georef(pyproj.CRS.from_epsg(4326), affine), c.Place(lat_deg=40, lon_deg=0), SIZE_M)
    with pytest.raises(ImportRefused):
        fitting.lay(locate, 180, 360)


@pytest.mark.parametrize(
    "affine", [(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (1.0, 2.0, 0.0, 2.0, 4.0, 0.0), (np.nan, 0.0, 0.0, 0.0, 1.0, 0.0)]
)
def test_degenerate(affine: tuple[float, float, float, float, float, float]) -> None:
    """SPEC G22: samples on one line, or nowhere."""
    with pytest.raises(ImportRefused, match="degenerate"):
        check_affine(affine)


def test_web_mercator(files: Path) -> None:
    """SPEC G23: laid by its length on the ground."""
    report = look(files / "mercator_wedges.tif").report
    assert report.spacing_m == pytest.approx((10.0, 10.0), abs=0.05)
    assert any("Web Mercator" in note and "14.46" in note for note in report.notes)


def test_the_terrain_without_a_place(files: Path, tmp_path: Path) -> None:
    """SPEC G20: the file's middle becomes the middle of the terrain."""
    layer, raster = take(files / "little.tif", tmp_path / "raster", place=None)
    middle = world(layer, raster).reshape(-1, 2).mean(axis=0)
    assert middle == pytest.approx((4096.0, 4096.0), abs=1.0)


def test_from_elsewhere(files: Path, tmp_path: Path) -> None:
    """SPEC G24: asked in an examination, refused in a conversion unless somebody said so."""
    place = c.Place(lat_deg=46.2, lon_deg=-122.2)
    question = look(files / "little.tif", terrain=Terrain(place, 8192.0)).report.questions[0]
    assert question.id == "place"
    assert "km" in question.text
    with pytest.raises(ImportRefused, match="place=middle"):
        take(files / "little.tif", tmp_path / "a", place=place)
    answers = c.ImportAnswers(answers={"place": "middle"})
    layer, raster = take(files / "little.tif", tmp_path / "b", answers, place=place)
    assert world(layer, raster).reshape(-1, 2).mean(axis=0) == pytest.approx((4096.0, 4096.0), abs=1.0)
    assert not layer.facts.geo


def test_a_named_system_is_never_moved_silently(files: Path, tmp_path: Path) -> None:
    """SPEC G24: degrees that lie elsewhere are laid by hand by default; a system that is answered and lies elsewhere is
    refused with what to do."""
    place = c.Place(lat_deg=46.2, lon_deg=-122.2)
    question = look(files / "no_crs.tif", terrain=Terrain(place, 8192.0)).report.questions[0]
    assert (question.id, question.default) == ("place", "middle")
    with pytest.raises(ImportRefused, match="place=middle"):
        take(files / "no_crs.tif", tmp_path / "a", c.ImportAnswers(answers={"place": "EPSG:4326"}), place=place)
    layer, _ = take(files / "no_crs.tif", tmp_path / "b", c.ImportAnswers(answers={"place": "middle"}), place=place)
    assert not layer.facts.geo


def test_by_hand(files: Path, tmp_path: Path) -> None:
    """SPEC G11: who answers may say where a grid lies; a grid without a place fits the terrain otherwise."""
    answers = c.ImportAnswers(
        anchor=(100.0, 200.0), rotation_deg=30.0, spacing_m=(5.0, 4.0), scale=2.0, lift_m=-7.0, name="Hill"
    )
    layer, _ = take(files / "heights16.png", tmp_path / "a", answers)
    assert (layer.anchor, layer.rotation_deg, layer.spacing_m) == ((100.0, 200.0), 30.0, (5.0, 4.0))
    assert (layer.scale, layer.lift_m, layer.name) == (2.0, -7.0, "Hill")
    fitted, raster = take(files / "heights16.png", tmp_path / "b")
    there = world(fitted, raster)
    assert there[..., 1].min() == pytest.approx(0.0, abs=1e-3)
    assert there[..., 1].max() == pytest.approx(8192.0, abs=1e-3)
    assert there[..., 0].mean() == pytest.approx(4096.0, abs=1e-3)


def test_net_rounding_is_the_same_everywhere() -> None:
    """SPEC G25: displacements are whole multiples of 2^-20."""
    georef = Georef(pyproj.CRS.from_epsg(4326), (1 / 300, 0.0, -121.0, 0.0, -1 / 300, 47.0))
    laid = fitting.lay(fitting.on_frame(georef, c.Place(lat_deg=46.5, lon_deg=-120.5), SIZE_M), 100, 100)
    assert laid.warp is not None
    assert np.array_equal(laid.warp * 2**20, np.round(laid.warp * 2**20))
