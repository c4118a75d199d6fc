"""Other solvers on the same systems: PyAMG (Ruge-Stüben, smoothed aggregation), and direct ones (SuperLU, CHOLMOD).

Each runs in a process of its own under a limit of address space and of time, so that one that needs more than the
machine has says so and the run goes on. The system is the height step's, float64, free samples alone; making the
sparse matrix is not counted. Iterative ones are accelerated by conjugate gradients and stopped, not by a residual, but
where their largest error against the exact solution is down to the solver's own: time between iterations counts,
comparing does not. CHOLMOD is the one inside the cvxopt wheel (AMD ordering, supernodal).
"""

from __future__ import annotations

import importlib.util
import json
import resource
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.solver._accuracy import significant
from esker.solve.assembly import system

Field = NDArray[np.float64]
MOST_ITERATIONS = 200
MOST_RUNS, RUN_SECONDS = 5, 15.0
"""A peer is run again, and its least times taken like ours, until it has had so much time."""
ITERATIVE = {"pyamg_ruge_stuben": "ruge_stuben_solver", "pyamg_smoothed_aggregation": "smoothed_aggregation_solver"}
NAMES = (*ITERATIVE, "superlu", "cholmod")
NEEDS = {**dict.fromkeys(ITERATIVE, "pyamg"), "superlu": "scipy", "cholmod": "cvxopt"}


class _Enough(Exception):
    """All accuracies that were asked for are reached."""


def free_system(file: Path) -> tuple[Any, Field, Field, dict[str, float]]:
    """(A, b, exact) of the free samples of a problem that ``save`` wrote, and the errors to reach in metres by name."""
    data = np.load(file)
    a, b = system(data["d"].astype(np.float64), data["f"], float(data["screening"]))
    free = data["d"].ravel() >= 0
    a = a[np.flatnonzero(free)][:, np.flatnonzero(free)]
    return a, b[free], data["exact"].ravel()[free], json.loads(str(data["targets"]))


def save(file: Path, d: Any, f: Field, screening: float, exact: Field, targets: dict[str, float]) -> None:
    """A problem for ``main``: stiffness, right-hand side (see ``reference``), screening, solution, errors to reach."""
    np.savez(file, d=d, f=f, screening=screening, exact=exact, targets=json.dumps(targets))


def _iterative(name: str, a: Any, b: Field, exact: Field, targets: dict[str, float]) -> dict[str, Any]:
    import pyamg

    start = time.perf_counter()
    hierarchy = getattr(pyamg, ITERATIVE[name])(a)
    out: dict[str, Any] = {"set_up_ms": round(1e3 * (time.perf_counter() - start), 1), "solve": {}}
    out["operator_complexity"] = round(float(hierarchy.operator_complexity()), 2)
    spent, count, mark = 0.0, 0, 0.0

    def look(x: Field) -> None:
        nonlocal spent, count, mark
        spent += time.perf_counter() - mark
        count += 1
        error = float(np.abs(x - exact).max())
        for target, bound in targets.items():
            if error <= bound and target not in out["solve"]:
                row = {"ms": round(1e3 * spent, 1), "iterations": count, "error_m": significant(error)}
                out["solve"][target] = row
        if len(out["solve"]) == len(targets):
            raise _Enough
        mark = time.perf_counter()

    mark = time.perf_counter()
    try:
        hierarchy.solve(b, tol=1e-15, maxiter=MOST_ITERATIONS, accel="cg", callback=look)
    except _Enough:
        return out
    return out | {"failed": f"not as accurate after {count} iterations"}


def _superlu(a: Any, b: Field) -> tuple[float, float, Field]:
    import scipy.sparse.linalg as spla

    start = time.perf_counter()
    # A symmetric matrix: ordering by A + A^T and pivots from the diagonal are much the cheapest.
    factors = spla.splu(a.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    middle = time.perf_counter()
    x = factors.solve(b)
    return middle - start, time.perf_counter() - middle, x


def _cholmod(a: Any, b: Field) -> tuple[float, float, Field]:
    import scipy.sparse as sp
    from cvxopt import cholmod, matrix, spmatrix

    lower = sp.tril(a, format="coo")
    rows, columns = (matrix(k.astype(np.int64)) for k in (lower.row, lower.col))
    sparse = spmatrix(matrix(lower.data), rows, columns, a.shape)
    cholmod.options["supernodal"] = 2
    start = time.perf_counter()
    factors = cholmod.symbolic(sparse)
    cholmod.numeric(sparse, factors)
    middle = time.perf_counter()
    x = matrix(b)
    cholmod.solve(factors, x)
    return middle - start, time.perf_counter() - middle, np.asarray(x).ravel()


DIRECT: dict[str, Callable[[Any, Field], tuple[float, float, Field]]] = {"superlu": _superlu, "cholmod": _cholmod}


def solve(name: str, file: Path) -> dict[str, Any]:
    """One peer on one problem: milliseconds of set-up and of the solve to each accuracy, least of some runs."""
    a, b, exact, targets = free_system(file)
    best: dict[str, Any] = {}
    start = time.perf_counter()
    for _ in range(MOST_RUNS):
        figures = _iterative(name, a, b, exact, targets) if name in ITERATIVE else _direct(name, a, b, exact, targets)
        if not best or "failed" in figures:
            best = figures
        best["set_up_ms"] = min(best["set_up_ms"], figures["set_up_ms"])
        for target, row in figures["solve"].items():
            if row["ms"] < best["solve"][target]["ms"]:
                best["solve"][target] = row
        if "failed" in best or time.perf_counter() - start > RUN_SECONDS:
            break
    return best


def _direct(name: str, a: Any, b: Field, exact: Field, targets: dict[str, float]) -> dict[str, Any]:
    factor, back, x = DIRECT[name](a, b)
    row = {"ms": round(1e3 * back, 1), "error_m": significant(float(np.abs(x - exact).max()))}
    return {"set_up_ms": round(1e3 * factor, 1), "solve": dict.fromkeys(targets, row)}


def child(argv: list[str]) -> int:
    """``python -m bench.solver._peers NAME PROBLEM GIB``: prints the figures as JSON; runs under the memory limit."""
    name, file, gib = argv
    limit = int(float(gib) * 2**30)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    warnings.simplefilter("ignore")  # PyAMG warns of formats and of float64 reaching its limit
    try:
        figures = solve(name, Path(file))
    except MemoryError:
        figures = {"failed": "out of memory"}
    except Exception as error:
        # Whatever a foreign solver raises is a result: it could not solve this.
        text = f"{type(error).__name__}: {error}"
        figures = {"failed": "out of memory" if "memory" in text.lower() else text.splitlines()[0][:200]}
    figures["peak_gib"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20, 2)
    sys.stdout.write(json.dumps(figures) + "\n")
    return 0


def run(name: str, file: Path, gib: float, seconds: float) -> dict[str, Any]:
    """One peer in a process of its own; ``failed`` says why there are no figures, or not all."""
    if importlib.util.find_spec(NEEDS[name]) is None:
        return {"failed": f"{NEEDS[name]} is not installed (pip install 'esker[bench]')"}
    command = [sys.executable, "-m", "bench.solver._peers", name, str(file), str(gib)]
    limits = {"limit_gib": gib, "limit_s": seconds}
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return {"failed": "out of time"} | limits
    if done.returncode < 0:
        # A library that does not check its allocations dies of them.
        return {"failed": f"killed by {signal.Signals(-done.returncode).name} (out of memory?)"} | limits
    if done.returncode or not done.stdout.strip():
        said = (done.stderr or done.stdout).strip().splitlines()
        return {"failed": f"ended with {done.returncode}: {said[-1] if said else 'no word'}"} | limits
    figures: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return figures | (limits if "failed" in figures else {})


if __name__ == "__main__":
    sys.exit(child(sys.argv[1:]))
