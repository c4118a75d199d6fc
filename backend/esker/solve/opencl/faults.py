"""Faults of devices as typed errors, each with a sentence for people.

pyopencl raises its own errors wherever a call is made; ``guarded`` turns those that pass through it into the types
below. What to do about a fault (another device, a lower level, NumPy) is for the caller to decide.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

import numpy as np

Result = TypeVar("Result")


class Faulty(Protocol):
    """The part of a device that ``guarded`` asks when something failed: ``device.Faulty`` has it."""

    @property
    def name(self) -> str: ...
    @property
    def context(self) -> Any: ...
    @property
    def queue(self) -> Any: ...
    @property
    def forget(self) -> Callable[[], None] | None: ...


class DeviceError(RuntimeError):
    """An OpenCL device failed. ``device``: its name; the message is a sentence for people."""

    def __init__(self, message: str, device: str = "") -> None:
        super().__init__(message)
        self.device = device


class NoDeviceError(DeviceError):
    """The device that was asked for is not there or does not work; the message lists what is."""


class BuildError(DeviceError):
    """The device's compiler refused the kernels, or returned something that is not them."""


class OutOfDeviceMemoryError(DeviceError):
    """A solve does not fit into the device's memory. Less of it, or a coarser one, may."""


class DeviceLostError(DeviceError):
    """The device is gone, or its context is dead: nothing that was on it can be used again."""


# Codes of cl.h
_NO_MEMORY = {-4, -6, -61}
"""Allocation of a memory object failed, out of host memory, invalid buffer size."""
_OUT_OF_RESOURCES = -5
"""Memory on some drivers; on others what every call returns after a kernel's fault has killed the context."""
_LOST = {-1, -2, -14, -33, -34, -36, -9999}
"""Device not found, not available, a failed event in a wait list, invalid device, context or queue, NVIDIA's fault."""
_BUILD = {-3, -11, -12, -15, -16, -17, -44, -45, -46}
"""No compiler; build, compile or link failure; invalid program, executable or kernel name."""


def classify(error: BaseException, device: Faulty | None) -> DeviceError | None:
    """The fault that an exception of pyopencl means, or None for one that is not of OpenCL.

    Where the code leaves open whether memory or the device is gone, a few bytes on the device's queue tell. A lost
    device is forgotten, so that opening it again makes a new context.
    """
    if isinstance(error, DeviceError):
        return error
    if not is_fault(error):
        return None
    code = getattr(error, "code", None)
    name = device.name if device is not None else "the device"
    if code in _BUILD:
        return build_error(error, name)
    dead = code in _LOST or (device is not None and not _alive(device))
    if dead:
        if device is not None and device.forget is not None:
            device.forget()
        return DeviceLostError(f"{name} was lost while solving ({_short(error)}).", name)
    if code in _NO_MEMORY or code == _OUT_OF_RESOURCES:
        return OutOfDeviceMemoryError(f"{name} has too little memory for this solve ({_short(error)}).", name)
    return DeviceError(f"{name} failed ({_short(error)}).", name)


def is_fault(error: BaseException) -> bool:
    """Returns whether an exception comes from a device: a DeviceError, or one of pyopencl."""
    return isinstance(error, DeviceError) or type(error).__module__.startswith("pyopencl")


def build_error(error: BaseException, name: str) -> BuildError:
    """Returns the error that a compiler's complaint means for the device called ``name``."""
    return BuildError(f"{name} could not compile the solver's kernels ({_short(error)}).", name)


def _short(error: BaseException) -> str:
    """The first line of a driver's message, or of a compiler's the first that names an error."""
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return next((line.strip() for line in lines if "error:" in line), lines[0])


def _alive(device: Faulty) -> bool:
    """Returns whether the device's queue still does what it is told."""
    import pyopencl as cl

    sent, got = np.array([0x5EED], dtype=np.uint32), np.zeros(1, dtype=np.uint32)
    try:
        buffer = cl.Buffer(device.context, cl.mem_flags.READ_WRITE, size=sent.nbytes)
        cl.enqueue_copy(device.queue, buffer, sent)
        cl.enqueue_copy(device.queue, got, buffer)
    except cl.MemoryError:
        return True
    except cl.Error:
        return False
    return bool(got[0] == sent[0])


@contextmanager
def guarded(device: Faulty | None) -> Iterator[None]:
    """Errors of OpenCL that leave the block come out as DeviceError; all others as they are.

    The frames that the error went through forget their variables, so that what was allocated is free again even while
    somebody keeps the error.
    """
    try:
        yield
    except Exception as error:
        fault = classify(error, device)
        if fault is None:
            raise
        traceback.clear_frames(error.__traceback__)
        if fault is error:
            raise
        raise fault from error


def finished(device: Faulty, work: Callable[[], Result]) -> Result:
    """``work()`` with everything that it enqueued done, or the fault that it met: drivers report late."""
    with guarded(device):
        out = work()
        device.queue.finish()
        return out
