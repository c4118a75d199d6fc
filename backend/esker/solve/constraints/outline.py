"""Geometry of level crests: segments of a polyline, the inside of a closed one (see ``tables``). NumPy float64."""

from __future__ import annotations

import numpy as np

from esker.solve.constraints.tables import LONGEST_CELLS, SEGMENT_FIELDS, Floats, Ints


def segments_of(ring: Floats, closed: bool) -> Floats:
    """SEGMENT_FIELDS of a polyline (n, 3), cells and metres of height, shape (13, segments).

    A point is one segment of no length. A closed polyline ends where it begins.
    """
    if len(ring) == 1:
        out = np.zeros((len(SEGMENT_FIELDS), 1))
        out[:2, 0], out[11, 0] = ring[0, :2], ring[0, 2]
        out[5], out[7], out[9], out[10] = 1.0, 1.0, 1.0, 1.0
        return out
    d, rise = np.diff(ring[:, :2], axis=0), np.diff(ring[:, 2])
    length2 = d[:, 0] ** 2 + d[:, 1] ** 2
    unit = d / np.sqrt(length2)[:, None]
    joint = unit[:-1] + unit[1:]
    wrap = unit[-1] + unit[0] if closed else unit[0]
    before = _unit_or(np.vstack([wrap, joint]), unit)
    after = _unit_or(np.vstack([joint, wrap if closed else unit[-1]]), unit)
    caps = np.zeros((2, len(d)))
    if not closed:
        caps[0, 0] = caps[1, -1] = 1.0
    return np.vstack([ring[:-1, :2].T, d.T, 1 / length2, before.T, after.T, caps, ring[:-1, 2], rise])


def cut(line: Floats) -> Floats:
    """A polyline (n, 3), cells and metres of height, whose segments are at most LONGEST_CELLS long."""
    parts = np.ceil(np.hypot(*np.diff(line[:, :2], axis=0).T) / LONGEST_CELLS).astype(int)
    if (parts <= 1).all():
        return line
    knots = np.concatenate([k + np.arange(m) / m for k, m in enumerate(np.maximum(parts, 1))] + [[len(line) - 1.0]])
    return np.column_stack([np.interp(knots, np.arange(len(line)), line[:, axis]) for axis in range(3)])


def _unit_or(v: Floats, fallback: Floats) -> Floats:
    """Rows of ``v`` made unit length; rows that vanish (a fold) take the fallback."""
    length = np.hypot(v[:, 0], v[:, 1])[:, None]
    return np.where(length > 1e-6, v / np.maximum(length, 1e-30), fallback)


def spans_of(points: Floats, row0: int, row1: int) -> tuple[Ints, Floats]:
    """Inside of a closed outline (n, 2) by non-zero winding: per sample row of row0 .. row1 - 1 intervals [x0, x1].

    Cells. Returns CSR: index (row1 - row0 + 1), spans (m, 2). A loop drawn twice, or an eight, is inside all that it
    encloses.
    """
    ring = np.vstack([points, points[:1]])
    (x0, y0), (x1, y1) = ring[:-1].T, ring[1:].T
    first = np.clip(np.ceil(np.minimum(y0, y1)), row0, row1).astype(np.int64)
    count = np.maximum(np.clip(np.ceil(np.maximum(y0, y1)), row0, row1).astype(np.int64) - first, 0)
    edge = np.repeat(np.arange(len(count)), count)
    row = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + first[edge]
    x = x0[edge] + (row - y0[edge]) / (y1 - y0)[edge] * (x1 - x0)[edge]
    order = np.lexsort((x, row))
    x, row = x[order], row[order]
    # a closed line crosses a row as often upwards as downwards: the sum is 0 again at the end of each row
    inside = np.flatnonzero(np.cumsum(np.where(y1 > y0, 1, -1)[edge][order])[:-1])
    index = np.zeros(row1 - row0 + 1, dtype=np.int32)
    np.add.at(index, row[inside] - row0 + 1, 1)
    return np.cumsum(index, dtype=np.int32), np.column_stack([x[inside], x[inside + 1]]).reshape(-1, 2)
