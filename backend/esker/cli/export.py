"""``esker export``: a terrain as a file for game engines, modellers and GIS (docs/exporting.md)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from esker.api.terrain import Terrain
from esker.cli.solve import metres
from esker.contract import DEFAULT_LEVEL, EXPORT_LEVELS, MAX_LEVEL, MAX_SYNTHESIS_LEVEL
from esker.exporting.formats import MASKS, ONLY_MASKS, SUFFIXES, format_of
from esker.exporting.ground import Extent
from esker.render.pictures.studio import open_terrain
from esker.solve.solver import Solver


def main(argv: list[str]) -> int:
    """Run the command; 0, or 1 with one sentence on standard error. Bad arguments exit with 2, like argparse."""
    parser = _parser()
    options = parser.parse_args(argv)
    window = None if options.window is None else tuple(options.window)
    try:
        extent = Extent.of(options.level, options.samples, window)
        if format_of(options.output) != MASKS and options.weights:
            raise ValueError(ONLY_MASKS)
        if not options.output.absolute().parent.is_dir():
            raise ValueError(f"There is no folder {options.output.absolute().parent}.")
    except ValueError as error:
        parser.error(str(error))
    try:
        opened = open_terrain(options.terrain)
        solver = Solver(options.device, max_level=min(extent.level, MAX_LEVEL))
        terrain = Terrain.from_document(opened.document, opened.grids, solver)
        terrain.export(
            options.output, level=options.level, samples=options.samples, window=window, detail=options.detail,
            weights=options.weights, progress=None if options.quiet else _show,
        )  # fmt: skip
    except (OSError, ValueError, RuntimeError, MemoryError) as error:
        print(f"{_clear()}esker export: {str(error) or type(error).__name__}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"{_clear()}esker export: stopped, nothing was written.", file=sys.stderr)
        return 130
    if not options.quiet:
        size = options.output.stat().st_size
        print(f"{_clear()}{options.output}: {size:,} bytes", file=sys.stderr)
    return 0


def _clear() -> str:
    return "\r\x1b[K" if sys.stderr.isatty() else ""


def _show(share: float) -> None:
    if sys.stderr.isatty():
        print(f"\r\x1b[Kexporting: {100 * share:3.0f} %", end="", file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(
        prog="esker export", description="A terrain as a file for other programs: the same files as the page's."
    )
    p.add_argument("terrain", help="an .esker file, a document as .json, a link, or a starting terrain's name")
    p.add_argument("-o", "--output", type=Path, required=True,
                   help=f"what the suffix says: {', '.join(SUFFIXES)} (.zip: masks)")  # fmt: skip
    p.add_argument("--level", type=int, choices=range(MAX_SYNTHESIS_LEVEL + 1), metavar="N",
                   help=f"64 * 2^N + 1 samples a side, 0..{MAX_LEVEL}, with --window further (default {DEFAULT_LEVEL})"
                   )  # fmt: skip
    p.add_argument("--samples", type=int, metavar="N",
                   help=f"samples a side instead of a level: {', '.join(EXPORT_LEVELS)}")  # fmt: skip
    p.add_argument("--window", type=metres, nargs=4, metavar=("X0", "Y0", "X1", "Y1"),
                   help="only the samples in this rectangle of world metres")  # fmt: skip
    p.add_argument("--no-detail", dest="detail", action="store_false",
                   help="the solved ground alone, without the detail that the page shows")  # fmt: skip
    p.add_argument("--weights", action="store_true",
                   help="of masks (.zip): they sum to one at every sample, with one more for bare ground")  # fmt: skip
    p.add_argument("--device", help="part of an OpenCL device's name, or 'numpy'")
    p.add_argument("-q", "--quiet", action="store_true", help="nothing on standard error but errors")
    return p
