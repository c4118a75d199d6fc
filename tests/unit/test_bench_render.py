"""``esker bench render``: where screen errors are measured, and what is held beside what."""

from __future__ import annotations

import numpy as np

from bench.picture import _render_ground, render
from esker.render.camera import Camera, eye_projection


def test_errors_are_measured_inside_of_the_picture_and_in_all_of_it() -> None:
    grid = _render_ground.heights()
    cell = _render_ground.SIZE_M / (grid.shape[0] - 1)
    for name, pose in render.CAMERAS.items():
        places = np.array(_render_ground.places(pose | render.LENS, render.WIDTH, render.HEIGHT, grid))
        j, i = np.divmod(places, grid.shape[0])
        x, y, z = pose["eye"]
        points = np.stack([i * cell - x, j * cell - y, grid[j, i] - z, np.ones(len(places))])
        near, far, fov = (render.LENS[name] for name in ("near", "far", "fovDeg"))
        camera = Camera(pose["eye"], pose["target"], render.WIDTH, render.HEIGHT, near, far, fov_deg=fov)
        clip = eye_projection(camera) @ points
        seen = clip[:2] / clip[3]
        assert clip[3].min() > 0, name
        assert np.abs(seen).max() <= 1, name
        # Places reach all sides that show ground: the lower two corners and the sides.
        assert seen[0].min() < -0.97, name
        assert seen[0].max() > 0.97, name
        assert seen[1].min() < -0.95, name


def _row(ms: float, off: float = 0.0) -> dict[str, float]:
    return {"still_gpu_process_ms": ms, "pixels_off_percent": off}


def test_each_peer_is_held_beside_ours_in_its_own_shading() -> None:
    ours = {"lambert": {"tau 1": _row(300, 0.2), "tau 0.5": _row(500, 0.05), "tau 0.25": _row(900, 0.01)}}
    peers = {"three-webgl": _row(1000), "cesium sse 2": _row(400), "cesium sse 4": {"failed": "no"}}
    beside = {"cesium sse 2": {"tau": 2.5, "flat": _row(200), "lambert": _row(300)}}
    said = render.verdict(ours, peers, beside)
    assert said["for_three"] == "tau 0.5"
    assert said["share_of_three-webgl"] == 0.5
    assert said["share_of_cesium sse 2"] == {"at": "tau 2.5", "flat": 0.5, "lambert": 0.75}
    assert "share_of_cesium sse 4" not in said
