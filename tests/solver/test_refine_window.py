"""Windows above the global levels for scripts and exports: Terrain.window, esker solve --window, esker bench refine."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bench.ground import refine as bench
from esker import grid, templates
from esker.api.terrain import Terrain
from esker.cli import solve
from esker.document import archive
from esker.solve.solver import Solver
from tests.solver.scenes import SCENES, SIZE


@pytest.fixture(scope="module")
def terrain(solver: Solver) -> Terrain:
    out = Terrain(solver=solver)
    for stroke in SCENES["cross"]:
        out.add(stroke)
    return out


def test_a_rectangle_of_metres_at_any_level(terrain: Terrain) -> None:
    """SPEC S56: the samples inside, where they are, and the same heights whatever the rectangle."""
    whole = terrain.window(3, 0, 0, SIZE, SIZE, global_level=3)
    assert whole.heights.tobytes() == terrain.heights(3).tobytes()
    part = terrain.window(8, 1000.1, 2000, 1020, 2010.3, global_level=2)
    assert part.spacing_m == 0.25
    assert (part.x_m, part.y_m) == (1000.25, 2000.0)
    assert part.heights.shape == (42, 80)
    more = terrain.window(8, 990, 1990, 1021, 2011, global_level=2)
    row, column = round((part.y_m - more.y_m) / 0.25), round((part.x_m - more.x_m) / 0.25)
    assert np.array_equal(more.heights[row : row + 42, column : column + 80], part.heights)


def test_what_was_settled_once_is_not_settled_again(terrain: Terrain, monkeypatch: pytest.MonkeyPatch) -> None:
    terrain.window(4, 0, 0, 50, 50, global_level=2)
    with monkeypatch.context() as patch:
        patch.setattr(Solver, "steps", None)
        assert terrain.window(5, 0, 0, 50, 50, global_level=2).heights.shape == (26, 26)
    other = Terrain(size_m=SIZE / 2, solver=Solver("numpy"))
    assert not other.window(2, 0, 0, 100, 100, global_level=1).heights.any()


@pytest.mark.parametrize("where", [(11, 0.0, 0.0, 9.0, 9.0), (-1, 0, 0, 9, 9), (4, 9, 9, 5, 5), (4, 5000, 0, 6000, 9)])
def test_windows_without_samples_are_refused(terrain: Terrain, where: tuple[int, float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="level"):
        terrain.window(*where)


def test_the_command_writes_a_window(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """SPEC S56."""
    file, out = tmp_path / "t.esker", tmp_path / "h.npy"
    document = templates.load("canyon").document
    file.write_bytes(archive.dumps(document))
    arguments = [str(file), "-o", str(out), "--level", "7", "--window", "1000", "1000", "1030", "1020"]
    assert solve.main(arguments) == 0
    s = grid.spacing(7, document.settings.size_m)
    assert np.load(out).shape == (int(1020 / s) - int(999.9 / s), int(1030 / s) - int(999.9 / s))
    assert "sample [0, 0] at x 1000 m" in capsys.readouterr().err
    assert solve.main([*arguments[:5], "--window", "1e6", "0", "2e6", "5"]) == 1
    assert "No sample" in capsys.readouterr().err
    for size, more in (("4096", ["--level", "10"]), ("800", ["--level", "12", "--detail"])):
        assert solve.main([*arguments[:3], *more, "--window", "0", "0", size, size]) == 1
        assert "in parts" in capsys.readouterr().err
    for text in ("nan", "inf", "far"):
        with pytest.raises(SystemExit):
            solve.main([*arguments[:5], "--window", text, "0", "1", "1"])
        assert "--window" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        solve.main(arguments[:5])
    assert "--window" in capsys.readouterr().err


def test_the_benchmark_runs(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S57: every part of ``esker bench refine``, on coarse levels."""
    monkeypatch.setattr(bench, "DEPTHS", (3, 4))
    assert bench.main(["--quick", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    error = result["error"]["fifty"]["257 to 513"]
    assert 0 < error["rms_near"] <= error["max"] < 0.02
    assert result["cost"]["fifty"]["1025"]["tiles_per_s"] > 0
    assert result["view"]["fifty"]["ratio"] > 0
    assert result["view"]["fifty"]["513"]["tiles"] > 0
