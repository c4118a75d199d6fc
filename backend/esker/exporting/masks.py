"""Covers of the ground as pictures of 8 bits, for splat maps, in one archive."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any, Final

from PIL import Image

from esker.exporting.ground import Ground
from esker.exporting.weights import BARE

MEANING: Final = "8 bits, row 0 north; 255: all of the ground here has it"
SUMMED: Final = "; at every sample they sum to 255"


def write_masks(path: Path, ground: Ground) -> None:
    """A .zip with NAME.png for each mask, row 0 north, and masks.json. Raises ValueError without masks, OSError."""
    if not ground.masks:
        raise ValueError("masks come with the detail: there is none here")
    meaning = MEANING + (SUMMED if BARE in ground.masks else "")
    facts: dict[str, Any] = ground.facts() | {"encoding": meaning, "masks": [f"{name}.png" for name in ground.masks]}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, mask in ground.masks.items():
            out = io.BytesIO()
            Image.fromarray(mask[::-1]).save(out, format="PNG", compress_level=6)
            archive.writestr(f"{name}.png", out.getvalue())
        archive.writestr("masks.json", json.dumps(facts, indent=2) + "\n")
