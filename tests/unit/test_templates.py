"""The starting terrains are drawn, valid and within the limits (SPEC H6); that they solve is in tests/solver."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from esker import contract, templates
from esker.api.layers import Patchwork
from esker.document.ops import StrokeSet
from esker.document.strokes import world_points
from esker.templates import draw, survey


def test_drawing_again_changes_nothing() -> None:
    for name, text in draw.files().items():
        assert (templates.DRAWN / name).read_text(encoding="utf-8") == text, (
            f"{name}: run python -m esker.templates.draw"
        )


def test_there_are_nine_with_words() -> None:
    catalogue = templates.catalogue()
    assert len(catalogue) == 9
    assert len({t.id for t in catalogue}) == 9
    assert all(t.title and t.description for t in catalogue)
    with pytest.raises(KeyError):
        templates.load("atlantis")


def test_the_page_knows_the_words_of_all() -> None:
    """SPEC U654: a page in another language has these very sentences in its catalogue, lessons too."""
    page = (Path(__file__).parents[2] / "frontend/src/app/words/gallery.ts").read_text(encoding="utf-8")
    shown = [*templates.catalogue(), *templates.lessons()]
    assert [t.title for t in shown if f'msg("{t.title}")' not in page] == []
    assert [t.description for t in shown if f'"{t.description}"' not in page] == []


@pytest.mark.parametrize("template", templates.catalogue(), ids=lambda t: t.id)
def test_every_stroke_applies_as_an_op(template: templates.Template) -> None:
    """A starting terrain could have been drawn by a person: every stroke passes the checks that ops pass."""
    document = StrokeSet(template.id, settings=template.document.settings)
    for stroke in template.document.strokes:
        assert len(stroke.curve) >= 3
        assert stroke.finished
        document, dirty = document.apply(contract.BeginStroke(stroke=stroke))
        assert dirty is not None
        points = world_points(stroke)
        size = document.settings.size_m
        assert points[:, :2].min() > -0.25 * size
        assert points[:, :2].max() < 1.25 * size
    assert len(document.strokes) == len(template.document.strokes)


@pytest.mark.parametrize("name", templates.REAL)
def test_real_ground_comes_with_its_grids(name: str) -> None:
    """SPEC H6: the kept grids are those that the document names, they say whose they are, and cover the domain."""
    template = templates.load(name)
    document, grids = template.document, template.rasters()
    assert {layer.content for layer in document.layers} == grids.keys()
    assert document.settings.place is not None
    for layer in document.layers:
        raster = grids[layer.content]
        assert raster.digest == layer.content
        assert layer.facts == raster.facts(geo=True, file=layer.facts.file, format=layer.facts.format)
        assert layer.source
        assert layer.licence.startswith("Public domain")
    base = Patchwork(document.settings, document.layers, grids).base
    assert base is not None
    assert base.survey(0).min() > contract.BASE_SURVEY
    assert np.isfinite(base.level(1)).all()


def test_kept_grids_come_back(tmp_path: Path) -> None:
    """Within half a step, holes and nets as they were; too fine a step for the range is refused."""
    rng = np.random.default_rng(3)
    heights = (1500 + 400 * np.cumsum(rng.normal(size=(37, 52)), axis=1)).astype(np.float32)
    heights[rng.random(heights.shape) < 0.2] = np.nan
    heights[:, 0] = np.nan
    net = rng.normal(size=(3, 4, 2))
    for warp in (None, net):
        survey.write(tmp_path / "grid.npz", survey.Grid(heights, warp), 0.25)
        kept = survey.read(tmp_path / "grid.npz")
        assert kept.heights.dtype == np.float32
        assert np.array_equal(np.isnan(kept.heights), np.isnan(heights))
        assert np.nanmax(np.abs(kept.heights - heights)) <= 0.126
        assert (kept.warp is None) == (warp is None)
        assert warp is None or (kept.warp is not None and np.array_equal(kept.warp, warp))
    with pytest.raises(ValueError, match="too fine"):
        survey.write(tmp_path / "grid.npz", survey.Grid(heights, None), 0.001)
