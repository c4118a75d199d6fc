"""Choosing and opening the OpenCL device (DESIGN 5, 8, 16). Nothing here runs at import.

Two sets of kernels do the same: row-wise ones for CPUs (rows.cl and what follows it), tiles in local memory for GPUs
(gpu_*.cl). The kind of the device chooses; ESKER_KERNELS=rows or tiles overrides. See docs/decisions/0013-devices.md.
"""

from __future__ import annotations

import logging
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, cast

from esker.contract import CHEBYSHEV_SWEEPS, SATURATION
from esker.solve import gpu_program, pocl_cpu, priority, reference, tables, wave
from esker.solve.faults import BuildError, NoDeviceError, build_error, finished

log = logging.getLogger(__name__)

NUMPY = "numpy"
NUMPY_NAME = "NumPy float64 (no OpenCL device)"
SOURCES = ("rows.cl", "section.cl", "raster.cl", "setup.cl", "visit.cl", "refine.cl")
OVER_SOURCES = ("rows.cl", "section.cl", "raster.cl", "over_base.cl")
OVER_BASE = "#define OVER_BASE\n"
_OVER = " over a base"
Kernels = Literal["rows", "tiles"]
_KERNELS = "ESKER_KERNELS"
_ROWS_TOO = ", rows too"
_INLINE = "#undef inline\n#define inline static inline\n"
"""C looks for inline functions elsewhere when a compiler does not inline them, and some drivers then fail to link. PoCL
has a macro of its own for that."""
_POCL_THREADS = "POCL_MAX_PTHREAD_COUNT"
_POCL_CACHE = "POCL_KERNEL_CACHE"
_POCL_FOLDER = "POCL_CACHE_DIR"
_opened: dict[str, Device] = {}
"""Devices of this process by name: a program is compiled once."""
_programs: dict[str, tuple[Any, Any]] = {}
"""(context, program) of grounds with a base, by device and kind of kernels."""


@dataclass(frozen=True)
class Device:
    """An opened device: its context, an in-order queue, the built program and how many strips keep it busy.

    ``plan``: the tiles that a GPU's kernels were compiled for; None with row-wise kernels. ``memory`` and
    ``largest``: bytes of global memory and of one buffer, 0 where unknown. ``forget`` makes the next opening of this
    device a fresh one.
    """

    name: str
    context: Any
    queue: Any
    program: Any
    strips: int
    plan: gpu_program.Plan | None = None
    memory: int = 0
    largest: int = 0
    forget: Callable[[], None] | None = None


def default_threads() -> int:
    """All cores where the threads yield to the event loop's (``priority``), else it keeps one for itself (DESIGN 8)."""
    cores = os.cpu_count() or 1
    return cores if priority.can_yield() else max(1, cores - 1)


def open_device(
    wanted: str | None = None, threads: int | None = None, check: Callable[[Device], None] | None = None
) -> Device | None:
    """The device whose platform or device name contains ``wanted`` (any case); None: the best there is.

    Returns None for "numpy", and, when nothing was asked for, where no OpenCL works. Raises NoDeviceError when the
    wanted one is missing or does not work. ``threads`` counts for PoCL only, and only for the first device opened in a
    process. ``check`` is called once with a device that was just opened, and raises when its results are wrong.
    """
    if wanted is not None and wanted.lower() == NUMPY:
        return None
    _asked_kernels()
    try:
        found = _found(threads)
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
                _opened[name] = _checked(_open(name, d), check)
            return _opened[name]
        except Exception as error:
            log.warning("OpenCL device %s does not work: %s", name, error)
            if wanted:
                raise NoDeviceError(f"OpenCL device {name} does not work: {error}") from error
    return None


def candidates(threads: int | None = None) -> list[str]:
    """Names for ``open_device`` in order of preference, each one device; last always "numpy", which cannot fail."""
    try:
        return [*(name for name, _ in _found(threads)), NUMPY]
    except Exception as error:
        log.debug("no OpenCL: %s", error)
        return [NUMPY]


def _checked(device: Device, check: Callable[[Device], None] | None) -> Device:
    if check is not None:
        finished(device, lambda: check(device))
    return device


def _missing(wanted: str, found: list[tuple[str, Any]]) -> list[tuple[str, Any]]:
    there = ", ".join(name for name, _ in found) or "none"
    raise NoDeviceError(f"No OpenCL device is called like '{wanted}'. There are: {there}; or use 'numpy'.")


def _found(threads: int | None) -> list[tuple[str, Any]]:
    """``_devices`` with PoCL set up; a second device of the same name has its number behind it."""
    os.environ.setdefault(_POCL_THREADS, str(threads or default_threads()))
    if _POCL_FOLDER not in os.environ and _POCL_CACHE not in os.environ:
        folder = pocl_cpu.cache_folder()
        os.environ.update({_POCL_FOLDER: folder} if folder else {_POCL_CACHE: "0"})
    names: dict[str, int] = {}
    out = []
    with priority.yielding():  # PoCL starts its threads when its devices are first listed
        devices = _devices()
    for name, d in devices:
        names[name] = names.get(name, 0) + 1
        out.append((name if names[name] == 1 else f"{name} #{names[name]}", d))
    return out


def _devices() -> list[tuple[str, Any]]:
    """(name, device), best first (``_rank``)."""
    import pyopencl as cl

    pairs: list[tuple[Any, Any]] = []
    for platform in cl.get_platforms():
        try:
            pairs += [(platform, d) for d in platform.get_devices()]
        except cl.Error as error:
            log.warning("OpenCL platform %s lists no devices: %s", platform.name.strip(), error)
    if not pairs:
        raise RuntimeError("no platform has a device")
    return [(_describe(p, d), d) for p, d in sorted(pairs, key=lambda pair: _rank(pair[1]))]


def _rank(device: Any) -> int:
    """GPUs with memory of their own, then CPUs, then what shares the CPU's memory (and its bandwidth), then others."""
    import pyopencl as cl

    if device.type & cl.device_type.GPU:
        try:
            return 2 if device.host_unified_memory else 0
        except cl.Error:  # deprecated since OpenCL 2.0: then the vendor thinks of discrete ones
            return 0
    return 1 if device.type & cl.device_type.CPU else 3


def kernels_for(device: Any) -> Kernels:
    """Which kernels a pyopencl device gets: tiles for all but CPUs, if they fit it, unless ESKER_KERNELS says."""
    import pyopencl as cl

    wanted = _asked_kernels() or ("rows" if device.type & cl.device_type.CPU else "tiles")
    if wanted == "tiles" and gpu_program.plan_of(device) is None:
        log.warning("%s has too little local memory for tile kernels: row kernels.", device.name.strip())
        return "rows"
    return cast(Kernels, wanted)


def _asked_kernels() -> str:
    asked = os.environ.get(_KERNELS, "").lower()
    if asked not in {"", "rows", "tiles"}:
        raise NoDeviceError(f"{_KERNELS} must be 'rows' or 'tiles', not '{asked}'.")
    return asked


def _describe(platform: Any, device: Any) -> str:
    units, kernels = device.max_compute_units, f"{kernels_for(device)[:-1]} kernels"
    if "portable computing language" in platform.name.lower():
        return f"PoCL {device.name.strip()} ({units} thread{'s' if units != 1 else ''}, {kernels})"
    return f"{platform.name.strip()} {device.name.strip()} ({kernels})"


def shader_folder() -> Path:
    """The repository's shaders/opencl."""
    return Path(__file__).resolve().parents[3] / "shaders" / "opencl"


@lru_cache(maxsize=1)
def _files() -> dict[str, str]:
    return {path.name: path.read_text(encoding="utf-8") for path in sorted(shader_folder().glob("*.cl"))}


def named(kernel: str, over_base: bool) -> str:
    """The name of a kernel of the rasteriser, as it is compiled for grounds with a base or without."""
    return kernel + _OVER if over_base else kernel


def kernel_of(cl: Any, device: Device, name: str) -> Any:
    """A kernel by its name (``named``). The program for grounds with a base is compiled when the first one comes."""
    if not name.endswith(_OVER):
        return cl.Kernel(device.program, name)
    key = device.name + (_ROWS_TOO if device.plan is None else "") + _OVER
    if key not in _programs or _programs[key][0] is not device.context:
        source = _over_source(device.plan)
        _programs[key] = (
            device.context,
            _build(device.name, device.context.devices[0], device.context, device.plan, source),
        )
    return cl.Kernel(_programs[key][1], name.removesuffix(_OVER))


def _over_source(plan: gpu_program.Plan | None) -> str:
    """The rasteriser as it is over a base, and what the ground owes to it."""
    if plan is not None:
        return _INLINE + OVER_BASE + _defines(gpu_program.defines(plan)) + gpu_program.over_source(_files())
    return _INLINE + OVER_BASE + _defines({}) + "\n".join(_files()[name] for name in OVER_SOURCES)


def _source(plan: gpu_program.Plan | None) -> str:
    if plan is not None:
        return _INLINE + _defines(gpu_program.defines(plan)) + gpu_program.source(plan, _files())
    return _INLINE + _defines({}) + "\n".join(_files()[name] for name in SOURCES)


def _literal(value: float | int) -> str:
    return f"{value!r}f" if isinstance(value, float) else str(value)


def _defines(more: dict[str, float | int]) -> str:
    values: dict[str, float | int] = {
        **tables.defines(),
        **wave.defines(),
        "SATURATION": SATURATION,
        "CHEBYSHEV_SWEEPS": CHEBYSHEV_SWEEPS,
        "BOTTOM_LEVELS": reference.BOTTOM_LEVELS,
        "COARSEST_SWEEPS": reference.COARSEST_SWEEPS,
        "COARSEST_RELAXATION": reference.COARSEST_RELAXATION,
        **more,
    }
    return "".join(f"#define {name} {_literal(value)}\n" for name, value in values.items())


def _open(name: str, device: Any) -> Device:
    import pyopencl as cl

    context = cl.Context([device])
    plan = gpu_program.plan_of(device) if kernels_for(device) == "tiles" else None
    program = _build(name, device, context, plan, _source(plan))
    units = int(device.max_compute_units)
    return Device(
        name, context, cl.CommandQueue(context), program, units if units == 1 else 2 * units, plan,
        int(device.global_mem_size), int(device.max_mem_alloc_size), lambda: _forget(name),
    )  # fmt: skip


def row_kernels(device: Device) -> Device:
    """The same device, context and queue with row-wise kernels: for what has no others, correct anywhere.

    Raises BuildError.
    """
    if device.plan is None:
        return device
    key = device.name + _ROWS_TOO
    if key not in _opened:
        program = _build(device.name, device.context.devices[0], device.context, None, _source(None))
        _opened[key] = replace(device, program=program, plan=None)
    return _opened[key]


def _forget(name: str) -> None:
    _opened.pop(name, None)
    _opened.pop(name + _ROWS_TOO, None)
    for key in [k for k in _programs if k in {name + _OVER, name + _ROWS_TOO + _OVER}]:
        del _programs[key]


def _build(name: str, device: Any, context: Any, plan: gpu_program.Plan | None, source: str) -> Any:
    """The program; raises BuildError."""
    import pyopencl as cl

    try:
        try:
            program = _compile(context, source, plan)
        except cl.RuntimeError as error:
            if pocl_cpu.COMPLAINT not in str(error):
                raise
            cpu = pocl_cpu.name_cpu(device.int_ptr)
            log.info("PoCL does not know this processor: compiling for %s.", cpu)
            program = _compile(context, source, plan)
    except cl.Error as error:
        log.debug("%s: %s", name, error)
        raise build_error(error, name) from error
    if "rasterise" not in program.kernel_names:
        raise BuildError(f"{name}: the compiler returned a program without kernels.", name)
    return program


def _compile(context: Any, source: str, plan: gpu_program.Plan | None) -> Any:
    import pyopencl as cl

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)
        # tiles say themselves where they want fma, so that all of them round alike
        return cl.Program(context, source).build(["-cl-mad-enable"] if plan is None else [])
