"""Where a file is laid on a terrain: by its place on Earth, by its own numbers, or by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from esker import contract as c
from esker.importing import laying, questions
from esker.importing.answers import MIDDLE
from esker.importing.georef import Georef, crs_label, on_earth, parse_crs
from esker.importing.laying import Laid
from esker.importing.refusal import ImportRefused
from esker.importing.source import Source

Ask = Callable[[c.ImportQuestion], str]
"""The answer to a question, its default when nobody answered."""
EARTH_RADIUS_M = 6_371_008.8


@dataclass(frozen=True)
class Terrain:
    """What an import needs to know of the terrain: its place (None: it has none) and its size in metres."""

    place: c.Place | None
    size_m: float


@dataclass(frozen=True, eq=False)
class Placed:
    """``laid`` None: only its shape is known. ``geo``: it lies by its place on Earth; ``crs``: its system, as a person
    writes it; ``far_m``: how far off it would lie, when that is outside the terrain."""

    laid: Laid | None
    geo: bool = False
    crs: str = ""
    far_m: float | None = None


def place(source: Source, answers: Mapping[str, str], ask: Ask, terrain: Terrain | None) -> Placed:
    """Lays a file, asking for what it does not say. ``terrain`` None: in a frame of its own. Raises ImportRefused."""
    size_m = terrain.size_m if terrain is not None else c.DEFAULT_SIZE_M
    if source.georef is None:
        return Placed(_unplaced(source, ask, terrain))
    georef, named = source.georef, False
    answer = answers.get("place")
    if georef.crs is None or not on_earth(georef.crs):
        degrees = georef.crs is None and georef.looks_like_degrees(source.rows, source.cols)
        guess = georef.with_crs(parse_crs("EPSG:4326")) if degrees else None
        elsewhere = guess is not None and _far_m(source, guess, terrain) is not None
        answer = ask(questions.system_question(degrees, _reason(georef), elsewhere))
        if answer != MIDDLE:
            georef, named = georef.with_crs(parse_crs(answer)), True
        elif guess is not None:
            georef = guess
        else:
            return Placed(_by_hand(source, size_m), crs="" if georef.crs is None else crs_label(georef.crs))
    source.georef = georef
    return _on_earth(source, georef, answer, named, ask, terrain or Terrain(None, size_m))


def _reason(georef: Georef) -> str:
    if georef.crs is None:
        return "It does not name its coordinate system."
    return f"Its coordinate system ({crs_label(georef.crs)[:40]}) is not of the Earth."


def _on_earth(source: Source, georef: Georef, answer: str | None, named: bool, ask: Ask, terrain: Terrain) -> Placed:
    """A file with a place on Earth. ``named``: somebody said in which system, so that it must not be moved."""
    assert georef.crs is not None
    label = crs_label(georef.crs)
    at = laying.middle(georef, source.rows, source.cols)
    if at is None:
        raise ImportRefused(f"Its place ({label}) cannot be found on Earth, or lies at a pole.")
    far_m = _far_m(source, georef, terrain) if answer != MIDDLE else None
    if far_m is not None:
        if named:
            raise ImportRefused(
                f"In {label} it lies {far_m / 1000:,.0f} km from this terrain. Answer place={MIDDLE} to lay it "
                "in the middle."
            )
        answer = ask(questions.far_question(far_m))
        if answer != MIDDLE:
            raise ImportRefused(f"It lies {far_m / 1000:,.0f} km from this terrain.")
    moved = answer == MIDDLE
    own = c.Place(lat_deg=round(at[0], 6), lon_deg=round(at[1], 6))
    there = own if moved or terrain.place is None else terrain.place
    laid = laying.lay(laying.on_frame(georef, there, terrain.size_m), source.rows, source.cols)
    _note_mercator(source, label, laid)
    return Placed(replace(laid, at=at), not moved, label, far_m)


def _far_m(source: Source, georef: Georef, terrain: Terrain | None) -> float | None:
    """Distance in metres from the middle of the terrain when the grid does not touch it, else None."""
    at = laying.middle(georef, source.rows, source.cols)
    if terrain is None or terrain.place is None or at is None:
        return None
    arc = _great_circle_m(at, (terrain.place.lat_deg, terrain.place.lon_deg))
    if arc > 10 * c.MAX_SIZE_M + terrain.size_m:  # so far that the frame is not asked; no grid is that large
        return arc
    try:
        laid = laying.lay(laying.on_frame(georef, terrain.place, terrain.size_m), source.rows, source.cols)
    except ImportRefused:
        return arc
    low, high = laying.ground_box(laid, source.rows, source.cols)
    outside = bool(np.any(high < 0.0) or np.any(low > terrain.size_m))
    return arc if outside else None


def _great_circle_m(a: tuple[float, float], b: tuple[float, float]) -> float:
    (lat_a, lon_a), (lat_b, lon_b) = (tuple(map(math.radians, point)) for point in (a, b))
    haversine = (
        math.sin(0.5 * (lat_b - lat_a)) ** 2 + math.cos(lat_a) * math.cos(lat_b) * math.sin(0.5 * (lon_b - lon_a)) ** 2
    )
    return 2.0 * EARTH_RADIUS_M * math.asin(min(1.0, math.sqrt(haversine)))


def _by_hand(source: Source, size_m: float) -> Laid:
    """A grid with coordinates in metres of nowhere: its own shape and turn, in the middle of the terrain."""
    assert source.georef is not None
    crs = source.georef.crs
    unit = float(crs.axis_info[0].unit_conversion_factor) if crs is not None and crs.axis_info else 1.0
    laid = laying.lay(laying.locally(source.georef, unit), source.rows, source.cols)
    return _centred(laid, source, size_m)


def _centred(laid: Laid, source: Source, size_m: float) -> Laid:
    low, high = laying.ground_box(laid, source.rows, source.cols)
    shift = 0.5 * size_m - 0.5 * (low + high)
    x, y = (round(float(a), 4) for a in np.array(laid.anchor) + shift)
    return replace(laid, anchor=(x, y))


def _unplaced(source: Source, ask: Ask, terrain: Terrain | None) -> Laid | None:
    """A grid without any place: as wide as somebody says; None while nobody does and no terrain is known."""
    width = questions.parse_size(ask(questions.SIZE))
    if width is None and terrain is None:
        return None
    size_m = terrain.size_m if terrain is not None else c.DEFAULT_SIZE_M
    step = width / (source.cols - 1) if width is not None else size_m / (max(source.rows, source.cols) - 1)
    if not c.MIN_GRID_SPACING_M <= step <= c.MAX_GRID_SPACING_M:
        raise ImportRefused(f"Its samples would lie {step:.6g} m apart: that is no grid for a terrain.")
    return _centred(Laid((0.0, 0.0), 0.0, (round(step, 9), round(step, 9)), True, False), source, size_m)


def _note_mercator(source: Source, label: str, laid: Laid) -> None:
    if label != "EPSG:3857" or source.georef is None or source.georef.affine is None:
        return
    a, _, _, d, _, _ = source.georef.affine
    note = (
        f"Web Mercator: its steps of {math.hypot(a, d):.4g} m are {laid.spacing_m[0]:.4g} m on the ground, and so laid."
    )
    source.notes.append(note)
