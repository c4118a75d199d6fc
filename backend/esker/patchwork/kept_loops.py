"""Where the compiled loops of this room lie, and a folder of them for a process that may not write there.

Whoever can write where numba keeps loops runs code in every process that loads them. So a process that reads what
strangers sent has a folder of its own, in which links lead to what is kept: it loads that and writes beside it. This
module loads no numba, since the folder must be chosen before.
"""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Final

from esker.process.caches import LOOPS

_PACKAGE: Final = Path(__file__).resolve().parents[1]


@lru_cache(1)
def digest() -> str:
    """Returns what names the loops: a digest of everything from which they are compiled."""
    files = [_PACKAGE / "compiled.py", *sorted(Path(__file__).parent.rglob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:16]


def beside() -> Path:
    """Returns the folder of loops within this package."""
    return Path(__file__).parent / "__pycache__" / f"compiled-{digest()}"


def folder() -> Path:
    """Returns where processes that may write keep loops."""
    named = os.environ.get(LOOPS)
    return Path(named) if named else beside()


def use_own(own: Path) -> None:
    """From now on this process, which has not loaded numba, keeps loops in ``own``, and finds there what was kept."""
    kept = folder()
    with suppress(OSError):
        for path in kept.rglob("*.nb[ic]"):
            link = own / path.relative_to(kept)
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(path)
    with suppress(OSError):
        own.mkdir(parents=True, exist_ok=True)
    os.environ[LOOPS] = str(own)
