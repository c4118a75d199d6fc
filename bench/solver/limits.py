"""Random documents at the limits of every field, solved on every device: all ground is finite, nothing is raised.

Equations that do not converge are counted apart: a room says so and keeps its previews (rule P80).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np

from bench.room import _serving
from bench.solver._limit_documents import document
from esker import contract as c
from esker.events import Done, Level
from esker.grid import TileKey
from esker.solve.multigrid import DivergedError
from esker.solve.opencl.device import NUMPY
from esker.solve.solver import Solver
from esker.version import VERSION

LEVEL: Final = 1
REFINED_EVERY: Final = 10
"""One document in so many is also refined where somebody may look."""


def faults(solver: Solver, made: c.Document, refine: bool) -> Iterator[str]:
    """What is wrong with the ground of a document: nothing, if all is well. Raises DivergedError."""
    try:
        basis = None
        for result in solver.steps(made.strokes, made.settings, basis=True):
            if isinstance(result, Level) and not np.isfinite(result.heights).all():
                yield f"channel {result.channel.name} of level {result.level} is not finite"
            if isinstance(result, Done):
                basis = result.basis
        if refine and basis is not None:
            for tile in solver.refiner(basis).tiles([TileKey(solver.max_level + 1, 0, 0)]):
                if tile is not None and not np.isfinite(tile.heights).all():
                    yield "a refined tile is not finite"
    except DivergedError:
        raise
    except Exception as error:
        yield f"{type(error).__name__}: {error}"


def search(solvers: Sequence[Solver], seeds: Iterable[int]) -> dict[str, Any]:
    """All findings, each with the device and with the seed that repeats it."""
    count, findings, diverged = 0, list[str](), list[str]()
    for seed in seeds:
        made = document(seed)
        count += 1
        for solver in solvers:
            where = f"{solver.device_name}, seed {seed}"
            try:
                findings += [f"{where}: {fault}" for fault in faults(solver, made, seed % REFINED_EVERY == 0)]
            except DivergedError:
                diverged.append(where)
    return {"documents": count, "findings": findings, "diverged": diverged}


def main(argv: list[str]) -> int:
    """``esker bench limits [--json] [--count N] [--from SEED] [--level N]``; status 1 with findings."""
    parser = argparse.ArgumentParser(prog="esker bench limits", description=__doc__)
    parser.add_argument("--count", type=int, default=10_000, help="documents (default: %(default)s)")
    parser.add_argument("--from", type=int, default=0, dest="first", metavar="SEED", help="the first seed")
    parser.add_argument("--level", type=int, default=LEVEL, help="the finest level (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    arguments = parser.parse_args(argv)
    solvers = [Solver(NUMPY, arguments.level), Solver(None, arguments.level)]
    began = time.perf_counter()
    found = search(solvers, range(arguments.first, arguments.first + arguments.count))
    result = {
        "bench": "limits",
        "version": VERSION,
        "machine": _serving.machine(solvers[-1].device_name),
        "level": arguments.level,
        "first_seed": arguments.first,
        "seconds": round(time.perf_counter() - began, 1),
        **found,
    }
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        sys.stdout.write(f"{found['documents']} documents, {len(found['diverged'])} diverged\n")
        sys.stdout.writelines(f"  {line}\n" for line in found["findings"])
    return 1 if found["findings"] else 0
