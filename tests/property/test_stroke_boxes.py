"""Boxes of curves stand for their points (SPEC D7, D9): rectangles, and how far a stroke reaches."""

from __future__ import annotations

from dataclasses import replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from esker import contract as c
from esker.document import ops
from esker.document.ops import Refusal, StrokeSet
from esker.document.strokes import CurveBox, bounds, curve_box, influence_extent, reach, world_points
from esker.grid import Rect

far = st.floats(-50_000, 50_000)
anchor = st.tuples(far, far, far)
point = st.tuples(st.floats(-1e7, 1e7), st.floats(-1e7, 1e7)) | st.tuples(st.floats(-2, 3), st.floats(-500, 500))
kinds: st.SearchStrategy[c.StrokeKind] = st.sampled_from(("profile", "level", "paint"))


@st.composite
def strokes(draw: st.DrawFn) -> c.Stroke:
    kind = draw(kinds)
    paint = c.Paint(channel="snow", value=1.0, radius_m=draw(st.floats(0, 500))) if kind == "paint" else None
    curve = tuple(draw(st.lists(point, min_size=1, max_size=20)))
    return c.Stroke(id="s", kind=kind, first=draw(anchor), last=draw(anchor), curve=curve, paint=paint)


def _rect_of_points(stroke: c.Stroke) -> Rect:
    """The twin: every point is made and looked at."""
    xy = world_points(stroke)[:, :2]
    return Rect(*map(float, (*xy.min(axis=0), *xy.max(axis=0)))).grown(influence_extent(stroke))


@given(strokes())
@settings(max_examples=300, deadline=None)
def test_bounds_are_those_of_all_points_to_the_bit(stroke: c.Stroke) -> None:
    assert bounds(stroke) == _rect_of_points(stroke)
    assert bounds(stroke, curve_box(stroke.curve)) == _rect_of_points(stroke)


@given(strokes())
@settings(max_examples=300, deadline=None)
def test_no_point_lies_farther_than_the_reach(stroke: c.Stroke) -> None:
    box = curve_box(stroke.curve)
    assert box is not None
    points = world_points(stroke)
    assert np.abs(points).max() <= reach(stroke, box)
    mirrored = [(u, v) for u in _both(box.u0, box.u1) for v in _both(box.v0, box.v1)]
    widest = np.abs(world_points(stroke.model_copy(update={"curve": tuple(mirrored)}))).max()
    assert reach(stroke, box) <= max(widest, abs(stroke.first[2])) * 1.001, "nor is it out of all proportion"


def _both(low: float, high: float) -> tuple[float, float]:
    """The end of a range that is farther from zero, on both sides of zero."""
    far = max(abs(low), abs(high))
    return far, -far


def test_a_stroke_whose_parts_outweigh_each_other() -> None:
    """Its point is low only because the fall of its anchors takes away what its curve rises; the reach adds both."""
    stroke = c.Stroke(id="s", kind="profile", first=(0, 0, 0), last=(0, 0, -875), curve=((9, 9287),))
    box = curve_box(stroke.curve)
    assert box is not None
    assert np.abs(world_points(stroke)).max() == 1412
    assert reach(stroke, box) == pytest.approx(9 * 875 + 9287)


@given(st.lists(point, max_size=12), st.lists(point, max_size=5))
@settings(deadline=None)
def test_a_box_goes_on_with_the_curve(curve: list[c.CurvePoint], more: list[c.CurvePoint]) -> None:
    assert curve_box(more, curve_box(curve)) == curve_box([*curve, *more])


def test_a_far_point_is_refused_wherever_it_comes_in_an_append() -> None:
    document = StrokeSet("t")
    bound = c.DOMAIN_MARGIN * document.settings.size_m
    begin = c.Stroke(id="s", kind="profile", first=(0, 0, 0), last=(1000, 0, 0), curve=((0, 0),))
    document, _ = document.apply(c.BeginStroke(stroke=begin))
    for curve in (((0.5, 1.0),), ((0.6, bound),), ((bound / 1000, 0.0),)):
        start = len(document.strokes["s"].curve)
        document, _ = document.apply(c.AppendPoints(stroke="s", start=start, points=curve, last=(1000, 0, 0)))
    for start in (4, 0):  # going on with a known box, and with a box that is made
        for wrong in ((bound / 1000 * 1.001, 0.0), (0.5, bound * 1.001)):
            op = c.AppendPoints(stroke="s", start=start, points=((0.5, 0.0), wrong), last=(1000, 0, 0))
            with pytest.raises(Refusal) as refusal:
                document.apply(op)
            assert refusal.value.code == "out_of_domain"
    with pytest.raises(Refusal):  # what is there already lies too far once the anchor is moved
        document.apply(c.AppendPoints(stroke="s", start=4, points=((0.5, 0.0),), last=(1010, 0, 0)))


def test_a_box_is_used_again_only_for_the_stroke_that_it_is_of(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    def noted(points: tuple[c.CurvePoint, ...], known: CurveBox | None = None) -> CurveBox | None:
        seen.append(len(points))
        return curve_box(points, known)

    monkeypatch.setattr(ops, "curve_box", noted)
    document = StrokeSet("t")
    begin = c.Stroke(id="s", kind="profile", first=(0, 0, 0), last=(1000, 0, 0), curve=((0, 0),) * 9)
    first, _ = document.apply(c.BeginStroke(stroke=begin))
    longer, _ = first.apply(c.AppendPoints(stroke="s", start=9, points=((1, 1),), last=(1000, 0, 0)))
    assert seen == [9, 1]
    # Another successor of the same document: the cache knows the longer stroke, which is not this one's.
    other, dirty = first.apply(c.AppendPoints(stroke="s", start=9, points=((0.2, 0.1),), last=(1000, 0, 0)))
    assert 10 in seen[2:]
    fresh = replace(first, _rects={})
    again, expected = fresh.apply(c.AppendPoints(stroke="s", start=9, points=((0.2, 0.1),), last=(1000, 0, 0)))
    assert dirty == expected
    assert other == again
    assert len(longer.strokes["s"].curve) == 10
