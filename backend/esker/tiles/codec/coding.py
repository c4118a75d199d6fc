"""A tile of a level that is solved as a whole, from its samples to its payload in one compiled piece (DESIGN 6).

It lets go of the interpreter's lock from beginning to end, so that tiles of a frame are coded in two threads. What it
makes is, to the bit, what ``plans._options``, ``payload.cost`` and ``filters.pack_smallest`` make one after the other,
but for tiles of ``FEW`` bytes, which are not tried as a lattice.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from esker.contract import TILE_MAX_SHIFT, TILE_SAMPLES, Filter, Predictor
from esker.tiles.codec import entropy
from esker.tiles.codec.payload import Ints, Wide

PREDICTORS: Final = (Predictor.PARENT, Predictor.HELD, Predictor.PREVIOUS)
LOGS: Final = np.log2(np.arange(1, 1025, dtype=np.float32))
FEW: Final = 96
"""A tile that takes at most so many bytes is not tried as a lattice as well. Most tiles of a segment are that small,
and the second try is half of their time."""
IN_TWO: Final = 4
"""A second thread is woken for at least so many tiles."""
_local = threading.local()
_second = ThreadPoolExecutor(1, thread_name_prefix="coding")
A = TypeVar("A")
B = TypeVar("B")


class Coded(NamedTuple):
    """A coded tile: the cheapest predictor, the smaller of the filters NONE and LATTICE, and the payload."""

    predictor: Predictor
    filter: Filter
    shift: int
    payload: bytes


def code(now: Ints, own: Wide, before: Ints | None, then: Wide | None) -> Coded | None:
    """A tile, (65, 65) in quanta, that has a parent; None where no predictor leaves numbers that can be coded.

    ``own``: the parent's prediction of it; ``before``: the tile as the client holds it; ``then``: the prediction as it
    was for that one, None where it is not known.
    """
    samples = now.astype(np.int64)
    had = samples if before is None else before.astype(np.int64)
    moved = samples if before is None or then is None else then.astype(np.int64)
    known = 0 if before is None else 1 if then is None else 2
    plain, lattice = _room()
    tables = LOGS, entropy.WEIGHTS, entropy.RATES
    option, shift, size, small = entropy.encode_cheapest(
        samples, own.astype(np.int64), had, moved, known, TILE_MAX_SHIFT, *tables, plain, lattice, FEW
    )
    if option < 0:
        return None
    if 0 <= small < size:
        return Coded(PREDICTORS[option], Filter.LATTICE, shift, lattice[:small].tobytes())
    return Coded(PREDICTORS[option], Filter.NONE, shift, plain[:size].tobytes())


def in_two(work: Callable[[A], B], items: Sequence[A]) -> list[B]:
    """Does ``work`` for each, in order. Where there are many, a second thread does one half of them."""
    half = len(items) // 2 if len(items) >= IN_TWO else len(items)
    second = [_second.submit(lambda part: [work(item) for item in part], items[half:])] if half < len(items) else []
    first = [work(item) for item in items[:half]]
    return first + [made for future in second for made in future.result()]


def both(work: Callable[[A], object], first: A, second: A) -> None:
    """Does ``work`` for the first, and meanwhile for the second in a second thread."""
    other = _second.submit(work, second)
    try:
        work(first)
    finally:
        other.result()


def _room() -> NDArray[np.uint8]:
    """Returns this thread's own space for two payloads: fresh pages every time cost more than some tiles."""
    room: NDArray[np.uint8] | None = getattr(_local, "room", None)
    if room is None:
        room = _local.room = np.empty((2, entropy.MAX_BYTES), dtype=np.uint8)
    return room


def warm() -> None:
    """Compiles the loop of this file."""
    tile = np.eye(TILE_SAMPLES, dtype=np.int32)
    code(tile, np.zeros_like(tile), tile, tile)
