"""The ground of a terrain without a stroke that lifts anything: nothing is computed for it, and nothing held."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import Stroke
from esker.events import Done, Settled
from esker.solve.injection import frozen, injections
from esker.solve.passes import Basis, Job


def is_blank(strokes: Sequence[Stroke]) -> bool:
    """Returns whether no stroke constrains a height (``crest.crest_of`` of each is None)."""
    return all(stroke.hidden or not stroke.curve or stroke.kind == "paint" for stroke in strokes)


@lru_cache(maxsize=8)
def _levels(top: int) -> tuple[NDArray[np.float32], ...]:
    """Levels of zeros: the same arrays for all terrains."""
    n = grid.samples(top)
    return tuple(injections(frozen(np.zeros((n, n), dtype=np.float32))))


@lru_cache(maxsize=8)
def _gradient(top: int) -> NDArray[np.float32]:
    n = grid.samples(top)
    return frozen(np.zeros((2, n, n), dtype=np.float32))


def settled(job: Job, top: int, basis: bool) -> Iterator[Settled | Done]:
    """All levels: what the equations give without a constraint."""
    strokes, settings, base = job
    own = None if base is None else base.base
    *coarser, finest = enumerate(_levels(top))
    for level, samples in coarser:
        yield Settled(level, samples)
    found = Basis(tuple(strokes), settings, top, finest[1], _gradient(top), own) if basis else None
    yield Settled(*finest)
    yield Done(found)
