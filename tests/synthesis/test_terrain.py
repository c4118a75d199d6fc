"""Detail of real terrains: what the wire says, the Python API, the command (SPEC F17, F18)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from esker import Stroke, Terrain, contract, grid
from esker.cli import solve
from esker.contract import DEFAULT_LEVEL, Channel, PaintChannel
from esker.document import archive
from esker.solve.detail import settle
from esker.solve.solver import Solver
from esker.synthesis import detailed
from esker.synthesis.detailed import DetailedTerrain, on_the_wire, site_of
from esker.synthesis.interpolate import Window
from esker.synthesis.site import Site, extended
from esker.synthesis.subdivide import interpolated
from esker.tiles.channels import ChannelPyramid, values
from esker.tiles.pyramid import quantise
from tests.synthesis.sites import SIZE, heights

RIDGE = [(500, 1000, 0), (2000, 2200, 900), (3500, 2900, 0)]
WHERE = (2000.0, 2150.0, 2040.0, 2200.0)


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    out = Terrain(size_m=SIZE)
    out.add(Stroke.profile(RIDGE, left=(40, 900), right=(45, 700), amplitude_m=12.0, roughness=0.7))
    return out


@pytest.mark.parametrize("size", [4096.0, 1000.0, 65536.0])
@pytest.mark.parametrize("level", [0, 2])
def test_guides_are_what_clients_decode(size: float, level: int) -> None:
    """SPEC F17."""
    z = heights(level, size) + np.random.default_rng(1).normal(0, 1, heights(level).shape).astype(np.float32)
    samples = quantise(z, level, size)
    q = grid.quantum(level, size)
    assert np.array_equal(on_the_wire(z, level, size), (samples.astype(np.float64) * q).astype(np.float32))
    assert np.abs(on_the_wire(z, level, size) - z).max() <= 0.51 * q
    under = (0.7 * np.roll(z, 5, axis=0)).astype(np.float32)
    both = (samples + quantise(under, level, size)).astype(np.float64) * q
    assert np.array_equal(on_the_wire(z, level, size, under), both.astype(np.float32))
    if level == 0:
        terrain = contract.TerrainSettings(size_m=size)
        assert np.array_equal(site_of(terrain, z, {}, base=(under,)).guides[0], both.astype(np.float32))


def test_channels_are_what_clients_decode(terrain: Terrain) -> None:
    """SPEC F17."""
    solver = Solver()
    settled = settle(solver, terrain.strokes, terrain.settings, 3)
    site = site_of(terrain.settings, settled.basis.heights, settled.channels)
    assert site.solved == 3
    for channel in (Channel.AMPLITUDE, Channel.ROUGHNESS):
        name = channel.name.lower()
        given = settled.channels[name]
        pyramid = ChannelPyramid(channel, 3)
        pyramid.settle(1, pyramid.levels, given)
        level = pyramid.level(pyramid.levels)
        assert level is not None
        assert np.array_equal(site.channels[name], values(level.samples, channel))
        assert site.channels[name].std() > 0


def test_heights_are_base_and_detail(terrain: Terrain) -> None:
    """SPEC F18."""
    solved = terrain.heights(DEFAULT_LEVEL)
    for level in (2, DEFAULT_LEVEL):
        jump = 1 << (DEFAULT_LEVEL - level)
        with_detail, attributes = terrain.heights(level, detail=True), terrain.attributes(level)
        n = grid.samples(level)
        assert set(attributes) == {"detail", "smoothness", "snow", "wetness", "grass", "forest", "foam"}
        assert all(a.shape == (n, n) and a.dtype == np.float32 for a in (with_detail, *attributes.values()))
        base = on_the_wire(np.ascontiguousarray(solved[::jump, ::jump]), level, SIZE)
        assert np.array_equal(with_detail, base + attributes["detail"])
        assert 5 < np.abs(attributes["detail"]).max() < 120
        assert not with_detail.flags.writeable
        assert terrain.heights(level, True) is with_detail


def test_windows_are_the_whole_and_go_on_to_the_centimetre(terrain: Terrain) -> None:
    """SPEC F18."""
    whole = terrain.heights(DEFAULT_LEVEL, detail=True)
    part = terrain.window(DEFAULT_LEVEL, *WHERE, detail=True)
    row, col = round(part.y_m / part.spacing_m), round(part.x_m / part.spacing_m)
    rows, cols = part.heights.shape
    assert np.array_equal(part.heights, whole[row : row + rows, col : col + cols])
    assert np.array_equal(part.attributes["snow"], terrain.attributes()["snow"][row : row + rows, col : col + cols])
    assert not terrain.window(DEFAULT_LEVEL, *WHERE).attributes
    done: list[float] = []
    near = terrain.window(13, 2010, 2180, 2011, 2180.5, detail=True, progress=done.append)
    assert near.spacing_m <= 0.01
    assert near.heights.shape == (65, 129)
    assert done[-1] == 1
    coarse = terrain.window(9, 2010, 2180, 2011, 2180.5, detail=True)
    assert np.abs(near.heights[::16, ::16] - coarse.heights).max() < 1.0
    with pytest.raises(ValueError, match=r"0\.\.13"):
        terrain.window(14, 0, 0, 1, 1, detail=True)


def test_the_base_is_refined_as_a_server_refines_and_interpolated_beyond(terrain: Terrain) -> None:
    """SPEC F18."""
    refined = terrain.window(6, *WHERE)
    shown = terrain.window(6, *WHERE, detail=True)
    base = shown.heights - shown.attributes["detail"]
    assert np.abs(base - refined.heights).max() <= 0.51 * grid.quantum(6, SIZE) + 1e-4
    beyond = terrain.window(6, *WHERE, detail=True, refined_level=5)
    assert np.array_equal(beyond.attributes["detail"], shown.attributes["detail"])
    assert not np.array_equal(beyond.heights, shown.heights)


def test_a_refined_base_is_held_like_tiles_hold_it() -> None:
    """SPEC F18: integers of its level, point-symmetric beyond the domain, interpolated from there on."""
    fine = heights(5)
    asked: list[tuple[int, slice, slice]] = []

    def refine(level: int, rows: slice, cols: slice) -> Any:
        asked.append((level, rows, cols))
        return fine[rows, cols] + np.float32(0.3 * grid.quantum(level, SIZE))

    terrain = DetailedTerrain(Site(SIZE, 1, (heights(0), heights(1))), refine=refine, finest=5)
    n = grid.samples(5)
    for r, c in ((-2, n - 30), (n // 2, 11), (n - 20, -2)):
        window = Window(5, r, r + 22, c, c + 32)
        wanted = extended(fine, window)
        assert np.array_equal(terrain.base(window), wanted)
        child = Window(6, 2 * r + 4, 2 * r + 30, 2 * c + 4, 2 * c + 40)
        parent = child.parent()
        found = terrain.base(child)
        assert np.allclose(found, interpolated(extended(fine, parent).astype(np.float64), parent, child), atol=1e-4)
    for narrow in (Window(5, -2, 0, -2, -1), Window(5, n, n + 2, n + 1, n + 2), Window(5, -1, 1, n - 1, n + 1)):
        assert np.array_equal(terrain.base(narrow), extended(fine, narrow))
    for level, rows, cols in asked:
        assert level == 5
        assert 0 <= rows.start < rows.stop <= n
        assert 0 <= cols.start < cols.stop <= n
        assert (rows.stop - rows.start) * (cols.stop - cols.start) < 2000


def test_memory_is_bounded_by_bands(monkeypatch: pytest.MonkeyPatch, terrain: Terrain) -> None:
    """SPEC F18: in whatever pieces it is made."""
    made = terrain.window(5, 1900, 2100, 2100, 2200, detail=True)
    monkeypatch.setattr(detailed, "BAND_SAMPLES", 500)
    again = Terrain.from_document(terrain.document).window(5, 1900, 2100, 2100, 2200, detail=True)
    assert np.array_equal(made.heights, again.heights)
    assert all(np.array_equal(made.attributes[name], again.attributes[name]) for name in made.attributes)


def test_heights_alone_are_those_of_the_window(monkeypatch: pytest.MonkeyPatch, terrain: Terrain) -> None:
    """SPEC F561: to the bit, in bands, on a solved level and on one that nobody solved; the same slices are refused."""
    monkeypatch.setattr(detailed, "BAND_SAMPLES", 1 << 12)
    made = DetailedTerrain(site_of(terrain.settings, terrain.heights(2), {}))
    shares: list[float] = []
    for level in (2, 4):
        rows, cols = slice(40, 190), slice(7, 90)
        alone = made.heights(level, rows, cols, shares.append)
        assert np.array_equal(alone, made.window(level, rows, cols).heights)
    assert shares[-1] == 1
    assert len(shares) > 4
    with pytest.raises(ValueError, match="level 2 has samples"):
        made.heights(2, slice(0, 300), slice(0, 3))


def test_what_changes_is_made_anew(terrain: Terrain) -> None:
    other = Terrain.from_document(terrain.document)
    other.settings = other.settings.model_copy(update={"rule": "plain", "look": "alpine"})
    assert not other.attributes(2)["detail"].any()
    assert np.mean(other.attributes(2)["snow"]) > np.mean(terrain.attributes(2)["snow"])
    other.settings = other.settings.model_copy(update={"rule": "landscape", "seed": 9})
    assert not np.array_equal(other.heights(2, detail=True), terrain.heights(2, detail=True))
    for level in (-1, 7):
        with pytest.raises(ValueError, match="level"):
            terrain.heights(level, detail=True)
    with pytest.raises(ValueError, match="refined"):
        terrain.attributes(2, refined_level=11)


def test_the_numpy_solver_makes_the_same(terrain: Terrain) -> None:
    other = Terrain(size_m=SIZE, solver=Solver("numpy"))
    for stroke in terrain.strokes:
        other.add(stroke)
    mine = terrain.window(3, *WHERE, detail=True, global_level=2)
    twin = other.window(3, *WHERE, detail=True, global_level=2)
    assert np.abs(mine.heights - twin.heights).max() <= 2 * grid.quantum(2, SIZE)


def test_the_command_writes_heights_and_attributes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], terrain: Terrain
) -> None:
    """SPEC F18."""
    file, out, more = tmp_path / "t.esker", tmp_path / "h.npy", tmp_path / "a.npz"
    file.write_bytes(archive.dumps(terrain.document))
    corners = [str(v) for v in WHERE]
    options = ["--level", "9", "--attributes", str(more), "--window", *corners]
    assert solve.main([str(file), "-o", str(out), *options]) == 0
    said = capsys.readouterr().err
    assert "level 4 (1025 x 1025) settled" in said
    assert "heights with detail" in said
    wanted = terrain.window(9, *WHERE, detail=True)
    assert np.array_equal(np.load(out), wanted.heights)
    with np.load(more) as attributes:
        shapes = {name: attributes[name].shape for name in attributes}
        assert shapes == dict.fromkeys(wanted.attributes, wanted.heights.shape)
        assert np.array_equal(attributes["snow"], wanted.attributes["snow"])
    assert solve.main([str(file), "-o", str(out), "--level", "2", "--detail", "-q"]) == 0
    assert capsys.readouterr().err == ""
    assert np.array_equal(np.load(out), terrain.heights(2, detail=True))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--level", "14", "--detail", "--window", "0", "0", "9", "9"], "0..13"),
        (["--level", "3", "--detail", "--window", "0.1", "0.1", "0.2", "0.2"], "No sample"),
        (["--attributes", "a.txt"], "not as '.txt'"),
    ],
)
def test_the_command_says_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], terrain: Terrain, arguments: list[str], words: str
) -> None:
    file, out = tmp_path / "t.esker", tmp_path / "h.npy"
    file.write_bytes(archive.dumps(terrain.document))
    assert solve.main([str(file), "-o", str(out), "-q", *arguments]) == 1
    assert words in capsys.readouterr().err
    assert not out.exists()
    with pytest.raises(SystemExit):
        solve.main([str(file), "-o", str(out), "--level", "12", "--window", "0", "0", "9", "9"])
    assert "--detail" in capsys.readouterr().err


def test_what_is_painted_is_there(terrain: Terrain) -> None:
    """SPEC F12, F18: along the line in the attributes, far away not at all, and no base height moves."""
    painted = Terrain.from_document(terrain.document)
    low, high = (1000.0, 3200.0), (1700.0, 3400.0)
    asked: dict[PaintChannel, float] = {"snow": 1.0, "forest": -1.0, "amplitude": -1.0}
    for channel, value in asked.items():
        painted.add(Stroke.paint([low, high], channel=channel, value=value, radius_m=120.0))
    level = 4
    before, after = terrain.attributes(level), painted.attributes(level)
    s = grid.spacing(level, SIZE)
    on = round(0.5 * (low[1] + high[1]) / s), round(0.5 * (low[0] + high[0]) / s)
    assert after["snow"][on] > 0.97 > 0.3 > before["snow"][on]
    assert after["forest"][on] < 0.03 < before["forest"][on]
    near = np.s_[on[0] - 4 : on[0] + 5, on[1] - 4 : on[1] + 5]
    finest_octaves = [np.abs(np.diff(a["detail"][near], 2, axis=0)).mean() for a in (before, after)]
    assert finest_octaves[1] < 0.2 * finest_octaves[0]
    base = [t.heights(level, detail=True) - a["detail"] for t, a in ((terrain, before), (painted, after))]
    assert np.abs(base[1] - base[0]).max() < 1e-3
    far = np.s_[: round(800 / s), round(3000 / s) :]
    for name in before:
        assert np.abs(after[name][far] - before[name][far]).max() < 1e-3
