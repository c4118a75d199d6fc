"""Elevation layers in the Python API (SPEC PW: ``Terrain.add_grid`` and its like)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import Stroke, Terrain, contract, grid
from esker.api.layers import Sample
from esker.document import archive
from esker.synthesis.detailed import on_the_wire

SIZE = 1024.0
LEVEL = 2


def hills(rows: int = 90, cols: int = 80, spacing: float = 14.0) -> NDArray[np.float64]:
    """Smooth ground that a bicubic patch follows."""
    y, x = np.mgrid[0:rows, 0:cols] * spacing
    return np.asarray(500 + 60 * np.sin(x / 170) * np.cos(y / 210) + 0.05 * x)


def true(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same at places of the grid laid at (-20, -30) without a turn."""
    x, y = (points - [-20.0, -30.0]).T
    return np.asarray(500 + 60 * np.sin(x / 170) * np.cos(y / 210) + 0.05 * x)


@pytest.fixture
def terrain() -> Terrain:
    out = Terrain(size_m=SIZE)
    out.add_grid(hills(), anchor=(-20.0, -30.0), spacing=14.0, accuracy=0.5, name="hills", source="a formula")
    return out


def lattice(level: int) -> NDArray[np.float64]:
    t = np.arange(grid.samples(level)) * grid.spacing(level, SIZE)
    x, y = np.meshgrid(t, t)
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def test_heights_are_those_of_the_grid(terrain: Terrain) -> None:
    """Without strokes the ground is the data; hidden or removed layers leave the blank sheet, exactly."""
    z = terrain.heights(LEVEL)
    assert z.dtype == np.float32
    assert not z.flags.writeable
    assert np.abs(z.ravel() - true(lattice(LEVEL))).max() < 0.25 * grid.spacing(LEVEL, SIZE) + 0.5
    assert terrain.heights(LEVEL) is z
    (layer,) = terrain.layers
    terrain.set_grid(layer.id, name="other", outline=1.0)
    assert terrain.heights(LEVEL) is z
    terrain.set_grid(layer.id, hidden=True)
    assert not terrain.heights(LEVEL).any()
    terrain.set_grid(layer.id, hidden=False)
    assert np.array_equal(terrain.heights(LEVEL), z)
    terrain.set_grid(layer.id, lift_m=10.0)
    assert np.abs(terrain.heights(LEVEL) - z - 10).max() < 1e-3
    terrain.remove_grid(layer.id)
    assert not terrain.heights(LEVEL).any()
    assert terrain.layers == ()
    assert dict(terrain.grids) == {}


def test_samples_have_derivatives(terrain: Terrain) -> None:
    """Height, gradient and curvature anywhere, of one smooth surface."""
    points = np.random.default_rng(1).uniform(60, SIZE - 60, (200, 2))
    heights = terrain.sample(points)
    assert isinstance(heights, np.ndarray)
    assert np.abs(heights - true(points)).max() < 0.01
    found = terrain.sample(points, derivatives=True)
    assert isinstance(found, Sample)
    assert np.array_equal(found.heights, heights)
    h = 0.5
    for axis in range(2):
        step = np.eye(2)[axis] * h
        slope = (true(points + step) - true(points - step)) / (2 * h)
        bend = (true(points + step) - 2 * true(points) + true(points - step)) / h**2
        assert np.abs(found.gradient[:, axis] - slope).max() < 2e-3
        assert np.abs(found.hessian[:, 2 * axis] - bend).max() < 2e-4
    assert found.slope_deg.max() < 45
    north = Sample(np.zeros(3), np.array([[0.0, -1.0], [0.0, 0.0], [1.0, 0.0]]), np.tile([2.0, 0.0, 2.0], (3, 1)))
    assert north.aspect_deg[0] == 0
    assert np.isnan(north.aspect_deg[1])
    assert north.aspect_deg[2] == 270
    assert north.slope_deg[0] == pytest.approx(45)
    assert north.mean_curvature[1] == pytest.approx(2)
    assert north.gaussian_curvature[1] == pytest.approx(4)
    blank = Terrain(SIZE).sample(points, derivatives=True)
    assert isinstance(blank, Sample)
    assert not any(part.any() for part in blank)


def test_strokes_stand_on_the_ground(terrain: Terrain) -> None:
    """A crest is at its own height, far from it the data stay."""
    before = terrain.heights(LEVEL)
    terrain.add(Stroke.profile([(300, 500, 640), (500, 520, 660), (700, 500, 640)], left=(40, 120), right=(40, 120)))
    after = terrain.heights(LEVEL)
    crest = round(510 / grid.spacing(LEVEL, SIZE)), round(500 / grid.spacing(LEVEL, SIZE))
    assert abs(after[crest] - 660) < 12
    assert np.abs(after - before)[-20:].max() < 0.1
    window = terrain.window(LEVEL, 400, 400, 600, 600)
    row, col = round(window.y_m / window.spacing_m), round(window.x_m / window.spacing_m)
    rows, cols = window.heights.shape
    assert np.abs(window.heights - after[row : row + rows, col : col + cols]).max() < 0.05


def test_detail_begins_below_the_data(terrain: Terrain) -> None:
    """SPEC F19: levels down to the data's spacing have none; the guide is what the wire says of both parts."""
    made, attributes = terrain.heights(0, detail=True), terrain.attributes(0)
    assert not attributes["detail"].any()
    assert np.array_equal(made, on_the_wire(terrain.heights(0), 0, SIZE))
    assert grid.spacing(0, SIZE) > 14.0 > grid.spacing(3, SIZE)
    assert terrain.attributes(3)["detail"].any()


def test_files_keep_grids(terrain: Terrain, tmp_path: Path) -> None:
    """Saved and loaded: the same heights, to the bit; a document alone does not do."""
    terrain.add_grid(hills()[::-1] + 40, spacing=(6.0, 7.0), rotation=27.0, accuracy=0.1)
    terrain.save(tmp_path / "a.esker")
    again = Terrain.load(tmp_path / "a.esker")
    assert again.layers == terrain.layers
    assert np.array_equal(again.heights(LEVEL), terrain.heights(LEVEL))
    with pytest.raises(ValueError, match="not at hand"):
        Terrain.from_document(terrain.document)
    assert Terrain.from_document(terrain.document, terrain.grids).layers == terrain.layers
    other = dict.fromkeys(terrain.grids, terrain.grids[terrain.layers[0].content])
    damaged = archive.dumps(terrain.document, other)
    (tmp_path / "b.esker").write_bytes(damaged)
    with pytest.raises(archive.ArchiveError):
        Terrain.load(tmp_path / "b.esker")


def test_what_cannot_be_laid_is_refused() -> None:
    terrain = Terrain(SIZE)
    for wrong, words in (
        ({"spacing": None}, "spacing"),
        ({"spacing": (1.0, 2.0, 3.0)}, "spacing"),
        ({"spacing": -1.0}, "spacing_m"),
        ({"spacing": 5.0, "accuracy": float("nan")}, "accuracy must be"),
        ({"spacing": 5.0, "anchor": (1e9, 0.0)}, "anchor"),
    ):
        with pytest.raises(ValueError, match=words):
            terrain.add_grid(hills(), **wrong)
    with pytest.raises(ValueError, match="no data"):
        terrain.add_grid(np.full((20, 20), np.nan), spacing=5.0)
    with pytest.raises(ValueError, match="grid"):
        terrain.add_grid(np.zeros(20), spacing=5.0)
    with pytest.raises(FileNotFoundError):
        terrain.add_grid("no such file.tif")
    with pytest.raises(ValueError, match="shape"):
        terrain.sample(np.zeros((3, 3)))
    with pytest.raises(KeyError):
        terrain.remove_grid("nobody")
    assert terrain.layers == ()


def test_a_grid_without_an_anchor_lies_in_the_middle_and_counts_last() -> None:
    terrain = Terrain(SIZE)
    first = terrain.add_grid(hills(), spacing=5.0, rotation=33.0)
    terrain.add_grid(hills() + 100, spacing=5.0)
    layers = {layer.id: layer for layer in terrain.layers}
    a = np.radians(33.0)
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    middle = np.array(layers[first].anchor) + turn @ (np.array([79, 89]) * 5.0 / 2)
    assert np.abs(middle - SIZE / 2).max() < 1e-6
    assert [layer.priority for layer in terrain.layers] == [0, 1]
    assert layers[first].accuracy_m == pytest.approx(0.5)
    assert terrain.sample([[SIZE / 2, SIZE / 2]])[0] > 590


def test_a_file_brings_its_place(tmp_path: Path) -> None:
    """A plain array in a file is read by a process of its own and says what it leaves open."""
    np.save(tmp_path / "hills.npy", hills().astype(np.float32))
    terrain = Terrain(SIZE)
    with pytest.raises(ValueError, match="leaves something open"):
        terrain.add_grid(tmp_path / "hills.npy")
    (tmp_path / "empty.tif").write_bytes(b"")
    with pytest.raises(ValueError, match="empty"):
        terrain.add_grid(tmp_path / "empty.tif")
    assert terrain.layers == ()
    assert contract.MAX_LAYERS > 0
