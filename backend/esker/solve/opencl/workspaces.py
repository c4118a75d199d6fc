"""Workspaces by device, and whether they fit it.

OpenCL does not say how much memory is free, so what the workspaces of this process hold is counted here. Most drivers
overcommit and fail late, in the middle of a solve: a plan that cannot fit is refused before anything is allocated.
"""

from __future__ import annotations

import threading
import weakref
from collections import Counter
from typing import TYPE_CHECKING

from esker import grid
from esker.solve.opencl import gpu_levels, levels
from esker.solve.opencl.device import Device
from esker.solve.opencl.device_workspace import Arena
from esker.solve.opencl.faults import OutOfDeviceMemoryError, finished
from esker.solve.opencl.fields import fields_of
from esker.solve.reference import NumpyWorkspace

if TYPE_CHECKING:
    from esker.solve.passes import Workspace

OnDevice = levels.ClWorkspace | gpu_levels.GpuWorkspace
SHARE = 0.9
"""Workspaces may take this share of a device's memory: tables, the driver and the display need some too."""
_held: Counter[str] = Counter()
_lock = threading.Lock()


def new_workspace(device: Device | None, top: int, based: bool = False) -> Workspace:
    """Memory and kernels for one solve of levels 0..top, over a base if ``based``; None is NumPy.

    Raises OutOfDeviceMemoryError, before or while allocating, and other DeviceErrors.
    """
    if device is None:
        return NumpyWorkspace(top, based)
    return on_device(device, top, based)


def on_device(device: Device, top: int, based: bool = False) -> OnDevice:
    """``new_workspace`` for a device."""
    needed, largest = planned_bytes(device, top, based)
    name = device.name
    with _lock:
        left = int(SHARE * device.memory) - _held[name]
        if device.memory and needed > left:
            raise OutOfDeviceMemoryError(
                f"A solve of {grid.samples(top)}² samples needs {_mib(needed)} of {name}, which has {_mib(left)} left.",
                name,
            )
        if device.largest and largest > device.largest:
            raise OutOfDeviceMemoryError(
                f"A solve of {grid.samples(top)}² samples needs a buffer of {_mib(largest)}; {name} gives at most "
                f"{_mib(device.largest)}.",
                name,
            )
        _held[name] += needed
    try:
        made = finished(device, lambda: _make(device, top, based))
    except BaseException:
        _release(name, needed)
        raise
    weakref.finalize(made.launch, _release, name, needed)  # memory goes from workspace to workspace with its queue
    return made


def held_bytes(device: Device) -> int:
    """Bytes of the workspaces of this process on a device, by plan."""
    with _lock:
        return _held[device.name]


def planned_bytes(device: Device, top: int, based: bool = False) -> tuple[int, int]:
    """(all, largest) bytes of the buffers of a workspace."""
    rows = device.plan is None
    floats = []
    for channels, static in ((2, "f"), (1, "s")):
        for name, level in fields_of(top, static):
            stride = (levels if rows else gpu_levels).shape_of(level).stride
            floats.append(stride * (1 if name == "d" else channels) + (levels.PAD if rows else 0))
    if based:
        stride = (levels if rows else gpu_levels).shape_of(top).stride + (levels.PAD if rows else 0)
        floats += [stride] * grid.BASE_FIELDS
    if rows:
        floats.append(2 * device.strips * levels.scratch_floats(top))
    return 4 * sum(floats), 4 * max(floats)


def with_arena(device: Device, top: int, based: bool, arena: Arena) -> OnDevice:
    """A workspace that works with the memory of another one of its kind, which gave it away."""
    return _make(device, top, based, arena)


def _make(device: Device, top: int, based: bool, arena: Arena | None = None) -> OnDevice:
    kind = levels.ClWorkspace if device.plan is None else gpu_levels.GpuWorkspace
    return kind(device, top, based, arena)


def _release(name: str, size: int) -> None:
    with _lock:
        _held[name] -= size


def _mib(size: int) -> str:
    return f"{max(size, 0) / 2**20:,.0f} MiB"
