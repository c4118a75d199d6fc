"""All formats give the same ground at the same place (SPEC G1, G3, G4, G5, G7, G8, G9, G25)."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pyproj
import pytest

from esker import contract as c
from esker.importing import source
from esker.importing.formats import ascii_grid, gdal_source
from esker.importing.refusal import ImportRefused
from tests.importing import make_files
from tests.importing.conftest import PLACE, SIZE_M, look, take, world
from tests.importing.make_files import COLS, NORTH, ROWS, STEP, WEST, ground


def truth(lon: np.ndarray, lat: np.ndarray) -> np.ndarray:
    """World x, y of longitudes and latitudes, straight from PROJ."""
    frame = (
        f"+proj=tmerc +lat_0={PLACE.lat_deg} +lon_0={PLACE.lon_deg} +k=1 +x_0={SIZE_M / 2} +y_0={SIZE_M / 2} "
        "+datum=WGS84 +units=m"
    )
    transformer = pyproj.Transformer.from_crs("EPSG:4326", frame, always_xy=True)
    return np.stack(transformer.transform(lon, lat), axis=-1)


def places(rows: int, cols: int, step: float, west: float, north: float) -> np.ndarray:
    """Truth for all sample centres of a north-up geographic grid, first row in the south."""
    col, row = np.meshgrid(np.arange(cols) + 0.5, np.arange(rows)[::-1] + 0.5)
    return truth(west + step * col, north - step * row)


@pytest.mark.parametrize("name", list(make_files.SAME))
def test_same_ground(name: str, files: Path, tmp_path: Path) -> None:
    """SPEC G3, G20, G21: the same heights at the same places, within a twentieth of a step of where PROJ says."""
    layer, raster = take(files / name, tmp_path / "raster")
    assert np.array_equal(raster.heights, ground()[::-1].astype(np.float32))
    error = np.hypot(*np.moveaxis(world(layer, raster) - places(ROWS, COLS, STEP, WEST, NORTH), -1, 0)).max()
    assert error <= min(layer.spacing_m) / 20
    assert abs(layer.rotation_deg) < 0.1
    assert (layer.facts.rows, layer.facts.cols, layer.facts.crs) == (ROWS, COLS, "EPSG:4326")
    assert layer.facts.geo


def test_the_net_is_needed(files: Path, tmp_path: Path) -> None:
    """SPEC G20: without it the same file misses by more than a twentieth of a step."""
    layer, raster = take(files / "N19W156.hgt", tmp_path / "raster")
    assert raster.warp is not None
    true = places(121, 121, 1 / 120, -156 - 1 / 240, 20 + 1 / 240)
    flat = world(layer, type("Flat", (), {"heights": raster.heights, "warp": None})())
    with_net = np.hypot(*np.moveaxis(world(layer, raster) - true, -1, 0)).max()
    without = np.hypot(*np.moveaxis(flat - true, -1, 0)).max()
    assert with_net <= min(layer.spacing_m) / 20 < without


@pytest.mark.parametrize("name", ["N19W156.hgt", "N19W156.hgt.zip", "n19_w156.dt0"])
def test_tiles_of_a_degree(name: str, files: Path) -> None:
    """SPEC G3: HGT (its name says where), zipped, and DTED."""
    exam = look(files / name)
    assert exam.report.verdict == "good"
    assert exam.report.at == pytest.approx((19.5, -155.5))
    assert (exam.report.low_m, exam.report.high_m) == (155.0, float(ground(121, 121).max()))


def test_hgt_without_a_place_in_its_name(files: Path, tmp_path: Path) -> None:
    """SPEC G1, G11."""
    path = tmp_path / "unknown.hgt"
    path.write_bytes((files / "N19W156.hgt").read_bytes())
    assert [q.id for q in look(path).report.questions] == ["size"]


def test_overviews_are_not_looked_at(files: Path) -> None:
    """SPEC G3: a COG is as large as its full resolution."""
    report = look(files / "cog.tif").report
    assert (report.format, report.rows, report.cols, report.verdict) == ("GeoTIFF (COG)", 600, 480, "good")


def test_feet_and_scale(files: Path, tmp_path: Path) -> None:
    """SPEC G4: steps of half a foot become metres, and both are said."""
    layer, raster = take(files / "feet.tif", tmp_path / "raster")
    assert np.abs(raster.heights - ground()[::-1]).max() <= 0.25 * 0.3048 + 1e-3
    notes = " ".join(look(files / "feet.tif").report.notes)
    assert "0.5" in notes
    assert "0.3048" in notes
    assert layer.facts.low_m == pytest.approx(155, abs=0.1)


def test_nan_and_infinity(files: Path, tmp_path: Path) -> None:
    """SPEC G5."""
    _, raster = take(files / "nan_inf.tif", tmp_path / "raster")
    holes = np.isnan(raster.heights[::-1])
    expected = np.zeros((ROWS, COLS), bool)
    expected[20:25, 10:20] = expected[3, 4] = expected[5, 6] = True
    assert np.array_equal(holes, expected)
    assert not np.isinf(raster.heights).any()


def test_declared_nodata(files: Path, tmp_path: Path) -> None:
    """SPEC G5: no question about it."""
    assert look(files / "declared.tif").report.verdict == "good"
    _, raster = take(files / "declared.tif", tmp_path / "raster")
    assert np.isnan(raster.heights[::-1][30:34, 20:26]).all()
    assert np.isnan(raster.heights).sum() == 24


@pytest.mark.parametrize("encoding", ["terrarium", "mapbox"])
def test_heights_in_colours(encoding: str, files: Path, tmp_path: Path) -> None:
    """SPEC G9: told apart by themselves, and read to the step."""
    path = files / f"{encoding}.png"
    question = next(q for q in look(path).report.questions if q.id == "encoding")
    assert question.default == encoding
    _, raster = take(path, tmp_path / "raster", c.ImportAnswers(answers={"encoding": encoding}))
    assert np.abs(raster.heights[::-1] - ground(256, 256) * 0.1).max() <= 0.06


def test_a_photograph(files: Path) -> None:
    """SPEC G9."""
    with pytest.raises(ImportRefused, match="picture in colours"):
        look(files / "photograph.png")


def test_headless(files: Path, tmp_path: Path) -> None:
    """SPEC G11: type and shape are asked, the likely ones first; a shape that does not fit is refused."""
    path = files / "heights.r16"
    defaults = {q.id: q.default for q in look(path).report.questions}
    assert defaults["type"] == "uint16 little-endian"
    assert defaults["shape"] == "96 x 64"
    _, raster = take(path, tmp_path / "raster", c.ImportAnswers(answers={"range": "0..100"}))
    raw = (ground(64, 96) * 10).astype(np.uint16).astype(float)
    expected = 100 * (raw - raw.min()) / (raw.max() - raw.min())
    assert np.abs(raster.heights[::-1] - expected).max() < 1e-4
    with pytest.raises(ImportRefused, match="not the"):
        look(path, {"shape": "100 x 64"})


@pytest.mark.parametrize(("order", "flip"), [("north first", True), ("south first", False)])
def test_plain_arrays(order: str, flip: bool, tmp_path: Path) -> None:
    """SPEC G11: NPY does not say which row is the northern one; Fortran order and byte order are no matter."""
    path = tmp_path / "grid.npy"
    np.save(path, np.asfortranarray(ground().astype(">f8")))
    assert {q.id for q in look(path).report.questions} == {"rows", "size"}
    _, raster = take(path, tmp_path / "raster", c.ImportAnswers(answers={"rows": order}))
    assert np.array_equal(raster.heights, (ground()[::-1] if flip else ground()).astype(np.float32))


class _Evil:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return (exec, ("raise SystemExit('unpickled')",))


def test_nothing_is_unpickled(tmp_path: Path) -> None:
    """SPEC G7."""
    path = tmp_path / "evil.npy"
    np.save(path, np.array([[_Evil()] * 8] * 8), allow_pickle=True)
    with pytest.raises(ImportRefused, match="pickled"):
        look(path)


def _zip(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name.replace("__", "/").replace("_dot_", "."), data)
    return path


def test_zip_files(files: Path, tmp_path: Path) -> None:
    """SPEC G7: exactly one grid inside; a .prj beside it names its system; no name inside is ever a path of ours."""
    tif, asc = (files / "little.tif").read_bytes(), (files / "degrees.asc").read_bytes()
    wkt = pyproj.CRS.from_epsg(4326).to_wkt().encode()
    assert look(_zip(tmp_path / "a.zip", **{"../../up.tif": tif})).report.verdict == "good"
    assert look(_zip(tmp_path / "b.zip", **{"x/grid.asc": asc, "x/grid.prj": wkt})).report.verdict == "good"
    assert not (tmp_path.parent / "up.tif").exists()
    for members, reason in [
        ({"a.tif": tif, "b.tif": tif}, "2 elevation files"),
        ({"readme.txt": b"x"}, "no elevation file"),
        ({"inner.tif": _zip(tmp_path / "c.zip", **{"a.tif": tif}).read_bytes()}, "inside a zip"),
    ]:
        with pytest.raises(ImportRefused, match=reason):
            look(_zip(tmp_path / "d.zip", **members))


def test_zip_bombs(tmp_path: Path) -> None:
    """SPEC G7: what a zip file would unpack to is bounded before and while it is unpacked."""
    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bomb.r16", b"\0" * 2_000_000)
    data = bytearray(path.read_bytes())
    at = data.index(b"PK\1\2")
    data[at + 24 : at + 28] = (3 << 30).to_bytes(4, "little")  # declares 3 GiB
    path.write_bytes(bytes(data))
    with pytest.raises(ImportRefused, match="MiB"):
        look(path)
    data[at + 24 : at + 28] = (100).to_bytes(4, "little")  # declares less than it holds
    path.write_bytes(bytes(data))
    with pytest.raises(ImportRefused):
        look(path)


@pytest.mark.parametrize(
    ("head", "reason"),
    [
        (b"<VRTDataset rasterXSize='9'>", "VRT"),
        (b"\xff\xd8\xff\xe0 jpeg", "JPEG"),
        (b"CDF\1", "NetCDF"),
        (b"\x1f\x8b\x08", "gzip"),
        (b"hello", "no format"),
    ],
)
def test_other_formats(head: bytes, reason: str, tmp_path: Path) -> None:
    """SPEC G1, G8: refused by what they are, whatever they are called."""
    path = tmp_path / "grid.tif"
    path.write_bytes(head + b" " * 100)
    with pytest.raises(ImportRefused, match=reason):
        look(path)


def test_parts_in_other_files(tmp_path: Path) -> None:
    """SPEC G8: an IMAGINE file that keeps its samples in another file is refused, with that file there or not."""
    path = tmp_path / "parts.img"
    make_files.write(path, ground(), "HFA", USE_SPILL="YES")
    assert path.with_suffix(".ige").exists()
    for _ in range(2):
        with pytest.raises(ImportRefused):
            look(path)
        path.with_suffix(".ige").unlink(missing_ok=True)


def test_nothing_beside_a_file_is_read(files: Path, tmp_path: Path) -> None:
    """SPEC G8: neither world files nor .aux.xml, which an upload would not have either."""
    path = tmp_path / "heights16.png"
    path.write_bytes((files / "heights16.png").read_bytes())
    (tmp_path / "heights16.pgw").write_text("10\n0\n0\n-10\n500000\n4000000\n")
    (tmp_path / "heights16.png.aux.xml").write_text(
        "<PAMDataset><SRS>EPSG:32610</SRS><PAMRasterBand band='1'><NoDataValue>1550</NoDataValue></PAMRasterBand>"
        "</PAMDataset>"
    )
    beside, alone = look(path).report, look(files / "heights16.png").report
    assert beside == alone


def test_same_bits_each_time(files: Path, tmp_path: Path) -> None:
    """SPEC G25."""
    first, _ = take(files / "rotated.tif", tmp_path / "a", size_m=40_000.0)
    second, _ = take(files / "rotated.tif", tmp_path / "b", size_m=40_000.0)
    assert first == second


def test_npz_with_broken_members(tmp_path: Path) -> None:
    """SPEC G7: an archive of arrays with more than one grid, or with none, is refused by name."""
    two = tmp_path / "two.npz"
    np.savez(two, a=ground(), b=ground())
    none = tmp_path / "none.npz"
    np.savez(none, a=np.arange(5))
    for path in (two, none):
        with pytest.raises(ImportRefused, match="exactly one"):
            look(path)
    buffer = io.BytesIO()
    np.savez(buffer, a=ground())
    cut = tmp_path / "cut.npz"
    cut.write_bytes(buffer.getvalue()[:-300])
    with pytest.raises(ImportRefused, match="broken"):
        look(cut)


@pytest.mark.parametrize("name", ["little.tif", "tiled.tif", "mirrored.tif", "imagine.img", "degrees.asc", "axes.npz"])
@pytest.mark.parametrize("samples", [1, 300])
def test_piece_by_piece(name: str, samples: int, files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC G3: blocks, bands of blocks and strips put together are the whole, flipped or not, and scanned alike."""
    whole, whole_raster = take(files / name, tmp_path / "whole")
    report = look(files / name).report
    for module in (source, gdal_source, ascii_grid):
        monkeypatch.setattr(module, "PIECE_SAMPLES", samples)
    layer, raster = take(files / name, tmp_path / "pieces")
    assert layer == whole
    assert raster.digest == whole_raster.digest
    assert look(files / name).report == report
