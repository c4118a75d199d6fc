"""``esker solve`` of terrains with elevation layers: the ground that one sees (SPEC S21)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from esker.api.terrain import Stroke, Terrain
from esker.cli import main, solve
from esker.document import archive
from tests.solver.scenes import SIZE, flank


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    """A hill of data in the middle of the domain, with a wall across it."""
    out = Terrain(size_m=SIZE)
    y, x = np.mgrid[-40:41, -40:41] / 40
    out.add_grid((200 + 150 * np.exp(-2 * (x * x + y * y))).astype(np.float32), spacing=32.0, accuracy=1.0)
    points = [(1000, 2000, 420), (3000, 2100, 420)]
    out.add(Stroke.profile(points, left=flank(35, 300), right=flank(35, 300), id="wall"))
    return out


@pytest.mark.parametrize("extra", [[], ["--window", "1500", "1900", "1700", "2050"], ["--detail"]])
def test_solve_command_stands_on_the_layers(terrain: Terrain, tmp_path: Path, extra: list[str]) -> None:
    file, out = tmp_path / "t.esker", tmp_path / "h.npy"
    terrain.save(file)
    level = 5 if extra[:1] == ["--window"] else 2
    assert main.main(["solve", str(file), "-q", "-o", str(out), "--level", str(level), *extra]) == 0
    heights = np.load(out)
    if not extra:
        assert np.array_equal(heights, terrain.heights(2))
        assert heights.max() == pytest.approx(420, abs=1)
    elif extra[0] == "--window":
        assert np.array_equal(heights, terrain.window(5, 1500, 1900, 1700, 2050).heights)
        assert heights.max() > 400
    else:
        assert np.abs(heights - terrain.heights(2)).max() < 60
        assert heights.max() > 380


def test_grids_that_are_not_at_hand_are_said(
    terrain: Terrain, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A document alone has no grids, and the solver alone does not know layers."""
    file, out = tmp_path / "t.json", tmp_path / "h.npy"
    file.write_text(terrain.document.model_dump_json())
    assert main.main(["solve", str(file), "-q", "-o", str(out)]) == 1
    assert "not at hand" in capsys.readouterr().err
    whole = tmp_path / "t.esker"
    whole.write_bytes(archive.dumps(terrain.document, terrain.grids))
    assert solve.main([str(whole), "-q", "-o", str(out)]) == 1
    assert "elevation layers" in capsys.readouterr().err
    assert not out.exists()
