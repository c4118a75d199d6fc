"""A proof that a device must give before it is trusted: a small terrain, solved as the NumPy twin solves it."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import Flank, Stroke
from esker.solve.opencl.device import Device
from esker.solve.opencl.faults import DeviceError

LEVEL: Final = 1
TOLERANCE: Final = 1e-3
"""Largest difference to the twin, as a share of the relief."""
STROKES: Final = (
    Stroke(
        id="proof",
        kind="profile",
        first=(1100, 1300, 0),
        last=(3000, 2500, 0),
        curve=((0, 0), (0.4, 300), (0.7, 120), (1, 0)),
        left=Flank(slope_deg=35, extent_m=500),
        plateau_radius_m=60,
    ),
)
"""A ridge with one flank, a flat top and a free side: every kernel has something to do."""


def compare(device: Device, heights: NDArray[np.float32], twin: NDArray[np.float32]) -> None:
    """Raises DeviceError when a device's heights of LEVEL are not those of the twin; NaN is neither."""
    error = float(np.abs(heights - twin).max())
    if not error < TOLERANCE * float(np.ptp(twin)):
        raise DeviceError(f"{device.name} computes another ground than NumPy (by {error:.2g} m).", device.name)
