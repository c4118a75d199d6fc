"""Takes from Python what Windows does not have, before anything else runs: put this folder on PYTHONPATH.

Python imports ``sitecustomize`` when it starts, in children too. Modules, functions of ``os`` and numbers of ``signal``
are gone, and /proc, /sys and folders cannot be opened, for Esker's code: other packages have code for the system that
they were built for. Loops take no signal handlers; there is no OpenCL. ``msvcrt`` can lock files and nothing else.
"""

from __future__ import annotations

import builtins
import ctypes
import fcntl
import importlib.machinery
import os
import signal
import socket
import sys
import types
from asyncio import unix_events
from typing import Any

MODULES = frozenset({"fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"})
NOBODY = ("pyopencl", "uvloop")
CALLS = """chown fchmod fchown fork forkpty getegid geteuid getgid getloadavg getpriority getuid killpg mkfifo nice
    pread pwrite sched_getaffinity sched_setaffinity setpgid setpriority setsid sysconf sysconf_names uname"""
NUMBERS = """AF_UNIX SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGUSR1 SIGUSR2"""
GONE = frozenset(f"{CALLS} {NUMBERS}".split())
MINE = ("pathlib", "io", "os", "codecs", "contextlib", "encodings", "genericpath", "posixpath")

_open = ctypes.CDLL.__init__
_flock = fcntl.lockf, fcntl.LOCK_EX | fcntl.LOCK_NB, fcntl.LOCK_UN


def _locking(descriptor: int, mode: int, count: int) -> None:
    """As Windows' ``_locking``: ``count`` bytes from where the file stands."""
    lock, take, leave = _flock
    lock(descriptor, take if mode == 2 else leave, count, os.lseek(descriptor, 0, os.SEEK_CUR))


def _asked_by_esker() -> bool:
    """Whether the nearest caller beyond Python's own library is a module of Esker."""
    frame: Any = sys._getframe(2)
    while frame is not None and str(frame.f_globals.get("__name__")).partition(".")[0] in MINE:
        frame = frame.f_back
    return frame is not None and str(frame.f_globals.get("__name__")).partition(".")[0] == "esker"


def _forbid(event: str, arguments: tuple[Any, ...]) -> None:
    if event not in ("open", "os.listdir", "os.scandir") or not isinstance(arguments[0], (str, bytes, os.PathLike)):
        return
    path = os.fsdecode(arguments[0])
    if path.startswith(("/proc", "/sys")) and _asked_by_esker():
        raise FileNotFoundError(2, "There is no such file on this system", path)
    if event == "open" and os.path.isdir(path) and _asked_by_esker():
        raise PermissionError(13, "Folders cannot be opened on this system", path)


def _no_handlers(*_: Any) -> None:
    raise NotImplementedError


class _Without(types.ModuleType):
    """A module that lacks what is ``GONE`` when Esker's code asks."""

    def __getattribute__(self, name: str) -> Any:
        if name in GONE and _asked_by_esker():
            raise AttributeError(f"this system has no {name}")
        return super().__getattribute__(name)


def _library(self: ctypes.CDLL, name: str | None, *given: Any, **named: Any) -> None:
    if name is None and _asked_by_esker():
        raise TypeError("bad argument type for built-in operation")
    _open(self, name, *given, **named)


def hide() -> None:
    """Takes everything away, once."""
    ctypes.CDLL.__init__ = _library  # type: ignore[method-assign]
    windows: Any = types.ModuleType("msvcrt")
    windows.__spec__ = importlib.machinery.ModuleSpec("msvcrt", None)
    windows.LK_NBLCK, windows.LK_UNLCK, windows.locking = 2, 0, _locking
    sys.modules["msvcrt"] = windows
    unix_events._UnixSelectorEventLoop.add_signal_handler = _no_handlers  # type: ignore[assignment]
    importing = builtins.__import__

    def import_(name: str, globals: Any = None, *given: Any, **named: Any) -> Any:
        if name in MODULES and str((globals or {}).get("__name__")).partition(".")[0] == "esker":
            raise ImportError(f"this system has no {name}")
        return importing(name, globals, *given, **named)

    builtins.__import__ = import_
    for name in NOBODY:
        sys.modules[name] = None  # type: ignore[assignment]
    for module in (os, signal, socket):
        module.__class__ = _Without
    sys.addaudithook(_forbid)


hide()
