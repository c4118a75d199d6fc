"""From the coordinates of a file to the terrain's frame: the best anchor, rotation and steps, and a net for the rest.

A layer lies on the terrain by an anchor, a rotation and two steps (contract.Layer). What a file's place has beyond
that (the bend of a geographic grid, shear, the distortion of another projection) goes into a net of displacements in
lattice units, refined until it misses no sample by more than a twentieth of a step, measured on the ground.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import pyproj
from numpy.typing import NDArray

from esker import contract as c
from esker.importing.placement.georef import Georef, on_earth
from esker.importing.refusal import ImportRefused

Points = NDArray[np.float64]
Locate = Callable[[Points, Points], tuple[Points, Points]]
"""World x, y in metres of fractional (col, row) in the file's order."""

NET_ERROR_SAMPLES: Final = 1 / 20
NET_AIM_SAMPLES: Final = 1 / 100
NO_NET_SAMPLES: Final = 1e-4
"""Below this a net is not worth having: 1 mm on a grid of 10 m."""
NET_STEPS: Final = 2.0**-20
"""Displacements are rounded to this many lattice units, so that two machines make the same content."""
MAX_NET: Final = 257
FIT_POINTS: Final = 17
WGS84: Final = "EPSG:4326"


@dataclass(frozen=True, eq=False)
class Laid:
    """Where a grid lies. ``flip_rows``, ``flip_cols``: turn the file's array so before it is stored; ``warp``: float64
    (m, n, 2) in lattice units or None; ``error_m``: what is left, on the ground; ``at``: WGS 84 (lat, lon)."""

    anchor: tuple[float, float]
    rotation_deg: float
    spacing_m: tuple[float, float]
    flip_rows: bool
    flip_cols: bool
    warp: NDArray[np.float64] | None = None
    error_m: float = 0.0
    at: tuple[float, float] | None = None


def frame(place: c.Place, size_m: float) -> pyproj.CRS:
    """The terrain's frame: transverse Mercator of WGS 84 around ``place``, which lies in the middle of the domain."""
    half = 0.5 * size_m
    return pyproj.CRS.from_proj4(
        f"+proj=tmerc +lat_0={place.lat_deg!r} +lon_0={place.lon_deg!r} +k=1 +x_0={half!r} +y_0={half!r} "
        "+datum=WGS84 +units=m +no_defs"
    )


def on_earth_from_frame(place: c.Place, size_m: float, x: Points, y: Points) -> tuple[Points, Points]:
    """WGS 84 longitudes and latitudes of points of the terrain's frame, metres."""
    to_earth = pyproj.Transformer.from_crs(frame(place, size_m), WGS84, always_xy=True)
    lon, lat = to_earth.transform(x, y)
    return lon, lat


def middle(georef: Georef, rows: int, cols: int) -> tuple[float, float] | None:
    """WGS 84 (lat, lon) of the middle of a grid on Earth; None when it cannot be told."""
    if georef.crs is None or not on_earth(georef.crs):
        return None
    x, y = georef.at(np.array([0.5 * (cols - 1)]), np.array([0.5 * (rows - 1)]))
    try:
        lon, lat = pyproj.Transformer.from_crs(georef.crs, WGS84, always_xy=True).transform(x, y)
    except pyproj.exceptions.ProjError:
        return None
    if not (np.isfinite(lon[0]) and np.isfinite(lat[0]) and abs(lat[0]) <= 89.0):
        return None
    return float(lat[0]), float((lon[0] + 180.0) % 360.0 - 180.0)


def on_frame(georef: Georef, place: c.Place, size_m: float) -> Locate:
    """Locates samples of a file with a place on Earth in the terrain's frame."""
    assert georef.crs is not None
    transformer = pyproj.Transformer.from_crs(georef.crs, frame(place, size_m), always_xy=True)

    def locate(cols: Points, rows: Points) -> tuple[Points, Points]:
        x, y = transformer.transform(*georef.at(cols, rows), errcheck=False)
        return np.asarray(x), np.asarray(y)

    return locate


def locally(georef: Georef, unit_m: float) -> Locate:
    """Locates samples by the file's own numbers, taken for lengths of ``unit_m`` metres from nowhere in particular."""

    def locate(cols: Points, rows: Points) -> tuple[Points, Points]:
        x, y = georef.at(cols, rows)
        return x * unit_m, y * unit_m

    return locate


def lay(locate: Locate, rows: int, cols: int) -> Laid:
    """The layer's place that fits ``locate`` best, with a net for the rest. Raises ImportRefused."""
    col, row = _lattice(cols, rows, FIT_POINTS)
    world = np.stack(locate(col, row), axis=-1)
    if not np.all(np.isfinite(world)):
        raise ImportRefused("It reaches where the terrain's frame cannot: it covers too much ground, or a pole.")
    if float(np.abs(world).max()) > 8 * c.ABSOLUTE_BOUND_M:
        raise ImportRefused("It covers too much ground for one terrain. Cut out the part that you need first.")
    flip_rows, flip_cols, across, up = _orient(_affine(col, row, world), rows, cols)
    rotation, steps = _rotation(across, up, rows, cols)
    turn = _turn(rotation) * np.array(steps)

    def place_of(u: Points, v: Points) -> Points:
        return np.stack(locate(cols - 1 - u if flip_cols else u, rows - 1 - v if flip_rows else v), axis=-1)

    u, v = _lattice(cols, rows, FIT_POINTS)
    rest = place_of(u, v) - np.stack([u, v], axis=-1) @ turn.T
    anchor = np.round(rest.mean(axis=0), 4)
    inverse = np.linalg.inv(turn)

    def displacement(u: Points, v: Points) -> Points:
        found: Points = (place_of(u, v) - anchor) @ inverse.T - np.stack([u, v], axis=-1)
        return found

    warp, error_m = _net(displacement, rows, cols, turn)
    return Laid((float(anchor[0]), float(anchor[1])), rotation, steps, flip_rows, flip_cols, warp, error_m)


def _lattice(cols: int, rows: int, count: int) -> tuple[Points, Points]:
    """A lattice of about ``count`` x ``count`` points over a grid, flat: (u, v)."""
    u, v = np.meshgrid(np.linspace(0, cols - 1, min(cols, count)), np.linspace(0, rows - 1, min(rows, count)))
    return u.reshape(-1), v.reshape(-1)


def _affine(col: Points, row: Points, world: Points) -> Points:
    """Least-squares 2 x 3 affine (col, row, 1) -> world."""
    middle_col, middle_row = col.mean(), row.mean()
    design = np.stack([col - middle_col, row - middle_row, np.ones_like(col)], axis=-1)
    solution = np.linalg.lstsq(design, world, rcond=None)[0]
    return np.asarray(solution.T)


def _orient(affine: Points, rows: int, cols: int) -> tuple[bool, bool, Points, Points]:
    """Flips that make the lattice right-handed and turn it least; steps of one column and of one row after them."""
    best: tuple[float, bool, bool, Points, Points] | None = None
    for flip_rows, flip_cols in itertools.product((False, True), repeat=2):
        across = affine[:, 0] * (-1.0 if flip_cols else 1.0)
        up = affine[:, 1] * (-1.0 if flip_rows else 1.0)
        if across[0] * up[1] - across[1] * up[0] <= 0.0:
            continue
        turn = abs(_rotation(across, up, rows, cols)[0])
        if best is None or turn < best[0] - 1e-9:
            best = (turn, flip_rows, flip_cols, across, up)
    if best is None:
        raise ImportRefused("Its geotransform is degenerate: all samples would lie on one line.")
    _, flip_rows, flip_cols, across, up = best
    return flip_rows, flip_cols, across, up


def _rotation(across: Points, up: Points, rows: int, cols: int) -> tuple[float, tuple[float, float]]:
    """Degrees counter-clockwise and steps of the turned rectangle nearest to a pair of lattice vectors.

    The rotation that maximises the sum of both sides' projections, weighted by their lengths. Raises ImportRefused.
    """
    a, b = across * (cols - 1), up * (rows - 1)
    angle = math.atan2(a[1] - b[0], a[0] + b[1])
    degrees = round(math.degrees(angle), 7) + 0.0  # makes 0.0 of -0.0
    matrix = _turn(degrees)
    steps = (float(across @ matrix[:, 0]), float(up @ matrix[:, 1]))
    if not all(c.MIN_GRID_SPACING_M <= step <= c.MAX_GRID_SPACING_M for step in steps):
        raise ImportRefused(f"Its samples are {steps[0]:.6g} x {steps[1]:.6g} m apart: that is no grid for a terrain.")
    return degrees, (round(steps[0], 9), round(steps[1], 9))


def _turn(degrees: float) -> Points:
    angle = math.radians(degrees)
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def _net(
    displacement: Callable[[Points, Points], Points], rows: int, cols: int, turn: Points
) -> tuple[NDArray[np.float64] | None, float]:
    """The coarsest net that is good enough, and the largest error that it leaves in metres. Raises ImportRefused."""
    step = float(min(np.hypot(*turn[:, 0]), np.hypot(*turn[:, 1])))
    none = _error_m(displacement, None, rows, cols, FIT_POINTS * 4, turn)
    if none <= NO_NET_SAMPLES * step:
        return None, none
    count = 2
    while True:
        n, m = min(count, cols), min(count, rows)
        u, v = np.meshgrid(np.linspace(0, cols - 1, n), np.linspace(0, rows - 1, m))
        net = displacement(u.reshape(-1), v.reshape(-1)).reshape(m, n, 2)
        net = np.round(net / NET_STEPS) * NET_STEPS
        error = _error_m(displacement, net, rows, cols, 4 * count + 1, turn)
        if error <= NET_AIM_SAMPLES * step:
            return net, error
        if count >= MAX_NET:
            break
        count = 2 * count - 1
    if error > NET_ERROR_SAMPLES * step:
        raise ImportRefused("It bends too much in the terrain's frame: it covers too much ground.")
    return net, error


def _error_m(
    displacement: Callable[[Points, Points], Points],
    net: NDArray[np.float64] | None,
    rows: int,
    cols: int,
    count: int,
    turn: Points,
) -> float:
    """Largest distance on the ground between the net's and the true places of samples, checked at count x count."""
    u, v = (np.round(axis) for axis in _lattice(cols, rows, count))
    true = displacement(u, v)
    said = np.zeros_like(true) if net is None else net_at(net, u, v, rows, cols)
    return float(np.hypot(*((true - said) @ turn.T).T).max())


def net_at(net: NDArray[np.float64], u: Points, v: Points, rows: int, cols: int) -> Points:
    """Displacements (n, 2) of a net at lattice points, bilinear between its control points."""
    m, n = net.shape[:2]
    b = np.clip(u * (n - 1) / (cols - 1), 0, n - 1)
    a = np.clip(v * (m - 1) / (rows - 1), 0, m - 1)
    j, i = np.minimum(b.astype(int), max(n - 2, 0)), np.minimum(a.astype(int), max(m - 2, 0))
    fb, fa = (b - j)[:, None], (a - i)[:, None]
    low = net[i, j] * (1 - fb) + net[i, j + 1] * fb
    high = net[i + 1, j] * (1 - fb) + net[i + 1, j + 1] * fb
    return np.asarray(low * (1 - fa) + high * fa)


def ground_box(laid: Laid, rows: int, cols: int) -> tuple[Points, Points]:
    """Lower and upper corner, world metres, of a laid grid's samples (without its net)."""
    corners = np.array([[0, 0], [cols - 1, 0], [0, rows - 1], [cols - 1, rows - 1]], float)
    world = np.array(laid.anchor) + (corners * laid.spacing_m) @ _turn(laid.rotation_deg).T
    return world.min(axis=0), world.max(axis=0)
