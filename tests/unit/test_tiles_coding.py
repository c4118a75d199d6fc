"""What codes a tile in one compiled piece makes what its parts in NumPy make (SPEC T52)."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from esker.contract import Filter, Predictor
from esker.tiles.codec import coding
from esker.tiles.codec.filters import pack_smallest
from esker.tiles.codec.payload import Ints, child_window, cost, predict

Rng = np.random.Generator


def noise(rng: Rng, amplitude: float, share: float) -> Ints:
    most = int(amplitude) + 1
    return (rng.integers(-most, most, (65, 65)) * (rng.random((65, 65)) < share)).astype(np.int32)


def hills(rng: Rng, amplitude: float) -> Ints:
    ground = np.cumsum(np.cumsum(rng.standard_normal((65, 65)), 0), 1)
    return np.asarray(np.rint(ground * amplitude / np.abs(ground).max()), dtype=np.int32)


def in_parts(now: Ints, own: Ints, before: Ints | None, then: Ints | None) -> tuple[Predictor, object]:
    """The same step by step, in 64 bits."""
    own_wide, options = own.astype(np.int64), []
    options.append((Predictor.PARENT, now - own_wide))
    if before is not None:
        change = now - before.astype(np.int64)
        options.append((Predictor.HELD, change))
        if then is not None:
            options.append((Predictor.PREVIOUS, change - (own_wide - then)))
    kind, residual = min(options, key=lambda option: cost(option[1]))
    plain = pack_smallest(residual, ())
    return kind, plain if len(plain[2]) <= coding.FEW else pack_smallest(residual, (Filter.LATTICE,))


def example(rng: Rng, kind: int) -> tuple[Ints, Ints, Ints | None, Ints | None]:
    parent = hills(rng, 10 ** rng.uniform(0, 8) / 2)
    shifted = parent.copy()
    shifted[20:30, 40:50] += 1 + int(np.abs(parent).max()) // 100
    own, then = (child_window(predict(p), 3, 6).astype(np.int32) for p in (parent, shifted))
    now = own + noise(rng, 10 ** rng.uniform(0, 5), rng.random())
    if kind % 5 == 0:
        now = now // 8 * 8
    if kind % 7 == 0:
        now = own.copy()
    held = (None, now + noise(rng, 4, 0.1), then + (now - own) + noise(rng, 1, 0.01))[kind % 3]
    return now, own, held, then if kind % 2 else None


@pytest.mark.parametrize("seed", range(3))
def test_a_tile_is_coded_as_in_parts(seed: int) -> None:
    rng, chosen = np.random.default_rng(seed), set()
    for kind in range(42):
        tile = example(rng, kind)
        found = coding.code(*tile)
        assert found is not None
        assert (found.predictor, (found.filter, found.shift, found.payload)) == in_parts(*tile)
        chosen.add(found.predictor)
    assert chosen == set(coding.PREDICTORS)


def test_what_no_predictor_reaches_is_left_to_others() -> None:
    far = np.full((65, 65), 1 << 30, dtype=np.int32)
    assert coding.code(far, -far, -far, -far) is None
    found = coding.code(far, -far, far, None)
    assert found is not None
    assert (found.predictor, found.payload) == (Predictor.HELD, b"")


def test_items_come_back_in_order_and_many_are_shared() -> None:
    for count in range(9):
        threads: set[int] = set()

        def work(item: int, seen: set[int] = threads) -> int:
            seen.add(threading.get_ident())
            return 10 * item

        assert coding.in_two(work, range(count)) == [10 * item for item in range(count)]
        assert len(threads) == (0 if not count else 1 if count < coding.IN_TWO else 2)
