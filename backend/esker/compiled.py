"""The one way to compile a loop: exact IEEE arithmetic, no interpreter lock, kept on disk. It knows no other room."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
from numba.core import types

F = TypeVar("F", bound=Callable[..., Any])

OPTIONS: Final[dict[str, Any]] = {"nogil": True, "boundscheck": False, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Nothing but Python and other loops calls a loop: a third way to call each would be compiled for nobody."""
TRIES: Final = 8
"""Writes of an index until another process no longer replaces it meanwhile; without its line code is compiled again."""


def kernel(function: F) -> F:
    """The compiled form of a function. It is compiled at its first call, and kept on disk where a disk allows it.

    Numba compiles nothing where ``NUMBA_DISABLE_JIT`` says so: the function itself is returned then.
    """
    try:
        made: Any = numba.njit(cache=True, **OPTIONS)(function)
    except RuntimeError:  # no place on this machine to keep compiled code in
        made = numba.njit(**OPTIONS)(function)
    if made is function:
        return function
    if hasattr(made._cache, "_cache_file"):
        made._cache._cache_file = LoopFiles(made._cache._cache_file)
    _compile_once(made)
    return cast(F, made)


def _compile_once(made: Any) -> None:
    """Has other loops call one form of a loop, whether they pass constants or variables.

    Numba compiles a form for each constant, with all that the loop calls. The values are those of one form: LLVM folds
    constants into what it inlines.
    """
    template = made.get_call_template

    def of_values(args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
        return template(tuple(map(_value, args)), {name: _value(each) for name, each in kws.items()})

    made.get_call_template = of_values


def _value(kind: Any) -> Any:
    """Returns the type of an argument without its value."""
    return types.unliteral(kind)  # type: ignore[no-untyped-call]


class LoopFiles:
    """The files in which one function is kept: one of code for each form of its arguments, and an index of them.

    Numba numbers the files of code, and writes the index first. Two processes that compile the same function for other
    arguments at the same time then give two codes one name, and who loads one of them runs the other. Here a file has
    the name of what it was compiled from and for, and is there before a line of the index names it.
    """

    def __init__(self, files: Any) -> None:
        """``files``: numba's own, which read and write."""
        self._files = files
        self._base = files._index_name.removesuffix(".nbi")

    def load(self, key: object) -> Any:
        """Returns the code that is kept for the arguments ``key``; None where there is none."""
        return self._files.load(key)

    def save(self, key: object, data: object) -> None:
        """Keeps the code ``data`` for the arguments ``key``."""
        made_of = repr((self._files._source_stamp, key)).encode()
        name = f"{self._base}.{hashlib.sha256(made_of).hexdigest()[:16]}.nbc"
        self._files._save_data(name, data)
        for _ in range(TRIES):
            overloads = self._files._load_index()
            if not overloads:
                self._tidy(name)
            if overloads.get(key) == name:
                return
            overloads[key] = name
            self._files._save_index(overloads)

    def flush(self) -> None:
        """Forgets all code."""
        self._files.flush()

    def _tidy(self, name: str) -> None:
        """Removes all files of code but one: those of an earlier source, which no index names any more."""
        for path in Path(self._files._cache_path).glob(f"{self._base}.*.nbc"):
            if path.name != name:
                with suppress(OSError):
                    path.unlink()
