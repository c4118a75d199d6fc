"""Rivers, watersheds and raindrops of terrains, from Python and from the command line (SPEC W22 to W28)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from esker import Stroke, Terrain, contract, templates
from esker.cli.main import main
from esker.contract import Place
from esker.document import archive
from esker.document.birth import new_document
from esker.exporting.rivers import collection


@pytest.fixture(scope="module")
def valley() -> Terrain:
    terrain = Terrain(size_m=2048)
    for x in (300, 1700):
        terrain.add(Stroke.profile([(x, 100, 300), (x, 1000, 500), (x, 1900, 400)]))
    return terrain


def test_rivers_lie_in_the_valley_that_was_drawn(valley: Terrain) -> None:
    """SPEC W22."""
    rivers = valley.rivers(2)
    largest = max(rivers, key=lambda river: river.area_m2[1])
    assert (np.abs(largest.points[:, 0] - 1000) < 350).all()
    assert all(0 <= p <= 2048 for river in rivers for p in river.points.ravel())
    assert all(river.area_m2[0] <= river.area_m2[1] for river in rivers)
    for k, river in enumerate(rivers):
        if river.next is not None:
            assert river.next > k
            np.testing.assert_array_equal(river.points[-1], rivers[river.next].points[0])


def test_rivers_run_over_the_ground_with_its_detail(valley: Terrain) -> None:
    """SPEC W22: detail turns rivers, so without it others would be drawn than the ground shows."""
    with_detail = valley.rivers(2)
    settings = valley.settings
    try:
        valley.settings = settings.model_copy(update={"detail": 0.0})
        without = valley.rivers(2)
    finally:
        valley.settings = settings
    assert [r.points.tolist() for r in with_detail] != [r.points.tolist() for r in without]


def test_settings_say_how_many_rivers_and_how_wet(valley: Terrain) -> None:
    """SPEC W23."""
    settings = valley.settings
    by_default = valley.rivers(1)
    assert [r.points.tolist() for r in valley.rivers(1, many=1.0)] == [r.points.tolist() for r in by_default]
    assert valley.rivers(1, many=0) == ()
    try:
        valley.settings = settings.model_copy(update={"rivers": 4.0, "wetness": 10.0})
        more = valley.rivers(1)
    finally:
        valley.settings = settings
    assert len(more) > len(by_default)
    widest = max(river.width_m[1] for river in more)
    assert widest == pytest.approx(max(river.width_m[1] for river in valley.rivers(1, many=4.0)) * 10.0**0.352)


def test_a_watershed_has_the_area_of_its_samples(valley: Terrain) -> None:
    """SPEC W24."""
    shed = valley.watershed(1000.0, 40.0, level=2)
    assert shed.inside.dtype == bool
    assert shed.area_m2 == shed.inside.sum() * 64.0
    assert shed.point == (1000.0, 40.0)
    row, col = 5, 125
    assert shed.inside[row, col]


def test_a_raindrop_runs_down_and_leaves(valley: Terrain) -> None:
    """SPEC W25."""
    way = valley.raindrop(600.0, 1000.0, level=2)
    assert way.points[0, :2].tolist() == [600.0, 1000.0]
    assert (np.diff(way.water_m) <= 0).all()
    assert (way.water_m >= way.points[:, 2]).all()
    assert way.distance_m[0] == 0
    assert (np.diff(way.distance_m) > 0).all()
    assert not way.reaches_sea
    x, y = way.points[-1, :2]
    assert 0 in (x, y) or 2048 in (x, y)
    settings = valley.settings
    try:
        valley.settings = settings.model_copy(update={"sea_level_m": float(way.points[len(way.points) // 2, 2])})
        assert valley.raindrop(600.0, 1000.0, level=2).reaches_sea
    finally:
        valley.settings = settings


@pytest.mark.parametrize("call", ["watershed", "raindrop"])
@pytest.mark.parametrize(("x", "y"), [(-1, 5), (5, 2049), (float("nan"), 5), ("a", 5)])
def test_points_outside_are_refused(valley: Terrain, call: str, x: float, y: float) -> None:
    """SPEC W26."""
    with pytest.raises(ValueError, match=r"[xy] must"):
        getattr(valley, call)(x, y, level=1)


@pytest.mark.parametrize(
    "asked", [{"many": -1}, {"many": 5}, {"wetness": 0}, {"wetness": 11}, {"level": 7}, {"many": float("nan")}]
)
def test_numbers_out_of_range_are_refused(valley: Terrain, asked: dict[str, float]) -> None:
    """SPEC W26."""
    with pytest.raises(ValueError, match="must be"):
        valley.rivers(**asked)  # type: ignore[arg-type]


def test_terrains_of_nothing_have_no_rivers() -> None:
    """SPEC W17: neither has a blank plain with all of its detail, nor one under the sea."""
    terrain = Terrain(size_m=4096)
    assert terrain.rivers(2) == ()
    terrain.add(Stroke.profile([(900, 2000, 0), (2000, 2000, 700), (3200, 2000, 0)]))
    terrain.settings = terrain.settings.model_copy(update={"sea_level_m": 5000.0})
    assert terrain.rivers(2) == ()


def test_the_command_writes_lines_in_metres(
    valley: Terrain, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """SPEC W27."""
    scene, out = tmp_path / "valley.esker", tmp_path / "rivers.geojson"
    valley.save(scene)
    assert main(["flow", str(scene), "-o", str(out), "--level", "1"]) == 0
    assert "rivers" in capsys.readouterr().err
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["type"] == "FeatureCollection"
    assert found["metres"] is True
    assert len(found["features"]) == len(valley.rivers(1))
    first = found["features"][0]
    np.testing.assert_allclose(first["geometry"]["coordinates"], valley.rivers(1)[0].points, atol=0.006)
    assert first["properties"]["area_m2_end"] == pytest.approx(valley.rivers(1)[0].area_m2[1], abs=0.001)


def test_rivers_of_a_terrain_on_earth_have_longitude_and_latitude(valley: Terrain) -> None:
    """SPEC W27."""
    place = Place(lat_deg=46.5, lon_deg=8.25)
    found = collection(valley.rivers(1), valley.settings.model_copy(update={"place": place}))
    assert "metres" not in found
    lines = [np.array(feature["geometry"]["coordinates"]) for feature in found["features"]]
    for line, river in zip(lines, valley.rivers(1), strict=True):
        east, north = (river.points - 1024).T
        np.testing.assert_allclose(line[:, 1], 46.5 + north / 111_140, atol=2e-4)
        np.testing.assert_allclose(line[:, 0], 8.25 + east / (111_320 * np.cos(np.radians(46.5))), atol=4e-4)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nowhere.esker", "-o", "out.geojson"], "nowhere.esker"),
        (["alpine-ridge", "-o", "out.png"], "not as '.png'"),
        (["alpine-ridge", "-o", "no/such/folder/out.geojson"], "There is no folder"),
        (["alpine-ridge", "-o", "out.geojson", "--level", "9"], "invalid choice"),
        (["alpine-ridge", "-o", "out.geojson", "--level", "0", "--many", "9"], "many must be"),
    ],
)
def test_the_command_says_what_is_wrong(
    arguments: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """SPEC W28: in a sentence, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    try:
        status = main(["flow", *arguments])
    except SystemExit as left:
        status = int(left.code or 0)
    assert status in (1, 2)
    assert says in capsys.readouterr().err
    assert not (tmp_path / "out.geojson").exists()


def test_documents_that_are_older_than_rivers_ask_for_none() -> None:
    """SPEC W29: and new terrains ask for some."""
    old = contract.Document(id="old")
    assert old.settings.rivers == 0
    assert templates.load("alpine-ridge").document.settings.rivers == contract.DEFAULT_RIVERS
    assert old.settings.wetness == 1
    assert archive.loads(archive.dumps(old)).settings.rivers == 0
    assert contract.TerrainSettings.model_validate({"size_m": 1024.0}).rivers == 0
    assert new_document(1024.0).settings.rivers == contract.DEFAULT_RIVERS
