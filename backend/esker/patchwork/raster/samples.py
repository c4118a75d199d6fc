"""The samples of a patch: cut from its mipmap level, and carried on beyond the level's border and into nodata.

Ground goes on with the slope that it has there: from three samples in line, nearest first a, b, c, the next is a + s,
with s the smaller of a - b and b - c where these have one sign, else 0 (minmod). So a plane goes on as a plane, while a
peak, a cliff or noise at the very border is not thrown out: two samples further on are no farther from a than c is.

Where ``bent`` (terrains from edition 3 on) smooth ground also goes on with the bend that it has there: of the three
second differences of five samples in line the least, faded out where they differ by a quarter to a half of the most. So
a parabola goes on as a parabola, and a grid that ends in ground that another one shows, too, agrees with it. Noise has
no three alike second differences but by chance, about once in a hundred.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel

IN_LINE = 3
"""Samples from which the next one follows."""
BEND_IN_LINE = 5
"""Samples from which a bend follows."""


@kernel
def following(a: float, b: float, c: float) -> float:
    """The sample that follows c, b, a; NaN for NaN among them."""
    near, far = a - b, b - c
    if near * far <= 0.0:
        return a
    return a + (near if abs(near) < abs(far) else far)


@kernel
def course(a: float, b: float, c: float, d: float, e: float) -> tuple[float, float]:
    """How e, d, c, b, a go on: by ``rise`` and ``bend``, so that sample k is a + k rise + k (k + 1) / 2 bend.

    e, d: NaN where they are not known; there is no bend then. Nor is there a rise where c or b is NaN.
    """
    near, far = a - b, b - c
    rise = 0.0
    if near * far > 0.0:
        rise = near if abs(near) < abs(far) else far
    first, second, third = near - far, far - (c - d), (c - d) - (d - e)
    low, high = min(first, second, third), max(first, second, third)
    if not low * high > 0.0 or np.isnan(second) or np.isnan(third):
        return rise, 0.0
    least, most = min(abs(low), abs(high)), max(abs(low), abs(high))
    share = min(max(2.0 - 4.0 * (most - least) / most, 0.0), 1.0)
    return rise + share * (near - rise), share * (least if low > 0.0 else -least)


@kernel
def beyond(line: NDArray[np.float32], low: bool) -> float:
    """The sample before the first (``low``) or after the last of a line; as that one is where the line is short."""
    n = line.size
    if n < IN_LINE:
        return float(line[0] if low else line[n - 1])
    if low:
        return following(float(line[0]), float(line[1]), float(line[2]))
    return following(float(line[n - 1]), float(line[n - 2]), float(line[n - 3]))


@kernel
def cut(mip: NDArray[np.float32], row: int, col: int, out: NDArray[np.float32], bent: bool) -> None:
    """Copy the samples of ``mip`` from [row, col] on to ``out`` (side, side).

    Beyond the level's border its slope goes on, along rows first, and its bend where ``bent``. Nodata, which only lies
    in the margin, is filled ring by ring outwards from valid samples (``fill``), also from those that lie around the
    patch, as many as count in line.
    """
    _copy(mip, row, col, out, bent)
    side, deep = out.shape[0], BEND_IN_LINE if bent else IN_LINE
    for r in range(side):
        for c in range(side):
            if np.isnan(out[r, c]):
                wide = np.empty((side + 2 * deep, side + 2 * deep), np.float32)
                _copy(mip, row - deep, col - deep, wide, bent)
                fill(wide, bent)
                _middle(wide, deep, out)
                return


@kernel
def _middle(wide: NDArray[np.float32], deep: int, out: NDArray[np.float32]) -> None:
    """What lies ``deep`` samples within ``wide``. One slice assigned to another would take seconds to compile."""
    for r in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[r, c] = wide[deep + r, deep + c]


@kernel
def _copy(mip: NDArray[np.float32], row: int, col: int, out: NDArray[np.float32], bent: bool) -> None:
    """The samples from [row, col] on, nodata as it is."""
    if bent:
        _copy_bent(mip, row, col, out)
        return
    rows, side = mip.shape[0], out.shape[0]
    top, end = max(0, -row), min(side, rows - row)
    for r in range(top, end):
        row_of(mip, row + r, col, out[r])
    if top > 0 or end < side:
        _rows_beyond(mip, col, top, end, out)


@kernel
def _copy_bent(mip: NDArray[np.float32], row: int, col: int, out: NDArray[np.float32]) -> None:
    """The samples from [row, col] on, nodata as it is, with the bend that the level has at its border."""
    (rows, cols), side = mip.shape, out.shape[0]
    left, right = min(max(0, -col), side), max(min(side, cols - col), 0)
    top, end = max(0, -row), min(side, rows - row)
    for r in range(top, end):
        source = mip[row + r]
        for c in range(left, right):
            out[r, c] = source[col + c]
        if left > 0:
            _bend_on(source, out[r], left - 1, -1, col + left - 1)
        if right < side:
            _bend_on(source[::-1], out[r], right, 1, cols - col - right - 1)
    if top == 0 and end == side:
        return
    deep = min(BEND_IN_LINE, rows)
    near = np.empty((deep, side), np.float32)
    for low in (True, False):
        at = top - 1 if low else end
        if not 0 <= at < side:
            continue
        for k in range(deep):
            source = mip[k if low else rows - 1 - k]
            for c in range(left, right):
                near[k, c] = source[col + c]
            if left > 0:
                _bend_on(source, near[k], left - 1, -1, col + left - 1)
            if right < side:
                _bend_on(source[::-1], near[k], right, 1, cols - col - right - 1)
        for c in range(side):
            _bend_on(near[:, c], out[:, c], at, -1 if low else 1, row + at if low else rows - row - at - 1)


@kernel
def _bend_on(source: NDArray[np.float32], line: NDArray[np.float32], at: int, step: int, place: int) -> None:
    """Fill ``line`` from ``at`` on, in steps of 1 or -1, with what goes on before the first of ``source``.

    ``place``: where in ``source`` the sample at ``at`` would be, -1 for the one right before its first.
    """
    n = source.size
    first = float(source[0])
    second, third = float(source[1]) if n > 1 else np.nan, float(source[2]) if n > 2 else np.nan
    fourth, fifth = float(source[3]) if n > 3 else np.nan, float(source[4]) if n > 4 else np.nan
    rise, bend = course(first, second, third, fourth, fifth)
    count = -place
    while 0 <= at < line.size:
        line[at] = first + count * rise + 0.5 * count * (count + 1) * bend
        count += 1
        at += step


@kernel
def _go_on(last: float, following_: float, line: NDArray[np.float32], at: int, step: int) -> None:
    """Fill ``line`` from ``at`` on, in steps of 1 or -1, with the line through the last sample and the one after it.

    Where samples before the last are nodata the last goes on as it is.
    """
    rise = following_ - last
    if np.isnan(rise):
        rise = 0.0
    count = 0
    while 0 <= at < line.size:
        count += 1
        line[at] = last + count * rise
        at += step


@kernel
def _rows_beyond(mip: NDArray[np.float32], col: int, top: int, end: int, out: NDArray[np.float32]) -> None:
    """Rows of ``out`` outside of top..end, as the level goes on."""
    side = out.shape[0]
    last, after = np.empty(side, np.float32), np.empty(side, np.float32)
    for low in (True, False):
        if (top if low else side - end) > 0:
            row_of(mip, 0 if low else mip.shape[0] - 1, col, last)
            row_beyond(mip, low, col, after)
            for c in range(side):
                _go_on(last[c], after[c], out[:, c], top - 1 if low else end, -1 if low else 1)


@kernel
def row_beyond(mip: NDArray[np.float32], low: bool, col: int, out: NDArray[np.float32]) -> None:
    """The row before the first (``low``) or after the last of a level, from column ``col`` on."""
    deep = min(IN_LINE, mip.shape[0])
    near = np.empty((deep, out.size), np.float32)
    for k in range(deep):
        row_of(mip, k if low else mip.shape[0] - 1 - k, col, near[k])
    for c in range(out.size):
        out[c] = beyond(near[:, c], True)


@kernel
def row_of(mip: NDArray[np.float32], row: int, col: int, out: NDArray[np.float32]) -> None:
    """Row ``row`` of a level from column ``col`` on, as it goes on beyond its ends."""
    cols = mip.shape[1]
    source = mip[row]
    left, right = max(0, -col), min(out.size, cols - col)
    for c in range(left, right):
        out[c] = source[col + c]
    if left > 0:
        _go_on(source[0], beyond(source, True), out, left - 1, -1)
    if right < out.size:
        _go_on(source[cols - 1], beyond(source, False), out, right, 1)


@kernel
def fill(out: NDArray[np.float32], bent: bool = False) -> None:
    """Replace the NaN of samples (side, side), ring by ring from valid ones.

    As many at the edges as count in line stay as they are.

    Each takes the mean of what follows in those of the eight directions where three samples in line are known; if
    there is none, the mean of its known neighbours. Without any valid sample all stay.
    """
    side, deep = out.shape[0], BEND_IN_LINE if bent else IN_LINE
    known = np.empty_like(out)
    for _ in range(2 * side):
        holes = 0
        for r in range(side):
            for c in range(side):
                known[r, c] = out[r, c]
        for r in range(side):
            for c in range(side):
                if np.isnan(known[r, c]):
                    out[r, c] = _filled(known, r, c, bent)
                    inner = deep <= r < side - deep and deep <= c < side - deep
                    if inner and np.isnan(out[r, c]):
                        holes += 1
        if holes == 0:
            return


@kernel
def _filled(known: NDArray[np.float32], row: int, col: int, bent: bool) -> float:
    """Returns the height that a sample of nodata is taken for, NaN if it has no known neighbour."""
    side = known.shape[0]
    sloping, slopes, total, count = 0.0, 0, 0.0, 0
    for dr in range(-1, 2):
        for dc in range(-1, 2):
            r, c = row + dr, col + dc
            if (dr == 0 and dc == 0) or not (0 <= r < side and 0 <= c < side) or np.isnan(known[r, c]):
                continue
            total += known[r, c]
            count += 1
            y, x = row + IN_LINE * dr, col + IN_LINE * dc
            if 0 <= y < side and 0 <= x < side:
                value = following(float(known[r, c]), float(known[r + dr, c + dc]), float(known[y, x]))
                y, x = row + BEND_IN_LINE * dr, col + BEND_IN_LINE * dc
                if bent and 0 <= y < side and 0 <= x < side:
                    value = _bent_following(known, r, c, dr, dc, value)
                if not np.isnan(value):
                    sloping += value
                    slopes += 1
    if slopes:
        return sloping / slopes
    return total / count if count else np.nan


@kernel
def _bent_following(known: NDArray[np.float32], row: int, col: int, dr: int, dc: int, straight: float) -> float:
    """The sample before [row, col], where its line begins, by the course of five; ``straight``: by that of three."""
    if np.isnan(straight):
        return straight
    a, b, c = float(known[row, col]), float(known[row + dr, col + dc]), float(known[row + 2 * dr, col + 2 * dc])
    d, e = float(known[row + 3 * dr, col + 3 * dc]), float(known[row + 4 * dr, col + 4 * dc])
    rise, bend = course(a, b, c, d, e)
    return a + rise + bend
