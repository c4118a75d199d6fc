"""The one way to compile a loop: exact IEEE arithmetic, no interpreter lock, kept on disk. It knows no other room."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])

OPTIONS: Final[dict[str, Any]] = {"nogil": True, "boundscheck": False, "error_model": "numpy"}


def kernel(function: F) -> F:
    """The compiled form of a function. It is compiled at its first call, and kept on disk where a disk allows it."""
    try:
        return cast(F, numba.njit(cache=True, **OPTIONS)(function))
    except RuntimeError:  # no place on this machine to keep compiled code in
        return cast(F, numba.njit(**OPTIONS)(function))
