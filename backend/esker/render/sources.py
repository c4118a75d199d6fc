"""The shader modules: the page's files joined in the page's order (frontend/src/gpu/shaders.ts)."""

from __future__ import annotations

from functools import cache
from typing import Final

from esker.resources import SHADERS
from esker.wgsl.parse import parse
from esker.wgsl.tree import Constant, Literal, Module

_COMMON: Final = ("view", "tiles/tile", "sky/sky", "material/noise", "tonemap")
_GROUND: Final = tuple(f"material/{name}" for name in ("site", "rock", "growth", "snow", "wet"))
_LINES: Final = "overlay/lines", "overlay/overlay"


def terrain(look: str, detail: str) -> Module:
    """The ground in one look, for one of the two amounts of detail."""
    near = tuple(f"material/{name}" for name in (f"stones_{detail}", f"look_{look}", "shade"))
    over = "water/rivers", *_LINES, "overlay/difference", "ground/terrain"
    return _module(*_COMMON, _detail(detail), "ground/patch", "water/lakes", *_GROUND, *near, *over)


def wall(detail: str) -> Module:
    """The sides of the block."""
    return _module(*_COMMON, _detail(detail), "ground/patch", "ground/wall")


def background(detail: str) -> Module:
    """Sea, sky and what lies around."""
    return _module(*_COMMON, _detail(detail), "ground/patch", *_LINES, "water/lakes", "water/water", "sky/background")


def _detail(detail: str) -> str:
    return f"material/detail_{detail}"


def scatter() -> Module:
    """Where trees, rocks and tufts of a picture stand."""
    stands = "instances/stands", "instances/scatter"
    return _module(*_COMMON, _detail("plain"), "ground/patch", "water/lakes", "tiles/pages", *stands)


def instances() -> Module:
    """Trees, rocks and tufts."""
    return _module(*_COMMON, _detail("plain"), *_LINES, "instances/instances")


def normals() -> Module:
    """Gradients of tiles."""
    return _module("tiles/tile", "tiles/normals")


def sun() -> Module:
    """Sun and sky visibility of tiles."""
    return _module("tiles/tile", "tiles/pages", "tiles/sun")


def sky() -> Module:
    """Tables of the sky."""
    return _module("sky/atmosphere", "sky/tables", contract=False)


def number(module: Module, name: str) -> int:
    """A whole constant of a module. Raises KeyError where it has none of this name."""
    found = module.declarations.get(name)
    if not isinstance(found, Constant) or not isinstance(found.value, Literal):
        raise KeyError(name)
    return int(found.value.text, 0)


@cache
def _module(*names: str, contract: bool = True) -> Module:
    texts = [(SHADERS / "wgsl" / f"{name}.wgsl").read_text(encoding="utf-8") for name in names]
    if contract:
        texts.insert(0, (SHADERS / "generated" / "contract.wgsl").read_text(encoding="utf-8"))
    return parse("\n".join(texts))
