"""The version of this Esker; the same as in pyproject.toml (a test compares)."""

from typing import Final

VERSION: Final = "0.1.0"
