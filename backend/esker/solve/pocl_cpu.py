"""Makes PoCL 3.0 usable on processors that are newer than its compiler.

The PoCL wheel carries LLVM 14 (2022). On a processor that LLVM 14 does not know, AMD's since Zen 5, it names the target
CPU "generic", which its own front end then refuses ("unknown target CPU 'generic'"): nothing compiles. PoCL has no
option for the name, but keeps it as a C string that its device structure points to. ``name_cpu`` lets that pointer
point to the instruction set level that the processor says it has. It is called only after a compilation has failed
in exactly that way; whatever it does not recognise it leaves alone. See docs/decisions/0010-pocl-on-new-processors.md.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from pathlib import Path

UNKNOWN = b"generic\0"
COMPLAINT = "unknown target CPU 'generic'"
_STRUCT_BYTES = 4096
_LEVELS = (
    ("avx512f", "skylake-avx512", {"avx512bw", "avx512cd", "avx512dq", "avx512vl"}),
    ("avx2", "haswell", {"fma", "bmi2", "f16c"}),
    ("avx", "sandybridge", set[str]()),
    ("sse2", "x86-64", set[str]()),
)
"""What makes PoCL choose a library of built-in functions, best first; the CPU that this library was compiled for, as
far as vectors are passed; what else such a CPU has. Library and kernels must agree, or vectors are lost in calls."""
_kept: list[ctypes.Array[ctypes.c_char]] = []


def cpu_level(cpuinfo: Path = Path("/proc/cpuinfo")) -> str | None:
    """The CPU of LLVM 14 that this processor can pass for; None when there is none that fits PoCL's library."""
    flags: set[str] = set()
    for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
        if line.startswith("flags"):
            flags = set(line.partition(":")[2].split())
            break
    return next((name if needed <= flags else None for first, name, needed in _LEVELS if first in flags), None)


def cache_folder() -> str | None:
    """A folder of its own for what PoCL compiles, None where it cannot be made: then nothing should be kept.

    PoCL's key does not know the CPU's name: code for one, found by another in a folder that they share, has no
    kernels or crashes. It happens when a home moves to another machine, or a container's image does.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    try:
        folder = Path(home) / "esker" / f"pocl-{cpu_level()}"
        folder.mkdir(parents=True, exist_ok=True)
        return str(folder) if os.access(folder, os.W_OK) else None
    except OSError:
        return None


def name_cpu(device_pointer: int) -> str | None:
    """Give the PoCL device at this address a CPU name that its compiler knows; the name, or None if not possible."""
    for field in _fields(device_pointer):
        name = cpu_level()
        if name is None:
            return None
        text = ctypes.create_string_buffer(name.encode())
        _kept.append(text)
        ctypes.c_uint64.from_address(field).value = ctypes.addressof(text)
        return name
    return None


def _fields(base: int) -> Iterator[int]:
    """Addresses, inside the device structure, of pointers to the string "generic"."""
    maps = list(_readable())
    for field in range(base, base + _STRUCT_BYTES, 8):
        if not _within(maps, field, 8):
            return
        target = ctypes.c_uint64.from_address(field).value
        if _within(maps, target, len(UNKNOWN)) and ctypes.string_at(target, len(UNKNOWN)) == UNKNOWN:
            yield field


def _readable() -> Iterator[tuple[int, int]]:
    for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
        span, mode = line.split()[:2]
        if mode.startswith("r") and not line.endswith(("[vvar]", "[vsyscall]")):
            low, high = span.split("-")
            yield int(low, 16), int(high, 16)


def _within(maps: list[tuple[int, int]], address: int, size: int) -> bool:
    return any(low <= address and address + size <= high for low, high in maps)
