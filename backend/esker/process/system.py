"""One way to ask the operating system, whichever it is (decision 28).

Each function says what stands in for it where a system lacks it. What is missing is found by asking for it and not by
the system's name, so that a test can take it away.
"""

from __future__ import annotations

import ctypes
import errno
import importlib
import io
import mimetypes
import os
import platform
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Final

import psutil

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

MOST_OPEN_FILES: Final = 1 << 16
ASSUMED_OPEN_FILES: Final = 2_048
CPUINFO: Final = Path("/proc/cpuinfo")
MAPPED: Final = Path("/proc/self/maps")
"""Files in which Linux alone tells of the processor, and of what a process may read in its memory."""
FIRST_TO_END: Final = "700"
"""The score of a process that Linux should end before others when memory runs out (-1000 to 1000)."""
IDLE_FROM: Final = 10
"""Niceness from which on a process runs with Windows' lowest priority class; below it with the one under the usual."""
LOCKED_BYTE: Final = 1 << 30
"""Byte that is locked on Windows. It lies beyond what the file holds, since nobody else can read a locked byte
there."""
PR_SET_PDEATHSIG: Final = 1
M_ARENA_MAX: Final = -8
HEAPS: Final = 2
ORPHANED: Final = 9
"""Exit status of a child whose parent has ended."""
TYPES: Final = {
    ".css": "text/css",
    ".html": "text/html",
    ".js": "text/javascript",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".txt": "text/plain",
    ".webp": "image/webp",
    ".woff2": "font/woff2",
}
"""Kinds of the page's files. Windows reads them from its registry, where other programs have left theirs."""


def raise_open_files() -> int:
    """Lets this process open as many files and sockets as the system allows it; returns how many. Where a system does
    not say, as Windows does not, a number that its calls are known to bear."""
    if resource is None:
        return ASSUMED_OPEN_FILES
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MOST_OPEN_FILES if hard == resource.RLIM_INFINITY else min(hard, MOST_OPEN_FILES)
    if soft == resource.RLIM_INFINITY or soft >= wanted:
        return MOST_OPEN_FILES if soft == resource.RLIM_INFINITY else int(soft)
    with suppress(ValueError, OSError):  # macOS has a bound below the one that it tells
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
    return int(resource.getrlimit(resource.RLIMIT_NOFILE)[0])


# --- files --------------------------------------------------------------------------------------------------------


def lock(file: IO[str]) -> bool:
    """Takes an open file for this process alone; False where another process has it.

    The system lets it go when the file is closed or the process ends, however it ends.
    """
    try:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            windows: Any = importlib.import_module("msvcrt")
            place = file.tell()
            file.seek(LOCKED_BYTE)
            try:
                windows.locking(file.fileno(), windows.LK_NBLCK, 1)
            finally:
                file.seek(place)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK):
            return False
        raise
    return True


def sync(path: Path) -> None:
    """Waits until a file, or the names in a folder, are on the disk. Windows keeps folders by itself."""
    folder = path.is_dir()
    try:
        # Windows syncs only what is open for writing.
        handle = os.open(path, os.O_RDONLY if folder or fcntl is not None else os.O_RDWR)
    except PermissionError:
        if folder and fcntl is None:
            return
        raise
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


# --- memory and processors ------------------------------------------------------------------------------------------


def memory_bytes() -> int:
    """The memory of this machine. Linux opens no file for it, so that modules may ask while they are imported."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return int(psutil.virtual_memory().total)


def resident_bytes() -> int:
    """The memory that this process takes."""
    return int(psutil.Process().memory_info().rss)


def share_heaps() -> bool:
    """Has all threads take memory from two heaps, where the GNU C library would give each of them one of its own: what
    one thread frees serves the others. Returns whether the system has such heaps. Call it before there are threads."""
    with suppress(OSError, AttributeError, TypeError):
        return bool(ctypes.CDLL(None).mallopt(M_ARENA_MAX, HEAPS))
    return False


def give_memory_back() -> None:
    """Returns freed memory to the system. The GNU C library alone keeps blocks that threads took until it is asked."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


def processors() -> int:
    """Processors that this process may run on; all of them where the system does not say."""
    try:
        return len(os.sched_getaffinity(0))
    except (AttributeError, OSError):
        return os.cpu_count() or 1


def processor_name() -> str:
    """The processor as its maker calls it, as far as the system tells."""
    with suppress(OSError):
        for line in CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def step_back(niceness: int) -> None:
    """Lets other processes go first from now on. ``niceness``: 1 to 19, as POSIX counts; Windows has two classes."""
    if hasattr(os, "nice"):
        os.nice(niceness)
        return
    kind = "IDLE_PRIORITY_CLASS" if niceness >= IDLE_FROM else "BELOW_NORMAL_PRIORITY_CLASS"
    if (value := getattr(psutil, kind, None)) is not None:
        with suppress(psutil.Error, OSError):
            psutil.Process().nice(value)


def first_to_end() -> None:
    """Has Linux end this process before the server where memory runs out. Other systems do not offer it."""
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(FIRST_TO_END, encoding="ascii")


# --- signals --------------------------------------------------------------------------------------------------------


def on_stop(handler: Callable[..., Any]) -> None:
    """Calls ``handler`` for what asks this process to stop: Ctrl-C, SIGTERM, and Windows' Ctrl-Break.

    From the main thread only.
    """
    for name in ("SIGINT", "SIGTERM", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), handler)


def apart() -> dict[str, Any]:
    """Arguments of ``Popen`` for a child that a terminal's Ctrl-C does not reach: whoever started it ends it.

    It would be interrupted wherever it is, in the middle of importing, say. It stays in the session of this process
    (``process/apart.py`` says why).
    """
    if hasattr(os, "setpgid"):
        return {"process_group": 0}
    return {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}


def end_apart(child: subprocess.Popen[bytes]) -> None:
    """Ends a child that was started ``apart`` and has not been waited for, with all that is in its group.

    What it starts in this very moment is in its group too; a list of its children would lack it.
    """
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
    else:
        child.kill()


def was_killed(status: int | None) -> bool:
    """Returns whether a child's exit status says that the system ended it. Windows says nothing of the kind."""
    return hasattr(signal, "SIGKILL") and status == -signal.SIGKILL


def end_with_parent() -> None:
    """Has Linux end this process with the thread that started it, however that ends. Other systems do not offer it."""
    parent = os.getppid()
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(ORPHANED)


# --- sockets and streams --------------------------------------------------------------------------------------------


def take_port(listener: socket.socket) -> None:
    """Sets a socket up to take a port that was left a moment ago, and never one that is in use.

    On Windows SO_REUSEADDR means the contrary, that two programs may listen on one port.
    """
    own = getattr(socket, "SO_EXCLUSIVEADDRUSE", None)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR if own is None else own, 1)


def port_is_taken(error: OSError) -> bool:
    """Returns whether ``bind`` failed because another program has the port."""
    names = ("EADDRINUSE", "WSAEADDRINUSE", "WSAEACCES")
    return error.errno in {getattr(errno, name) for name in names if hasattr(errno, name)}


def speak_utf8() -> None:
    """Writes UTF-8 to stdout and stderr, whatever code page or locale was set: links, names and QR codes need it."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors="replace")


def name_types() -> None:
    """Names the kinds of the page's files: a module that is sent as anything else is not run by browsers."""
    for ending, kind in TYPES.items():
        mimetypes.add_type(kind, ending)
