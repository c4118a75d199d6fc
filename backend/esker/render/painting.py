"""What the drawing process of ``previews.py`` does: one picture after the other with the same device and context."""

from __future__ import annotations

import io
from functools import cache

from PIL import Image

from esker.contract import Document
from esker.render.camera import home
from esker.render.frame import Scene
from esker.render.reference import Reference
from esker.render.studio import prepare
from esker.solve.solver import Solver


@cache
def _reference() -> Reference:
    return Reference("rich")


@cache
def _solver(device: str | None, level: int) -> Solver:
    return Solver(device, max_level=level, threads=1)


def picture(document: Document, device: str | None, size: tuple[int, int], level: int, quality: int) -> bytes:
    """The whole terrain in its own look and light, as JPEG. Raises device.NoGraphics, and what solves raise."""
    reference = _reference()
    stage = prepare(document, _solver(device, level), level=level, refined=level)
    scene = Scene(document.settings, home(document.settings.size_m, *size))
    made = reference.draw(stage.surface, scene, stage.channels)
    out = io.BytesIO()
    Image.fromarray(made.pixels).save(out, "JPEG", quality=quality, optimize=True)
    return out.getvalue()
