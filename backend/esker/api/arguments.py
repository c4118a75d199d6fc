"""Arguments of the Python face, checked where they come in: a wrong one is refused in a sentence that names it.

Nothing below the public methods has to be ready for NaN, infinity, text or numbers beyond all bounds then, and nobody
has to read a traceback out of NumPy or pydantic. Wrong values and wrong kinds of values are ValueErrors alike.
"""

from __future__ import annotations

import math
import operator
import os
import reprlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from esker import grid
from esker.contract import ABSOLUTE_BOUND_M, MAX_GRID_SAMPLES, MAX_LEVEL, MAX_REFINED_LEVEL

Model = TypeVar("Model", bound=BaseModel)
Kind = TypeVar("Kind")
LONGEST_WAIT_S: Final = 86_400.0 * 365
"""A lock of the system cannot wait much longer."""


def shown(value: object) -> str:
    """A value as a sentence can hold it: on one line, and short."""
    if isinstance(value, np.ndarray) and value.ndim > 0:
        return f"an array of {value.dtype} of shape {value.shape}"
    text = " ".join(reprlib.repr(value).split())
    return text if len(text) <= 60 else f"{text[:60]}…"


def whole(name: str, value: object, low: int, high: int) -> int:
    """A whole number low..high; any type of integers, but no truth value and no 4.0. Raises ValueError."""
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        found = operator.index(value)  # type: ignore[arg-type]  # what has none raises TypeError
    except TypeError:
        raise ValueError(f"{name} must be a whole number {low}..{high}, not {shown(value)}") from None
    if not low <= found <= high:
        raise ValueError(f"{name} must be {low}..{high}, not {shown(found)}")
    return found


def number(name: str, value: object, low: float = -math.inf, high: float = math.inf) -> float:
    """A finite number low..high; text is none. Raises ValueError."""
    try:
        if isinstance(value, (str, bytes, bool, np.bool_)):
            raise TypeError
        found = float(value)  # type: ignore[arg-type]  # what cannot be one raises TypeError
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be a number, not {shown(value)}") from None
    if not math.isfinite(found):
        raise ValueError(f"{name} must be a finite number, not {found}")
    if not low <= found <= high:
        bounds = f"at least {low:g}" if high == math.inf else f"{low:g}..{high:g}"
        raise ValueError(f"{name} must be {bounds}, not {found:g}")
    return found


def metres(name: str, value: object) -> float:
    """A place or a height, within the bound of all documents. Raises ValueError."""
    return number(name, value, -ABSOLUTE_BOUND_M, ABSOLUTE_BOUND_M)


def pair(name: str, value: object) -> tuple[float, float]:
    """Two finite numbers. Raises ValueError."""
    x, y = numbers(name, value, 2)
    return x, y


def numbers(name: str, value: object, count: int) -> tuple[float, ...]:
    """Returns a value as ``count`` finite numbers. Raises ValueError."""
    try:
        if isinstance(value, (str, bytes, Mapping)):
            raise TypeError
        found: tuple[Any, ...] = tuple(value)  # type: ignore[arg-type]  # what cannot be gone through raises TypeError
    except TypeError:
        found = ()
    if len(found) != count:
        raise ValueError(f"{name} must be {count} numbers, not {shown(value)}")
    return tuple(number(name, one) for one in found)


def flag(name: str, value: object) -> bool:
    """True or False. Raises ValueError."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{name} must be True or False, not {shown(value)}")
    return bool(value)


def text(name: str, value: object, most: int) -> str:
    """A text of at most so many characters. Raises ValueError."""
    if not isinstance(value, str):
        raise ValueError(f"{name} must be a text, not {shown(value)}")
    if len(value) > most:
        raise ValueError(f"{name} must have at most {most} characters, not {len(value)}")
    return value


def texts(name: str, value: object) -> dict[str, str]:
    """Texts by text; None has none. Raises ValueError."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(one, str) for pair in value.items() for one in pair):
        raise ValueError(f"{name} must be texts by the id of a question, not {shown(value)}")
    return dict(value)


def points(name: str, value: object, columns: tuple[int, ...], most: int | None = None) -> NDArray[np.float64]:
    """Places as a new array float64 (n, k), k one of ``columns``, finite and within the bound of all documents.

    Masked values are none. Raises ValueError, also for more than ``most`` of them.
    """
    array = real_array(name, value)
    if array.ndim != 2 or array.shape[1] not in columns:
        wanted = " or ".join(f"(n, {k})" for k in columns)
        raise ValueError(f"{name} must be finite and of shape {wanted}, not of shape {array.shape}")
    if most is not None and len(array) > most:
        raise ValueError(f"{name} are at most {most}, not {len(array)}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite and of shape (n, {array.shape[1]}); some are not finite")
    if len(array) and np.abs(array).max() > ABSOLUTE_BOUND_M:
        raise ValueError(f"{name} must lie within {ABSOLUTE_BOUND_M:.0f} m of zero, not at {np.abs(array).max():g}")
    return array


def real_array(name: str, value: object) -> NDArray[np.float64]:
    """A new array float64 of real numbers of any shape; NaN where values are masked. Raises ValueError."""
    try:
        array = np.ma.asanyarray(value) if isinstance(value, np.ma.MaskedArray) else np.asarray(value)
        if array.dtype.kind not in "iufO":
            raise TypeError
        filled = np.ma.filled(array.astype(np.float64), np.nan)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be an array of numbers, not {shown(value)}") from None
    return np.array(filled, dtype=np.float64)


def wait(name: str, value: object) -> float:
    """Seconds that a caller waits at most. Raises ValueError."""
    return number(name, value, 0.0, LONGEST_WAIT_S)


def clock(name: str, value: object) -> int:
    """The clock of a document. Raises ValueError."""
    return whole(name, value, 0, 2**53)


def kind(name: str, value: Kind | None, wanted: type[Kind]) -> Kind | None:
    """A value of a class, or None. Raises ValueError."""
    if value is not None and not isinstance(value, wanted):
        raise ValueError(f"{name} must be a {wanted.__module__}.{wanted.__name__} or None, not {shown(value)}")
    return value


def called(name: str, value: Callable[..., Any] | None) -> None:
    """Refuses what cannot be called; None is nobody. Raises ValueError."""
    if value is not None and not callable(value):
        raise ValueError(f"{name} must be a function or None, not {shown(value)}")


def path(name: str, value: object) -> Path:
    """The path of a file. Raises ValueError."""
    if not isinstance(value, (str, os.PathLike)) or "\0" in os.fspath(value):
        raise ValueError(f"{name} must be the path of a file, not {shown(value)}")
    return Path(os.fspath(value))


def model(kind: type[Model], fields: Mapping[str, Any]) -> Model:
    """A value of the contract. Raises ValueError that names the first field that is wrong, and how."""
    try:
        return kind(**fields)
    except ValidationError as error:
        raise ValueError(first_wrong(error)) from None


def first_wrong(error: ValidationError) -> str:
    """The first field that is wrong, and how, as a sentence."""
    first = error.errors(include_url=False, include_input=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    return f"{where}: {first['msg']}" if where else str(first["msg"])


def detailed(detail: bool, global_level: int, refined_level: int, progress: Callable[..., Any] | None) -> bool:
    """``detail``, once it and what goes with it are what they must be. Raises ValueError."""
    whole("global_level", global_level, 0, MAX_LEVEL)
    whole("refined_level", refined_level, 0, MAX_REFINED_LEVEL)
    called("progress", progress)
    return flag("detail", detail)


def samples_inside(corners: tuple[float, ...], level: int, size: float) -> tuple[int, int, int, int]:
    """Rows and columns (r0, r1, c0, c1) of the samples in a rectangle (x0, y0, x1, y1). Raises ValueError for none, and
    for more than fit into memory."""
    far = 2 * ABSOLUTE_BOUND_M
    r0, r1, c0, c1 = grid.Rect(*(min(max(x, -far), far) for x in corners)).sample_window(level, size)
    if r0 >= r1 or c0 >= c1:
        x0, y0, x1, y1 = corners
        raise ValueError(
            f"no sample of level {level} lies in ({x0:g}, {y0:g})..({x1:g}, {y1:g}); the terrain is {size:g} m wide"
        )
    if (r1 - r0) * (c1 - c0) > MAX_GRID_SAMPLES:
        raise ValueError(
            f"that window holds {c1 - c0:,} x {r1 - r0:,} samples of level {level}; at most "
            f"{MAX_GRID_SAMPLES:,} are made at a time"
        )
    return r0, r1, c0, c1
