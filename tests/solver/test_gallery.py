"""The committed gallery, and the solver's accuracy on all of it (SPEC S3, S4, S18, S80 to S82)."""

from __future__ import annotations

import numpy as np
import pytest

from bench.solver import _accuracy, _exact
from esker import grid
from esker.cli import solve
from esker.contract import Border
from esker.document import archive
from esker.solve.opencl.device import Device
from esker.solve.opencl.levels import ClWorkspace
from esker.solve.solver import Solver
from esker.templates import gallery


def test_drawing_again_changes_nothing() -> None:
    """SPEC S80: what is committed is what the script draws."""
    drawn = gallery.draw()
    assert list(drawn) == list(gallery.NAMES)
    assert {path.stem for path in gallery.FOLDER.iterdir()} == set(gallery.NAMES)
    for name, document in drawn.items():
        text = (gallery.FOLDER / f"{name}.json").read_text(encoding="utf-8")
        assert gallery.to_json(document) == text, f"{name} is stale: run python -m esker.templates.gallery"
        assert archive.document_from_json(text.encode()) == document


def test_what_the_gallery_holds() -> None:
    """The scenes that the rules name: counts, overlaps, the border, something smaller than a cell."""
    counts = {name: len(gallery.load(name).strokes) for name in gallery.NAMES}
    assert (counts["five"], counts["fifty"], counts["five-hundred"], counts["tiny"]) == (5, 50, 500, 1)
    tiny = gallery.load("tiny").strokes[0]
    assert np.hypot(*np.subtract(tiny.last, tiny.first)[:2]) < grid.spacing(4, gallery.SIZE)
    again = {(s.first, s.last, s.curve) for s in gallery.load("twins").strokes}
    assert len(again) < counts["twins"]
    assert any(0.0 in (s.first[1], s.last[1]) for s in gallery.load("border").strokes)
    with pytest.raises(KeyError):
        gallery.load("nothing")


@pytest.mark.parametrize("name", gallery.NAMES)
def test_solve_command_on_every_scene(name: str, tmp_path, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    """SPEC S21."""
    out = tmp_path / "heights.npy"
    assert solve.main([str(gallery.FOLDER / f"{name}.json"), "--level", "2", "-o", str(out)]) == 0
    heights = np.load(out)
    assert heights.shape == (257, 257)
    assert np.isfinite(heights).all()
    assert np.ptp(heights) > 5
    said = capsys.readouterr().err
    assert "level 2 (257 x 257) settled" in said


@pytest.mark.parametrize("level", [2, 3])
@pytest.mark.parametrize("name", gallery.NAMES)
def test_accuracy(device: Device, solver: Solver, name: str, level: int) -> None:
    """SPEC S3, S4, S18, S81, S82 on every scene; ``esker bench solve`` goes on to 4097 samples a side."""
    document = gallery.load(name)
    shown = _accuracy.product(solver, document, level)
    figures = _accuracy.measure(ClWorkspace(device, level), document, shown, previews=False)
    assert figures["gradient_factor"] <= 0.4
    assert figures["height_factor"] <= 0.4
    assert figures["preview_of_relief"] <= 1e-3
    assert figures["rest_of_quantum"] < 0.5
    assert figures["floor_of_relief"] <= 2e-6
    assert figures["curve_of_relief"][3] <= 1e-3, "full multigrid and three cycles"


@pytest.mark.parametrize("border", ["free", "pinned"])
@pytest.mark.parametrize("reach_m", [128.0, None])
def test_accuracy_of_the_borders(device: Device, solver: Solver, border: Border, reach_m: float | None) -> None:
    """SPEC S3, S4, S82 with strokes on the border, free and pinned, with reach and without."""
    document = gallery.load("border")
    settings = document.settings.model_copy(update={"border": border, "reach_m": reach_m})
    document = document.model_copy(update={"settings": settings})
    shown = _accuracy.product(solver, document, 3)
    figures = _accuracy.measure(ClWorkspace(device, 3), document, shown, previews=False)
    assert max(figures["gradient_factor"], figures["height_factor"]) <= 0.4
    assert figures["preview_of_relief"] <= 1e-3
    assert figures["rest_of_quantum"] < 0.5
    assert figures["floor_of_relief"] <= 2e-6


@pytest.mark.parametrize("reach_m", [256.0, 1024.0, 1025.0, None])
@pytest.mark.parametrize("name", ["five", "crossing"])
def test_previews_of_wide_reaches(device: Device, solver: Solver, name: str, reach_m: float | None) -> None:
    """SPEC S18: sparse strokes that are felt far away ask more of the gradient."""
    document = gallery.load(name)
    settings = document.settings.model_copy(update={"reach_m": reach_m})
    preview, settled, _ = _accuracy.product(solver, document.model_copy(update={"settings": settings}), 3)
    assert np.abs(preview - settled).max() <= 1e-3 * np.ptp(settled)


@pytest.mark.parametrize("name", ["loops", "five-hundred", "crossing", "border", "archipelago"])
def test_previews_of_edits(solver: Solver, name: str) -> None:
    """SPEC S18: a stroke more, made from the ground without it: those of the gallery that take the most cycles."""
    document = gallery.load(name)
    solver.solve(document.strokes[:-1], document.settings, 4)
    preview, settled, _ = _accuracy.product(solver, document, 4)
    assert np.abs(preview - settled).max() <= 1e-3 * np.ptp(settled)


@pytest.mark.parametrize("name", ["five", "crossing", "twins", "canyon"])
def test_ties(device: Device, name: str) -> None:
    """SPEC S4: where float32 and float64 see the same constraints they give the same ground."""
    document = gallery.load(name)
    w = ClWorkspace(device, 2)
    c = _exact.load(w, document.strokes, document.settings)
    figures = _accuracy.ties(document, c, _exact.exact(w, c))
    assert figures["samples"] < 100
    assert figures["error_of_relief"] < 1e-3
    assert figures["error_elsewhere_of_relief"] < 5e-5


def test_solver_is_shared(solver: Solver) -> None:
    """The whole gallery through one solver: no scene disturbs the next."""
    first = solver.solve(gallery.load("five").strokes, gallery.load("five").settings, 2)[2]
    for name in gallery.NAMES:
        d = gallery.load(name)
        solver.solve(d.strokes, d.settings, 2)
    again = solver.solve(gallery.load("five").strokes, gallery.load("five").settings, 2)[2]
    assert np.array_equal(first, again)
