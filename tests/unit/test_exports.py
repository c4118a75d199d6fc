"""Files for other programs, read back by others' libraries or by hand (SPEC X1 to X8)."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from PIL import Image

from bench.ground.export import measure_files
from esker import Stroke, Terrain, contract
from esker.api.terrain import default_solver
from esker.cli import main as command_line
from esker.contract import ExportRequest
from esker.exporting import formats, mesh
from esker.exporting.flowmasks import deposits
from esker.exporting.ground import Extent, wear_m
from esker.exporting.resample import resampled
from esker.exporting.water import under_water
from esker.exporting.weights import weights
from esker.flow.rivers import water_of
from esker.flow.water import find_water
from esker.importing.examine import examine
from esker.importing.placement import placing
from esker.importing.placement.fitting import frame
from esker.synthesis.lakes import Lakes, find_lakes

SIZE = 512.0
LEVEL = 2
PLACE = contract.Place(lat_deg=46.5, lon_deg=8.25)


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    made = Terrain(size_m=SIZE)
    made.add(Stroke.profile([(60, 250, 0), (250, 280, 130), (440, 250, 0)], left=(35, 250), right=(45, 250)))
    made.settings = made.settings.model_copy(update={"place": PLACE, "sea_level_m": 4.0, "title": "Föhn/ridge"})
    return made


def exported(terrain: Terrain, folder: Path, name: str, **more: Any) -> Path:
    path = folder / name
    terrain.export(path, **({"level": LEVEL} | more))
    return path


def metres(steps: NDArray[Any], low: float, high: float) -> NDArray[np.float64]:
    """Heights, row 0 south, of a heightmap's steps, row 0 north."""
    return low + steps[::-1].astype(np.float64) * ((high - low) / 65535)


@pytest.mark.parametrize("detail", [False, True])
def test_a_png_holds_the_heights_within_half_a_step(terrain: Terrain, tmp_path: Path, detail: bool) -> None:
    """SPEC X1."""
    path = exported(terrain, tmp_path, "a.png", detail=detail)
    with Image.open(path) as picture:
        steps, told = np.asarray(picture), json.loads(picture.info["Esker"])
        assert picture.info["Description"].startswith("257 x 257 samples, north first: 0 is ")
    heights = terrain.heights(LEVEL, detail=detail)
    assert steps.dtype == np.uint16
    assert (int(steps.min()), int(steps.max())) == (0, 65535)
    off = np.abs(metres(steps, told["low_m"], told["high_m"]) - heights).max()
    assert off <= 0.5001 * (told["high_m"] - told["low_m"]) / 65535
    assert told["spacing_m"] == 2.0
    # Unreal: a sample at scale z % is z / 100 * (step - 32768) / 128 centimetres x 100 above the actor.
    unreal = told["unreal"]
    top = unreal["location_z_cm"] + unreal["scale_z"] * (65535 - 32768) / 128
    assert top / 100 == pytest.approx(told["high_m"], abs=1e-3)
    assert told["unity"]["position_y"] + told["unity"]["height"] == pytest.approx(told["high_m"])


def test_a_raw_file_has_its_range_beside_it(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC X1."""
    path = exported(terrain, tmp_path, "a.r16", detail=False)
    told = json.loads((tmp_path / "a.json").read_text())
    steps = np.fromfile(path, "<u2").reshape(told["samples"])
    off = np.abs(metres(steps, told["low_m"], told["high_m"]) - terrain.heights(LEVEL)).max()
    assert off <= 0.5001 * (told["high_m"] - told["low_m"]) / 65535


@pytest.mark.parametrize("placed", [True, False])
def test_a_geotiff_has_the_heights_at_their_place(terrain: Terrain, tmp_path: Path, placed: bool) -> None:
    """SPEC X2."""
    settings = terrain.settings
    try:
        terrain.settings = settings.model_copy(update={"place": PLACE if placed else None})
        path = exported(terrain, tmp_path, "a.tif", detail=False)
        heights = terrain.heights(LEVEL)
        with rasterio.open(path) as file:
            np.testing.assert_array_equal(file.read(1)[::-1], heights)
            assert file.dtypes == ("float32",)
            assert file.nodata is None
            assert file.tags()["AREA_OR_POINT"] == "Point"
            # The middle of the pixel in the south-west is the terrain's corner.
            assert file.xy(256, 0) == pytest.approx((0.0, 0.0))
            assert file.xy(0, 256) == pytest.approx((SIZE, SIZE))
            if placed:
                assert file.crs == rasterio.CRS.from_wkt(frame(PLACE, SIZE).to_wkt())
                assert file.lnglat() == pytest.approx((8.25, 46.5), abs=1e-9)
            else:
                assert (file.crs.is_geographic, file.crs.is_projected) == (False, False), "nowhere on Earth"
        whole = placing.Terrain(PLACE if placed else None, SIZE)
        report = examine(path, "a.tif", tmp_path, {}, whole, lambda _: None).report
        assert report.verdict == ("good" if placed else "ask")
        if placed:
            assert report.at == pytest.approx((46.5, 8.25), abs=1e-6)
            assert report.spacing_m == pytest.approx((2.0, 2.0))
            assert report.rotation_deg == pytest.approx(0.0, abs=1e-9)
    finally:
        terrain.settings = settings


def test_an_array_is_the_heights(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC X3."""
    path = exported(terrain, tmp_path, "a.npy", detail=True)
    np.testing.assert_array_equal(np.load(path), terrain.heights(LEVEL, detail=True))


def opened(path: Path) -> tuple[dict[str, Any], bytes]:
    """The document and the binary chunk of a .glb file; checks its frame."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert (kind, size % 4) == (b"JSON", 0)
    rest, binary = struct.unpack_from("<I4s", data, 20 + size)
    assert (binary, rest % 4, 28 + size + rest) == (b"BIN\0", 0, len(data))
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def read(document: dict[str, Any], binary: bytes, number: int) -> NDArray[Any]:
    """The values of an accessor."""
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    dtype, width = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]], {"SCALAR": 1, "VEC2": 2, "VEC3": 3}
    count = accessor["count"] * width[accessor["type"]]
    assert view["byteOffset"] % 4 == 0
    assert count * 4 == view["byteLength"]
    assert view["byteOffset"] + view["byteLength"] <= len(binary)
    values = np.frombuffer(binary, dtype, count, view["byteOffset"])
    return values if accessor["type"] == "SCALAR" else values.reshape(accessor["count"], -1)


def test_a_mesh_is_valid_gltf(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC X4."""
    document, binary = opened(exported(terrain, tmp_path, "a.glb", detail=True))
    assert document["asset"]["version"] == "2.0"
    assert document["buffers"][0]["byteLength"] == len(binary)
    part = document["meshes"][0]["primitives"][0]
    position, normal, uv = (read(document, binary, part["attributes"][k]) for k in ("POSITION", "NORMAL", "TEXCOORD_0"))
    accessor = document["accessors"][part["attributes"]["POSITION"]]
    np.testing.assert_array_equal(accessor["min"], position.min(axis=0))
    np.testing.assert_array_equal(accessor["max"], position.max(axis=0))
    corners = read(document, binary, part["indices"]).reshape(-1, 3)
    assert len(corners) == 2 * 256 * 256
    assert corners.max() == len(position) - 1
    heights = terrain.heights(LEVEL, detail=True)
    np.testing.assert_array_equal(position[:, 1].reshape(257, 257), heights)
    assert position[0, [0, 2]].tolist() == [-256.0, 256.0], "the south-west: west is -x, south is +z"
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)
    a, b, c = (position[corners[:, k]].astype(np.float64) for k in range(3))
    face = np.cross(b - a, c - a)
    assert (face[:, 1] > 0).all(), "triangles face up"
    smooth = normal[corners].mean(axis=1)
    assert (np.sum(face * smooth, axis=1) > 0).all(), "normals agree with the triangles"
    assert uv[0].tolist() == [0.0, 1.0]
    image = document["images"][document["textures"][0]["source"]]
    view = document["bufferViews"][image["bufferView"]]
    with Image.open(io.BytesIO(binary[view["byteOffset"] :][: view["byteLength"]])) as picture:
        assert (picture.size, picture.mode) == ((257, 257), "RGB")
    assert document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0}


def test_a_mesh_is_bounded(terrain: Terrain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC X4, X8."""
    monkeypatch.setattr(contract, "EXPORT_MESH_SAMPLES", 129)
    with pytest.raises(ValueError, match="2 to 129 samples a side"):
        exported(terrain, tmp_path, "a.glb", detail=False)
    assert list(tmp_path.iterdir()) == []
    assert mesh.triangles(2, 2).tolist() == [0, 1, 3, 0, 3, 2]


def test_masks_are_the_attributes(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC X5."""
    path = exported(terrain, tmp_path, "a.zip")
    attributes, heights = terrain.attributes(LEVEL), terrain.heights(LEVEL, detail=True)
    with zipfile.ZipFile(path) as archive:
        told = json.loads(archive.read("masks.json"))
        masks = {}
        for name in told["masks"]:
            with Image.open(io.BytesIO(archive.read(name))) as picture:
                assert picture.mode == "L"
                masks[name.removesuffix(".png")] = np.asarray(picture)[::-1]
    assert set(masks) == {"snow", "wetness", "grass", "forest", "water", "wear", "flow", "deposits"}
    worn = np.clip(-attributes["detail"] / wear_m(terrain.settings), 0, 1)
    assert np.abs(masks["wear"] / 255.0 - worn).max() <= 0.5001 / 255
    assert masks["wear"].max() > 0
    for name in ("snow", "wetness", "grass", "forest"):
        assert np.abs(masks[name] / 255.0 - attributes[name]).max() <= 0.5001 / 255
    assert masks["grass"].max() > 0, "there is something to compare"
    np.testing.assert_array_equal(masks["water"] > 0, heights < 4.0)
    assert 0 < (masks["water"] > 0).mean() < 1


def test_masks_of_running_water(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC W51: flow is what drains through a place, by its logarithm; what is laid down lies where water slows."""
    masks = masks_of(exported(terrain, tmp_path, "a.zip"))
    size = terrain.settings.size_m
    water = water_of(terrain.heights(4, detail=True), size, terrain.settings.sea_level_m)
    step = (len(water.area) - 1) // (len(masks["flow"]) - 1)
    area = water.area[::step, ::step]
    share = np.log(area) / np.log(water.area.size)
    assert np.abs(masks["flow"] / 255 - share).max() < 1.01 / 255
    # A steep flank that runs out on a plain: what it brings is left at its foot, not on it.
    y, x = np.mgrid[0:65, 0:65]
    fan = np.where(y > 32, (y - 32) * 400, 0) + y * 4 + np.abs(x - 32) * 30
    laid = deposits(find_water(fan.astype(np.int32)))
    assert laid[28:34, 30:35].max() > 0.8
    assert laid[40:60, 30:35].max() < 0.5
    assert laid.min() >= 0
    assert laid.max() <= 1


def masks_of(path: Path) -> dict[str, NDArray[np.uint8]]:
    """The masks of a .zip, row 0 south."""
    with zipfile.ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.endswith(".png")]
        assert json.loads(archive.read("masks.json"))["masks"] == names
        return {name[:-4]: np.asarray(Image.open(io.BytesIO(archive.read(name))))[::-1] for name in names}


def test_masks_that_sum_to_one(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC X380: at every sample, each within a step of its part of what those above it leave."""
    plain = masks_of(exported(terrain, tmp_path, "a.zip"))
    summed = masks_of(exported(terrain, tmp_path, "b.zip", weights=True))
    assert set(summed) == {*plain, "ground"} - {"wear", "flow", "deposits"}
    assert max(mask.max() for mask in (summed["ground"], summed["grass"])) > 128, "there is something to share out"
    np.testing.assert_array_equal(sum(mask.astype(int) for mask in summed.values()), 255)
    assert np.sum([mask.astype(int) for name, mask in plain.items() if name in summed], axis=0).max() > 255
    left = np.ones(summed["ground"].shape)
    for name in ("water", "snow", "forest", "grass", "wetness"):
        assert np.abs(summed[name] / 255 - left * plain[name] / 255).max() < 1.001 / 255
        left *= 1 - plain[name] / 255
    assert np.abs(summed["ground"] / 255 - left).max() < 1.001 / 255


def test_any_masks_can_be_made_to_sum_to_one() -> None:
    """SPEC X380: all of everything at once, nothing at all, and every value between."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        few = rng.integers(0, 256, size=(5, 4, 64)) * rng.integers(0, 2, size=(5, 1, 64)) | 255 * rng.integers(0, 2, 64)
        found = weights(dict(zip(("grass", "snow", "water", "wetness", "forest"), few.astype(np.uint8), strict=True)))
        np.testing.assert_array_equal(sum(mask.astype(int) for mask in found.values()), 255)


def test_only_masks_sum_to_one(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC X380, X8."""
    with pytest.raises(ValueError, match="Only masks"):
        exported(terrain, tmp_path, "a.tif", weights=True)
    assert list(tmp_path.iterdir()) == []
    assert "Only masks" in formats.refusal(ExportRequest(format="npy", weights=True))
    assert not formats.refusal(ExportRequest(format="masks", weights=True))


def inside_lake(lakes: Lakes, x: float, y: float, lake: float) -> float:
    """The twin: ``inside_lake`` of shaders/wgsl/water/lakes.wgsl at a place in samples of the lakes' lattice."""
    n = len(lakes.levels)
    i, j = min(int(y), n - 2), min(int(x), n - 2)
    sides, covered, shore = [], False, True
    for dy, dx in ((0, 0), (0, 1), (1, 0), (1, 1)):
        level, ground = float(lakes.levels[i + dy, j + dx]), float(lakes.heights[i + dy, j + dx])
        covers = level == lake and ground < lake
        covered, shore = covered or covers, shore and level == lake
        sides.append(lake - ground if covers else ground - lake)
    if not (covered or shore):
        return -1.0
    fx, fy = x - j, y - i
    south, north = sides[0] + (sides[1] - sides[0]) * fx, sides[2] + (sides[3] - sides[2]) * fx
    return south + (north - south) * fy


def test_water_stands_in_basins_and_in_the_sea() -> None:
    """SPEC X5: two craters, one on the flank of the other, beside a sea."""
    y, x = np.mgrid[0:1:65j, 0:1:65j]
    far = np.hypot(x - 0.4, y - 0.5), np.hypot(x - 0.75, y - 0.6)
    ground = np.maximum(60 - 150 * np.abs(far[0] - 0.2), 40 - 200 * np.abs(far[1] - 0.12)).astype(np.float32)
    lakes = find_lakes(ground, 4.0, 2.0, sea_m=5.0)
    assert len(lakes.samples) == 2
    u = np.arange(190) * 64 / 189
    rows, columns = np.minimum(u.astype(int), 63), np.minimum(u.astype(int), 63)
    fine = (ground[rows][:, columns] + np.sin(np.arange(190)) * 1.5).astype(np.float32)
    wet = under_water(fine, u, u, lakes, 5.0)
    twin = fine < 5.0
    for r in range(190):
        for c in range(190):
            i, j = rows[r], columns[c]
            lake = float(lakes.levels[i : i + 2, j : j + 2].max())
            twin[r, c] |= lake > contract.NO_LAKE and fine[r, c] < lake and inside_lake(lakes, u[c], u[r], lake) > 0
    np.testing.assert_array_equal(wet, twin)
    assert 0.05 < (wet & (fine >= 5.0)).mean() < 0.5
    np.testing.assert_array_equal(under_water(fine, u, u, None, None), False)


def keys(values: NDArray[np.float64], at: float) -> float:
    """The twin: cubic convolution (Keys 1981) of a row at a fractional index, by the kernel itself."""
    n = len(values)

    def value(i: int) -> float:
        if i < 0:
            return float(3 * values[0] - 3 * values[1] + values[2])
        return float(3 * values[-1] - 3 * values[-2] + values[-3] if i >= n else values[i])

    def kernel(x: float) -> float:
        x = abs(x)
        if x <= 1:
            return 1.5 * x**3 - 2.5 * x**2 + 1
        return -0.5 * x**3 + 2.5 * x**2 - 4 * x + 2 if x < 2 else 0.0

    first = min(int(at), n - 2)
    return sum(value(i) * kernel(at - i) for i in range(first - 1, first + 3))


@pytest.mark.parametrize("wanted", [30, 40])
def test_a_few_samples_less(wanted: int) -> None:
    """SPEC X6; more too, where samples lie in the outermost cells."""
    rng = np.random.default_rng(7)
    grid = rng.normal(size=(33, 33)).astype(np.float32)
    found, step = resampled(grid, wanted), 32 / (wanted - 1)
    rows = np.array([[keys(column, i * step) for column in grid.T.astype(np.float64)] for i in range(wanted)])
    twin = np.array([[keys(row, j * step) for j in range(wanted)] for row in rows])
    np.testing.assert_allclose(found, twin, atol=5e-6)
    corners = np.ix_([0, -1], [0, -1])
    np.testing.assert_array_equal(found[corners], grid[corners])
    y, x = np.mgrid[0:1:65j, 0:1:65j]
    v, u = np.mgrid[0:1:61j, 0:1:61j]
    quadratic = (x * x - 2 * x * y + 3 * y * y + x).astype(np.float32)
    np.testing.assert_allclose(resampled(quadratic, 61), u * u - 2 * u * v + 3 * v * v + u, atol=2e-6)


def test_a_landscape_of_unreal(terrain: Terrain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC X6, X5: heights and masks have the same samples."""
    monkeypatch.setitem(contract.EXPORT_LEVELS, "253", LEVEL)
    heights = np.load(exported(terrain, tmp_path, "a.npy", detail=False, level=None, samples=253))
    np.testing.assert_array_equal(heights, resampled(terrain.heights(LEVEL), 253))
    with zipfile.ZipFile(exported(terrain, tmp_path, "a.zip", level=None, samples=253)) as archive:
        told = json.loads(archive.read("masks.json"))
        assert (told["samples"], told["spacing_m"]) == ([253, 253], SIZE / 252)


def test_a_window_lies_at_its_place(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC X7."""
    corners = (100.0, 200.0, 180.0, 230.0)
    for detail in (False, True):
        wanted = terrain.window(3, *corners, detail=detail)
        path = exported(terrain, tmp_path, "a.tif", level=3, window=corners, detail=detail)
        with rasterio.open(path) as file:
            np.testing.assert_array_equal(file.read(1)[::-1], wanted.heights)
            assert file.xy(file.height - 1, 0) == pytest.approx((100.0, 200.0))


@pytest.mark.parametrize(
    ("name", "more", "says"),
    [
        ("a.obj", {}, "exports are .png"),
        ("a.npy", {"samples": 1000, "level": None}, "samples a side must be one of"),
        ("a.npy", {"samples": 1025, "level": 4}, "not both"),
        ("a.npy", {"level": 7}, "level must be 0..6"),
        ("a.npy", {"samples": 1025, "level": None, "window": (0, 0, 1, 1)}, "by level"),
        ("a.npy", {"window": (600, 600, 700, 700)}, "no sample"),
    ],
)
def test_what_cannot_be_written_is_refused(
    terrain: Terrain, tmp_path: Path, name: str, more: dict[str, Any], says: str
) -> None:
    """SPEC X8."""
    with pytest.raises(ValueError, match=says):
        exported(terrain, tmp_path, name, **more)
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_whole_or_not_there(terrain: Terrain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC X8."""

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numpy.save", full)
    with pytest.raises(OSError, match="No space"):
        exported(terrain, tmp_path, "a.npy", detail=False)
    assert list(tmp_path.iterdir()) == []


def test_every_export_of_the_page_has_an_estimate() -> None:
    """SPEC X30."""
    for kind in formats.FORMATS:
        sizes = [int(n) for n in contract.EXPORT_LEVELS]
        options = [ExportRequest(format=kind, samples=n) for n in sizes]
        fine = [w for w in options if not formats.refusal(w)]
        assert [w.samples for w in options if w not in fine] == ([n for n in sizes if n > formats.FORMATS[kind].most])
        costs = [formats.estimate(w) for w in fine]
        assert [c.bytes for c in costs] == sorted(c.bytes for c in costs)
        assert all(c.seconds > 0 for c in costs)
    assert formats.refusal(ExportRequest(format="npy", samples=1000))
    for samples, level in contract.EXPORT_LEVELS.items():
        assert 0.9 * (64 * 2**level + 1) < int(samples) <= 64 * 2**level + 1
        assert Extent.of(None, int(samples)).level == level


def test_estimates_are_near_what_files_are() -> None:
    """SPEC X30: on a real scene, within a factor of two; it is also what ``esker bench export`` measures."""
    found = measure_files(default_solver(), [257])
    assert set(found) == {
        f"{kind}_257{detail}"
        for kind, form in formats.FORMATS.items()
        for detail in (["_detail"] if form.covers else ["", "_detail"])
    }
    for kind in formats.FORMATS:
        told = formats.estimate(ExportRequest(format=kind, samples=257)).bytes
        assert 0.5 < found[f"{kind}_257_detail"]["bytes"] / told < 2.0


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """SPEC X8, X24: the command line makes the same file."""
    made = Terrain(size_m=SIZE)
    made.add(Stroke.profile([(60, 250, 0), (440, 250, 90)], left=(35, 250), right=(45, 250)))
    made.save(tmp_path / "a.esker")
    out = tmp_path / "a.npy"
    args = ["export", str(tmp_path / "a.esker"), "-o", str(out), "--level", "1", "--no-detail"]
    assert command_line.main([*args, "-q"]) == 0
    np.testing.assert_array_equal(np.load(out), made.heights(1))
    assert command_line.main(["export", str(tmp_path / "none.esker"), "-o", str(out)]) == 1
    assert "There is no file" in capsys.readouterr().err
    for name, more, says in (("a.obj", [], "exports are .png"), ("a.tif", ["--weights"], "Only masks")):
        with pytest.raises(SystemExit):
            command_line.main(["export", str(tmp_path / "a.esker"), "-o", str(tmp_path / name), *more])
        assert says in capsys.readouterr().err
    masks = tmp_path / "a.zip"
    assert command_line.main([*args[:2], "-o", str(masks), "--level", "1", "--weights", "-q"]) == 0
    np.testing.assert_array_equal(sum(mask.astype(int) for mask in masks_of(masks).values()), 255)
