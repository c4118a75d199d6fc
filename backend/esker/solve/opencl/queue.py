"""A device's queue with what every launch needs: buffers, constants, and kernels that keep their arguments."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.solve.opencl.device import Device, kernel_of
from esker.solve.reference import chebyshev_weights

MOST_BOUND = 512
"""Kernels with arguments set that a queue keeps, for some 200 that a solve of seven levels comes back to; each costs a
kilobyte or two, and setting them 50 microseconds."""


class Queue:
    """``bound(name, *args)`` is a kernel whose first arguments are set: the same again for the same, which live on.

    ``table``: (offset, n, pitch, 0) of levels 0, -1, ..., int32, for the bottom kernels.
    """

    def __init__(self, device: Device, table: NDArray[np.int32]) -> None:
        import pyopencl as cl

        self.cl, self.device, self.queue = cl, device, device.queue
        # of functions, not of methods: a cycle through the queue would keep its buffers until somebody collects it
        self.bound = lru_cache(MOST_BOUND)(partial(_bound, cl, device))
        self._passing: dict[str, Any] = {}
        self.weights = self.constant(chebyshev_weights().astype(np.float32))
        self.table = self.constant(table)

    def zeros(self, floats: int) -> Any:
        """A new buffer of zeros."""
        buffer = self.cl.Buffer(self.device.context, self.cl.mem_flags.READ_WRITE, size=4 * max(floats, 1))
        self.cl.enqueue_fill_buffer(self.queue, buffer, np.zeros(1, dtype=np.float32), 0, buffer.size)
        return buffer

    def raw(self, size: int) -> Any:
        """A new buffer of so many bytes, of which nothing is known."""
        return self.cl.Buffer(self.device.context, self.cl.mem_flags.READ_WRITE, size=size)

    def constant(self, array: NDArray[Any]) -> Any:
        """A read-only copy of a host array (one zero when it is empty)."""
        host = np.ascontiguousarray(array) if array.size else np.zeros(1, dtype=array.dtype)
        flags = self.cl.mem_flags.READ_ONLY | self.cl.mem_flags.COPY_HOST_PTR
        return self.cl.Buffer(self.device.context, flags, hostbuf=host)

    def once(self, name: str, args: tuple[Any, ...]) -> Any:
        """A kernel with all arguments set, for those that will not come again: enqueue it before the next of its name.

        Making one takes pyopencl more than a millisecond where it has many arguments, so each name has one.
        """
        kernel = self._passing.get(name)
        if kernel is None:
            kernel = self._passing[name] = kernel_of(self.cl, self.device, name)
        kernel.set_args(*args)
        return kernel


def _bound(cl: Any, device: Device, name: str, *args: Any) -> Any:
    kernel = kernel_of(cl, device, name)
    for k, value in enumerate(args):
        kernel.set_arg(k, value)
    return kernel
