"""Trees, rocks and tufts of pictures: where they stand, and that they stay (SPEC R612, R613)."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from esker.contract import TerrainSettings
from esker.render import instances, stands
from esker.render.camera import Camera, look_at
from esker.render.frame import Scene
from esker.render.instances import Instances
from esker.render.programs import Resources
from esker.render.reference import Reference
from esker.render.surface import Surface
from esker.synthesis.detailed import DetailedTerrain
from esker.synthesis.site import Site
from tests.render.ground import rough_levels

SIZE = 4096.0
SETTINGS = TerrainSettings(size_m=SIZE)
Found = dict[str, NDArray[np.float64]]
"""By sort: (n, 12) floats of each instance, the place in the world first."""
KIND_OF = {"tree": stands.TREE, "impostor": stands.TREE, "rock": stands.ROCK, "tuft": stands.TUFT}


@pytest.fixture(scope="module")
def surface() -> Surface:
    levels = [0.25 * z + 120 for z in rough_levels(3, SIZE, octaves=5)]
    return Surface.of(DetailedTerrain(Site(SIZE, 3, tuple(levels))), 12)


@dataclass
class Watch:
    """What the last picture found."""

    found: Found


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch) -> Watch:
    """The instances of each picture, in the world."""
    seen, find = Watch({}), Instances.find

    def watched(
        self: Instances, resources: Resources, records: moderngl.Buffer, count: int, size_m: float
    ) -> list[moderngl.Buffer]:
        buffers = find(self, resources, records, count, size_m)
        for sort, buffer in zip(instances.SORTS, buffers, strict=True):
            n = self.counts[sort.name]
            data = np.frombuffer(buffer.read(), dtype="<f4").astype(np.float64)
            seen.found[sort.name] = data[: instances.FLOATS * n].reshape(n, instances.FLOATS)
        return buffers

    monkeypatch.setattr(Instances, "find", watched)
    return seen


def view(surface: Surface, x: float, y: float, up: float, ahead: tuple[float, float]) -> Camera:
    """An eye over a place that looks at another one on the ground."""
    z = surface.height_at(x, y, surface.levels)
    tx, ty = x + ahead[0], y + ahead[1]
    return look_at((x, y, z + up), (tx, ty, surface.height_at(tx, ty, surface.levels)), SIZE, 160, 100)


def picture(drawer: Reference, surface: Surface, camera: Camera, tau: float = 2.0) -> NDArray[np.uint8]:
    """A picture with instances."""
    return drawer.draw(surface, Scene(SETTINGS, camera, tau, instances=True)).pixels


def placed(found: NDArray[np.float64], camera: Camera) -> dict[tuple[float, float], NDArray[np.float64]]:
    """Instances by turn and hue, which tell them apart: their feet in the world."""
    out = {}
    for one in found:
        out[round(one[4], 6), round(one[5], 6)] = one[:3] + np.array(camera.eye)
    return out


def test_each_stands_where_its_cell_says(surface: Surface, watch: Watch) -> None:
    """R612: trees, rocks and tufts stand in the cells of the twin, one in each, on the drawn ground."""
    camera = view(surface, 1900, 2100, 6.0, (24.0, 10.0))
    picture(Reference("plain"), surface, camera)
    assert len(watch.found["rock"]) > 3
    assert len(watch.found["tuft"]) > 50
    assert len(watch.found["tree"]) + len(watch.found["impostor"]) > 3
    for sort, found in watch.found.items():
        if not len(found):
            continue
        kind = KIND_OF[sort]
        place = found[:, :3] + np.array(camera.eye)
        cells = np.floor(place[:, :2] / stands.CELLS_M[kind]).astype(np.int64)
        assert len(np.unique(cells, axis=0)) == len(cells)
        want = stands.stands(cells, kind)
        at = (cells + want.at) * stands.CELLS_M[kind]
        assert np.abs(at - place[:, :2]).max() < 2e-3
        assert np.abs(np.column_stack([want.turn, want.hue]) - found[:, 4:6]).max() < 1e-6


def test_they_stay_as_the_eye_moves_and_tiles_refine(surface: Surface, watch: Watch) -> None:
    """R613: of two views, and of two error bounds, what both have stands at the same place; few are in one alone."""
    drawer = Reference("plain")
    first = view(surface, 1900, 2100, 5.0, (22.0, 9.0))
    second = view(surface, 1898, 2099.2, 5.0, (24.0, 9.8))
    seen = []
    for camera, tau in ((first, 1.0), (first, 6.0), (second, 1.0)):
        picture(drawer, surface, camera, tau)
        seen.append({sort: placed(found, camera) for sort, found in watch.found.items()})
    for other, most in ((seen[1], 0.02), (seen[2], 0.35)):
        for sort in ("rock", "tuft"):
            both = seen[0][sort].keys() & other[sort].keys()
            assert len(both) > (1 - most) * min(len(seen[0][sort]), len(other[sort]))
            away = np.array([seen[0][sort][key] - other[sort][key] for key in both])
            assert np.abs(away[:, :2]).max() < 3e-3
            assert np.abs(away[:, 2]).max() < 0.6  # as far as the drawn surfaces are apart


def test_pictures_with_instances_show_them(surface: Surface) -> None:
    """R613: they are in the picture, and the same picture is drawn again."""
    drawer = Reference("plain")
    camera = view(surface, 1900, 2100, 6.0, (24.0, 10.0))
    bare = drawer.draw(surface, Scene(SETTINGS, camera, 2.0)).pixels.astype(int)
    planted = picture(drawer, surface, camera)
    assert (np.abs(planted.astype(int) - bare).max(axis=2) > 24).mean() > 0.01
    assert np.abs(picture(drawer, surface, camera).astype(int) - planted).max() <= 1
