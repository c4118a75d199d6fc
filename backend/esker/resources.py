"""Where the product's own files lie: shaders, the built page, scenes. In a checkout they lie beside the package, in an
installed wheel inside of it (``esker/files``, put there by ``setup.py``). Nobody else knows."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

_PACKAGE: Final = Path(__file__).resolve().parent
_ABOVE: Final = _PACKAGE.parents[1]
_FILES: Final = _PACKAGE / "files"
CHECKOUT: Final = _ABOVE if (_ABOVE / "pyproject.toml").is_file() and (_ABOVE / "shaders").is_dir() else None
"""The repository that this package runs from; None when it was installed from a wheel."""
SHADERS: Final = _FILES / "shaders" if CHECKOUT is None else CHECKOUT / "shaders"
PAGE: Final = _FILES / "page" if CHECKOUT is None else CHECKOUT / "frontend" / "dist"
SCENES: Final = _FILES / "scenes" if CHECKOUT is None else CHECKOUT / "bench" / "scenes"


def sources() -> Path:
    """The repository, for what only works in one; in a wheel a folder that is not there."""
    return CHECKOUT or _FILES / "sources"


def has_benchmarks() -> bool:
    """Whether the benchmarks are here, which lie in a checkout beside the package; then ``bench`` can be imported."""
    if CHECKOUT is None:
        return False
    if str(CHECKOUT) not in sys.path:
        sys.path.append(str(CHECKOUT))
    return True
