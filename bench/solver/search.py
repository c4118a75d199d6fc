"""Wrong ground, searched by machine: adversarial scenes at levels 0 to 3, on OpenCL and NumPy, against direct solves.

Scenes are drawn by ``_adversary`` in chunks of CHUNK, each with a seed and a level of its own; ``_direct`` measures how
far the settled ground is off, in tolerances: half a quantum, or 10^-6 of the highest ground where that is more. What is
off by more is shrunk to the simplest scene that still is, and listed. With ``--keep FILE``, which becomes the result, a
run that was stopped goes on unless something that solves has changed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import multiprocessing
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

from hypothesis import HealthCheck, Phase, Verbosity, given
from hypothesis import seed as seeded
from hypothesis import settings as rules
from hypothesis.errors import Flaky

from bench.room import _serving
from bench.solver import _adversary, _direct
from bench.solver._accuracy import significant
from esker.solve import solver
from esker.solve.opencl.device import NUMPY
from esker.solve.opencl.program_text import shader_folder
from esker.solve.solver import Solver
from esker.version import VERSION

CHUNK: Final = 20
LEVELS: Final = (0, 1, 0, 0, 1, 0, 2, 0, 0, 1, 0, 0, 1, 0, 3, 0, 0, 1, 0, 0)
"""Level of a chunk, by its number. Most scenes are of the coarsest: level 3 takes a hundred times as long."""
SIMPLEST_S: Final = 120.0
"""Seconds for which a finding is made simpler."""
AGAIN: Final = 1_000_000
"""Number that is added to the seed of a chunk when it goes on after a finding."""
MOST_FINDINGS: Final = 3
"""Findings of a chunk: then it is given up."""
KEPT: Final = 200
"""Findings of a result."""


class WrongGroundError(AssertionError):
    """A scene whose ground is off."""


@cache
def solvers() -> dict[str, Solver]:
    """Returns one solver of each kind, for this process; NumPy alone where there is no OpenCL."""
    best = Solver(threads=1)
    return {"numpy": Solver(NUMPY)} | ({"opencl": best} if best.device is not None else {})


def measured(scene: _direct.Scene) -> dict[str, float]:
    """``_direct.measure``; a solve that fails is off without bound, by the name of its error."""
    try:
        return _direct.measure(scene, solvers())
    except Exception as error:  # a search goes on, whatever it finds
        return {f"{type(error).__name__}: {error}": float("inf")}


def wrong(found: dict[str, float]) -> bool:
    """Whether a ground is off; where rounding of the strokes' own numbers moves it as far it is not."""
    return any(value > 1 for name, value in found.items() if not name.startswith("rounding"))


@dataclass
class Draw:
    """Scenes of one seed and level, until one is wrong; ``wrong`` ends with the simplest that still is. rounding: how
    many are off by no more than rounding of the strokes' own numbers moves them."""

    count: int = 0
    rounding: int = 0
    worst: dict[str, float] = field(default_factory=dict)
    wrong: list[tuple[_direct.Scene, dict[str, float]]] = field(default_factory=list)
    until: float = math.inf

    def one(self, scene: _direct.Scene) -> None:
        """Measures a scene. Raises WrongGroundError."""
        if time.monotonic() > self.until:
            return  # this is simple enough
        found = measured(scene)
        off = wrong(found)
        if not self.wrong:
            self.count += 1
            self.rounding += "rounding" in found
            add_worst(self.worst, found)
        if off:
            if not self.wrong:
                self.until = time.monotonic() + SIMPLEST_S
            self.wrong.append((scene, found))
            raise WrongGroundError

    def run(self, seed: int, cases: int, level: int) -> None:
        """Draws at most so many scenes."""
        limits = rules(
            max_examples=cases,
            database=None,
            deadline=None,
            phases=(Phase.generate, Phase.shrink),
            report_multiple_bugs=False,
            verbosity=Verbosity.quiet,
            suppress_health_check=list(HealthCheck),
        )
        with suppress(WrongGroundError, Flaky), _adversary.drawn_alike():
            seeded(seed)(limits(given(_adversary.scenes(level))(self.one)))()


def add_worst(worst: dict[str, float], found: dict[str, float]) -> None:
    """The larger of both, measure by measure."""
    worst.update({name: max(value, worst.get(name, 0.0)) for name, value in found.items()})


def chunk(number: int, cases: int) -> dict[str, Any]:
    """Measures ``cases`` scenes of chunk ``number``: how many there were, the worst of every measure, what was
    found."""
    level = LEVELS[number % len(LEVELS)]
    out: dict[str, Any] = {"level": level, "cases": 0, "rounding": 0, "worst": {}, "findings": []}
    while out["cases"] < cases and len(out["findings"]) < MOST_FINDINGS:
        draw, seed = Draw(), number + AGAIN * len(out["findings"])
        draw.run(seed, cases - out["cases"], level)
        out["cases"] += draw.count
        out["rounding"] += draw.rounding
        add_worst(out["worst"], draw.worst)
        if not draw.wrong:
            break  # hypothesis has nothing more to draw
        (_, drawn), (scene, simplest) = draw.wrong[0], draw.wrong[-1]
        out["findings"].append({"seed": seed, "drawn": drawn, "measured": simplest} | scene.document())
    return out


def empty() -> dict[str, Any]:
    """A result without a case."""
    return {
        "bench": "search",
        "version": VERSION,
        "machine": _serving.machine(),
        "sources": sources(),
        "unit": "of what the ground may be off: half a quantum, or 10^-6 of the highest ground",
        "cases": 0,
        "levels": {str(level): {"cases": 0, "rounding": 0, "worst": {}} for level in sorted(set(LEVELS))},
        "findings": [],
        "chunks": [],
    }


def sources() -> str:
    """SHA-256 of all that draws scenes and solves them: a result comes from one state of the solver."""
    digest = hashlib.sha256()
    package = Path(solver.__file__).parents[1]
    files = [*(package / "solve").rglob("*.py"), *shader_folder().rglob("*.cl"), *(package / "contract").rglob("*.py")]
    own = [Path(__file__).with_name(f"{name}.py") for name in ("_adversary", "_direct", "search")]
    for file in sorted([*files, *own]):
        digest.update(f"{file.name}\n".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def load(keep: Path | None) -> dict[str, Any]:
    """Returns what a stopped run of the same sources has, else an empty result."""
    fresh = empty()
    if keep is None or not keep.exists():
        return fresh
    kept: dict[str, Any] = json.loads(keep.read_text(encoding="utf-8"))
    return kept if kept.get("sources") == fresh["sources"] else fresh


def add(result: dict[str, Any], number: int, found: dict[str, Any]) -> None:
    """Counts a chunk in."""
    level = result["levels"][str(found["level"])]
    result["cases"] += found["cases"]
    level["cases"] += found["cases"]
    level["rounding"] += found["rounding"]
    add_worst(level["worst"], {name: significant(value) for name, value in found["worst"].items()})
    result["findings"] = [*result["findings"], *found["findings"]][:KEPT]
    result["chunks"] = sorted({*result["chunks"], number})


def search(result: dict[str, Any], cases: int, processes: int, keep: Path | None) -> None:
    """Adds chunks to the result until ``cases`` are drawn; ``keep`` is written after each."""
    wanted = [k for k in range(-(-cases // CHUNK)) if k not in result["chunks"]]
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        jobs = {pool.submit(chunk, k, min(CHUNK, cases - k * CHUNK)): k for k in wanted}
        for job in as_completed(jobs):
            add(result, jobs[job], job.result())
            if keep is not None:
                part = keep.with_suffix(".part")
                part.write_text(written(result), encoding="utf-8")
                part.replace(keep)
            sys.stderr.write(f"\r{result['cases']} of {cases} cases, {len(result['findings'])} findings")
    sys.stderr.write("\n")


def written(result: dict[str, Any]) -> str:
    """The result as JSON; a ground that is no number is off by "inf"."""
    return json.dumps(_finite(result), indent=1) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_finite(part) for part in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def main(argv: list[str]) -> int:
    """``esker bench search [--json] [--cases N] [--processes N] [--keep FILE]``: 1 when something was found."""
    parser = argparse.ArgumentParser(prog="esker bench search", description=(__doc__ or "").split("\n\n", 1)[0])
    parser.add_argument("--cases", type=int, default=10_000, help="scenes in all (default 10,000)")
    parser.add_argument("--processes", type=int, default=1, help="processes side by side, a core each (default 1)")
    parser.add_argument("--keep", type=Path, help="result file, written after every chunk and gone on from")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args(argv)
    result = load(options.keep)
    search(result, options.cases, max(1, options.processes), options.keep)
    if options.json:
        sys.stdout.write(written(result))
    else:
        for level, row in result["levels"].items():
            sys.stdout.write(f"level {level}: {row}\n")
        for finding in result["findings"]:
            sys.stdout.write(f"{_finite(finding)}\n")
    return int(bool(result["findings"]))
