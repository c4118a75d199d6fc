"""``esker solve``: heights of a terrain file, without a server."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from esker import grid
from esker.contract import DEFAULT_LEVEL, MAX_LEVEL, Document
from esker.document import archive
from esker.solve.device import NoDeviceError
from esker.solve.solver import LevelResult, Solver


def main(argv: list[str]) -> int:
    """Run the command; 0, or 1 with one sentence on standard error. Bad arguments exit with 2, like argparse."""
    options = _parser().parse_args(argv)
    try:
        document = _read(options.terrain)
        solver = Solver(options.device, max_level=options.level)
        if options.output.suffix != ".npy":
            raise ValueError(f"Heights are written as .npy, not as '{options.output.suffix or options.output.name}'.")
        heights = _solve(solver, document, options.level, quiet=options.quiet)
        with options.output.open("wb") as file:
            np.save(file, heights)
    except (OSError, ValueError, NoDeviceError) as error:
        print(f"esker solve: {error}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="esker solve", description="Settled heights of a terrain, as a NumPy file.")
    p.add_argument("terrain", type=Path, help="an .esker file, or a document as .json")
    p.add_argument("-o", "--output", type=Path, required=True, help="heights.npy: float32, metres, row 0 south")
    samples = f"finest level, 0..{MAX_LEVEL}; 64 * 2^N + 1 samples a side (default {DEFAULT_LEVEL})"
    p.add_argument("--level", type=int, choices=range(MAX_LEVEL + 1), default=DEFAULT_LEVEL, metavar="N", help=samples)
    p.add_argument("--device", help="part of an OpenCL device's name, or 'numpy'")
    p.add_argument("-q", "--quiet", action="store_true", help="no progress on standard error")
    return p


def _read(path: Path) -> Document:
    """A document from an archive or from JSON. Raises OSError, ValueError."""
    data = path.read_bytes()
    if data[:2] == b"PK":
        return archive.loads(data)
    return archive.document_from_json(data)


def _solve(solver: Solver, document: Document, level: int, *, quiet: bool) -> np.ndarray:
    start = time.perf_counter()

    def say(text: str) -> None:
        if not quiet:
            print(text, file=sys.stderr)

    def progress(result: LevelResult) -> None:
        if result.settled == (result.level == level):
            what = "settled" if result.settled else "preview"
            elapsed = 1e3 * (time.perf_counter() - start)
            say(f"  level {result.level} ({grid.samples(result.level)} samples a side) {what} after {elapsed:.0f} ms")

    say(f"{len(document.strokes)} strokes on {solver.device_name}")
    heights = solver.solve(document.strokes, document.settings, level, on_level=progress)[level]
    say(f"heights from {heights.min():.2f} to {heights.max():.2f} m")
    return heights
