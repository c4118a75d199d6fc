"""Scenes that are meant to find wrong ground (``esker bench search``): strategies of hypothesis, which shrinks them.

Every number comes from both ends of its range, from what is usual, or from between; every place from the lattice lines
that coarse levels share, half a cell beside them, corners, borders, far outside, or anywhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from unittest import mock

import hypothesis.strategies as st
import numpy as np
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants

from bench.solver._direct import Scene
from esker.contract import (
    CURRENT_EDITION,
    DEFAULT_REACH_FRACTION,
    DOMAIN_MARGIN,
    MAX_SIZE_M,
    MAX_SLOPE_DEG,
    MIN_REACH_M,
    MIN_SIZE_M,
    Border,
    Course,
    CurvePoint,
    Flank,
    FlankShape,
    Stroke,
    StrokeKind,
    TerrainSettings,
)
from esker.contract.values import ABSOLUTE_BOUND_M
from esker.document.strokes import world_points

MOST_STROKES = 5
LATTICE = 8
"""Lattice lines are this share of the side apart: all levels have samples there."""
Place = tuple[float, float]

KINDS: st.SearchStrategy[StrokeKind] = st.sampled_from(("profile", "profile", "level", "course"))
SHAPES: st.SearchStrategy[FlankShape] = st.sampled_from(("straight", "concave", "convex"))
BORDERS: st.SearchStrategy[Border] = st.sampled_from(("free", "pinned"))


@contextmanager
def drawn_alike() -> Iterator[None]:
    """Within it a seed gives the same scenes in every version of this project.

    Hypothesis draws numbers that stand in the modules of a project, too: else any constant that is added anywhere, and
    any module that another test has imported, would change the scenes of all seeds.
    """
    none = mock.patch.object(providers.HypothesisProvider, "_local_constants", Constants())
    providers.CONSTANTS_CACHE.cache.clear()
    try:
        with none:
            yield
    finally:
        providers.CONSTANTS_CACHE.cache.clear()


def number(low: float, high: float, *usual: float) -> st.SearchStrategy[float]:
    """Draws what is usual, the ends of the range, or anything between."""
    return st.sampled_from((*usual, low, high)) | st.floats(low, high, allow_nan=False, allow_infinity=False)


def coordinates(size: float, spacing: float) -> st.SearchStrategy[float]:
    """One coordinate of a place: on a lattice line or beside it, between two, or outside."""
    beside = st.sampled_from((0.0, 0.5, -0.5, 0.49, 0.51, 1e-4, 1.0, -1.0)).map(lambda cells: cells * spacing)
    lines = st.tuples(st.integers(0, LATTICE), beside).map(lambda p: min(max(p[0] * size / LATTICE + p[1], 0.0), size))
    inside = st.floats(0, 1).map(lambda share: share * size)
    outside = number(-DOMAIN_MARGIN / 2 * size, DOMAIN_MARGIN / 2 * size, -0.25 * size, 1.25 * size)
    return st.one_of(lines, lines, inside, inside, outside)


@st.composite
def anchors(draw: st.DrawFn, size: float, spacing: float, known: Sequence[Stroke]) -> tuple[Place, Place]:
    """Both ends of a crest: anywhere, along a lattice line, or those of a stroke that is there already."""
    coordinate = coordinates(size, spacing)
    a = (draw(coordinate), draw(coordinate))
    how = draw(st.sampled_from(("anywhere", "row", "column", "again", "reversed", "crossing")))
    if known and how in ("again", "reversed", "crossing"):
        other = draw(st.sampled_from(known))
        first, last = other.first[:2], other.last[:2]
        if how == "again":
            return first, last
        if how == "reversed":
            return last, first
        return (first[0], last[1]), (last[0], first[1])
    b = (draw(coordinate), draw(coordinate))
    if how == "row":
        b = (b[0], a[1])
    elif how == "column":
        b = (a[0], b[1])
    return a, b


@st.composite
def flanks(draw: st.DrawFn, size: float, spacing: float) -> Flank | None:
    """A side of a cross-section, or none."""
    if draw(st.booleans()):
        return None
    slope = draw(st.none() | number(0.0, MAX_SLOPE_DEG, 35.0, 45.0, 1.0))
    extent = draw(number(0.0, ABSOLUTE_BOUND_M, size / 32, size / 8, size / 2, spacing, 1e-3))
    return Flank(slope_deg=slope, extent_m=extent, shape=draw(SHAPES))


@st.composite
def curves(draw: st.DrawFn, kind: StrokeKind, size: float) -> tuple[CurvePoint, ...]:
    """Points of a crest in the frame of its anchors: straight, jagged, going back, beyond the anchors, a point."""
    u = st.sampled_from((0.0, 1.0, 0.5)) | st.floats(-0.5, 1.5)
    v = number(-0.5, 0.5, 0.0) if kind != "profile" else number(-size, size, 0.0, size / 16, -size / 16, 1e-3)
    middle = draw(st.lists(st.tuples(u, v), max_size=4))
    if draw(st.booleans()):
        return ((0.0, 0.0), *middle, (1.0, 0.0))
    return tuple(middle) or ((0.0, 0.0),)


@st.composite
def courses(draw: st.DrawFn, size: float) -> Course:
    """What a course is: heights anyhow, or of a river."""
    rises = draw(st.lists(number(-size, size, size / 16, 0.0, -size / 16, 1e-3), max_size=6))
    if draw(st.booleans()):
        return Course(use="river", rises=tuple(sorted(rises, reverse=True)))
    return Course(use="road", rises=tuple(rises))


@st.composite
def strokes(draw: st.DrawFn, settings: TerrainSettings, spacing: float, known: Sequence[Stroke]) -> Stroke:
    """One stroke, within the limits of a server."""
    size = settings.size_m
    kind = draw(KINDS)
    height = number(-size, size, size / 16, 0.0, -size / 16, 1e-3)
    (ax, ay), (bx, by) = draw(anchors(size, spacing, known))
    plateau = draw(number(0.0, size, 0.0, 0.0, 0.0, spacing, size / 32))
    stroke = Stroke(
        id=f"s{len(known)}",
        kind=kind,
        first=(ax, ay, draw(height)),
        last=(bx, by, draw(height)),
        curve=draw(curves(kind, size)),
        left=draw(flanks(size, spacing)),
        right=draw(flanks(size, spacing)),
        plateau_radius_m=plateau,
        yields=draw(number(0.0, 1.0, 0.0, 0.0)),
        finished=True,
        course=draw(courses(size)) if kind == "course" else None,
    )
    bound = DOMAIN_MARGIN * size
    return stroke if np.abs(world_points(stroke)).max() <= bound else stroke.model_copy(update={"curve": ((0.0, 0.0),)})


@st.composite
def settings(draw: st.DrawFn) -> TerrainSettings:
    """Settings on which a settled height depends, each at its ends."""
    size = draw(st.sampled_from((4096.0, 4096.0, 4096.0, MIN_SIZE_M, MAX_SIZE_M)))
    usual = (size * DEFAULT_REACH_FRACTION, 0.4 * size, 0.5 * size, size, size / 1024)
    reach = draw(st.none() | st.none() | number(MIN_REACH_M, ABSOLUTE_BOUND_M, *usual))
    return TerrainSettings(size_m=size, reach_m=reach, border=draw(BORDERS), edition=CURRENT_EDITION)


@st.composite
def scenes(draw: st.DrawFn, level: int) -> Scene:
    """A scene of a level."""
    chosen = draw(settings())
    spacing = chosen.size_m / (64 << level)
    known: list[Stroke] = []
    for _ in range(draw(st.integers(1, MOST_STROKES))):
        known.append(draw(strokes(chosen, spacing, known)))
    return Scene(tuple(known), chosen, level)
