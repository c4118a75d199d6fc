"""Compiles, in a process of its own, what a server runs.

``python -m esker.server.first_build kernels | driver | loops [tiles | rivers | layers]`` is that process.
A compiler that hangs, takes all memory or aborts then harms nobody (``solve.prepare`` starts this and bounds it). What
is compiled is kept on disk by PoCL and by numba, and whoever starts this process only loads it.

PoCL compiles a program's front half when it is built, and each kernel when it is first enqueued, once for each size of
its work-groups. So ``kernels`` solves a small known scene, over a base too, and asks for the rest by name. Graphics
drivers compile whole programs; ``driver`` has one build them all and solves the same scene.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import TerrainSettings
from esker.events import Done
from esker.process import priority, system
from esker.process.child_process import end_with_parent
from esker.solve.opencl import prepare, proof
from esker.solve.opencl.pocl import cpu, home

TILES: Final = "tiles"
RIVERS: Final = "rivers"
LAYERS: Final = "layers"
SCENE_LEVEL: Final = 2
LOOPS_TIMES: Final = 10.0
"""Loops may take so many times as long as kernels: no driver can hang in them. Those of layers take a minute of a fast
core, and what a child leaves undone the server compiles itself, with its interpreter's lock."""
ROWS: Final = "1-1-1-goffs0-smallgrid"
"""The name that PoCL gives the shape of the launches of row-wise kernels."""
log = logging.getLogger("esker.server.first_build")


class Slope:
    """A base that rises to the east: the smallest ground that strokes can stand on."""

    digest, low, high = b"slope", 0.0, 100.0

    def level(self, level: int, device: Any = None) -> NDArray[np.float32]:  # noqa: ARG002
        """Heights of a whole level."""
        return self.window(level, slice(None), slice(None))

    def window(self, level: int, rows: slice, cols: slice, device: Any = None) -> NDArray[np.float32]:  # noqa: ARG002
        """Heights of some samples of a level."""
        n = grid.samples(level)
        row = np.linspace(self.low, self.high, n, dtype=np.float32)
        return np.ascontiguousarray(np.broadcast_to(row, (n, n))[rows, cols])

    def survey(self, level: int) -> NDArray[np.float32]:
        """Returns how fine the data are."""
        return np.zeros((grid.samples(level),) * 2, dtype=np.float32)

    def changed(self, other: Any) -> grid.Rect | None:  # noqa: ARG002
        """Returns None, as no such base differs from another anywhere."""
        return None


def kernels(wanted: str | None, threads: int | None, level: str, name: str | None = None) -> dict[str, Any]:
    """Compiles every kernel for the device that ``wanted`` names, if it is PoCL's; what came of it.

    ``name``: a CPU to compile for in place of the level's own, for tests of what does not fit.
    """
    from esker.solve.opencl import device as devices
    from esker.solve.solver import Solver

    at = next(one for one in cpu.LEVELS if one.name == level)
    prepare.adopt(replace(at, name=name or at.name))
    found = [(name, d) for name, d in devices.listed(threads) if wanted is None or wanted.lower() in name.lower()]
    if not found or cpu.compiled_for(found[0][1].version) is None:
        return {"other": True}
    solver = Solver(found[0][0], SCENE_LEVEL, threads)
    device = solver.device
    assert device is not None, "a device that was asked for by name is there"
    _solve(solver)
    for program, names in devices.programs(device):
        _complete(program, names)
    _blend(device)
    return {"device": device.name}


def driver(name: str, threads: int | None, level: str | None) -> dict[str, Any]:
    """Builds every program with the driver of one device, which is not PoCL's. Raises NoDeviceError, BuildError.

    ``level``: what PoCL compiles for in the process that asks, so that devices are listed as they are there.
    """
    from esker.solve.opencl import device as devices
    from esker.solve.solver import Solver

    if level is not None:
        prepare.adopt(next(one for one in cpu.LEVELS if one.name == level))
    solver = Solver(name, SCENE_LEVEL, threads)
    device = solver.device
    assert device is not None, "a device that was asked for by name is there"
    _solve(solver)
    devices.programs(device)
    _blend(device)
    return {"device": device.name}


def _solve(solver: Any) -> None:
    """A scene in which most kernels have something to do; the device's proof has been made already."""
    from esker.solve.opencl.workspaces import new_workspace

    strokes = [*proof.STROKES, proof.STROKES[0].model_copy(update={"id": "rough", "amplitude_m": 8.0})]
    settings = TerrainSettings()
    for base in (None, Slope()):
        *_, last = solver.steps(strokes, settings, SCENE_LEVEL, basis=True, base=base)
        assert isinstance(last, Done)
        for _ in solver.refiner(last.basis).tiles([grid.TileKey(SCENE_LEVEL + 1, 0, 0)]):
            pass
    new_workspace(solver.device, SCENE_LEVEL, False).height.hold()  # only ground that is edited needs this kernel
    solver.device.queue.finish()


def _complete(program: Any, names: tuple[str, ...]) -> None:
    """Compiles those kernels of a row-wise program that no scene has used."""
    kept = Path(os.environ["POCL_CACHE_DIR"])
    missing = [name for name in names if not any(kept.glob(f"*/*/{name}/{ROWS}/{name}.so"))]
    if missing:
        log.debug("not in the scene: %s", missing)
        os.environ["POCL_BINARY_SPECIALIZE_WG"] = ROWS
        prepare.machine_code(program)


def _blend(device: Any) -> None:
    """Runs the kernels that blend elevation layers: one bin that no patch meets."""
    from esker.patchwork.blend import device as blend_device
    from esker.patchwork.blend import packs

    none = np.zeros(0, dtype=np.int32)
    for smooth in (False, True):
        coefficients, to_patch = np.zeros((0, 34, 34), dtype=np.float32), np.zeros((0, 2, 3))
        domain, volume = np.zeros((0, 4)), np.zeros(0)
        pack = packs.Pack(smooth, coefficients, to_patch, domain, domain, volume, none, none, none)
        found = packs.Bins(
            np.zeros(2, dtype=np.int32), none, np.zeros((0, 2), np.float32), np.zeros((0, 4), np.float32)
        )
        constants = np.zeros((0, 9), dtype=np.float32)
        blend_device.program(device, smooth).run(device.queue, pack, constants, found, (1, 1))


def loops(what: str = TILES) -> dict[str, Any]:
    """Compiles the loops of tiles, which every server runs before anybody draws, those of its rivers, or of layers."""
    for warm in _parts(what):
        warm()
    return {"loops": what}


def _parts(what: str) -> list[Callable[[], None]]:
    """Returns what runs the loops. Raises KeyError for something else."""
    from esker.flow import warming
    from esker.patchwork import warming as layering
    from esker.synthesis.rules import octave
    from esker.tiles import pyramid

    parts: dict[str, list[Callable[[], None]]] = {
        TILES: [pyramid.warm],
        RIVERS: [warming.warm, octave.warm],
        LAYERS: [layering.warm],
    }
    return parts[what]


def have_loops(stopped: threading.Event, begun: threading.Event) -> None:
    """Compiles the loops of tiles in a child process, unless one has done so, then loads them into this process.

    ``begun`` is set before they are compiled.
    """
    if _compiled(TILES, stopped, begun.set):
        loops(TILES)


def have_river_loops(stopped: threading.Event) -> None:
    """Compiles the loops of rivers in a child process, unless one has done so.

    Nobody waits for these to draw: a server is ready without them, and its first rivers come after.
    """
    _compiled(RIVERS, stopped, lambda: None)


def have_layer_loops(stopped: threading.Event) -> None:
    """Compiles the loops of elevation layers in a child process, unless one has done so.

    Where nobody lays a layer nobody needs them. Compiled by the server itself they would hold its interpreter for a
    minute, and everybody's strokes with it. The child yields to others.
    """
    _compiled(LAYERS, stopped, lambda: None)


def _compiled(what: str, stopped: threading.Event, begins: Callable[[], None]) -> bool:
    """Compiles loops in a child process unless one has; False where it was stopped on the way."""
    record = home.root() / f"loops-{what}-{_content(what)}"
    if record.exists():
        return True
    begins()
    try:
        result = prepare.bounded(["loops", what], stopped=stopped, times=LOOPS_TIMES)
        if "failed" in result:
            log.warning("loops of %s: %s; the server compiles what is missing", what, result["failed"])
        else:
            with suppress(OSError):
                record.parent.mkdir(parents=True, exist_ok=True)
                record.touch()
    except prepare.Stopped:
        return False
    except OSError as error:  # no process can be had: whatever thread asks goes on without
        log.warning("loops of %s: no process compiles them (%s); the server compiles what is missing", what, error)
    return True


def _content(what: str) -> str:
    """Returns a digest of the sources of loops, where they lie, and what compiles them."""
    from esker import compiled

    rooms = {Path(sys.modules[warm.__module__].__file__ or "").parent for warm in _parts(what)}
    files = [Path(compiled.__file__), *(path for room in sorted(rooms) for path in sorted(room.rglob("*.py")))]
    known = [version("numba").encode(), compiled.__file__.encode(), *(path.read_bytes() for path in files)]
    return hashlib.sha256(b"".join(known)).hexdigest()[:16]


def main(arguments: list[str]) -> int:
    """Does one of the three; prints one line of JSON: what came of it, or ``failed`` with a sentence."""
    end_with_parent()
    system.end_with_parent()  # compiling may hold the interpreter for minutes
    logging.basicConfig(stream=sys.stderr, level=os.environ.get("ESKER_LOG_LEVEL", "warning").upper())
    prepare.THIS_IS_THE_CHILD = True
    try:
        if arguments[:1] == ["loops"]:
            if arguments[1:] == [LAYERS]:
                priority.yield_to_others()  # people draw meanwhile
            done = loops(*arguments[1:])
        else:
            given = json.loads(arguments[1])
            done = driver(**given) if arguments[0] == "driver" else kernels(**given)
    except Exception as error:
        log.debug("the first build failed", exc_info=True)
        done = {"failed": str(error) or type(error).__name__}
    sys.stdout.write(json.dumps(done) + "\n")
    sys.stdout.flush()
    os._exit(0)  # PoCL's threads need not be waited for


if __name__ == "__main__":
    main(sys.argv[1:])
