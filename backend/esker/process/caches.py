"""Where compiled code is kept when whoever runs Esker has no folder for it, as the users of services often have none.

It is settled before numba and pyopencl are loaded. Both look once, and pyopencl's first kernel fails where its folder
for caches cannot be made.
"""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Final

log = logging.getLogger(__name__)

CACHES: Final = "XDG_CACHE_HOME"
LOOPS: Final = "NUMBA_CACHE_DIR"
"""Names numba's folder, which goes before the folders beside the modules."""
NO_PYOPENCL: Final = "PYOPENCL_NO_CACHE"
PACKAGE: Final = Path(__file__).resolve().parents[1]


def users() -> Path:
    """Returns the user's folder for caches."""
    return Path(os.environ.get(CACHES) or os.path.expanduser("~/.cache"))


def writable(folder: Path) -> bool:
    """Returns whether files can be made in the folder; makes it when it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def keep_in(data: Path) -> None:
    """Has compiled code kept in ``data/.cache`` where the user's folder for caches cannot be written.

    Loops lie beside the program, unless somebody else installed it; then they lie with the rest.
    """
    if not writable(users()):
        log.info("%s cannot be written: what is compiled is kept in %s", users(), data / ".cache")
        os.environ[CACHES] = str((data / ".cache").resolve())
    if not writable(PACKAGE / "process" / "__pycache__"):
        os.environ.setdefault(LOOPS, str(users() / "esker" / "loops"))


def spare_pyopencl() -> None:
    """Takes pyopencl's own cache away where it cannot be written."""
    if not writable(users() / "pytools"):
        os.environ.setdefault(NO_PYOPENCL, "true")
