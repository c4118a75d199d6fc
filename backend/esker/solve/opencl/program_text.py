"""The text that the solver's programs are compiled from: constants of the contract before the kernels' files."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from esker.contract import CHEBYSHEV_SWEEPS, SATURATION
from esker.resources import SHADERS
from esker.solve import reference
from esker.solve.constraints import tables
from esker.solve.opencl import gpu_program, wave
from esker.solve.refine import pocket

SOURCES = ("rows.cl", "nearest.cl", "section.cl", "raster.cl", "setup.cl", "visit.cl", "refine.cl", "pockets.cl")
OVER_SOURCES = ("rows.cl", "nearest.cl", "section.cl", "raster.cl", "over_base.cl")
OVER_BASE = "#define OVER_BASE\n"
INLINE = "#undef inline\n#define inline static inline\n"
"""C looks for inline functions elsewhere when a compiler does not inline them, and some drivers then fail to link. PoCL
has a macro of its own for that."""


def shader_folder() -> Path:
    """Where the kernels lie."""
    return SHADERS / "opencl"


@lru_cache(maxsize=1)
def files() -> dict[str, str]:
    """The kernels' files by name, with the folder that they lie in."""
    found = sorted(shader_folder().rglob("*.cl"))
    return {path.relative_to(shader_folder()).as_posix(): path.read_text(encoding="utf-8") for path in found}


def sources() -> str:
    """Returns the source of the row-wise programs, constants included."""
    return source(None) + over_source(None)


def over_source(plan: gpu_program.Plan | None) -> str:
    """The rasteriser as it is over a base, and what the ground owes to it."""
    if plan is not None:
        return INLINE + OVER_BASE + defines(gpu_program.defines(plan)) + gpu_program.over_source(files())
    return INLINE + OVER_BASE + defines({}) + "\n".join(files()[name] for name in OVER_SOURCES)


def source(plan: gpu_program.Plan | None) -> str:
    """The solver of ground without a base. ``plan``: the tiles of a GPU's kernels, None for row-wise ones."""
    if plan is not None:
        return INLINE + defines(gpu_program.defines(plan)) + gpu_program.source(files())
    return INLINE + defines({}) + "\n".join(files()[name] for name in SOURCES)


def _literal(value: float | int) -> str:
    return f"{value!r}f" if isinstance(value, float) else str(value)


def defines(more: dict[str, float | int]) -> str:
    """Constants as lines of ``#define``, with ``more`` of them."""
    values: dict[str, float | int] = {
        **tables.defines(),
        **wave.defines(),
        **pocket.defines(),
        "SATURATION": SATURATION,
        "CHEBYSHEV_SWEEPS": CHEBYSHEV_SWEEPS,
        "BOTTOM_LEVELS": reference.BOTTOM_LEVELS,
        "COARSEST_SWEEPS": reference.COARSEST_SWEEPS,
        "COARSEST_RELAXATION": reference.COARSEST_RELAXATION,
        "LEAST_HOLD": reference.LEAST_HOLD,
        **more,
    }
    return "".join(f"#define {name} {_literal(value)}\n" for name, value in values.items())
