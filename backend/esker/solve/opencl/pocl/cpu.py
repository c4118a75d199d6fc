"""The CPU that PoCL 3.0 compiles for, and the library of built-in functions that goes with it.

The PoCL wheel carries LLVM 14 (2022). It compiles kernels for the processor's *name*, as LLVM 14 knows it, and links
one of eight libraries by the processor's *flags*. The two can disagree: LLVM 14 calls Zen 4 ``znver3``, which has no
AVX-512, and PoCL links the AVX-512 library, so that a vector passed in one register by the one is expected in two by
the other. Such a build runs for minutes, or what it makes crashes. It calls Zen 5 ``generic``, which its own front end
refuses. So ``choose`` says before the first build which level fits, and ``name_cpu`` makes PoCL use its name: PoCL has
no option for it, but keeps it as a C string that its device structure points to. See
docs/decisions/0010-pocl-on-new-processors.md.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from esker.process import system

_STRUCT_BYTES = 4096
_kept: list[ctypes.Array[ctypes.c_char]] = []


@dataclass(frozen=True)
class Level:
    """A CPU of LLVM 14, the library that PoCL has for this very CPU, and the flags that a processor needs for it."""

    name: str
    library: str
    needs: frozenset[str]


_AVX = frozenset({"avx", "cx16", "popcnt"})
_AVX2 = _AVX | {"avx2", "fma", "f16c", "bmi1", "bmi2", "abm"}
LEVELS: Final = (
    Level("skylake-avx512", "avx512", _AVX2 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}),
    Level("haswell", "avx2", _AVX2),
    Level("ivybridge", "avx_f16c", _AVX | {"f16c"}),
    Level("sandybridge", "avx", _AVX),
    Level("penryn", "sse41", frozenset({"sse4_1", "ssse3", "cx16"})),
    Level("core2", "ssse3", frozenset({"ssse3", "cx16"})),
    Level("x86-64", "sse2", frozenset({"sse2"})),
)
"""Widest first. PoCL's ninth, for the first Bulldozers (avx_fma4), is left out: no processor of today can test it."""
NAMES: Final = tuple(level.name for level in LEVELS)


@dataclass(frozen=True)
class Choice:
    """The CPU that PoCL is to compile for.

    ``rename``: the name to give PoCL's device, None where it has this name already. ``forced``: whether PoCL itself
    would link another library than the level's.
    """

    level: Level
    rename: str | None
    forced: bool


def flags(cpuinfo: Path = system.CPUINFO) -> frozenset[str]:
    """The processor's flags; none where the system does not list them."""
    try:
        text = cpuinfo.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return frozenset()
    found = (line.partition(":")[2] for line in text.splitlines() if line.startswith("flags"))
    return frozenset(next(found, "").split())


def own_library(has: frozenset[str]) -> str:
    """The library that PoCL 3.0 links on a processor with these flags (``getX86KernelLibName``)."""
    found = "sse2"
    for library, needs in (
        ("ssse3", {"ssse3", "cx16"}),
        ("sse41", {"sse4_1", "cx16"}),
        ("avx", _AVX),
        ("avx_f16c", _AVX | {"f16c"}),
        ("avx_fma4", _AVX | {"xop", "fma4"}),
        ("avx2", _AVX2),
        ("avx512", {"avx512f"}),
    ):
        if needs <= has:
            found = library
    return found


def levels(has: frozenset[str], limit: str | None = None) -> tuple[Level, ...]:
    """The levels that a processor with these flags can run, widest first, none wider than the one named ``limit``.

    Raises ValueError for a limit that is no level's name.
    """
    if limit is not None and limit not in NAMES:
        raise ValueError(f"The CPU level must be one of {', '.join(NAMES)}, not '{limit}'.")
    allowed = LEVELS if limit is None else LEVELS[NAMES.index(limit) :]
    return tuple(level for level in allowed if level.needs <= has)


def choose(present: str, has: frozenset[str], limit: str | None = None) -> Choice | None:
    """Returns what PoCL should compile for, where LLVM calls the processor ``present`` and it has the flags ``has``.

    The CPU is always the one that the library was compiled for, also where LLVM's own name has vectors as wide: then
    all processors of a level run the same code, and a test at that level speaks for all of them. None: PoCL has no
    library for such a processor. Raises ValueError like ``levels``.

    >>> choose("znver3", LEVELS[0].needs).rename
    'skylake-avx512'
    """
    level = next(iter(levels(has, limit)), None)
    if level is None:
        return None
    return Choice(level, None if present == level.name else level.name, level.library != own_library(has))


def compiled_for(version: str) -> str | None:
    """The CPU that a device of PoCL compiles for, from its version; None for other devices.

    >>> compiled_for("OpenCL 3.0 PoCL HSTR: pthread-x86_64-unknown-linux-gnu-znver3")
    'znver3'
    """
    return version.rpartition("-linux-gnu-")[2] if "PoCL HSTR" in version and "x86_64-" in version else None


def name_cpu(device_pointer: int, present: str, name: str) -> bool:
    """Give the PoCL device at this address, whose compiler calls the CPU ``present``, another name.

    Returns whether ``present`` was found in the device's structure. Memory is read only where the system says that it
    can be.
    """
    for field in _fields(device_pointer, present.encode() + b"\0"):
        text = ctypes.create_string_buffer(name.encode())
        _kept.append(text)
        ctypes.c_uint64.from_address(field).value = ctypes.addressof(text)
        return True
    return False


def _fields(base: int, wanted: bytes) -> Iterator[int]:
    """Addresses, inside the device structure, of pointers to the string ``wanted``, which ends with a zero byte."""
    maps = list(_readable())
    for field in range(base, base + _STRUCT_BYTES, 8):
        if not _within(maps, field, 8):
            return
        target = ctypes.c_uint64.from_address(field).value
        if _within(maps, target, len(wanted)) and ctypes.string_at(target, len(wanted)) == wanted:
            yield field


def _readable() -> Iterator[tuple[int, int]]:
    for line in system.MAPPED.read_text(encoding="utf-8").splitlines():
        span, mode = line.split()[:2]
        if mode.startswith("r") and not line.endswith(("[vvar]", "[vsyscall]")):
            low, high = span.split("-")
            yield int(low, 16), int(high, 16)


def _within(maps: list[tuple[int, int]], address: int, size: int) -> bool:
    return any(low <= address and address + size <= high for low, high in maps)
