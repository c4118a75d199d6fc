"""What is asked, what is suspected, and what answers do (SPEC G10 to G12)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rasterio.transform import Affine

from esker import contract as c
from esker import grid
from esker.importing import questions
from esker.importing.placement.placing import Terrain
from esker.importing.refusal import ImportRefused
from esker.tiles.codec.payload import SAMPLE_LIMIT
from tests.importing.conftest import look, take
from tests.importing.make_files import geographic, ground, write


def _geo(path: Path, data: np.ndarray, **profile: Any) -> Path:
    write(path, data, crs="EPSG:4326", transform=geographic(), **profile)
    return path


def test_undeclared_voids(files: Path, tmp_path: Path) -> None:
    """SPEC G10: asked, left out by default, kept when somebody says so."""
    path = files / "void_no_tag.tif"
    report = look(path).report
    assert [(q.id, q.default) for q in report.questions] == [("nodata", "-32768")]
    assert report.low_m == 155.0
    assert look(path, {"nodata": "-32768"}).report.verdict == "good"
    kept = look(path, {"nodata": "none"}).report
    assert (kept.verdict, kept.low_m) == ("good", -32768.0)
    _, raster = take(path, tmp_path / "raster", c.ImportAnswers(answers={"nodata": "-32768"}))
    assert np.isnan(raster.heights).sum() == 24


def test_zero_wedges(files: Path) -> None:
    """SPEC G10: zeros along the border, far below everything else."""
    question = look(files / "mercator_wedges.tif").report.questions[0]
    assert (question.id, question.options) == ("nodata", ("0", "none"))


@pytest.mark.parametrize(
    "change",
    [
        lambda z: np.maximum(z.astype(np.int32) - 1200, 0),  # a sea at 0 m beside land
        lambda z: z - z.min(),  # one lowest sample at 0
        lambda z: z.astype(np.int32) - 2000,  # below the sea
        lambda z: np.where(z > 2400, 9000, z),  # a summit's plateau
    ],
)
def test_what_is_not_suspected(change: Callable[[np.ndarray], np.ndarray], tmp_path: Path) -> None:
    """SPEC G10."""
    path = _geo(tmp_path / "a.tif", change(ground()).astype(np.float32))
    assert look(path).report.verdict == "good"


@pytest.mark.parametrize("code", [-9999.0, -32767.0, -3.4028234663852886e38, 1e20, 9999.0, 65535.0])
def test_codes(code: float, tmp_path: Path) -> None:
    """SPEC G10: every usual code, in a file of floats."""
    data = ground().astype(np.float32)
    data[10:12, 10:12] = code
    report = look(_geo(tmp_path / "a.tif", data)).report
    assert [q.id for q in report.questions] == ["nodata"]
    assert float(report.questions[0].default) == np.float32(code)
    assert (report.low_m, report.high_m) == (155.0, float(ground().max()))


def test_codes_at_both_ends(tmp_path: Path) -> None:
    """SPEC G10: two codes below and one above are found together."""
    data = ground().astype(np.int32)
    data[0, 0], data[5, 5], data[7, 7] = -32768, -9999, 2147483647
    report = look(_geo(tmp_path / "a.tif", data)).report
    assert report.questions[0].default == "-32768 -9999 2147483647"
    assert report.high_m == float(ground().max())


def test_no_cliff_at_declared_zero(tmp_path: Path) -> None:
    """SPEC G5, G10: zeros that are declared are masked and not asked about."""
    data = ground().astype(np.float32) + 1500
    data[:, :20] = 0
    report = look(_geo(tmp_path / "a.tif", data, nodata=0)).report
    assert report.verdict == "good"
    assert report.low_m == 1655.0


def test_unknown_system(files: Path) -> None:
    """SPEC G11, G24: degrees are recognised; any system can be answered; nonsense is refused."""
    path = files / "no_crs.tif"
    assert [(q.id, q.default) for q in look(path).report.questions] == [("place", "EPSG:4326")]
    for answer in ("EPSG:4326", "4326", "EPSG:4269"):
        report = look(path, {"place": answer}).report
        assert report.verdict == "good"
        assert report.at == pytest.approx((19.875, -155.58), abs=1e-3)
    assert look(path, {"place": "middle"}).report.at is None
    for answer in ("nonsense", "EPSG:999999", "/etc/passwd", "+proj=pipeline"):
        with pytest.raises(ImportRefused):
            look(path, {"place": answer})


def test_range_and_size(files: Path, tmp_path: Path) -> None:
    """SPEC G11: heights of a picture run as somebody says; its width too."""
    path = files / "heights16.png"
    answers = {"range": "100..1100", "size": "4700"}
    report = look(path, answers).report
    assert (report.verdict, report.low_m, report.high_m) == ("good", 100.0, 1100.0)
    assert report.spacing_m == (100.0, 100.0)
    _, raster = take(path, tmp_path / "raster", c.ImportAnswers(answers=answers))
    assert (raster.low, raster.high) == (100.0, 1100.0)
    for bad in ({"range": "5"}, {"range": "9..1"}, {"range": "a..b"}, {"size": "-3"}, {"size": "nan"}):
        with pytest.raises(ImportRefused):
            look(path, bad)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0..4379.8", (0.0, 4379.8)),
        ("-10 .. 20", (-10.0, 20.0)),
        ("-1437 to 2205", (-1437.0, 2205.0)),
        ("1 2", (1.0, 2.0)),
    ],
)
def test_ranges_are_written_in_several_ways(text: str, expected: tuple[float, float]) -> None:
    assert questions.parse_range(text) == expected


def test_pictures_can_be_stopped(tmp_path: Path) -> None:
    """SPEC G11."""
    path = _geo(tmp_path / "a.tif", (ground() // 16).astype(np.uint8))
    assert [q.id for q in look(path).report.questions] == ["imagery"]
    with pytest.raises(ImportRefused, match="picture"):
        look(path, {"imagery": "stop"})


def test_bands(tmp_path: Path) -> None:
    """SPEC G11: the band that is answered is the one taken."""
    path = _geo(tmp_path / "a.tif", np.stack([ground(), ground() + 1000]))
    assert [(q.id, q.options) for q in look(path).report.questions] == [("band", ("1", "2"))]
    assert look(path, {"band": "2"}).report.low_m == 1155.0
    for bad in ("0", "3", "x"):
        with pytest.raises(ImportRefused):
            look(path, {"band": bad})


def test_feet_along_the_ground(tmp_path: Path) -> None:
    """SPEC G13: coordinates in feet, heights in nobody says what."""
    path = tmp_path / "a.tif"
    write(path, ground(), crs="EPSG:2263", transform=Affine(30.0, 0.0, 980_000.0, 0.0, -30.0, 200_000.0))
    report = look(path).report
    assert [(q.id, q.default) for q in report.questions] == [("unit", "feet")]
    assert report.low_m == pytest.approx(155 * 1200 / 3937)
    assert report.spacing_m == pytest.approx((30 * 0.3048, 30 * 0.3048), rel=1e-3)
    assert look(path, {"unit": "metres"}).report.low_m == 155.0
    with pytest.raises(ImportRefused):
        look(path, {"unit": "ells"})


def test_accuracy() -> None:
    """SPEC G12."""
    assert questions.accuracy_m((10.0, 10.0), None) == 1.0
    assert questions.accuracy_m((40.0, 90.0), 1.0) == 6.0
    assert questions.accuracy_m((2.0, 2.0), 1.0) == 0.5


def test_report_is_complete(files: Path) -> None:
    """The preview is south first, 0 to 255, with -1 for nodata; texts fit their limits."""
    report = look(files / "declared.tif").report
    picture = np.array(report.preview)
    assert picture.shape == (32, 32)
    assert picture.max() <= 255
    assert picture.min() == -1
    north, south = ground()[:2, :2].mean(), ground()[-2:, :2].mean()
    assert (picture[0, 0] > picture[31, 0]) == (south > north)
    assert (np.array(look(files / "little.tif").report.preview) >= 0).all()


def _high(path: Path, low: float, high: float) -> Path:
    return _geo(path, np.linspace(low, high, 60 * 48, dtype=np.float32).reshape(60, 48))


@pytest.mark.parametrize(("low", "high", "shift"), [(2410.0, 2500.0, -2400.0), (-3990.0, -3900.0, 4000.0)])
def test_too_high_for_a_small_terrain(low: float, high: float, shift: float, tmp_path: Path) -> None:
    """SPEC G14: asked with the size that would hold it, and shifted when somebody says so."""
    small = Terrain(None, 64.0)
    path = _high(tmp_path / "a.tif", low, high)
    question = look(path, terrain=small).report.questions[-1]
    assert (question.id, question.options, question.default) == ("height", ("shift", "stop"), "shift")
    assert f"at least {max(abs(low), abs(high)) / c.LAYER_HEIGHT_MARGIN:,.0f} m" in question.text
    answers = c.ImportAnswers(answers={"height": "shift", "place": "middle"})
    layer, _ = take(path, tmp_path / "raster", answers, None, 64.0)
    assert layer.lift_m == shift
    assert (layer.facts.low_m, layer.facts.high_m) == (low, high)
    assert not [q for q in look(path, terrain=Terrain(None, 4096.0)).report.questions if q.id == "height"]
    with pytest.raises(ImportRefused, match="farther from zero"):
        look(path, {"height": "stop"}, small)


def test_higher_than_a_small_terrain_is_wide(tmp_path: Path) -> None:
    """SPEC G14: no shift helps; what is laid by hand is held to the same."""
    path = _high(tmp_path / "a.tif", 0.0, 400.0)
    with pytest.raises(ImportRefused, match="at least 100 m wide"):
        look(path, terrain=Terrain(None, 64.0))
    by_hand = c.ImportAnswers(answers={"place": "middle"}, scale=0.5)
    assert take(path, tmp_path / "halved", by_hand, None, 64.0)[0].scale == 0.5
    with pytest.raises(ImportRefused, match="reach 700 m from zero"):
        take(path, tmp_path / "lifted", by_hand.model_copy(update={"lift_m": 500.0}), None, 64.0)


def test_nothing_that_is_taken_saturates() -> None:
    """SPEC G14: layers and strokes at their bounds, and offsets between them, fit into quanta of the finest tiles."""
    side = 64.0
    held = SAMPLE_LIMIT * grid.quantum(c.MAX_REFINED_LEVEL, side)
    assert (c.LAYER_HEIGHT_MARGIN + c.DOMAIN_MARGIN) * side < held
    assert questions.held_m(side) == c.LAYER_HEIGHT_MARGIN * side
