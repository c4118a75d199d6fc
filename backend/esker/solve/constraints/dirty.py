"""Finds the bins that an edit inside one stroke can change (DESIGN 5.5): its changed part reaches them before or after.

What a sample gets depends on its nearest crest point and what the tables say there. So segments that both versions of
an outline have, and stretches of a profile that are the same in both, keep the bits of all samples nearest to them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.solve.constraints.packing import Packed, window_of
from esker.solve.constraints.tables import STROKE_AT, BinBox, Floats, Window, union

_MAY_DIFFER = ("reach", "length")
_PARTS = 16
"""Rectangles that a changed stretch of a profile is covered with."""
_KEPT = [at for name, at in STROKE_AT.items() if name not in _MAY_DIFFER]


def changed(old: Packed | None, new: Packed | None, box: BinBox) -> Window | None:
    """The bins of a whole level whose constraints may differ between two versions of a stroke (None: it is not there).

    None when no bin does.
    """
    whole = [p.window for p in (old, new) if p is not None]
    if old is None or new is None or not np.array_equal(_read(old.params)[_KEPT], _read(new.params)[_KEPT]):
        return union(whole)
    if old.segments is not None and new.segments is not None:
        reach = STROKE_AT["reach"]
        if old.spans is not None or new.spans is not None or old.params[reach] != new.params[reach]:
            return union(whole)
        return _changed_outline(old.segments, new.segments, float(new.params[reach]), box)
    interval = _changed_interval(old, new)
    if interval is None:
        return union(whole)
    strip, both = _strip(old, new, *interval, box), union(whole)
    return None if strip is None or both is None else strip.within(both)


def _read(array: Floats) -> NDArray[np.float32]:
    """Rounds a table to what a kernel reads of it."""
    return array.astype(np.float32)


def _changed_outline(old: Floats, new: Floats, reach: float, box: BinBox) -> Window | None:
    """Segments (13, m) that only one of two open outlines has, apart from a common beginning and end."""
    shorter = min(old.shape[1], new.shape[1])
    differ = np.flatnonzero((_read(old[:, :shorter]) != _read(new[:, :shorter])).any(axis=0))
    start = int(differ[0]) if len(differ) else shorter
    rest = shorter - start
    a, b = (_read(table[:, table.shape[1] - rest :]) for table in (old, new))
    differ = np.flatnonzero((a != b).any(axis=0))
    end = rest - 1 - int(differ[-1]) if len(differ) else rest
    parts = np.hstack([table[:, start : table.shape[1] - end] for table in (old, new)])
    if parts.shape[1] == 0:
        return None
    ends = parts[:2], parts[:2] + parts[2:4]
    return window_of(np.minimum(*ends), np.maximum(*ends), reach, box)


def _changed_interval(old: Packed, new: Packed) -> tuple[float, float] | None:
    """Where along the crest two versions of a profile on the same line differ, cells; None: too much does.

    (inf, -inf) when nothing does.
    """
    assert old.knots is not None
    assert new.knots is not None
    if old.culled != new.culled:
        return None
    length = STROKE_AT["length"]
    low, high = _differing_knots(_read(old.knots), _read(new.knots))
    if old.params[length] != new.params[length]:
        both = old.params[length], new.params[length]
        low, high = min(low, *both), max(high, *both)
    middle = new.params[STROKE_AT["middle"]]
    for o in range(len(old.octaves)):
        first, last, step = _differing_pieces(old, new, o)
        if first <= last:
            low, high = min(low, middle + first * step), max(high, middle + (last + 1) * step)
    return float(low), float(high)


def _differing_knots(old: NDArray[np.float32], new: NDArray[np.float32]) -> tuple[float, float]:
    """Stretch between the knots (3, q) that both versions have at their beginnings and ends."""
    if old.shape == new.shape and np.array_equal(old, new):
        return np.inf, -np.inf
    shorter = min(old.shape[1], new.shape[1])
    same = (old[:, :shorter] == new[:, :shorter]).all(axis=0)
    start = int(np.argmin(same)) if not same.all() else shorter
    same = (old[:, -shorter:] == new[:, -shorter:]).all(axis=0)[::-1]
    end = int(np.argmin(same)) if not same.all() else shorter
    low = min(float(k[0, max(start - 1, 0)]) for k in (old, new))
    high = max(float(k[0, min(max(k.shape[1] - end, 0), k.shape[1] - 1)]) for k in (old, new))
    return low, high


def _differing_pieces(old: Packed, new: Packed, o: int) -> tuple[int, int, float]:
    """First and last piece of octave ``o`` that differ, and the length of one, cells."""
    a, b = (_read(p.octave(o)) for p in (old, new))
    shorter = min(len(a), len(b))
    differ = np.flatnonzero((a[:shorter] != b[:shorter]).any(axis=1))
    first = new.culled[o] + (int(differ[0]) if len(differ) else shorter)
    last = new.culled[o] + (max(len(a), len(b)) - 1 if len(a) != len(b) else int(differ[-1]) if len(differ) else -1)
    return first, last, new.octave_cells * 2**o


def _strip(old: Packed, new: Packed, low: float, high: float, box: BinBox) -> Window | None:
    """Bins that a stretch of a profile reaches."""
    if low > high:
        return None
    at = STROKE_AT
    start, unit = new.params[[at["ax"], at["ay"]]], new.params[[at["tx"], at["ty"]]]
    reach = max(old.params[at["reach"]], new.params[at["reach"]])
    edges = np.linspace(low, high, _PARTS + 1)[:, None] * unit + start
    a, b = edges[:-1].T, edges[1:].T
    return window_of(np.minimum(a, b), np.maximum(a, b), reach, box)
