"""``esker solve``: heights of a terrain file, without a server."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import DEFAULT_LEVEL, MAX_LEVEL, MAX_REFINED_LEVEL, MAX_SYNTHESIS_LEVEL, Document
from esker.document import archive
from esker.document.layers import span_m
from esker.events import Done, Pause, Preview, Settled, SolveEvent
from esker.exporting import heightmap
from esker.solve.base import Base
from esker.solve.detail import detailed, settle
from esker.solve.solver import Solver

EXPECTED_CYCLES = 10
"""Cycles of the finest level that most scenes take from nothing to rest, both steps together: for the estimate only."""
PLAIN_SECONDS = 2.0
"""Where nobody watches, a line as often as this while a long level is under way."""
BAR = 24
MOST_SAMPLES = 1 << 29
"""Samples of a window: 2 GiB of heights. With detail a tenth as many, since its attributes are ten times as much."""


BaseOf = Callable[[Document, bytes], Base | None]
"""From a document and the bytes of its file to the ground of its elevation layers; raises ValueError."""


def _without_layers(document: Document, _: bytes) -> None:
    if document.layers:
        raise ValueError("This terrain has elevation layers, which need the whole of Esker: run `esker solve`.")


def main(argv: list[str], base_of: BaseOf = _without_layers) -> int:
    """Run the command; 0, or 1 with one sentence on standard error. Bad arguments exit with 2, like argparse."""
    parser = _parser()
    options = parser.parse_args(argv)
    with_detail = options.detail or options.attributes is not None
    most = MAX_SYNTHESIS_LEVEL if with_detail else MAX_REFINED_LEVEL
    if options.level > most:
        parser.error(f"levels above {most} need --detail")
    if options.level > MAX_LEVEL and options.window is None:
        parser.error(f"levels above {MAX_LEVEL} are made where they are looked at: say --window X0 Y0 X1 Y1")
    try:
        _writable("Heights", options.output, heightmap.SUFFIXES)
        if options.attributes is not None:
            _writable("Attributes", options.attributes, (".npz",))
        terrain = _read(options.terrain, base_of)
        solver = Solver(
            options.device, max_level=min(options.level, MAX_LEVEL if options.window is None else DEFAULT_LEVEL)
        )
        attributes: Mapping[str, Any] = {}
        if with_detail:
            heights, attributes = _with_detail(solver, terrain, options.level, options.window, quiet=options.quiet)
        elif options.window is None:
            heights = _solve(solver, terrain, options.level, quiet=options.quiet)
        else:
            heights = _window(solver, terrain, options.level, options.window, quiet=options.quiet)
        if said := heightmap.write(options.output, heights):
            print(said)
        if options.attributes is not None:
            np.savez_compressed(options.attributes, **attributes)
    except (OSError, ValueError, RuntimeError, MemoryError) as error:
        print(f"esker solve: {str(error) or type(error).__name__}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nesker solve: stopped, nothing was written.", file=sys.stderr)
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="esker solve", description="Settled heights of a terrain, as a file.")
    p.add_argument("terrain", type=Path, help="an .esker file, or a document as .json")
    p.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help="heights.npy: float32, metres, row 0 south; .png or .r16: a heightmap of 16 bits, row 0 north",
    )
    samples = (
        f"finest level, 0..{MAX_LEVEL}, with --window to {MAX_REFINED_LEVEL}, with --detail as well to cells of a "
        "centimetre; 64 * 2^N + 1 samples a side"
    )
    p.add_argument("--level", type=int, choices=range(MAX_SYNTHESIS_LEVEL + 1), default=DEFAULT_LEVEL, metavar="N",
                   help=f"{samples} (default {DEFAULT_LEVEL})")  # fmt: skip
    p.add_argument("--window", type=metres, nargs=4, metavar=("X0", "Y0", "X1", "Y1"),
                   help="only the samples in this rectangle of world metres, refined from level "
                   f"{DEFAULT_LEVEL} where N is above it")  # fmt: skip
    p.add_argument("--detail", action="store_true", help="heights as the page shows them, with synthesised detail")
    p.add_argument("--attributes", type=Path, metavar="FILE.npz",
                   help="also snow, wetness, plants and the like of every sample; implies --detail")  # fmt: skip
    p.add_argument("--device", help="part of an OpenCL device's name, or 'numpy'")
    p.add_argument("-q", "--quiet", action="store_true", help="no progress on standard error")
    return p


def metres(text: str) -> float:
    """A coordinate of the command line. Raises what argparse makes a sentence of."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{text}' is no place")
    return value


def _writable(what: str, path: Path, suffixes: Sequence[str]) -> None:
    """Refuse a file of another kind, or in a folder that is not there, before anything is computed."""
    if path.suffix not in suffixes:
        raise ValueError(f"{what} are written as {', '.join(suffixes)}, not as '{path.suffix or path.name}'.")
    if not path.absolute().parent.is_dir():
        raise ValueError(f"There is no folder {path.absolute().parent}.")


class _Terrain(NamedTuple):
    """The strokes to be solved, and the ground below them."""

    document: Document
    base: Base | None


def _read(path: Path, base_of: BaseOf) -> _Terrain:
    """A terrain from an archive or from JSON. Raises OSError, ValueError."""
    if not path.is_file():
        raise ValueError(f"There is no file {path}.")
    data = path.read_bytes()
    document = archive.loads(data) if data[:2] == b"PK" else archive.document_from_json(data)
    return _Terrain(document, base_of(document, data))


class Progress:
    """The progress of a solve for a person: one line that changes on a terminal, plain lines elsewhere.

    ``done`` counts in cycles of the finest level: a preview of a level l costs 4^(l - top) of one. How many cycles a
    scene takes is known only when it is at rest, so the bar slows down where more than EXPECTED_CYCLES are needed.
    """

    def __init__(self, stream: TextIO, top: int, clock: Callable[[], float] = time.perf_counter) -> None:
        self.stream, self.top, self.clock = stream, top, clock
        self.live = stream.isatty()
        self.start = self.said = self.solving = clock()
        self.done, self.what = 0.0, "rasterising"

    def show(self) -> None:
        """The present state: at once on a terminal, elsewhere when it is time for a line."""
        now = self.clock()
        if self.live:
            self.stream.write(f"\r\x1b[K{self._line(now)}")
            self.stream.flush()
        elif now - self.said >= PLAIN_SECONDS:
            self._plain(self._line(now).strip(), now)

    def step(self, result: SolveEvent) -> None:
        """One step of ``Solver.steps`` was made."""
        if isinstance(result, Pause):
            self.done += 1
            self.show()
            return
        if not isinstance(result, Preview | Settled) or (result.settled and result.level < self.top):
            return
        now = self.clock()
        if result.level == 0:
            self.solving = now  # what came before was rasterising, which says nothing of the cycles
        self.done += 0 if result.settled else 4.0 ** (result.level - self.top)
        if not self.live:
            state = "settled" if result.settled else "preview"
            self._plain(f"{_name(result.level)} {state} after {now - self.start:.2f} s", now)
        if not result.settled:
            last = result.level == self.top
            self.what = f"{_name(self.top)}: settling" if last else f"{_name(result.level + 1)}: preview"
            self.show()

    def close(self, text: str) -> None:
        """The last line."""
        self.stream.write(f"\r\x1b[K{text}\n" if self.live else f"{text}\n")
        self.stream.flush()

    def share(self) -> float:
        """Estimated share of the work that is done, 0..1, rising and below 1."""
        plain = self.done / EXPECTED_CYCLES
        return plain if plain < 0.75 else 1 - 0.25 * math.exp(-4 * (plain - 0.75))

    def _line(self, now: float) -> str:
        share, elapsed = self.share(), now - self.start
        filled = round(BAR * share)
        left = f", about {(now - self.solving) * (1 - share) / share:.1f} s left" if share > 0.05 else ""
        return f"[{'=' * filled}{' ' * (BAR - filled)}] {100 * share:3.0f} %  {self.what}, {elapsed:.1f} s{left}"

    def _plain(self, text: str, now: float) -> None:
        self.stream.write(f"  {text}\n")
        self.stream.flush()
        self.said = now


def _name(level: int) -> str:
    n = grid.samples(level)
    return f"level {level} ({n} x {n})"


def _solve(solver: Solver, terrain: _Terrain, level: int, *, quiet: bool) -> NDArray[np.float32]:
    """The settled heights of ``level``, with progress on standard error unless ``quiet``."""
    document, base = terrain
    progress = None if quiet else Progress(sys.stderr, level)
    if progress:
        print(f"{len(document.strokes)} strokes on {solver.device_name}", file=sys.stderr)
        progress.show()
    heights: NDArray[np.float32] | None = None
    for result in solver.steps(document.strokes, document.settings, level, base=base):
        if progress:
            progress.step(result)
        if isinstance(result, Settled) and result.level == level:
            heights = result.heights
    if heights is None:
        raise RuntimeError("The solve ended before the ground was settled.")
    if base is not None:
        heights = heights + base.level(level, solver.device)
    if progress:
        elapsed = progress.clock() - progress.start
        n = len(heights)
        progress.close(f"{n} x {n} heights from {heights.min():.2f} to {heights.max():.2f} m in {elapsed:.2f} s")
    return heights


def _samples(level: int, size: float, corners: Sequence[float], most: int) -> tuple[int, int, int, int]:
    """Rows r0 to r1 and columns c0 to c1 of a window; raises ValueError for one without samples or with too many."""
    r0, r1, c0, c1 = grid.Rect(*corners).sample_window(level, size)
    if r0 >= r1 or c0 >= c1:
        raise ValueError(f"No sample of level {level} lies in that window; the terrain is {size:g} m wide.")
    if (r1 - r0) * (c1 - c0) > most:
        raise ValueError(
            f"That window has {r1 - r0:,} x {c1 - c0:,} samples of level {level}; at most {most:,} are made at once. "
            "Take it in parts: they agree to the bit where they meet."
        )
    return r0, r1, c0, c1


def _window(
    solver: Solver, terrain: _Terrain, level: int, corners: Sequence[float], *, quiet: bool
) -> NDArray[np.float32]:
    """The heights of a rectangle of ``level``; raises ValueError for one without samples."""
    document, under = terrain
    size = document.settings.size_m
    r0, r1, c0, c1 = _samples(level, size, corners, MOST_SAMPLES)
    basis = None
    steps = solver.steps(document.strokes, document.settings, min(level, DEFAULT_LEVEL), basis=True, base=under)
    for result in steps:
        basis = result.basis if isinstance(result, Done) else basis
    if basis is None:
        raise RuntimeError("The solve ended before the ground was settled.")
    live = not quiet and sys.stderr.isatty()

    def show(share: float) -> None:
        if live:
            print(f"\r\x1b[Krefining to {_name(level)}: {100 * share:3.0f} %", end="", file=sys.stderr, flush=True)

    rows, columns = slice(r0, r1), slice(c0, c1)
    heights = solver.refiner(basis).window(level, rows, columns, show)
    if under is not None:
        heights = heights + under.window(level, rows, columns, solver.device)
    if not quiet:
        s = grid.spacing(level, size)
        where = f"sample [0, 0] at x {c0 * s:g} m, y {r0 * s:g} m, {s:g} m apart"
        clear = "\r\x1b[K" if live else ""
        print(f"{clear}{r1 - r0} x {c1 - c0} heights of {_name(level)}, {where}", file=sys.stderr)
    return heights


def _with_detail(
    solver: Solver, terrain: _Terrain, level: int, corners: Sequence[float] | None, *, quiet: bool
) -> tuple[NDArray[np.float32], Mapping[str, NDArray[np.float32]]]:
    """Heights and attributes as the page shows them, of a whole level or of a rectangle of it; raises ValueError."""
    document, base = terrain
    size, n = document.settings.size_m, grid.samples(level)
    r0, r1, c0, c1 = (0, n, 0, n) if corners is None else _samples(level, size, corners, MOST_SAMPLES // 10)
    progress = None if quiet else Progress(sys.stderr, DEFAULT_LEVEL)
    step = progress.step if progress else None
    settled = settle(solver, document.strokes, document.settings, DEFAULT_LEVEL, step, base=base)
    if progress:
        progress.close(f"{_name(DEFAULT_LEVEL)} settled in {progress.clock() - progress.start:.2f} s")
    live = not quiet and sys.stderr.isatty()

    def show(share: float) -> None:
        if live:
            print(f"\r\x1b[Kdetail of {_name(level)}: {100 * share:3.0f} %", end="", file=sys.stderr, flush=True)

    maker = detailed(solver, settled, ground_m=span_m(document.layers))
    made = maker.window(level, slice(r0, r1), slice(c0, c1), show)
    if not quiet:
        s = grid.spacing(level, size)
        clear = "\r\x1b[K" if live else ""
        low, high = made.heights.min(), made.heights.max()
        print(
            f"{clear}{r1 - r0} x {c1 - c0} heights with detail from {low:.2f} to {high:.2f} m, "
            f"sample [0, 0] at x {c0 * s:g} m, y {r0 * s:g} m, {s:g} m apart",
            file=sys.stderr,
        )
    return made.heights, made.attributes
