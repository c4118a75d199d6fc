"""A page as shapes and words in millimetres, from its top left corner: what ``svg`` and ``pdf`` write."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

Colour = tuple[float, float, float]
Anchor = Literal["start", "middle", "end"]

WIDTHS: Final = (
    "278 278 355 556 556 889 667 191 333 333 389 584 278 333 278 278 556 556 556 556 556 556 556 556 "
    "556 556 278 278 584 584 584 556 1015 667 667 722 722 667 611 778 722 278 500 667 556 833 722 778 "
    "667 778 722 667 611 722 667 944 667 667 611 278 278 278 469 556 333 556 556 500 556 556 278 556 "
    "556 222 222 500 222 833 556 556 556 556 333 500 278 556 500 722 500 500 500 334 260 334 584 "
)
"""Widths of Helvetica's letters from the space to the tilde, in thousandths of its size (Adobe's font metrics)."""
_WIDTHS: Final = tuple(int(width) for width in WIDTHS.split())
OTHER_WIDTH: Final = 556
CAP_HEIGHT: Final = 0.72


class CannotPrint(ValueError):
    """What was asked for cannot be printed; the message is a sentence."""


@dataclass(frozen=True, eq=False)
class Path:
    """Lines or areas. ``rings``: each (n, 2). ``width_mm`` 0: no line; ``fill`` None: no area; areas are even-odd."""

    rings: Sequence[NDArray[np.float64]]
    width_mm: float = 0.0
    colour: Colour = (0.0, 0.0, 0.0)
    fill: Colour | None = None
    closed: bool = False


@dataclass(frozen=True)
class Text:
    """Words on a base line that begins, has its middle or ends at (x, y). ``angle_deg``: anticlockwise."""

    x: float
    y: float
    text: str
    size_mm: float
    anchor: Anchor = "start"
    bold: bool = False
    angle_deg: float = 0.0
    colour: Colour = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Clip:
    """Shapes of which only what lies in a rectangle (x0, y0, x1, y1) is seen."""

    box: tuple[float, float, float, float]
    shapes: Sequence[Path | Text]


@dataclass(frozen=True, eq=False)
class Drawing:
    """A page. ``shapes``: from the lowest to the topmost."""

    width_mm: float
    height_mm: float
    title: str
    shapes: list[Path | Text | Clip] = field(default_factory=list)


def width_of(text: str, size_mm: float) -> float:
    """How long words are in Helvetica."""
    units = sum(_WIDTHS[ord(c) - 32] if 32 <= ord(c) < 127 else OTHER_WIDTH for c in text)
    return units * size_mm / 1000.0
