"""The rules of synthesis, one file each, one signature (``Rule``)."""

from __future__ import annotations

from typing import Final

from esker.synthesis.rules.landscape import landscape
from esker.synthesis.rules.plain import plain
from esker.synthesis.rules.smooth import smooth
from esker.synthesis.site import Rule

RULES: Final[dict[str, Rule]] = {"landscape": landscape, "smooth": smooth, "plain": plain}
"""By the names that ``TerrainSettings.rule`` has."""
