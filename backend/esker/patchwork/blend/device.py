"""The blend on an OpenCL device (shaders/opencl/patchwork.cl): a gather, a row of a bin for each work-item on CPUs, a
sample for each on GPUs. Twin: ``blend.evaluate`` without a device.

Bits of a bin depend on the device's kind, on its patches, and on nothing else.
"""

from __future__ import annotations

import threading
import warnings
import weakref
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_MARGIN_CELLS
from esker.patchwork.blend.loops import BIN
from esker.patchwork.blend.packs import Bins, Pack
from esker.patchwork.blend.splines import STRIDE
from esker.resources import SHADERS

PATCH: Final = np.dtype([("constants", "<f4", 9), ("step", "<f4", 4), ("side", "<i4"), ("rank", "<i4")])
"""``Patch`` of patchwork.cl."""
_GPU_GROUP: Final = (32, 8, 1)
_programs: weakref.WeakKeyDictionary[Any, dict[bool, Program]] = weakref.WeakKeyDictionary()
_lock: Final = threading.Lock()


class ClDevice(Protocol):
    """The part of an opened OpenCL device that the blend uses."""

    @property
    def context(self) -> Any: ...
    @property
    def queue(self) -> Any: ...


class Program:
    """Builds the kernel for smooth or linear patches for one context. Raises pyopencl errors if it does not build."""

    def __init__(self, device: ClDevice, smooth: bool) -> None:
        import pyopencl as cl

        self._cl, self._context = cl, device.context
        kinds = [d.type for d in self._context.devices]
        self._cpu = all(kind & cl.device_type.CPU for kind in kinds)
        self._span = BIN if self._cpu else 1
        text = SHADERS / "opencl" / "patchwork.cl"
        defines = {"BIN": BIN, "STRIDE": STRIDE, "SPAN": self._span, "MARGIN": f"{1 / PATCH_MARGIN_CELLS!r}f"}
        lines = [f"#define {name} {value}" for name, value in defines.items()] + ["#define SMOOTH"] * smooth
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", cl.CompilerWarning)
            program = cl.Program(self._context, "\n".join([*lines, text.read_text(encoding="utf-8")])).build([])
        self._program = program

    def run(
        self, queue: Any, packed: Pack, constants: NDArray[np.float32], found: Bins, shape: tuple[int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Heights and cover of ``shape`` bins, float32 (rows * BIN, cols * BIN) each."""
        cl, flags = self._cl, self._cl.mem_flags
        rows, cols = shape
        patches = np.zeros(max(1, len(packed)), dtype=PATCH)
        patches["constants"][: len(packed)] = constants
        patches["step"][: len(packed)] = found.step
        patches["side"][: len(packed)] = packed.side
        patches["rank"][: len(packed)] = packed.rank

        def copied(array: NDArray[Any]) -> Any:
            whole = np.ascontiguousarray(array) if array.size else np.zeros(16, dtype=np.uint8)
            kind = flags.USE_HOST_PTR if self._cpu else flags.COPY_HOST_PTR
            return cl.Buffer(self._context, flags.READ_ONLY | kind, hostbuf=whole)

        inputs = [copied(a) for a in (found.start, found.patch, found.origin, patches, packed.coefficients)]
        outputs = [np.empty((rows * BIN, cols * BIN), dtype=np.float32) for _ in range(2)]
        kind = flags.USE_HOST_PTR if self._cpu else flags.COPY_HOST_PTR
        buffers = [cl.Buffer(self._context, flags.WRITE_ONLY | kind, hostbuf=array) for array in outputs]
        size, group = (BIN // self._span, BIN, rows * cols), (1, BIN, 1) if self._cpu else _GPU_GROUP
        kernel = cl.Kernel(self._program, "blend_bins")
        kernel(queue, size, group, *inputs, np.int32(cols), *buffers)
        for array, buffer in zip(outputs, buffers, strict=True):
            if self._cpu:
                cl.enqueue_map_buffer(queue, buffer, cl.map_flags.READ, 0, array.shape, array.dtype)[0].base.release()
            else:
                cl.enqueue_copy(queue, array, buffer)
        queue.finish()
        return outputs[0], outputs[1]


def program(device: ClDevice, smooth: bool) -> Program:
    """Returns the built kernel for a device: built once a context."""
    with _lock:
        built = _programs.setdefault(device.context, {})
        if smooth not in built:
            built[smooth] = Program(device, smooth)
        return built[smooth]
