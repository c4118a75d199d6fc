"""Tile payloads: integer prediction from the parent, residuals coded by ``entropy`` (DESIGN 6).

Everything is exact integer arithmetic, mirrored by ``frontend/src/core/predict.ts`` and ``net/decode.ts``; both read
``tests/vectors/tiles.json``. Arrays are ``[row, col]``, row 0 south; a tile is 65x65 int32 in quanta of its level.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import TILE_CELLS, TILE_MAX_SHIFT, TILE_SAMPLE_LIMIT, TILE_SAMPLES
from esker.tiles import loops
from esker.tiles.codec import entropy

Ints = NDArray[np.int32]
Wide = NDArray[np.signedinteger]

SAMPLE_LIMIT: Final = TILE_SAMPLE_LIMIT
_NARROW_LIMIT: Final = (1 << 31) // (26 * 26) - 1
"""Largest |parent sample| for which the two-dimensional sums below fit in int32 (weights add up to at most 26)."""


class CodecError(ValueError):
    """A payload that no encoder could have written."""


def predict(parent: Ints, ratio: int = 2) -> Wide:
    """All four children of a parent at once, as one 129x129 grid.

    Args:
        parent: (65, 65) int32, |sample| <= 2^28, in quanta of the parent's level.
        ratio: quanta of the child's level in one of the parent's: 2 for heights, 1 for the other channels.
    Returns:
        (129, 129) int32 or int64 in quanta of the child's level: the tensor product of (-1, 9, 9, -1)/16, at the
        parent tile's border of (5, 15, -5, 1)/16, times ``ratio``, rounded once, halves upward: with the sum S of
        weights that add up to 256, ``floor((S + 64) / 128)`` or ``floor((S + 128) / 256)``. Even samples are exactly
        ``ratio`` times the parent's. |result| is below 2^30.5. Child (cx, cy) is
        ``[64*cy : 64*cy+65, 64*cx : 64*cx+65]``. Twin of this compiled form: ``upsampled``.
    """
    small = max(int(parent.max()), -int(parent.min())) <= _NARROW_LIMIT
    wide: Wide = parent.astype(np.int32 if small else np.int64, order="C")
    out: Wide = np.empty((2 * parent.shape[0] - 1, 2 * parent.shape[1] - 1), dtype=wide.dtype)
    loops.predicted(wide, 9 - ratio, out)
    return out


def upsampled(parent: Ints, ratio: int = 2) -> Wide:
    """Computes ``predict`` in plain NumPy, (n, n) -> (2n - 1, 2n - 1) int64."""
    both = _upsample(_upsample(parent.astype(np.int64)).T).T
    return np.asarray((both + (1 << (8 - ratio))) >> (9 - ratio))


def _upsample(a: Wide) -> Wide:
    """Upsamples along the last axis, n -> 2n-1 samples, scaled by 16: interpolating 4-point rule, one-sided at both
    ends."""
    out = np.empty((*a.shape[:-1], 2 * a.shape[-1] - 1), dtype=a.dtype)
    out[..., 0::2] = 16 * a
    odd = out[..., 1::2]
    odd[..., 1:-1] = 9 * (a[..., 1:-2] + a[..., 2:-1]) - a[..., :-3] - a[..., 3:]
    odd[..., 0] = 5 * a[..., 0] + 15 * a[..., 1] - 5 * a[..., 2] + a[..., 3]
    odd[..., -1] = 5 * a[..., -1] + 15 * a[..., -2] - 5 * a[..., -3] + a[..., -4]
    return out


def child_window(prediction: Wide, x: int, y: int) -> Wide:
    """Returns the 65x65 part of ``predict``'s grid that belongs to child tile (x, y); only their parities matter."""
    r, c = TILE_CELLS * (y & 1), TILE_CELLS * (x & 1)
    return prediction[..., r : r + TILE_SAMPLES, c : c + TILE_SAMPLES]


def follow(samples: Ints, then: Ints | None, now: Ints | None, x: int, y: int, ratio: int = 2) -> Wide:
    """A tile predicted from its previous samples: moved along with its parent, (65, 65) int64, |result| < 2^32.

    ``then`` and ``now`` are the parent's 65x65 samples when ``samples`` were new and at present; both predictions are
    rounded as in ``predict``. None, or the same array twice: the parent has not moved.
    """
    if then is None or now is None or then is now:
        return samples.astype(np.int64)
    before, after = (child_window(predict(p, ratio), x, y).astype(np.int64) for p in (then, now))
    return np.asarray(samples + after - before)


def cost(residual: Wide) -> float:
    """Estimates the bits that a residual will take: near enough to choose between two predictors."""
    return float(np.log2(np.abs(residual).astype(np.float32) + 1).sum())


def pack(residual: Wide, lattice: bool = False) -> tuple[int, bytes] | None:
    """One tile's residual, (65, 65) with 32 bits, as ``(shift, payload)``; None where ``lattice`` makes it too large.

    What is coded is the residual divided by 2^shift, the greatest power of two that all samples are multiples of. A
    residual of zeros has no payload. ``lattice``: see ``entropy.encode``.
    """
    bits = int(np.bitwise_or.reduce(residual, axis=None))
    if not bits:
        return 0, b""
    shift = min((bits & -bits).bit_length() - 1, TILE_MAX_SHIFT)
    payload = entropy.encode(residual >> shift, lattice)
    return None if payload is None else (shift, payload)


def unpack(shift: int, payload: bytes | memoryview, lattice: bool = False) -> Wide:
    """Inverse of ``pack``: the residual, (65, 65) int64. Raises CodecError for what no encoder writes."""
    if len(payload) == 0:
        return np.zeros((TILE_SAMPLES, TILE_SAMPLES), dtype=np.int64)
    coded = entropy.decode(payload, lattice)
    if coded is None or max(int(coded.max()), -int(coded.min())) >= entropy.LIMIT >> shift:
        raise CodecError("a tile payload has bytes left over or numbers that are too large")
    return coded << shift


def reconstruct(prediction: Wide | None, residual: Wide) -> Ints:
    """Samples from prediction (None: zero) and residual. Raises CodecError beyond +-2^28, which no encoder sends."""
    samples = residual.astype(np.int64) if prediction is None else prediction.astype(np.int64) + residual
    if samples.min() < -SAMPLE_LIMIT or samples.max() > SAMPLE_LIMIT:
        raise CodecError("a tile sample is out of range")
    return samples.astype(np.int32)
