"""``esker flow``: the rivers of a terrain as GeoJSON (docs/water.md)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from esker.api.terrain import Terrain
from esker.contract import DEFAULT_LEVEL, DEFAULT_RIVERS, MAX_LEVEL, MAX_RIVERS, MAX_WETNESS, MIN_WETNESS
from esker.exporting.rivers import write_rivers
from esker.render.pictures.studio import open_terrain
from esker.solve.solver import Solver

SUFFIXES = (".geojson", ".json")


def main(argv: list[str]) -> int:
    """Run the command; 0, or 1 with one sentence on standard error. Bad arguments exit with 2, like argparse."""
    parser = _parser()
    options = parser.parse_args(argv)
    output: Path = options.output
    if output.suffix not in SUFFIXES:
        parser.error(f"rivers are written as {' or '.join(SUFFIXES)}, not as '{output.suffix or output.name}'")
    if not output.absolute().parent.is_dir():
        parser.error(f"There is no folder {output.absolute().parent}.")
    try:
        opened = open_terrain(options.terrain)
        solver = Solver(options.device, max_level=max(options.level, DEFAULT_LEVEL))
        terrain = Terrain.from_document(opened.document, opened.grids, solver)
        rivers = terrain.rivers(options.level, options.many, options.wetness)
        write_rivers(output, rivers, terrain.settings)
    except (OSError, ValueError, RuntimeError, MemoryError) as error:
        print(f"esker flow: {str(error) or type(error).__name__}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nesker flow: stopped, nothing was written.", file=sys.stderr)
        return 130
    if not options.quiet:
        named = "1 river" if len(rivers) == 1 else f"{len(rivers)} rivers"
        print(f"{output}: {named}" if rivers else f"{output}: no rivers, as no water gathers here", file=sys.stderr)
    return 0


def _parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="esker flow", description="The rivers of a terrain, as GeoJSON.")
    p.add_argument("terrain", help="an .esker file, a document as .json, a link, or a starting terrain's name")
    p.add_argument("-o", "--output", type=Path, required=True,
                   help="rivers.geojson: lines in longitude and latitude where the terrain has a place on Earth, "
                   "else in metres")  # fmt: skip
    p.add_argument("--level", type=int, choices=range(MAX_LEVEL + 1), default=DEFAULT_LEVEL, metavar="N",
                   help=f"whose samples the water runs over, 0..{MAX_LEVEL} (default {DEFAULT_LEVEL})")  # fmt: skip
    p.add_argument("--many", type=float, metavar="X",
                   help=f"how many rivers, 0..{MAX_RIVERS:g} (default: what the terrain says, or {DEFAULT_RIVERS:g})"
                   )  # fmt: skip
    p.add_argument("--wetness", type=float, metavar="X",
                   help=f"how many times as much water, {MIN_WETNESS:g}..{MAX_WETNESS:g} "
                   "(default: what the terrain says)")  # fmt: skip
    p.add_argument("--device", help="part of an OpenCL device's name, or 'numpy'")
    p.add_argument("-q", "--quiet", action="store_true", help="nothing on standard error but errors")
    return p
