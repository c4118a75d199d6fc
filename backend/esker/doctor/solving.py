"""What solves here: the devices, a known scene against a direct solve, all kernels against NumPy, and a soak."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from esker import grid, resources
from esker.contract import Stroke
from esker.doctor.findings import Finding
from esker.events import Preview, Settled
from esker.process import system
from esker.solve.assembly import assemble
from esker.solve.opencl.device import NUMPY, candidates, driver, refusals
from esker.solve.opencl.faults import NoDeviceError
from esker.solve.solver import Solver
from esker.templates import gallery

SCENE: Final = "five"
SCENES: Final = ("five", "border", "tiny", "loops")
"""Small scenes that use every kernel."""
LEVEL: Final = 2
TIMED: Final = "fifty"
SOAK_LEVEL: Final = 4
SOAK_STROKES: Final = 20
ABSENT: Final = "there is no OpenCL device"
TOLERANCE: Final = 2e-3
"""Share of the relief by which two devices may differ, since they may break ties between strokes differently. A wrong
device is off by far more."""
QUANTUM: Final = 1.0
"""Error of the known scene against its direct solve, in quantisation steps, that is still right."""


def devices(wanted: str | None) -> Iterator[Finding]:
    """The devices there are, and how the chosen one solves the known scene."""
    names = candidates()
    if names == [NUMPY]:
        text = "No OpenCL device: NumPy solves, right but slowly. Install your processor's or graphics card's OpenCL."
        yield Finding("devices", "poor", text, {"devices": names, "drivers": {}})
    else:
        drivers = {name: driver(name) for name in names[:-1]}
        listed = "; ".join(f"{name}, driver {version}" for name, version in drivers.items())
        yield Finding("devices", "good", f"{listed}; and NumPy.", {"devices": names, "drivers": drivers})
    try:
        solved = known_scene(wanted)
        yield from (Finding("driver", "broken", f"{name} cannot be used: {why}.") for name, why in refusals().items())
        yield solved
    except NoDeviceError as error:
        yield Finding("solve", "broken", str(error))
    except Exception as error:
        yield Finding("solve", "broken", f"The known scene cannot be solved: {type(error).__name__}: {error}")


def known_scene(wanted: str | None) -> Finding:
    """Solves a scene of the gallery and compares it with a direct solve of the same system in float64."""
    document = gallery.load(SCENE)
    began = time.perf_counter()
    solver = Solver(wanted, max_level=LEVEL)
    opened = time.perf_counter() - began
    first, took = _solved(solver, SCENE), min(_solved(solver, SCENE)[1] for _ in range(3))
    a, b = assemble(document.strokes, document.settings, LEVEL)
    exact = spla.spsolve(a.tocsc(), b).reshape(first[0].shape)
    error = float(np.abs(first[0] - exact).max())
    quanta = error / grid.quantum(LEVEL, document.settings.size_m)
    facts = {
        "device": solver.device_name,
        "opened_s": round(opened, 2),
        "scene": SCENE,
        "samples": grid.samples(LEVEL),
        "solve_ms": round(1000 * took, 2),
        "error_m": float(f"{error:.3g}"),
        "error_quanta": float(f"{quanta:.3g}"),
    }
    text = (
        f"{facts['device']} was ready after {facts['opened_s']} s and settles “{SCENE}” at {facts['samples']}² in "
        f"{facts['solve_ms']} ms, {facts['error_quanta']} of a step of the tiles from the direct solve."
    )
    return Finding("solve", "good" if quanta <= QUANTUM else "broken", text, facts)


def _solved(solver: Solver, scene: str) -> tuple[NDArray[np.float32], float]:
    document = gallery.load(scene)
    began = time.perf_counter()
    heights = solver.solve(document.strokes, document.settings, LEVEL)[LEVEL]
    return heights, time.perf_counter() - began


def kernels(wanted: str | None) -> dict[str, Any]:
    """Both sets of kernels against the NumPy twin on small scenes: largest differences, in shares of the relief."""
    twin = Solver(NUMPY, max_level=LEVEL)
    truths = {scene: _solved(twin, scene)[0] for scene in SCENES}
    out: dict[str, Any] = {"level": LEVEL, "tolerance_of_relief": TOLERANCE}
    before = os.environ.get("ESKER_KERNELS")
    try:
        for kind in ("rows", "tiles"):
            os.environ["ESKER_KERNELS"] = kind
            out[kind] = _against(wanted, truths)
    finally:
        os.environ.pop("ESKER_KERNELS")
        if before is not None:
            os.environ["ESKER_KERNELS"] = before
    out["right"] = all(out[kind].get("right", False) for kind in ("rows", "tiles"))
    return out


def _against(wanted: str | None, truths: dict[str, NDArray[np.float32]]) -> dict[str, Any]:
    try:
        solver = Solver(wanted, max_level=LEVEL)
        if solver.device is None:
            return {"failed": _absence()}
        found: dict[str, Any] = {}
        for scene, truth in truths.items():
            heights, took = _solved(solver, scene)
            off = float(np.abs(heights - truth).max()) / max(float(np.ptp(truth)), 1e-9)
            found[scene] = {"of_relief": float(f"{off:.3g}"), "ms": round(1000 * took, 2)}
    except Exception as error:
        return {"failed": f"{type(error).__name__}: {error}"}
    right = all(np.isfinite(row["of_relief"]) and row["of_relief"] < TOLERANCE for row in found.values())
    return {"device": solver.device_name, "scenes": found, "right": right}


def _absence() -> str:
    """Why NumPy solves: there is no other device, or those that are there cannot be used."""
    refused = "; ".join(f"{name}: {why}" for name, why in refusals().items())
    return f"no OpenCL device works ({refused})" if refused else ABSENT


def soak(wanted: str | None, seconds: float, level: int = SOAK_LEVEL) -> dict[str, Any]:
    """Edits one stroke after the other and settles each time, for so long; then compares with a solver that is new.

    What is settled is a function of the strokes, so a solver that has solved for minutes may differ by nothing but
    rounding.
    """
    solver = Solver(wanted, max_level=level)
    settings = gallery.load(SCENE).settings
    strokes = gallery.random_strokes(SOAK_STROKES, 7, (500, 1800), (80, 400))
    rng = np.random.default_rng(11)
    firsts, settles, memory, bad = [], [], [system.resident_bytes()], 0
    end = time.monotonic() + seconds
    last: NDArray[np.float32] | None = None
    while last is None or time.monotonic() < end:
        k = int(rng.integers(len(strokes)))
        strokes[k] = _moved(strokes[k], rng.uniform(-120, 120, 2))
        began, first = time.perf_counter(), None
        for result in solver.steps(tuple(strokes), settings, level):
            if not isinstance(result, Preview | Settled):
                continue
            first = first or time.perf_counter()
            if result.settled and result.level == level:
                last = result.heights
        settles.append(time.perf_counter() - began)
        firsts.append((first or time.perf_counter()) - began)
        bad += last is None or not bool(np.isfinite(last).all())
        memory.append(system.resident_bytes())
    assert last is not None
    fresh = Solver(wanted, max_level=level).solve(tuple(strokes), settings, level)[level]
    quanta = float(np.abs(fresh - last).max()) / grid.quantum(level, settings.size_m)
    quarter = memory[len(memory) // 4]
    return {
        "device": solver.device_name, "seconds": seconds, "level": level, "strokes": len(strokes),
        "edits": len(settles),
        "first_preview_ms": _spread(firsts), "settled_ms": _spread(settles), "not_finite": int(bad),
        "resident_mib": {"first_quarter": quarter >> 20, "end": memory[-1] >> 20},
        "from_new_quanta": float(f"{quanta:.3g}"), "right": bad == 0 and quanta <= QUANTUM,
    }  # fmt: skip


def _moved(stroke: Stroke, by: NDArray[np.float64]) -> Stroke:
    """The stroke elsewhere, within the terrain."""
    dx, dy = (float(v) for v in by)
    ends = (stroke.first, stroke.last)
    if any(not (100 < x + dx < 3996 and 100 < y + dy < 3996) for x, y, _ in ends):
        dx = dy = 0.0
        lifted = 5.0 if stroke.first[2] < 50 else -5.0
        raised = [(x, y, z + lifted) for x, y, z in ends]
        return stroke.model_copy(update={"first": raised[0], "last": raised[1]})
    moved = [(x + dx, y + dy, z) for x, y, z in ends]
    return stroke.model_copy(update={"first": moved[0], "last": moved[1]})


def _spread(times: list[float]) -> dict[str, float]:
    ms = 1000 * np.asarray(times)
    return {f"p{q}": round(float(np.percentile(ms, q)), 2) for q in (50, 99)}


def times(wanted: str | None, levels: tuple[int, ...]) -> Iterator[dict[str, Any]]:
    """``esker bench solve`` of one device: what there is after each grid size, smallest first."""
    if not resources.has_benchmarks():
        yield {"failed": "the benchmarks lie in a checkout of Esker's sources (git clone, make run)"}
        return
    from bench.solver import _kernels  # imported only here, since it compiles what it measures

    solver = Solver(wanted, max_level=LEVEL)
    if solver.device is None:
        yield {"failed": f"{_absence()}: NumPy is not worth timing"}
        return
    out: dict[str, Any] = {}
    for level in levels:
        found = _kernels.run(None, range(level, level + 1), (TIMED,), lambda _: None, wanted)
        scenes = {name: out.get("scenes", {}).get(name, {}) | sizes for name, sizes in found["scenes"].items()}
        out = found | {"scenes": scenes}
        yield out
