"""Where a file says that its samples lie: coordinates of samples and the system they are in."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

import numpy as np
import pyproj
from numpy.typing import NDArray

from esker.importing.refusal import ImportRefused

Affine6 = tuple[float, float, float, float, float, float]
"""(a, b, c, d, e, f): x = a col + b row + c, y = d col + e row + f, at sample centres."""
EARTH_RADII: Final = (6_300_000.0, 6_450_000.0)


@dataclass(frozen=True, eq=False)
class Georef:
    """Coordinates of samples: by ``affine``, or by the axes ``xs`` (cols,) and ``ys`` (rows,); ``crs`` None: the file
    does not say in which system."""

    crs: pyproj.CRS | None
    affine: Affine6 | None = None
    xs: NDArray[np.float64] | None = None
    ys: NDArray[np.float64] | None = None

    def at(
        self, cols: NDArray[np.float64], rows: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coordinates x, y (any equal shape) of fractional sample indices."""
        if self.affine is not None:
            a, b, c0, d, e, f = self.affine
            return a * cols + b * rows + c0, d * cols + e * rows + f
        assert self.xs is not None
        assert self.ys is not None
        x = np.interp(cols, np.arange(self.xs.size), self.xs)
        y = np.interp(rows, np.arange(self.ys.size), self.ys)
        return x, y

    def with_crs(self, crs: pyproj.CRS | None) -> Georef:
        """Returns the coordinates, taken to be of another system."""
        return Georef(crs, self.affine, self.xs, self.ys)

    def looks_like_degrees(self, rows: int, cols: int) -> bool:
        """True when all coordinates could be longitudes and latitudes, with less than half a degree a step."""
        x, y = self.at(np.array([0.0, cols - 1, 0.0, cols - 1]), np.array([0.0, 0.0, rows - 1, rows - 1]))
        steps = self.at(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
        width = max(float(np.ptp(steps[0])), float(np.ptp(steps[1])))
        inside = np.all(np.abs(x) <= 360.0) and np.all(np.abs(y) <= 90.0)
        return bool(inside and 0.0 < width < 0.5)


def from_corner(a: float, b: float, c0: float, d: float, e: float, f: float) -> Affine6:
    """Affine of sample centres from one whose (0, 0) is the outer corner of the first cell (as GDAL's)."""
    return a, b, c0 + 0.5 * (a + b), d, e, f + 0.5 * (d + e)


def world_affine(text: str) -> Affine6 | None:
    """The affine of a world file: six numbers, those of the first column before those of the second, for the middles
    of samples. None for anything else."""
    try:
        a, d, b, e, c0, f = (float(word.replace(",", ".")) for word in text.split())
        return check_affine((a, b, c0, d, e, f))
    except (ValueError, ImportRefused):
        return None


def check_affine(affine: Affine6) -> Affine6:
    """The affine itself. Raises ImportRefused when it is not finite or maps the grid onto a line."""
    a, b, _, d, e, _ = affine
    det = a * e - b * d
    if not all(map(math.isfinite, affine)) or abs(det) <= 1e-12 * (math.hypot(a, d) * math.hypot(b, e)) or det == 0.0:
        raise ImportRefused("Its geotransform is degenerate: all samples would lie on one line.")
    return affine


def parse_crs(text: str) -> pyproj.CRS:
    """A coordinate system as a person or a .prj file writes it: EPSG:26910, 26910, WKT. Raises ImportRefused."""
    text = text.strip()
    if re.fullmatch(r"\d{4,6}", text):
        text = f"EPSG:{text}"
    if not (re.fullmatch(r"(?i)[a-z]{2,8}:\d{2,7}", text) or "[" in text):
        raise ImportRefused(f"{text[:40]!r} is no coordinate system; write for instance EPSG:26910.")
    try:
        return pyproj.CRS.from_user_input(text)
    except pyproj.exceptions.CRSError as error:
        raise ImportRefused(f"The coordinate system {text[:40]!r} is not known.") from error


def on_earth(crs: pyproj.CRS) -> bool:
    """True when the body of the system is about as large as the Earth."""
    if crs.ellipsoid is None:
        return False
    return EARTH_RADII[0] < crs.ellipsoid.semi_major_metre < EARTH_RADII[1]


def along_the_ground(crs: pyproj.CRS) -> bool:
    """True when the first two coordinates of a system say where on a map something lies: longitude and latitude, or
    the coordinates of a projection. False for geocentric and vertical systems."""
    return bool(crs.is_geographic or crs.is_projected)


def metres_of_degrees(crs: pyproj.CRS, middle: tuple[float, float]) -> pyproj.Proj:
    """The transverse Mercator projection of the body of a geographic system around ``middle`` (longitude, latitude in
    degrees), scale 1 there, in metres: the projection of the terrain's own frame, on another body."""
    assert crs.ellipsoid is not None
    a, b = crs.ellipsoid.semi_major_metre, crs.ellipsoid.semi_minor_metre
    lon, lat = middle
    return pyproj.Proj(f"+proj=tmerc +lat_0={lat!r} +lon_0={lon!r} +k=1 +a={a!r} +b={b!r} +units=m +no_defs")


def crs_label(crs: pyproj.CRS) -> str:
    """How a person writes the system: its authority code, else its name."""
    authority = crs.to_authority(min_confidence=70)
    label = ":".join(authority) if authority else crs.name
    return label[:80]


def horizontal_unit_m(crs: pyproj.CRS) -> float | None:
    """Metres per unit of a projected system's coordinates, None for others."""
    if not crs.is_projected or not crs.axis_info:
        return None
    return float(crs.axis_info[0].unit_conversion_factor)


def vertical_unit_m(crs: pyproj.CRS) -> float | None:
    """Metres per unit of the system's height axis, None when it has none."""
    for part in crs.sub_crs_list:
        if part.is_vertical and part.axis_info:
            return float(part.axis_info[0].unit_conversion_factor)
    return None
