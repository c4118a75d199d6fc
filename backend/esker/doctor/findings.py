"""Looks at the machine: Python and packages, files, disk, memory, graphics. What solves is looked at in ``solving``."""

from __future__ import annotations

import os
import platform
import re
import shutil
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, Final, Literal

import psutil

from esker import resources
from esker.process import system
from esker.version import VERSION

State = Literal["good", "poor", "broken"]
"""Poor: the server runs, with less than it could have. Broken: it does not run, or what it makes is wrong."""
GIB: Final = 1 << 30
DISK_POOR, DISK_BROKEN = 2 * GIB, GIB // 8
MEMORY_POOR, MEMORY_BROKEN = GIB, GIB // 4
PYTHON: Final = (3, 11)
BROWSERS: Final = (
    "WebGPU: Chrome and Edge from 113 on, Safari from 26 on, Firefox from 141 on (Windows) and 145 on (macOS); pages "
    "must come by https, or from this computer itself. Other browsers get the map."
)


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at. ``text`` is a sentence for people, ``facts`` are for programs."""

    name: str
    state: State
    text: str
    facts: dict[str, Any] = field(default_factory=dict)


def look(data: Path) -> Iterator[Finding]:
    """Everything but what solves. ``data``: the folder that a server would keep its terrains in."""
    yield python()
    yield packages()
    yield files()
    yield processor()
    yield memory()
    yield disk(data)
    yield pictures()
    yield Finding("browser", "good", BROWSERS)


def python() -> Finding:
    """The interpreter and the system."""
    facts = {
        "esker": VERSION,
        "python": platform.python_version(),
        "system": platform.platform(),
        "wheel": not checkout(),
    }
    state: State = "good" if sys.version_info >= PYTHON else "broken"
    where = "an installed wheel" if facts["wheel"] else "a checkout"
    text = f"Esker {VERSION} from {where}, Python {facts['python']} on {facts['system']}."
    return Finding("python", state, text, facts)


def checkout() -> bool:
    """Returns whether this is a checkout and no installed wheel."""
    return resources.CHECKOUT is not None


def wanted() -> list[str]:
    """Names of the packages that an installation needs on this system."""
    found = []
    try:
        lines = metadata.requires("esker") or []
    except metadata.PackageNotFoundError:  # run from sources that were never installed
        lines = _named_in_sources()
    for line in lines:
        name, _, marker = line.partition(";")
        if "extra ==" in marker or ("win32" in marker and sys.platform == "win32"):
            continue
        if "linux" in marker and (sys.platform != "linux" or platform.machine() != "x86_64"):
            continue
        found.append(re.split(r"[\s\[<>=!~(]", name.strip())[0])
    return found


def _named_in_sources() -> list[str]:
    """The requirements that ``pyproject.toml`` of a checkout names."""
    if resources.CHECKOUT is None:
        return []
    project = tomllib.loads((resources.CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))
    return list(project["project"]["dependencies"])


def packages() -> Finding:
    """Versions of the packages."""
    versions: dict[str, str | None] = {}
    for name in wanted():
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = None
    missing = sorted(name for name, version in versions.items() if version is None)
    if missing:
        text = f"Packages are missing: {', '.join(missing)}. Install Esker again, or run `make run`."
        return Finding("packages", "broken", text, versions)
    return Finding(
        "packages", "good", ", ".join(f"{name} {version}" for name, version in versions.items()) + ".", versions
    )


def files() -> Finding:
    """The built page and the shaders."""
    there = {"page": (resources.PAGE / "index.html").is_file(), "shaders": (resources.SHADERS / "opencl").is_dir()}
    if all(there.values()):
        return Finding("files", "good", f"The built page and the shaders are in {resources.PAGE.parent}.", dict(there))
    if there["shaders"] and checkout():
        return Finding("files", "poor", "The page is not built yet: `make run` builds it.", dict(there))
    return Finding("files", "broken", "Files of this installation are missing. Install it again.", dict(there))


def processor() -> Finding:
    """The processor, and what OpenCL kernels are compiled for on it where PoCL compiles them."""
    model = system.processor_name()
    facts: dict[str, Any] = {"model": model, "cores": os.cpu_count(), "usable": system.processors(), "level": level()}
    compiled = f"; PoCL compiles for {facts['level']}" if facts["level"] else ""
    return Finding("processor", "good", f"{model}, {facts['usable']} of {facts['cores']} cores{compiled}.", facts)


def level() -> str | None:
    """The CPU that PoCL is told to compile for, None where there is none of its own choice."""
    from esker.solve.opencl import prepare

    prepare.settle()
    one = prepare.level()
    return None if one is None else one.name


def memory() -> Finding:
    """The machine's memory, and what is free of it."""
    there = psutil.virtual_memory()
    facts = {"total_gib": round(there.total / GIB, 2), "available_gib": round(there.available / GIB, 2)}
    text = f"{facts['available_gib']} of {facts['total_gib']} GiB are free."
    if there.available < MEMORY_POOR:
        text += " A server with a few terrains wants a gigabyte."
    return Finding("memory", _state(there.available, MEMORY_POOR, MEMORY_BROKEN), text, facts)


def disk(data: Path) -> Finding:
    """The folder of the terrains: whether it can be written, and how much is free there."""
    folder = data.absolute()
    while not folder.exists():  # the server makes the folder, so its nearest parent is asked
        folder = folder.parent
    facts: dict[str, Any] = {"folder": str(data.absolute()), "writable": os.access(folder, os.W_OK)}
    if not facts["writable"]:
        return Finding(
            "disk", "broken", f"The folder {folder} cannot be written. Choose another one with --data.", facts
        )
    free = shutil.disk_usage(folder).free
    facts["free_gib"] = round(free / GIB, 2)
    text = f"{facts['free_gib']} GiB are free for {data.absolute()}."
    return Finding("disk", _state(free, DISK_POOR, DISK_BROKEN), text, facts)


def _state(there: int, poor: int, broken: int) -> State:
    return "broken" if there < broken else "poor" if there < poor else "good"


def pictures() -> Finding:
    """OpenGL without a window, which draws the previews of links."""
    return guarded("pictures", _pictures)


def _pictures() -> Finding:
    from esker.render.device import NoGraphics, open_context

    try:
        context = open_context()
    except NoGraphics as error:
        return Finding("pictures", "poor", f"{error} Links have no preview then; all else works.")
    info = {"renderer": str(context.info["GL_RENDERER"]), "version": str(context.info["GL_VERSION"])}
    context.release()
    return Finding(
        "pictures", "good", f"Previews of links are drawn by {info['renderer']}, OpenGL {info['version']}.", info
    )


def guarded(name: str, check: Callable[[], Finding], state: State = "poor") -> Finding:
    """Returns what a check finds. A check that raises becomes a finding that it failed, so that the others go on."""
    try:
        return check()
    except Exception as error:
        return Finding(name, state, f"This could not be looked at: {type(error).__name__}: {error}")
