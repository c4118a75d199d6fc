"""The first build of PoCL's kernels: in a child process, bounded in time and memory, once for each processor level.

LLVM may take minutes, all memory, or end the process in which it runs. So nothing that PoCL has not compiled yet is
compiled where people are served: a child (``server.first_build``) compiles all of it and solves a known scene. Past its
bounds the next narrower level is tried; where none is left, NumPy serves. What came of it is kept beside what was
compiled, by level, kernel sources and versions, so that the next start only looks.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

import psutil

from esker.process import caches, system
from esker.solve.opencl import program_text
from esker.solve.opencl.pocl import cpu, home

log = logging.getLogger(__name__)

SECONDS = 60.0
"""Processor time that one child may take. On a machine that does nothing else it is as long by the clock; on a busy one
a build that would succeed is not given up."""
PATIENCE: Final = 300.0
"""Seconds by the clock after which a child is given up that waits for something instead."""
BYTES: Final = 3 << 29
"""Memory that one child may take, 1.5 GiB."""
LOOK_EVERY: Final = 0.1
AGAIN_AFTER: Final = 24 * 3600.0
"""Seconds after which a level that failed is tried again: the machine may have been busy."""
MODULE: Final = "esker.server.first_build"
POCL: Final = "PoCL"
"""In the names of its devices, and of no others."""
NEXT: Final = "the next device is tried"
THIS_IS_THE_CHILD = False
"""Set in the child: there everything is compiled in place."""


class Stopped(Exception):
    """A build is no longer wanted by whoever asked for it."""


@dataclass(frozen=True)
class Step:
    """How far the first build is. ``done`` of ``of`` kernels are compiled; ``said``: a sentence for people."""

    said: str
    done: int = 0
    of: int = 0


Tell = Callable[[Step], None]


@dataclass
class _State:
    """State of this process. PoCL is loaded once in a process, so its level is settled once."""

    level: cpu.Level | None = None
    settled: bool = False
    ready: bool = False
    failed: bool = False
    other: bool = False
    drivers: dict[str, str | None] = field(default_factory=dict)
    """Devices that are not PoCL's, each with why its driver cannot be used here, None where it can."""


_state = _State()
_lock = threading.RLock()


def settle() -> None:
    """Settles PoCL's environment before anything lists the devices of this process."""
    caches.spare_pyopencl()
    with _lock:
        if _state.settled or home.site() is None:
            return
        levels = cpu.levels(cpu.flags(), home.limit())
        chosen = next((one for one in levels if _kept(one)), next(iter(levels), None))
        if chosen is not None:
            _settle(chosen)


def adopt(one: cpu.Level) -> None:
    """Settles PoCL's environment at this level, in a process that has not settled it yet."""
    with _lock:
        _settle(one)


def check() -> None:
    """Raises ValueError for an ESKER_CPU_LEVEL that names no level."""
    cpu.levels(frozenset(), home.limit())


def level() -> cpu.Level | None:
    """The level that PoCL compiles for in this process; None before it is settled and where there is none."""
    return _state.level


def ready(
    wanted: str | None,
    threads: int | None,
    tell: Tell = lambda _: None,
    stopped: threading.Event | None = None,
    *,
    only_pocl: bool = False,
) -> bool:
    """Sees to it that all kernels are compiled, should PoCL be the device that ``wanted`` names (None: the best).

    Returns whether PoCL can be used. Logs and tells one line for each step. ``only_pocl``: PoCL is needed, whichever
    device would be better. Raises ValueError for an ESKER_CPU_LEVEL that is none, Stopped.
    """
    if THIS_IS_THE_CHILD or home.site() is None:
        return True
    with _lock:
        if _state.ready or _state.failed or (_state.other and not only_pocl):
            return not _state.failed
        levels = [_state.level] if _state.settled and _state.level else cpu.levels(cpu.flags(), home.limit())
        for one, narrower in zip(levels, [*levels[1:], None], strict=True):
            why = _tried(one, POCL if only_pocl else wanted, threads, tell, stopped)
            if why is None:
                return True
            following = f"trying {narrower.name}" if narrower else "NumPy serves, which is slow"
            _say(tell, f"Kernels for {one.name}: {why}; {following}.")
        if not levels:
            _say(tell, "PoCL has no functions for this processor; NumPy serves, which is slow.")
        _state.failed = True
        return False


def _tried(
    one: cpu.Level, wanted: str | None, threads: int | None, tell: Tell, stopped: threading.Event | None
) -> str | None:
    """Returns None when the kernels of this level are there; else a sentence about what went wrong."""
    if _kept(one):
        _settle(one)
        _state.ready = True
        return None
    record = _failure(one)
    if record is not None:
        return f"{record}, not long ago"
    result = _built(one, task(one, wanted, threads), tell, stopped)
    if result.get("other"):
        _state.other = True
        return None
    if "failed" in result:
        _write(_record(one, "failed"), {"why": result["failed"], "at": time.time()})
        return str(result["failed"])
    files = [str(path.relative_to(home.folder(one))) for path in _compiled(one)]
    _write(_record(one, "ready"), {"device": result["device"], "files": files})
    _settle(one)
    _state.ready = True
    return None


def driver(
    name: str,
    release: str,
    threads: int | None,
    tell: Tell = lambda _: None,
    stopped: threading.Event | None = None,
) -> str | None:
    """None when a child has built all kernels with the driver of a device that is not PoCL's; else what went wrong.

    Graphics drivers compile in the process that asks them, and keep what they compiled on disk: a child that has built
    everything shows that this process may, and leaves it little to compile. ``release``: what tells this driver from
    its next version. A driver that failed is tried again after a day. Logs and tells a line. Raises Stopped.
    """
    with _lock:
        if THIS_IS_THE_CHILD:
            return None
        known = f"{name}, {release}"
        if known not in _state.drivers:
            _state.drivers[known] = _driver(known, name, threads, tell, stopped)
            if why := _state.drivers[known]:
                _say(tell, f"Kernels for {name}: {why}; {NEXT}.")
        return _state.drivers[known]


def refusals() -> dict[str, str]:
    """Drivers that cannot be used, by device and release, each with what went wrong."""
    return {known: why for known, why in _state.drivers.items() if why is not None}


def _driver(known: str, name: str, threads: int | None, tell: Tell, stopped: threading.Event | None) -> str | None:
    named = hashlib.sha256(known.encode()).hexdigest()[:16]
    built, failed = (_drivers() / f"{kind}-{named}-{key()}.json" for kind in ("ready", "failed"))
    if _read(built) is not None:
        return None
    if (record := _recent(failed)) is not None:
        return f"{record}, not long ago"
    log.info("building the solver's kernels for %s, once for its driver", name)
    order = {"name": name, "threads": threads, "level": _state.level.name if _state.level else None}
    step = Step(f"Compiling kernels for {name}, once for its driver")
    result = bounded(["driver", json.dumps(order)], lambda: tell(step), stopped)
    if "failed" in result:
        _write(failed, {"why": result["failed"], "at": time.time()})
        return str(result["failed"])
    _write(built, {"device": known})
    return None


def task(one: cpu.Level, wanted: str | None, threads: int | None) -> dict[str, Any]:
    """Returns the environment of the child."""
    return {"wanted": wanted, "threads": threads, "level": one.name}


def _settle(one: cpu.Level) -> None:
    if not _state.settled:
        home.settle(one)
        _state.level, _state.settled = one, True


def _say(tell: Tell, sentence: str) -> None:
    log.warning("%s", sentence)
    tell(Step(sentence))


# --- the child ------------------------------------------------------------------------------------------------------


def _built(one: cpu.Level, order: dict[str, Any], tell: Tell, stopped: threading.Event | None) -> dict[str, Any]:
    """Runs a child that compiles for a level; what it says came of it, or ``failed``."""
    began, of = time.monotonic(), expected()
    log.info("compiling the solver's kernels for %s, once on this machine", one.name)

    def look() -> None:
        done = min(len(_compiled(one)), of)
        tell(Step(f"Compiling kernels for {one.name}, once on this machine", done, of))

    result = bounded(["kernels", json.dumps(order)], look, stopped)
    if "failed" not in result:
        log.info("%d kernels for %s in %.1f s", len(_compiled(one)), one.name, time.monotonic() - began)
    return result


def bounded(
    arguments: list[str],
    look: Callable[[], None] = lambda: None,
    stopped: threading.Event | None = None,
    times: float = 1.0,
) -> dict[str, Any]:
    """Runs ``esker.server.first_build`` until it ends or is past its bounds; its answer, or ``failed`` with the reason.

    ``look`` is called now and then. ``times``: so many times as long as kernels may take. Raises Stopped, after the
    child and its own children have ended.
    """
    command = [sys.executable, "-m", MODULE, *arguments]
    pipe = subprocess.PIPE
    ends: dict[str, Any] = {"stdin": pipe, "stdout": pipe, "stderr": pipe}
    with subprocess.Popen(command, env=_environment(), **ends, **system.apart()) as child:
        answers: list[bytes] = []
        readers = [threading.Thread(target=lambda: answers.append(_all(child.stdout)), daemon=True)]
        complaints: list[bytes] = []
        readers.append(threading.Thread(target=lambda: complaints.append(_all(child.stderr)), daemon=True))
        for reader in readers:
            reader.start()
        try:
            why = _watched(child, look, stopped, times)
        except BaseException:
            _end(child)
            raise
        if why is not None:
            _end(child)
            return {"failed": why}
        for reader in readers:
            reader.join()
    with contextlib.suppress(ValueError, IndexError):
        return dict(json.loads(answers[0].splitlines()[-1]))
    log.info("the build said: %s", b"".join(complaints).decode("utf-8", "replace").strip()[-2000:])
    return {"failed": f"the compiler ended ({child.returncode})"}


def _all(stream: Any) -> bytes:
    return bytes(stream.read())


def _environment() -> dict[str, str]:
    """The child finds this package where this process has it, whatever folder it starts in."""
    package = str(Path(__file__).resolve().parents[3])
    path = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    return os.environ | {"PYTHONPATH": path, home.ROOT: str(home.root())}


def _watched(
    child: subprocess.Popen[bytes], look: Callable[[], None], stopped: threading.Event | None, times: float
) -> str | None:
    """Waits for the child. Returns why it has to be ended, None when it ended by itself. Raises Stopped."""
    most, end = SECONDS * times, time.monotonic() + PATIENCE * times
    while True:
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(LOOK_EVERY)
            return None
        if stopped is not None and stopped.is_set():
            raise Stopped
        look()
        taken, resident = usage(child.pid)
        if taken > most or time.monotonic() > end:
            return f"not compiled within {most:.0f} s"
        if resident > BYTES:
            return f"the compiler took more than {BYTES / 2**30:.1f} GiB"


def usage(pid: int) -> tuple[float, int]:
    """Seconds of processor time and bytes of memory that a process has taken; nothing when it is gone."""
    try:
        process = psutil.Process(pid)
        times = process.cpu_times()
        return times.user + times.system, int(process.memory_info().rss)
    except psutil.Error:
        return 0.0, 0


def _end(child: subprocess.Popen[bytes]) -> None:
    """Ends a child and whatever it started, its linker say, and waits until they are gone."""
    family = []
    with contextlib.suppress(psutil.Error):
        family = psutil.Process(child.pid).children(recursive=True)
    system.end_apart(child)
    for one in family:
        with contextlib.suppress(psutil.Error):
            one.kill()
    psutil.wait_procs(family, timeout=5)
    child.wait()


def machine_code(program: Any) -> None:
    """Has PoCL compile all kernels of a program, each also in a general form that nobody needs."""
    import pyopencl as cl

    program.get_info(cl.program_info.BINARIES)


# --- what is kept ---------------------------------------------------------------------------------------------------


def expected() -> int:
    """About how many kernels there are to compile, for a line that says how far it is."""
    names = [*program_text.SOURCES, *program_text.OVER_SOURCES, "patchwork.cl", "patchwork.cl"]
    return sum(len(re.findall(r"\bkernel\s", program_text.files()[name])) for name in names)


def key() -> str:
    """Returns all that compiled kernels depend on beside the level: sources, constants, versions, kind of kernels."""
    parts = [program_text.sources(), "".join(program_text.files().values()), os.environ.get("ESKER_KERNELS", "")]
    for package in ("pyopencl", "pocl-binary-distribution"):
        with contextlib.suppress(PackageNotFoundError):
            parts.append(version(package))
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def _record(one: cpu.Level, kind: str) -> Path:
    return home.folder(one) / f"{kind}-{key()}.json"


def _compiled(one: cpu.Level) -> list[Path]:
    return list(home.folder(one).glob("*/*/*/*/*.so"))


def _kept(one: cpu.Level) -> bool:
    """Returns whether everything for this level was compiled and is still there."""
    record = _read(_record(one, "ready"))
    place = home.folder(one)
    return record is not None and all((place / name).is_file() for name in record["files"])


def _failure(one: cpu.Level) -> str | None:
    """Why this level failed, if that was not long ago."""
    return _recent(_record(one, "failed"))


def _drivers() -> Path:
    return home.root() / "drivers"


def _recent(path: Path) -> str | None:
    record = _read(path)
    return str(record["why"]) if record and 0 <= time.time() - record["at"] < AGAIN_AFTER else None


def _read(path: Path) -> dict[str, Any] | None:
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return None


def _write(path: Path, record: dict[str, Any]) -> None:
    """Keeps a record; without it the next start does the same again."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{os.getpid()}")
        part.write_text(json.dumps(record), encoding="utf-8")
        os.replace(part, path)
