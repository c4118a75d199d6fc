"""Masks that sum to one: what lies on top takes its share first, for splat maps whose layers must add up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from esker.exporting.ground import WHOLE, Ground, Mask, bands

ON_TOP: Final = ("water", "snow", "forest", "grass", "wetness")
"""Masks, what lies over the others first. Wetness is ground that nothing covers and that is wet."""
BARE: Final = "ground"
"""The mask of ground that no other mask covers: earth, or rock where it is steep."""


def weighted(ground: Ground) -> Ground:
    """Returns the ground with masks that sum to 255 at every sample, ``BARE`` among them. Without masks, itself."""
    return replace(ground, masks=weights(ground.masks)) if ground.masks else ground


def weights(masks: Mapping[str, Mask]) -> dict[str, Mask]:
    """Shares of the ground that add up, from masks (rows, columns) that overlap, all uint8 with 255 for all of it.

    A mask gets its part of what those above it leave (Porter and Duff 1984, "over"). What is left after each is rounded
    to whole steps, which never grow, and a share is the difference of two: so the sum is 255 to the step, and a share
    is within a step of the exact one.
    """
    shape = next(iter(masks.values())).shape
    names = [name for name in ON_TOP if name in masks]
    out = {name: np.empty(shape, np.uint8) for name in (*names, BARE)}
    for start, stop in bands(0, *shape):
        rows, part = slice(start, stop), (stop - start, shape[1])
        left, steps = np.ones(part, np.float32), np.full(part, WHOLE, np.uint8)
        for name in names:
            left *= np.float32(1.0) - masks[name][rows].astype(np.float32) / np.float32(WHOLE)
            rest = np.rint(left * WHOLE).astype(np.uint8)
            out[name][rows], steps = steps - rest, rest
        out[BARE][rows] = steps
    return out
