"""Choosing and opening the OpenCL device (DESIGN 5, 8, 16). Nothing here runs at import.

Two sets of kernels do the same: row-wise ones for CPUs (rows.cl and what follows it), tiles in local memory for GPUs
(gpu_*.cl). The kind of the device chooses; ESKER_KERNELS=rows or tiles overrides. See docs/decisions/0013-devices.md.
"""

from __future__ import annotations

import logging
import os
import threading
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

from esker.process import priority
from esker.solve.opencl import gpu_program, prepare, program_text
from esker.solve.opencl.faults import BuildError, NoDeviceError, build_error, finished
from esker.solve.opencl.pocl import cpu, home

log = logging.getLogger(__name__)

NUMPY = "numpy"
NUMPY_NAME = "NumPy float64 (no OpenCL device)"
Kernels = Literal["rows", "tiles"]
_OVER = " over a base"
_KERNELS = "ESKER_KERNELS"
_ROWS_TOO = ", rows too"
_POCL_THREADS = "POCL_MAX_PTHREAD_COUNT"
_agreed: set[int] = set()
"""Addresses of PoCL's devices whose CPU has been named."""
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
    for name, d in _usable(wanted, threads):
        try:
            if name not in _opened:
                if (why := _refused(name, d, threads)) is not None:
                    raise BuildError(why, name)
                _opened[name] = _checked(_open(name, d), check)
            return _opened[name]
        except prepare.Stopped:
            raise
        except Exception as error:
            log.warning("OpenCL device %s does not work: %s", name, error)
            if wanted:
                raise NoDeviceError(f"OpenCL device {name} does not work: {error}") from error
    return None


def ready(
    wanted: str | None,
    threads: int | None,
    tell: prepare.Tell = lambda _: None,
    stopped: threading.Event | None = None,
) -> None:
    """Has child processes build all kernels for the device that ``open_device`` would take, and says how far they are.

    Raises NoDeviceError, prepare.Stopped.
    """
    for name, d in _usable(wanted, threads, tell, stopped):
        if _is_pocl(d) and prepare.ready(wanted, threads, tell, stopped, only_pocl=True):
            return
        if not _is_pocl(d) and _refused(name, d, threads, tell, stopped) is None:
            return


def _usable(
    wanted: str | None,
    threads: int | None,
    tell: prepare.Tell = lambda _: None,
    stopped: threading.Event | None = None,
) -> list[tuple[str, Any]]:
    """(name, device) that are as ``wanted`` says and whose kernels PoCL, if it is PoCL's, has compiled; best first.

    Raises NoDeviceError.
    """
    _asked_kernels()
    _asked_level()
    try:
        usable = prepare.ready(wanted, threads, tell, stopped)
        found = [(name, d) for name, d in listed(threads) if usable or not _is_pocl(d)]
    except prepare.Stopped:
        raise
    except Exception as error:
        if wanted:
            raise NoDeviceError(f"No OpenCL on this machine ({error}). Use --device numpy.") from error
        log.warning("No OpenCL device (%s): solving in NumPy, which is slow.", error)
        return []
    if wanted and not usable and not any(wanted.lower() in name.lower() for name, _ in found):
        raise NoDeviceError(f"PoCL could not compile the solver's kernels for '{wanted}'. Use --device numpy.")
    if wanted:
        found = [(name, d) for name, d in found if wanted.lower() in name.lower()] or _missing(wanted, found)
    return found


def _refused(
    name: str,
    device: Any,
    threads: int | None,
    tell: prepare.Tell = lambda _: None,
    stopped: threading.Event | None = None,
) -> str | None:
    """Why the driver of a device cannot be used, as a child process found out. PoCL has been seen to (``_usable``)."""
    if _is_pocl(device):
        return None
    return prepare.driver(name, f"{device.driver_version.strip()}, {device.version.strip()}", threads, tell, stopped)


def candidates(threads: int | None = None) -> list[str]:
    """Names for ``open_device`` in order of preference, each one device; last always "numpy", which cannot fail."""
    try:
        return [*(name for name, _ in listed(threads)), NUMPY]
    except Exception as error:
        log.debug("no OpenCL: %s", error)
        return [NUMPY]


def driver(name: str) -> str:
    """The version of the driver of a device among ``candidates``, and of OpenCL; empty when there is none such."""
    return next((f"{d.driver_version.strip()}, {d.version.strip()}" for n, d in listed(None) if n == name), "")


def refusals() -> dict[str, str]:
    """Devices that were looked at in this process and cannot be used, by name and release, each with a sentence."""
    return prepare.refusals()


def _checked(device: Device, check: Callable[[Device], None] | None) -> Device:
    if check is not None:
        finished(device, lambda: check(device))
    return device


def _missing(wanted: str, found: list[tuple[str, Any]]) -> list[tuple[str, Any]]:
    there = ", ".join(name for name, _ in found) or "none"
    raise NoDeviceError(f"No OpenCL device is called like '{wanted}'. There are: {there}; or use 'numpy'.")


def listed(threads: int | None) -> list[tuple[str, Any]]:
    """(name, device), best first, with PoCL set up; a second device of the same name has its number behind it."""
    os.environ.setdefault(_POCL_THREADS, str(threads or default_threads()))
    prepare.settle()
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


def _is_pocl(device: Any) -> bool:
    """Returns whether this is the PoCL of the wheel. A distribution's PoCL links and names processors by itself: it is
    a driver like any other."""
    return home.site() is not None and cpu.compiled_for(getattr(device, "version", "")) is not None


def _asked_level() -> None:
    try:
        prepare.check()
    except ValueError as error:
        raise NoDeviceError(f"{error} (ESKER_CPU_LEVEL)") from None


def kernels_for(device: Any) -> Kernels:
    """Returns the kind of kernels for a pyopencl device: tiles for all but CPUs, if they fit, unless ESKER_KERNELS
    says."""
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


def named(kernel: str, over_base: bool) -> str:
    """The name of a kernel of the rasteriser, as it is compiled for grounds with a base or without."""
    return kernel + _OVER if over_base else kernel


def kernel_of(cl: Any, device: Device, name: str) -> Any:
    """A kernel by its name (``named``). The program for grounds with a base is compiled when the first one comes."""
    if not name.endswith(_OVER):
        return cl.Kernel(device.program, name)
    return cl.Kernel(_over_program(device), name.removesuffix(_OVER))


def _over_program(device: Device) -> Any:
    key = device.name + (_ROWS_TOO if device.plan is None else "") + _OVER
    if key not in _programs or _programs[key][0] is not device.context:
        source = program_text.over_source(device.plan)
        built = _build(device.name, device.context.devices[0], device.context, device.plan, source)
        _programs[key] = (device.context, built)
    return _programs[key][1]


def programs(device: Device) -> list[tuple[Any, tuple[str, ...]]]:
    """All programs that a solver on this device may ever use, built, each with the names of its row-wise kernels.

    Raises BuildError.
    """
    return [
        (program, tuple(program.kernel_names.split(";")) if one.plan is None else ())
        for one in ([device] if device.plan is None else [device, row_kernels(device)])
        for program in (one.program, _over_program(one))
    ]


def _open(name: str, device: Any) -> Device:
    import pyopencl as cl

    context = cl.Context([device])
    plan = gpu_program.plan_of(device) if kernels_for(device) == "tiles" else None
    program = _build(name, device, context, plan, program_text.source(plan))
    units = int(device.max_compute_units)
    return Device(
        name, context, cl.CommandQueue(context), program, units if units == 1 else 2 * units, plan,
        int(device.global_mem_size), int(device.max_mem_alloc_size), lambda: _forget(name),
    )  # fmt: skip


def row_kernels(device: Device) -> Device:
    """Returns the device, with its context and queue, with row-wise kernels: for work that has no other kernels,
    correct anywhere. Raises BuildError."""
    if device.plan is None:
        return device
    key = device.name + _ROWS_TOO
    if key not in _opened:
        program = _build(device.name, device.context.devices[0], device.context, None, program_text.source(None))
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

    _agree(device)
    try:
        program = _compile(context, source, plan)
    except cl.Error as error:
        log.debug("%s: %s", name, error)
        raise build_error(error, name) from error
    if "rasterise" not in program.kernel_names:
        raise BuildError(f"{name}: the compiler returned a program without kernels.", name)
    return program


def _agree(device: Any) -> None:
    """PoCL compiles for the processor's name and links by its flags: both must mean the same vectors (decision 10).

    Raises BuildError where PoCL cannot be used in this process.
    """
    present = cpu.compiled_for(device.version) if _is_pocl(device) else None
    if present is None or device.int_ptr in _agreed:
        return
    level = prepare.level()
    if level is None or not prepare.ready(None, None, only_pocl=True):
        raise BuildError("PoCL could not compile the solver's kernels on this processor.")
    _agreed.add(device.int_ptr)
    if present != level.name and not cpu.name_cpu(device.int_ptr, present, level.name):
        log.warning("PoCL compiles for %s: the name %s could not be set.", present, level.name)


def _compile(context: Any, source: str, plan: gpu_program.Plan | None) -> Any:
    import pyopencl as cl

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)
        # tiles say themselves where they want fma, so that all of them round alike
        return cl.Program(context, source).build(["-cl-mad-enable"] if plan is None else [])
