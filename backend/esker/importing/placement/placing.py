"""Where a file is laid on a terrain: by its place on Earth, by its own numbers, or by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pyproj

from esker import contract as c
from esker.importing import questions
from esker.importing.answers import MIDDLE
from esker.importing.placement import fitting
from esker.importing.placement.fitting import Laid
from esker.importing.placement.georef import (
    Georef,
    along_the_ground,
    crs_label,
    metres_of_degrees,
    on_earth,
    parse_crs,
)
from esker.importing.refusal import ImportRefused
from esker.importing.source import Own, Source

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
    if source.own is not None and "size" not in answers:
        return _as_it_was(source, source.own, answers.get("place"), ask, terrain)
    if source.georef is None:
        return Placed(_unplaced(source, ask, terrain))
    georef, named = source.georef, False
    answer = answers.get("place")
    if georef.crs is None or not _usable(georef.crs):
        degrees = georef.crs is None and georef.looks_like_degrees(source.rows, source.cols)
        guess = georef.with_crs(parse_crs("EPSG:4326")) if degrees else None
        elsewhere = guess is not None and _far_m(source, guess, terrain) is not None
        answer = ask(questions.system_question(degrees, _reason(georef), elsewhere))
        if answer != MIDDLE:
            georef, named = georef.with_crs(_answered(answer)), True
        elif guess is not None:
            georef = guess
        else:
            return Placed(_by_hand(source, size_m), crs="" if georef.crs is None else crs_label(georef.crs))
    source.georef = georef
    return _on_earth(source, georef, answer, named, ask, terrain or Terrain(None, size_m))


def _as_it_was(source: Source, own: Own, answer: str | None, ask: Ask, terrain: Terrain | None) -> Placed:
    """A heightmap of Esker's own: by its place, else at the same metres, in the middle if these are outside."""
    x, y = own.south_west_m
    if own.place is not None:
        north = y + (source.rows - 1) * own.spacing_m
        source.georef = Georef(
            fitting.frame(own.place, own.terrain_m), (own.spacing_m, 0.0, x, 0.0, -own.spacing_m, north)
        )
        return _on_earth(source, source.georef, answer, False, ask, terrain or Terrain(None, own.terrain_m))
    laid = Laid((x, y), 0.0, (own.spacing_m, own.spacing_m), True, False)
    size_m = own.terrain_m if terrain is None else terrain.size_m
    low, high = fitting.ground_box(laid, source.rows, source.cols)
    inside = bool(np.all(low >= -own.spacing_m) and np.all(high <= size_m + own.spacing_m))
    return Placed(laid if inside else _centred(laid, source, size_m))


def _usable(crs: pyproj.CRS) -> bool:
    """Whether a file of this system can be laid by its place on Earth."""
    return on_earth(crs) and along_the_ground(crs)


def _answered(text: str) -> pyproj.CRS:
    """The system that somebody named. Raises ImportRefused for one that says nothing about the ground."""
    crs = parse_crs(text)
    if not along_the_ground(crs):
        raise ImportRefused(
            f"{crs_label(crs)[:40]} does not say where on the ground samples lie; name a geographic or a projected "
            "system."
        )
    return crs


def _reason(georef: Georef) -> str:
    if georef.crs is None:
        return "It does not name its coordinate system."
    label = crs_label(georef.crs)[:40]
    if georef.crs.is_geocentric:
        return f"Its coordinate system ({label}) counts from the middle of the Earth, not along the ground."
    if on_earth(georef.crs) or georef.crs.is_vertical:
        return f"Its coordinate system ({label}) does not say where on the ground its samples lie."
    return f"Its coordinate system ({label}) is not of the Earth."


def _on_earth(source: Source, georef: Georef, answer: str | None, named: bool, ask: Ask, terrain: Terrain) -> Placed:
    """A file with a place on Earth. ``named``: somebody said in which system, so that it must not be moved."""
    assert georef.crs is not None
    label = crs_label(georef.crs)
    at = fitting.middle(georef, source.rows, source.cols)
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
    laid = fitting.lay(fitting.on_frame(georef, there, terrain.size_m), source.rows, source.cols)
    _note_mercator(source, label, laid)
    return Placed(replace(laid, at=at), not moved, label, far_m)


def _far_m(source: Source, georef: Georef, terrain: Terrain | None) -> float | None:
    """Distance in metres from the middle of the terrain when the grid does not touch it, else None."""
    at = fitting.middle(georef, source.rows, source.cols)
    if terrain is None or terrain.place is None or at is None:
        return None
    arc = _great_circle_m(at, (terrain.place.lat_deg, terrain.place.lon_deg))
    if arc > 10 * c.MAX_SIZE_M + terrain.size_m:  # so far that the frame is not asked; no grid is that large
        return arc
    try:
        laid = fitting.lay(fitting.on_frame(georef, terrain.place, terrain.size_m), source.rows, source.cols)
    except ImportRefused:
        return arc
    low, high = fitting.ground_box(laid, source.rows, source.cols)
    outside = bool(np.any(high < 0.0) or np.any(low > terrain.size_m))
    return arc if outside else None


def _great_circle_m(a: tuple[float, float], b: tuple[float, float]) -> float:
    (lat_a, lon_a), (lat_b, lon_b) = (tuple(map(math.radians, point)) for point in (a, b))
    haversine = (
        math.sin(0.5 * (lat_b - lat_a)) ** 2 + math.cos(lat_a) * math.cos(lat_b) * math.sin(0.5 * (lon_b - lon_a)) ** 2
    )
    return 2.0 * EARTH_RADIUS_M * math.asin(min(1.0, math.sqrt(haversine)))


def _by_hand(source: Source, size_m: float) -> Laid:
    """A grid with coordinates in metres of nowhere, or in degrees of another body: its own shape and turn, in the
    middle of the terrain. Raises ImportRefused."""
    georef = source.georef
    assert georef is not None
    crs = georef.crs
    if crs is not None and crs.is_geographic and crs.ellipsoid is not None:
        locate = _of_degrees(source, georef, crs)
    else:
        unit = float(crs.axis_info[0].unit_conversion_factor) if crs is not None and crs.axis_info else 1.0
        locate = fitting.locally(georef, unit)
    return _centred(fitting.lay(locate, source.rows, source.cols), source, size_m)


def _of_degrees(source: Source, georef: Georef, crs: pyproj.CRS) -> fitting.Locate:
    """Locates samples that lie at degrees of another body by metres on its ground. Raises ImportRefused."""
    to_degrees = math.degrees(float(crs.axis_info[0].unit_conversion_factor)) if crs.axis_info else 1.0
    x, y = georef.at(np.array([0.5 * (source.cols - 1)]), np.array([0.5 * (source.rows - 1)]))
    lon, lat = float(x[0]) * to_degrees, float(y[0]) * to_degrees
    if not (abs(lon) <= 720.0 and abs(lat) <= 89.0):
        raise ImportRefused(
            f"Its middle lies at latitude {lat:.6g}, longitude {lon:.6g} of its body: at a pole or none."
        )
    frame = metres_of_degrees(crs, (lon, lat))
    assert crs.ellipsoid is not None
    radius = crs.ellipsoid.semi_major_metre
    source.notes.append(
        f"Its degrees are of a body of {radius / 1000:,.0f} km radius ({crs_label(crs)[:40]}); a degree there is "
        f"{math.radians(radius) / 1000:,.1f} km, and so it is laid."
    )

    def locate(cols: fitting.Points, rows: fitting.Points) -> tuple[fitting.Points, fitting.Points]:
        at_lon, at_lat = georef.at(cols, rows)
        east, north = frame(at_lon * to_degrees, at_lat * to_degrees, errcheck=False)
        return np.asarray(east), np.asarray(north)

    return locate


def _centred(laid: Laid, source: Source, size_m: float) -> Laid:
    low, high = fitting.ground_box(laid, source.rows, source.cols)
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
