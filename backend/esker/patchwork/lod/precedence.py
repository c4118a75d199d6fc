"""Which of two layers is believed, and what a new one's priority is by default. Light: no compiled loops, no arrays."""

from __future__ import annotations

import math
from collections.abc import Iterable

from esker.contract import Layer

MOST = 10**6
"""Greatest priority of the contract."""


def precedence(layer: Layer) -> tuple[int, float, float, str]:
    """Sort key of layers: the greater is believed where two of them say different things.

    Greater priority; else smaller accuracy; else finer spacing; else greater id.
    """
    return layer.priority, -layer.accuracy_m, -_cell(layer), layer.id


def default_priority(layer: Layer, others: Iterable[Layer]) -> int:
    """Priority of a layer that is added to others, until somebody says otherwise.

    What comes later is the newer survey and is believed; but a grid that is both coarser and less accurate than others
    that it overlaps is ground to lay them on, whenever it comes: it takes the least of their priorities, and at equal
    priority the more accurate is believed.
    """
    others = [other for other in others if other.id != layer.id]
    better = [
        other.priority
        for other in others
        if other.accuracy_m < layer.accuracy_m and _cell(other) < _cell(layer) and _meet(other, layer)
    ]
    return min(better) if better else min(MOST, max((other.priority + 1 for other in others), default=0))


def _cell(layer: Layer) -> float:
    """Area of a cell, square metres."""
    return layer.spacing_m[0] * layer.spacing_m[1]


def _meet(a: Layer, b: Layer) -> bool:
    """Returns whether the bounds of two layers' footprints overlap."""
    (ax0, ay0, ax1, ay1), (bx0, by0, bx1, by1) = _bounds(a), _bounds(b)
    return ax0 < bx1 and bx0 < ax1 and ay0 < by1 and by0 < ay1


def _bounds(layer: Layer) -> tuple[float, float, float, float]:
    """World bounds x0, y0, x1, y1 of a layer, its bend left out."""
    turn = math.radians(layer.rotation_deg)
    wide, tall = (layer.facts.cols - 1) * layer.spacing_m[0], (layer.facts.rows - 1) * layer.spacing_m[1]
    xs = [0.0, wide * math.cos(turn), -tall * math.sin(turn)]
    ys = [0.0, wide * math.sin(turn), tall * math.cos(turn)]
    x, y = layer.anchor
    xs.append(xs[1] + xs[2])
    ys.append(ys[1] + ys[2])
    return x + min(xs), y + min(ys), x + max(xs), y + max(ys)
