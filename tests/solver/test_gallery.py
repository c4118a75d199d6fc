"""The committed gallery, and the solver's accuracy on all of it (SPEC S3, S4, S18, S22 to S24)."""

from __future__ import annotations

import numpy as np
import pytest

from esker import grid
from esker.bench import gallery
from esker.document import archive
from esker.solve import command
from esker.solve.solver import Solver


def test_drawing_again_changes_nothing() -> None:
    """SPEC S22: what is committed is what the script draws."""
    drawn = gallery.draw()
    assert list(drawn) == list(gallery.NAMES)
    assert {path.stem for path in gallery.FOLDER.iterdir()} == set(gallery.NAMES)
    for name, document in drawn.items():
        text = (gallery.FOLDER / f"{name}.json").read_text(encoding="utf-8")
        assert gallery.to_json(document) == text, f"{name} is stale: run python -m esker.bench.gallery"
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
    assert command.main([str(gallery.FOLDER / f"{name}.json"), "--level", "2", "-o", str(out)]) == 0
    heights = np.load(out)
    assert heights.shape == (257, 257)
    assert np.isfinite(heights).all()
    assert np.ptp(heights) > 5
    said = capsys.readouterr().err
    assert "level 2 (257 x 257) settled" in said


def test_solver_is_shared(solver: Solver) -> None:
    """The whole gallery through one solver: no scene disturbs the next."""
    first = solver.solve(gallery.load("five").strokes, gallery.load("five").settings, 2)[2]
    for name in gallery.NAMES:
        d = gallery.load(name)
        solver.solve(d.strokes, d.settings, 2)
    again = solver.solve(gallery.load("five").strokes, gallery.load("five").settings, 2)[2]
    assert np.array_equal(first, again)
