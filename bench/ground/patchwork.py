"""The patchwork of elevation grids (paper 2, DESIGN 11) against GDAL and the paper.

``esker bench patchwork --json``. ``build``: mipmaps, errors and index of 1k, 4k and 16k samples a side, the last out
of core in a process of its own whose memory is watched; ``bytes_over``: what the model has beyond the heights.
``queries``: uniform ones a second, a view of 15 km at 1 px, and bytes a frame on the paper's straight flights and
rotations (a patch 4,106 bytes, a removal 4). ``blend``: 320,000 evaluations. ``add``: a turned grid of 512 x 512 into
a live 4k model, to the first levels on the screen. ``gdal``: the nearest that GDAL does, in the same run. ``paper``:
figures of the paper's section 6, Core i5 at 2.67 GHz, one core. Grids: ``_patchwork_data``. ``--quick``: no 16k, one
repetition.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.ground import _patchwork_data as data
from bench.ground import _patchwork_gdal as gdal
from bench.room import _serving
from esker.contract import GridFacts, Layer
from esker.patchwork.base import Base
from esker.patchwork.blend import lattice as blend
from esker.patchwork.lod import space
from esker.patchwork.lod.space import Model, Placed
from esker.patchwork.query import queries as query
from esker.patchwork.query.queries import Index, View
from esker.patchwork.raster import rasters
from esker.patchwork.raster.rasters import Raster
from esker.solve.opencl.device import open_device
from esker.version import VERSION

PAPER: Final[dict[str, Any]] = {
    "machine": "Core i5, 2.67 GHz, one core, 4 GB",
    "build": {
        "1025": {"mipmaps_s": 0.1, "errors_s": 0.6, "index_s": 0.05, "total_s": 0.75, "bytes_over": 732_000},
        "4097": {"mipmaps_s": 0.9, "errors_s": 10.0, "index_s": 0.83, "total_s": 11.73, "bytes_over": 11_700_000},
        "16385": {"mipmaps_s": 12.6, "errors_s": 169.0, "index_s": 14.6, "total_s": 196.2, "bytes_over": 187_000_000},
    },
    "queries": {"uniform_per_s": {"50": 800, "0": 55}, "view": {"ms": 2.5, "patches": 250}},
    "blend": {"bilinear_ms": 38.0, "bicubic_ms": 1000.0},
    "sample_bytes": 2,
}
"""Table 1, sections 6.2 to 6.5; heights of 16 bits."""
PATCH_BYTES: Final = 4106
REMOVAL_BYTES: Final = 4
VIEW_M: Final = 15_000.0
SCREEN: Final = (1024, 768)
FIELD_OF_VIEW: Final = math.radians(45)
FRAMES: Final = 250
FRAME_S: Final = 1 / 25
SPEEDS: Final = (50.0, 250.0, 1000.0)
"""Metres a second."""
TURNS: Final = (10.0, 30.0, 90.0)
"""Degrees a second."""
EVALUATIONS: Final = (500, 640)
DOMAIN_M: Final = 65_536.0
SPAN_M: Final = (data.SIDES[-1] - 1) * data.SPACING_16K_M
"""Side of all grids, metres."""


def say(text: str) -> None:
    """Progress, for people, beside the result."""
    print(time.strftime("%H:%M:%S"), text, file=sys.stderr, flush=True)


def quickest(work: Callable[[], object], repeats: int) -> float:
    """Seconds of the quickest of several runs."""
    found = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        found.append(time.perf_counter() - start)
    return min(found)


def layer_of(raster: Raster, name: str, spacing: float, anchor: tuple[float, float], **more: Any) -> Placed:
    """A layer of a raster, accurate to half a step of its heights."""
    facts: GridFacts = raster.facts()
    fields: dict[str, Any] = {"accuracy_m": data.STEP_M / 2, **more}
    return Placed(
        Layer(id=name, content=raster.digest, facts=facts, anchor=anchor, spacing_m=(spacing, spacing), **fields),
        raster,
    )


def whole(raster: Raster, anchor: tuple[float, float] = (0.0, 0.0)) -> Placed:
    """One of the grids of Puget Sound, all of the same extent."""
    return layer_of(raster, "puget", SPAN_M / (len(raster.heights) - 1), anchor)


class Stages:
    """Seconds of the stages of a build, from what it says of its progress."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._start = self._last = time.perf_counter()
        self._stage = "reading"

    def __call__(self, stage: str, _share: float) -> None:
        """Notes a part of a build, which calls it."""
        now = time.perf_counter()
        self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._last
        self._last, self._stage = now, stage


def built(make: Callable[[Stages], Raster]) -> tuple[dict[str, float], Raster, Model, Index]:
    """A raster, its model and index, and how long each took."""
    start, stages = time.perf_counter(), Stages()
    raster = make(stages)
    whole_s = time.perf_counter() - start
    model, index_s = None, 0.0
    start = time.perf_counter()
    model = space.build([whole(raster)])
    index = Index(model)
    index_s = time.perf_counter() - start
    mipmaps, errors = stages.seconds.get("mipmaps", 0.0), stages.seconds.get("errors", 0.0)
    figures = {
        "mipmaps_s": mipmaps,
        "errors_s": errors,
        "index_s": index_s,
        "three_stages_s": mipmaps + errors + index_s,
        "with_digest_and_files_s": whole_s + index_s,
    }
    return figures, raster, model, index


def bytes_over(raster: Raster, model: Model, index: Index) -> dict[str, float]:
    """Returns what is kept beyond the heights themselves."""
    mipmaps = sum(mip.nbytes for mip in raster.mips[1:])
    errors = sum(table.nbytes for table in raster.errors.tables)
    patches = sum(value.nbytes for value in vars(model).values() if isinstance(value, np.ndarray))
    held = [*vars(index).values(), *index.tree, *index.boxes]
    indexed = sum(value.nbytes for value in held if isinstance(value, np.ndarray))
    total = mipmaps + errors + patches + indexed
    return {
        "mipmaps": mipmaps, "errors": errors, "patches": patches, "index": indexed, "total": total,
        "share": total / raster.heights.nbytes,
    }  # fmt: skip


def build(folder: Path, puget: Path | None, quick: bool) -> tuple[dict[str, Any], Path, Raster]:
    """The three sizes; the folder of the largest raster that was made, and that of 4k."""
    out: dict[str, Any] = {}
    built(lambda stages: rasters.build(data.first(puget)[0][:200, :200], progress=stages))  # compiled loops, ready
    kept: Raster | None = None
    for side in data.SIDES[:2]:
        heights = np.load(data.make(side, folder, puget))
        runs = []
        for _ in range(1 if quick else 3):
            figures, raster, model, index = built(lambda stages, z=heights: rasters.build(z, progress=stages))  # type: ignore[misc]
            runs.append(figures)
        best = {name: min(run[name] for run in runs) for name in runs[0]}
        out[str(side)] = best | {"patches": model.count, "bytes_over": bytes_over(raster, model, index)}
        say(f"{side}: {best['three_stages_s']:.3f} s")
        kept = raster
    assert kept is not None
    place = folder / "4k"
    rasters.write(place, kept)
    if not quick:
        say("making 16k heights")
        path = data.make(data.SIDES[2], folder, puget)
        place = folder / "16k"
        line = [sys.executable, "-m", "bench.ground._patchwork_big", str(path), str(place)]
        done = subprocess.run(line, check=True, capture_output=True, text=True)
        out[str(data.SIDES[2])] = json.loads(done.stdout)
        say(f"16k: {out[str(data.SIDES[2])]['three_stages_s']:.2f} s")
    return out, place, kept


def queries(index: Index, quick: bool) -> dict[str, Any]:
    """Uniform ones, a view, flights and rotations."""
    seconds = 0.3 if quick else 2.0
    uniform = {}
    for e in (50.0, 5.0, 0.0):
        found, count, start = index.uniform(e), 0, time.perf_counter()
        while time.perf_counter() - start < seconds:
            index.uniform(e)
            count += 1
        uniform[f"{e:g}"] = {"per_s": count / (time.perf_counter() - start), "patches": len(found)}
    views = [_view(1.0, (0.3 + 0.05 * k) * SPAN_M, 0.4 * SPAN_M, 0.7 * k) for k in range(8)]
    counts = [len(index.view(view)) for view in views]
    ms = [1e3 * quickest(lambda view=view: index.view(view), 3 if quick else 20) for view in views]  # type: ignore[misc]
    return {
        "samples_a_side": _side(index),
        "uniform": uniform,
        "view_15km_1px": {"ms": float(np.mean(ms)), "ms_worst": max(ms), "patches": float(np.mean(counts))},
        "flight": {f"{v:g} m/s": _traffic(index, quick, speed=v) for v in SPEEDS},
        "rotation": {f"{w:g} deg/s": _traffic(index, quick, turn=w) for w in TURNS},
    }


def _side(index: Index) -> int:
    return len(index.model.placed[0].raster.heights)


def _view(pixels: float, x: float, y: float, heading: float) -> View:
    wide = math.atan(math.tan(FIELD_OF_VIEW / 2) * SCREEN[0] / SCREEN[1])
    return View((x, y), heading, wide, VIEW_M, query.slope(pixels, SCREEN[1], FIELD_OF_VIEW))


def _traffic(index: Index, quick: bool, speed: float = 0.0, turn: float = 0.0) -> dict[str, float]:
    """Bytes a frame at 25 frames a second and 3 px, as the paper counts them; the first view is not among them."""
    x, y, heading = 0.3 * SPAN_M, 0.45 * SPAN_M, 0.3
    before, sizes, patches = index.view(_view(3.0, x, y, heading)), [], []
    for _ in range(50 if quick else FRAMES):
        x, y = x + speed * FRAME_S * math.cos(heading), y + speed * FRAME_S * math.sin(heading)
        heading += math.radians(turn) * FRAME_S
        after = index.view(_view(3.0, x, y, heading))
        added, removed = query.difference(before, after)
        sizes.append(PATCH_BYTES * len(added) + REMOVAL_BYTES * len(removed))
        patches.append(len(after))
        before = after
    return {
        "bytes_a_frame": float(np.mean(sizes)),
        "p99": float(np.percentile(sizes, 99)),
        "patches": float(np.mean(patches)),
    }


def blending(index: Index, quick: bool) -> dict[str, Any]:
    """320,000 samples 20 m apart at a tolerance of 5 m, on all cores: compiled loops, and OpenCL where there is any."""
    rows, cols = EVALUATIONS
    r0, c0 = round(0.4 * SPAN_M / 20), round(0.6 * SPAN_M / 20)
    lattice = blend.Lattice(20.0, r0, r0 + rows, c0, c0 + cols)
    device = open_device()
    out: dict[str, Any] = {"samples": rows * cols, "device": None if device is None else device.name}
    for name, smooth in (("bilinear", False), ("bicubic", True)):
        chosen = index.uniform(5.0, lattice.rect())
        packed = blend.pack(index.model, chosen, smooth)
        repeats = 2 if quick else 15
        figures = {
            "patches": len(packed),
            "pack_ms": 1e3 * quickest(lambda s=smooth, i=chosen: blend.pack(index.model, i, s), repeats),  # type: ignore[misc]
            "compiled_ms": 1e3 * quickest(lambda p=packed: blend.evaluate(p, lattice), repeats),  # type: ignore[misc]
        }
        if device is not None:
            blend.evaluate(packed, lattice, device)
            figures["opencl_ms"] = 1e3 * quickest(lambda p=packed: blend.evaluate(p, lattice, device), repeats)  # type: ignore[misc]
        out[name] = figures
    return out


def adding(raster: Raster, quick: bool) -> dict[str, Any]:
    """A grid of 512 x 512 at 10 m, turned by 27 degrees, comes into a terrain of 65 km that has one of 4k."""
    half = (SPAN_M - DOMAIN_M) / 2
    old = space.build([whole(raster, (-half, -half))])
    before = Base(old, DOMAIN_M)
    for level in range(5):
        before.level(level)
    y, x = np.mgrid[0:512, 0:512]
    heights = (1500 + 300 * np.sin(x / 61) * np.cos(y / 47)).astype(np.float32)
    runs: list[dict[str, float]] = []
    for _ in range(1 if quick else 5):
        marks = [time.perf_counter()]
        fine = rasters.build(heights)
        marks.append(time.perf_counter())
        placed = layer_of(fine, "new", 10.0, (30_000.0, 20_000.0), rotation_deg=27.0, priority=1)
        model = old.with_(placed)
        marks.append(time.perf_counter())
        base = Base(model, DOMAIN_M, before)
        marks.append(time.perf_counter())
        for level in range(5):
            base.level(level)
        marks.append(time.perf_counter())
        names = ("raster_ms", "model_ms", "index_ms", "levels_0_to_4_ms")
        runs.append({name: 1e3 * (b - a) for name, a, b in zip(names, marks, marks[1:], strict=False)})
    best = {name: min(run[name] for run in runs) for name in runs[0]}
    return best | {"model_and_index_ms": best["model_ms"] + best["index_ms"], "total_ms": sum(best.values())}


def run(puget: Path | None, folder: Path, quick: bool) -> dict[str, Any]:
    """All of it, in ``folder``."""
    builds, place, four = build(folder, puget, quick)
    index = Index(space.build([whole(rasters.read(place))]))
    say("queries")
    asked = queries(index, quick)
    say("blending")
    blended = blending(index, quick)
    say("adding")
    added = adding(four, quick)
    say("GDAL")
    peer = gdal.measure(folder, four.heights, SPAN_M, None if quick else folder / f"{data.SIDES[2]}.npy", quick)
    return {
        "data": data.first(puget)[1], "quick": quick, "build": builds, "queries": asked, "blend": blended,
        "add": added, "gdal": peer, "paper": PAPER,
    }  # fmt: skip


def main(argv: list[str]) -> int:
    """``esker bench patchwork [--json] [--quick] [--puget FILE] [--work FOLDER]``."""
    parser = argparse.ArgumentParser(prog="esker bench patchwork", description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--json", action="store_true", help="print the result as JSON, indented")
    parser.add_argument("--quick", action="store_true", help="no 16k, one repetition: does it work?")
    parser.add_argument("--puget", type=Path, help="ps_height_1k.png of the Large Geometric Models Archive")
    parser.add_argument("--work", type=Path, help="where 3.5 GB of grids are made and kept")
    options = parser.parse_args(argv)
    machine = _serving.machine()
    folder = options.work or Path(tempfile.mkdtemp(prefix="esker-patchwork-"))
    folder.mkdir(parents=True, exist_ok=True)
    try:
        result = {"bench": "patchwork", "version": VERSION, "machine": machine} | run(
            options.puget, folder, options.quick
        )
    finally:
        if options.work is None:
            shutil.rmtree(folder, ignore_errors=True)
    sys.stdout.write(json.dumps(result, indent=1 if options.json else None) + "\n")
    return 0
