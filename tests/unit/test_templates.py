"""The starting terrains are drawn, valid and within the limits (SPEC H6); that they solve is in tests/solver."""

from __future__ import annotations

import pytest

from esker import contract, templates
from esker.document.ops import StrokeSet
from esker.document.strokes import world_points
from esker.templates import draw


def test_drawing_again_changes_nothing() -> None:
    for name, text in draw.files().items():
        assert (templates.FOLDER / name).read_text(encoding="utf-8") == text, (
            f"{name}: run python -m esker.templates.draw"
        )


def test_there_are_five_with_words() -> None:
    catalogue = templates.catalogue()
    assert len(catalogue) == 5
    assert len({t.id for t in catalogue}) == 5
    assert all(t.title and t.description for t in catalogue)
    with pytest.raises(KeyError):
        templates.load("atlantis")


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
