"""How much memory this process may take: the machine's, or less where a container says so (decision 31)."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Final

from esker.process import system

ROOT: Final = Path("/sys/fs/cgroup")
PROCESS: Final = Path("/proc/self/cgroup")
UNLIMITED: Final = 1 << 60
"""The first version of cgroups writes a number about as large for no limit."""


def limit_bytes(root: Path = ROOT, process: Path = PROCESS) -> int | None:
    """The least limit of the control groups that this process is in, of either version; None without one.

    ``root``: where they are mounted; ``process``: what names the groups of this process.
    """
    found: list[int] = []
    for folder, names in _groups(root, process):
        for name in names:
            with suppress(OSError, ValueError):  # the file is not there, or says "max"
                found.append(int((folder / name).read_text()))
    least = min(found, default=UNLIMITED)
    return None if least >= UNLIMITED else least


def _groups(root: Path, process: Path) -> list[tuple[Path, tuple[str, ...]]]:
    """Folders of the groups and of those above them, with the files that hold limits."""
    groups: list[tuple[Path, tuple[str, ...]]] = []
    names: tuple[str, ...]
    lines: list[str] = []
    with suppress(OSError):
        lines = process.read_text().splitlines()
    for line in lines:
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if controllers == "":
            place, names = root, ("memory.max", "memory.high")
        elif "memory" in controllers.split(","):
            place, names = root / "memory", ("memory.limit_in_bytes",)
        else:
            continue
        group = place / path.lstrip("/")
        groups += [(folder, names) for folder in (group, *group.parents) if folder == place or place in folder.parents]
    return groups


@lru_cache(maxsize=1)
def available_bytes() -> int:
    """Returns what this process may take: the machine's memory, or the limit of its control group."""
    limit = limit_bytes()
    return system.memory_bytes() if limit is None else min(limit, system.memory_bytes())
