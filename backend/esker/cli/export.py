"""``esker export``: a terrain as a file for game engines, modellers and GIS (docs/exporting.md)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from esker.api.terrain import Terrain
from esker.cli.solve import metres
from esker.contract import DEFAULT_LEVEL, EXPORT_LEVELS, MAX_LEVEL, MAX_SYNTHESIS_LEVEL, ModelOptions, PaperOptions
from esker.contract.values import Wire
from esker.exporting.formats import MAPS, MASKS, ONLY_MAPS, ONLY_MASKS, ONLY_SOLIDS, SOLID, SUFFIXES, format_of
from esker.exporting.ground import Extent
from esker.render.pictures.studio import open_terrain
from esker.solve.solver import Solver

Options = TypeVar("Options", bound=Wire)


def main(argv: list[str]) -> int:
    """Run the command; 0, or 1 with one sentence on standard error. Bad arguments exit with 2, like argparse."""
    parser = _parser()
    options = parser.parse_args(argv)
    window = None if options.window is None else tuple(options.window)
    try:
        paper = _options(PaperOptions, options, ("size", "scale", "interval_m"), MAPS, ONLY_MAPS)
        model = _options(ModelOptions, options, ("width_mm", "base_mm", "exaggeration"), (SOLID,), ONLY_SOLIDS)
        Extent.of(options.level, options.samples, window)  # refused before anything is opened
        if format_of(options.output) != MASKS and options.weights:
            raise ValueError(ONLY_MASKS)
        if not options.output.absolute().parent.is_dir():
            raise ValueError(f"There is no folder {options.output.absolute().parent}.")
    except ValueError as error:
        parser.error(str(error))
    try:
        opened = open_terrain(options.terrain)
        solver = Solver(options.device)
        terrain = Terrain.from_document(opened.document, opened.grids, solver)
        terrain.export(
            options.output, level=options.level, samples=options.samples, window=window, detail=options.detail,
            weights=options.weights, paper=paper, model=model, progress=None if options.quiet else _show,
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


def _options(
    kind: type[Options], options: argparse.Namespace, names: tuple[str, ...], formats: tuple[str, ...], otherwise: str
) -> Options | None:
    """Returns the options of a map or a solid that were given; None where none were. Raises ValueError."""
    said = {name: value for name in names if (value := getattr(options, name)) is not None}
    if not said:
        return None
    if format_of(options.output) not in formats:
        raise ValueError(otherwise)
    try:
        return kind(**said)
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"--{str(first['loc'][0]).split('_')[0]}: {first['msg']}") from None


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
    p.add_argument("--paper", dest="size", choices=("a4", "a3"), help="of a contour map (.pdf, .svg); default a4")
    p.add_argument("--scale", type=int, metavar="N", help="of a contour map: 1 : N; default the largest that fits")
    p.add_argument("--interval", dest="interval_m", type=metres, metavar="M",
                   help="metres between contours; default what suits the relief")  # fmt: skip
    p.add_argument("--width", dest="width_mm", type=metres, metavar="MM",
                   help="of a solid (.stl): its longer side in millimetres, default 150")  # fmt: skip
    p.add_argument("--base", dest="base_mm", type=metres, metavar="MM",
                   help="of a solid: what lies under its lowest point, default 3")  # fmt: skip
    p.add_argument("--exaggeration", type=metres, metavar="K", help="of a solid: of its heights, default 1")
    p.add_argument("--device", help="part of an OpenCL device's name, or 'numpy'")
    p.add_argument("-q", "--quiet", action="store_true", help="nothing on standard error but errors")
    return p
