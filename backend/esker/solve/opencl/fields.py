"""Fields of a family of equations on a device: their memory, level by level, and copies to and from the host."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.solve.opencl.queue import Queue

FLOOR = 1e-6
"""The floor of ``multigrid.System`` in float32."""


@dataclass(frozen=True)
class Shape:
    """One level's layout: n rows of ``pitch`` floats; ``stride`` floats from one channel to the next."""

    level: int
    n: int
    pitch: int
    stride: int


def fields_of(top: int, static: str) -> list[tuple[str, int]]:
    """Name and level of every field of a system (``multigrid``); ``static`` names the static part of f."""
    out = []
    for level in range(top + 1):
        inner = set() if level == top and top > 0 else {"b", "e", "t"}
        out += [(name, level) for name in sorted({"d", "f", "u", "v", static} | inner)]
    return out


class SystemMemory(NamedTuple):
    """What a system works with and can lend: its queue, with the kernels that are bound to the buffers, the fields, and
    a buffer that only its kind of kernels knows."""

    launch: Any
    fields: dict[tuple[str, int], Any]
    own: Any


class Fields:
    """Memory of a ``multigrid.System`` on a device. Names and their meaning: see there; d is the stiffness, with one
    channel. ``pad``: floats before sample 0 of a row."""

    pad: ClassVar[int] = 0
    floor: float = FLOOR

    def __init__(
        self,
        launch: Queue,
        shape_of: Callable[[int], Shape],
        top: int,
        channels: int,
        static: str,
        memory: SystemMemory | None = None,
    ) -> None:
        """``memory``: to be worked with instead of new memory."""
        self.top, self.channels, self.static = top, channels, static
        self.shapes = {level: shape_of(level) for level in range(top + 1)}
        self.eps = dict.fromkeys(range(top + 1), 0.0)
        self.fields: dict[tuple[str, int], Any] = {
            (name, level): launch.zeros(self.shapes[level].stride * (1 if name == "d" else channels) + self.pad)
            for name, level in (fields_of(top, static) if memory is None else ())
        }
        self._queue = launch

    def swap(self, level: int) -> None:
        """See ``multigrid.System``."""
        self.fields["u", level], self.fields["v", level] = self.fields["v", level], self.fields["u", level]

    def flush(self) -> None:
        """Enqueues what was put off: all buffers may be read after it."""

    def largest(self, name: str) -> float:
        """See ``multigrid.System``. For rare cases: reads the field."""
        return float(np.abs(self.get(name, self.top)).max())

    def get(self, name: str, level: int) -> NDArray[np.float32]:
        """A field as (channels, n, n); d has one channel."""
        shape, queue = self.shapes[level], self._queue
        channels = 1 if name == "d" else self.channels
        out = np.empty((channels, shape.n, shape.n), dtype=np.float32)
        for c in range(channels):
            queue.cl.enqueue_copy(queue.queue, out[c], self.fields[name, level], **self._window(shape, c))
        return out

    def put(self, name: str, level: int, value: NDArray[Any]) -> None:
        """Set a field from (channels, n, n)."""
        shape, queue = self.shapes[level], self._queue
        for c, channel in enumerate(value):
            host = np.ascontiguousarray(channel, dtype=np.float32)
            queue.cl.enqueue_copy(queue.queue, self.fields[name, level], host, **self._window(shape, c))

    def _window(self, shape: Shape, channel: int) -> dict[str, Any]:
        return rectangle(shape, channel, self.pad)


def rectangle(shape: Shape, channel: int, pad: int) -> dict[str, Any]:
    """A channel's samples, without padding, for a rectangular copy."""
    return {
        "host_pitches": (4 * shape.n,),
        "host_origin": (0, 0),
        "region": (4 * shape.n, shape.n),
        "buffer_pitches": (4 * shape.pitch,),
        "buffer_origin": (4 * (pad + channel * shape.stride), 0),
    }
