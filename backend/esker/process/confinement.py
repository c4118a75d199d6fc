"""What a child that reads strangers' files may see: a few folders, and no network (docs/decisions/0032-disk.md).

Linux keeps a process to folders with Landlock (kernel 5.13, TCP from 6.7), and without a network in a namespace of its
own, where the server may make one, and by a filter of system calls (``syscalls.py``), which needs no right at all.
Where none of these is to be had, as on other systems, nothing is kept, and the caller is told: bounds of memory and
time (``bounds.py``) hold everywhere.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

from esker.process import syscalls

_CREATE, _ADD, _RESTRICT = 444, 445, 446
"""System calls of Landlock, the same on all processors."""
_NO_NEW_PRIVILEGES: Final = 38
_NEW_NETWORK, _NEW_USER = 0x40000000, 0x10000000
_PATH_BENEATH: Final = 1
_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_FOLDER = 1, 2, 4, 8
_RIGHTS: Final = {1: (1 << 13) - 1, 2: 1 << 13, 3: 1 << 14, 5: 1 << 15}
"""Rights over files that each version of Landlock added."""
_TCP: Final = 3
_SCOPES: Final = 3
_SYSTEM: Final = ("/usr", "/lib", "/lib64", "/etc", "/opt", "/proc", "/sys/devices/system", "/dev")


def confine(read: Iterable[Path], work: Iterable[Path]) -> frozenset[str]:
    """Keeps this process, and whatever it starts, to Python, what it may ``read`` and its ``work`` folders, where it
    may write, and without a network.

    Call it before the first thread is started. Returns what is kept: "files", "network", both or neither. It cannot be
    undone.
    """
    kept: set[str] = set()
    if (libc := _libc()) is None:
        return frozenset()
    if _without_network(libc):
        kept.add("network")
    with suppress(OSError):
        version = libc.syscall(_CREATE, None, ctypes.c_size_t(0), 1)
        if version >= 1:
            folders = [path.resolve() for path in work]
            seen = [part for path in _python() for part in _without_surroundings(path, folders)]
            _keep_to(libc, version, [*seen, *read], folders)
            kept.add("files")
    with suppress(OSError):
        if syscalls.restrict(libc):
            kept.add("network")
    return frozenset(kept)


def possible() -> bool:
    """Returns whether this system keeps a process to folders and without a network. Nothing is restricted by asking."""
    if (libc := _libc()) is None:
        return False
    return int(libc.syscall(_CREATE, None, ctypes.c_size_t(0), 1)) >= 1 and syscalls.known()


def _libc() -> ctypes.CDLL | None:
    """Linux' C library; None elsewhere. Windows has none that is asked for without a name."""
    try:
        return ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else None
    except TypeError:
        return None


def _without_network(libc: ctypes.CDLL) -> bool:
    """A network namespace of its own holds not even a loopback that is up. Unprivileged, it needs one of users too."""
    return any(libc.unshare(kind) == 0 for kind in (_NEW_NETWORK, _NEW_USER | _NEW_NETWORK))


def _python() -> list[Path]:
    """Returns what the interpreter needs: itself, its packages, the system's libraries.

    ``python -m`` puts the working folder in front of where modules are looked for. It may hold anything, also the data
    of the server, and no module of this package comes from there but by the package's own folder.
    """
    here, package = Path.cwd().resolve(), Path(__file__).resolve().parents[1]
    modules = [Path(path) for path in sys.path if path and Path(path).resolve() != here]
    found = [package, *map(Path, (*_SYSTEM, sys.prefix, sys.base_prefix, sys.exec_prefix)), *modules]
    return [path.resolve() for path in found if path.exists()]


def _without_surroundings(path: Path, work: list[Path]) -> list[Path]:
    """A folder, but for the part of it in which a work folder lies: the server's data lie there too. So a server that
    was unpacked in ``/opt`` with its data beside it shows its modules, not its data."""
    within = [folder.relative_to(path).parts[0] for folder in work if folder != path and folder.is_relative_to(path)]
    if not within:
        return [path]
    with suppress(OSError):
        return [part for part in path.iterdir() if part.name not in within]
    return []


def _keep_to(libc: ctypes.CDLL, version: int, read: list[Path], write: list[Path]) -> None:
    """Restricts this thread and all that come after it. Raises OSError."""
    everything = sum(rights for since, rights in _RIGHTS.items() if version >= since)
    attributes = struct.pack("=QQQ", everything, _TCP if version >= 4 else 0, _SCOPES if version >= 6 else 0)
    size = 24 if version >= 6 else 16 if version >= 4 else 8
    rules = libc.syscall(_CREATE, attributes, ctypes.c_size_t(size), 0)
    if rules < 0:
        raise OSError(ctypes.get_errno(), "landlock_create_ruleset")
    try:
        looking = _EXECUTE | _READ_FILE | _READ_FOLDER
        for path, rights in [*((path, looking) for path in read), *((path, everything) for path in write)]:
            _allow(libc, rules, path, rights & everything)
        _allow(libc, rules, Path(os.devnull), _READ_FILE | _WRITE_FILE)
        if libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0) or libc.syscall(_RESTRICT, rules, 0):
            raise OSError(ctypes.get_errno(), "landlock_restrict_self")
    finally:
        os.close(rules)


def _allow(libc: ctypes.CDLL, rules: int, path: Path, rights: int) -> None:
    try:
        handle = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        return  # a path that is not there needs no right
    try:
        if not path.is_dir():
            rights &= ~(_READ_FOLDER | ((1 << 13) - (1 << 4)) | (1 << 13))
        beneath = struct.pack("=Qi", rights, handle)
        if libc.syscall(_ADD, rules, _PATH_BENEATH, beneath, 0):
            raise OSError(ctypes.get_errno(), "landlock_add_rule")
    finally:
        os.close(handle)
