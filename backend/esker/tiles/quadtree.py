"""View-dependent selection of tiles, as array operations (DESIGN 7; paper 0, III-A; paper 1, 3.2).

The server selects what a client's view needs; the client selects again, per 16-cell sub-patch, among what it holds.
A tile is wanted when its ground is in view and drawing its parent there would be seen: the parent's cells are wider
than tau, and the error that this tile or a descendant corrects projects to more than tau, or bends the light on cells
that are wide on the screen. Flat land is therefore never refined. The set is closed under parents and restricted: the
eight neighbours of a wanted tile's parent are wanted, so neighbours in the drawn cut, corners too, differ by at most
one level.
"""

from __future__ import annotations

import math
from typing import Final, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from esker.contract import QUANTA_PER_CELL, View
from esker.tiles.bounds import Bounds, Floats, dilate

Mask = NDArray[np.bool_]
Vector = NDArray[np.float64]
T = TypeVar("T", bound=np.generic)

ALWAYS: Final = 2
"""Levels 0..2 are always wanted, whatever the view: they are small, and shading and picking lean on them."""
MARGIN: Final = 0.8
"""The client refines at tau; the server sends at this part of it, so that a step nearer finds tiles."""
SHADING_CELL_PX: Final = 5.0
SHADING_ERROR: Final = 1.5 / QUANTA_PER_CELL
"""Lighting shows more than height does: where the parent's cells are wider than SHADING_CELL_PX taus, an error of this
part of such a cell is reason enough (as in ``frontend/src/tiles/patches/selection.ts``)."""
FRUSTUM_MARGIN: Final = 1.15
"""The half-angle tangents of the frustum are enlarged by this factor, so that a turning camera finds tiles."""
_NEAR_CELLS: Final = 4.0
"""Distances are not taken below this many cells of level 6 or one metre, whichever is larger."""


def default_selection(levels: int) -> list[Mask]:
    """Returns the tiles that a client gets before it has sent a view: levels 0..2, one (2^l, 2^l) mask per level."""
    return [np.full((1 << level, 1 << level), level <= ALWAYS, dtype=np.bool_) for level in range(levels + 1)]


def _axes(view: View) -> tuple[Vector, Vector, Vector, Vector]:
    """Returns eye and unit vectors forward, right, up.

    Where eye and target coincide or lie on a plumb line, the frame is some valid one.
    """
    eye = np.asarray(view.eye, dtype=np.float64)
    forward = np.asarray(view.target, dtype=np.float64) - eye
    length = float(np.linalg.norm(forward))
    forward = forward / length if length > 0 else np.array([0.0, 1.0, 0.0])
    fx, fy, fz = forward.tolist()
    across = math.hypot(fx, fy)
    rx, ry = (fy / across, -fx / across) if across > 1e-6 else (1.0, 0.0)
    up = np.array([ry * fz, -rx * fz, rx * fy - ry * fx])  # this is right x forward: np.cross takes ten times as long
    return eye, forward, np.array([rx, ry, 0.0]), up


class Boxes(Protocol):
    """Tiles as boxes with an error: the part of ``bounds.Bounds`` that projection needs, arrays of one length."""

    @property
    def size_m(self) -> float: ...
    @property
    def x(self) -> Floats: ...
    @property
    def y(self) -> Floats: ...
    @property
    def half(self) -> Floats: ...
    @property
    def spacing(self) -> Floats: ...
    @property
    def low(self) -> Floats: ...
    @property
    def high(self) -> Floats: ...
    @property
    def error(self) -> Floats: ...
    @property
    def valid(self) -> NDArray[np.bool_]: ...


def screen_error(bounds: Boxes, view: View) -> tuple[Mask, Floats, Floats]:
    """Per box, (n,) each: is it in the enlarged frustum; its error; its parent's cell size. Both in pixels.

    Lengths are projected at the nearest point of the tile's box, a bound from above. The frustum has no far plane;
    the near plane passes through the eye.
    """
    eye, forward, right, up = _axes(view)
    tan_y = math.tan(math.radians(view.fov_deg) / 2)
    tan_x = tan_y * view.width / view.height
    mid = (bounds.low + bounds.high) * np.float32(0.5)
    tall = bounds.high - mid
    dx, dy, dz = bounds.x - np.float32(eye[0]), bounds.y - np.float32(eye[1]), mid - np.float32(eye[2])
    half = bounds.half

    inside = bounds.valid.copy()
    planes = [forward]
    for side, tan in ((right, tan_x), (up, tan_y)):
        planes += [forward * (tan * FRUSTUM_MARGIN) - side, forward * (tan * FRUSTUM_MARGIN) + side]
    for n in planes:
        a, b, c = (np.float32(v) for v in n)
        reach = dx * a + dy * b + dz * c + half * (abs(a) + abs(b)) + tall * abs(c)
        inside &= reach >= 0

    px = np.maximum(np.abs(dx) - half, 0)
    py = np.maximum(np.abs(dy) - half, 0)
    pz = np.maximum(np.abs(dz) - tall, 0)
    nearest = max(1.0, _NEAR_CELLS * bounds.size_m / 4096)
    distance = np.maximum(np.sqrt(px * px + py * py + pz * pz), np.float32(nearest))
    pixels = np.float32(view.height / (2 * tan_y)) / distance
    return inside, bounds.error * pixels, bounds.spacing * (2 * pixels)


def restrict(masks: list[Mask]) -> list[Mask]:
    """Grows ``masks`` to the smallest superset that holds every tile's parent and the parent's eight neighbours."""
    for level in range(len(masks) - 1, 0, -1):
        n = 1 << (level - 1)
        parents: Mask = np.asarray(masks[level].reshape(n, 2, n, 2).any(axis=(1, 3)), dtype=np.bool_)
        masks[level - 1] |= dilate(parents)
    return masks


def select(bounds: Bounds, view: View) -> tuple[list[Mask], list[Floats]]:
    """Returns wanted tiles and their projected errors (pixels), one (2^l, 2^l) array per level, rows from the south."""
    found = screen_error(bounds, view)
    return _chosen(bounds, *found, MARGIN * view.tau_px), _by_level(bounds, found[1])


def select_shown(bounds: Bounds, view: View) -> tuple[list[Mask], list[Mask], list[Floats]]:
    """Returns what ``select`` does, with the wanted tiles that the view shows as it is, without MARGIN, between the
    two."""
    found = screen_error(bounds, view)
    wanted, shown = (_chosen(bounds, *found, margin * view.tau_px) for margin in (MARGIN, 1.0))
    return wanted, shown, _by_level(bounds, found[1])


def _chosen(bounds: Bounds, inside: Mask, error: Floats, cell: Floats, tau: float) -> list[Mask]:
    """Restricted masks of the tiles that are worth sending at ``tau`` pixels; the others: see ``screen_error``."""
    bends = (bounds.error > SHADING_ERROR * 2 * bounds.spacing) & (cell > SHADING_CELL_PX * tau)
    wanted = inside & (cell > tau) & ((error > tau) | bends)
    wanted[: (4 ** (ALWAYS + 1) - 1) // 3] = True
    return restrict(_by_level(bounds, wanted))


def _by_level(bounds: Bounds, flat: NDArray[T]) -> list[NDArray[T]]:
    """Cuts an array over all tiles into one (2^l, 2^l) array per level."""
    sides = (1 << level for level in range(len(bounds.starts)))
    return [flat[start : start + n * n].reshape(n, n) for start, n in zip(bounds.starts, sides, strict=True)]
