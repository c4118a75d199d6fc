"""Choosing and opening the OpenCL device (DESIGN 5, 8, 16). Nothing here runs at import."""

from __future__ import annotations

import logging
import os
import warnings
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from esker.contract import CHEBYSHEV_SWEEPS, SATURATION
from esker.solve import constraints, pocl_cpu, reference

log = logging.getLogger(__name__)

NUMPY = "numpy"
NUMPY_NAME = "NumPy float64 (no OpenCL device)"
SOURCES = ("rows.cl", "section.cl", "raster.cl", "setup.cl", "visit.cl")
_POCL_THREADS = "POCL_MAX_PTHREAD_COUNT"
_POCL_CACHE = "POCL_KERNEL_CACHE"
_opened: dict[str, Device] = {}
"""Devices of this process by name: a program is compiled once."""


class NoDeviceError(RuntimeError):
    """The device that was asked for is not there; the message lists what is."""


@dataclass(frozen=True)
class Device:
    """An opened device: its context, an in-order queue, the built program and how many strips keep it busy."""

    name: str
    context: Any
    queue: Any
    program: Any
    strips: int


def default_threads() -> int:
    """Cores - 1, at least 1: the event loop keeps a core (DESIGN 8)."""
    return max(1, (os.cpu_count() or 1) - 1)


def open_device(wanted: str | None = None, threads: int | None = None) -> Device | None:
    """The device whose platform or device name contains ``wanted`` (any case); None: the best there is.

    Returns None for "numpy", and, when nothing was asked for, where no OpenCL works. Raises NoDeviceError when the
    wanted one is missing. ``threads`` counts for PoCL only, and only for the first device opened in a process.
    """
    if wanted is not None and wanted.lower() == NUMPY:
        return None
    os.environ.setdefault(_POCL_THREADS, str(threads or default_threads()))
    if not pocl_cpu.cache_works():
        os.environ.setdefault(_POCL_CACHE, "0")
    try:
        found = _devices()
    except Exception as error:
        if wanted:
            raise NoDeviceError(f"No OpenCL on this machine ({error}). Use --device numpy.") from error
        log.warning("No OpenCL device (%s): solving in NumPy, which is slow.", error)
        return None
    if wanted:
        found = [(name, d) for name, d in found if wanted.lower() in name.lower()] or _missing(wanted, found)
    for name, d in found:
        try:
            if name not in _opened:
                _opened[name] = _open(name, d)
            return _opened[name]
        except Exception as error:
            log.warning("OpenCL device %s does not work: %s", name, error)
            if wanted:
                raise NoDeviceError(f"OpenCL device {name} does not work: {error}") from error
    return None


def _missing(wanted: str, found: list[tuple[str, Any]]) -> list[tuple[str, Any]]:
    there = ", ".join(name for name, _ in found) or "none"
    raise NoDeviceError(f"No OpenCL device is called like '{wanted}'. There are: {there}; or use 'numpy'.")


def _devices() -> list[tuple[str, Any]]:
    """(name, device), CPUs first: the kernels work row by row, which suits them; a GPU is taken when asked for."""
    import pyopencl as cl

    out = [(_describe(p, d), d) for p in cl.get_platforms() for d in p.get_devices()]
    if not out:
        raise RuntimeError("no platform has a device")
    return sorted(out, key=lambda pair: 0 if pair[1].type & cl.device_type.CPU else 1)


def _describe(platform: Any, device: Any) -> str:
    units = device.max_compute_units
    if "portable computing language" in platform.name.lower():
        return f"PoCL {device.name.strip()} ({units} thread{'s' if units != 1 else ''})"
    return f"{platform.name.strip()} {device.name.strip()}"


def shader_folder() -> Path:
    """The repository's shaders/opencl."""
    return Path(__file__).resolve().parents[3] / "shaders" / "opencl"


@lru_cache(maxsize=1)
def _source() -> str:
    return "\n".join((shader_folder() / name).read_text(encoding="utf-8") for name in SOURCES)


def _literal(value: float | int) -> str:
    return f"{value!r}f" if isinstance(value, float) else str(value)


def _defines() -> str:
    values: dict[str, float | int] = {
        **constraints.defines(),
        "SATURATION": SATURATION,
        "CHEBYSHEV_SWEEPS": CHEBYSHEV_SWEEPS,
        "BOTTOM_LEVELS": reference.BOTTOM_LEVELS,
        "COARSEST_SWEEPS": reference.COARSEST_SWEEPS,
        "COARSEST_RELAXATION": reference.COARSEST_RELAXATION,
    }
    return "".join(f"#define {name} {_literal(value)}\n" for name, value in values.items())


def _open(name: str, device: Any) -> Device:
    import pyopencl as cl

    context = cl.Context([device])
    try:
        program = _build(context)
    except cl.RuntimeError as error:
        if pocl_cpu.COMPLAINT not in str(error):
            raise
        cpu = pocl_cpu.name_cpu(device.int_ptr)
        log.info("PoCL does not know this processor: compiling for %s.", cpu)
        program = _build(context)
    units = int(device.max_compute_units)
    return Device(name, context, cl.CommandQueue(context), program, units if units == 1 else 2 * units)


def _build(context: Any) -> Any:
    program = _compile(context, _defines() + _source())
    if "rasterise" not in program.kernel_names:
        raise RuntimeError("the compiler returned a program without kernels")
    return program


def _compile(context: Any, source: str) -> Any:
    import pyopencl as cl

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)
        return cl.Program(context, source).build(["-cl-mad-enable"])
