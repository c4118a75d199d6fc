"""Exports: what each kind of file costs, and whether drawing waits for one (docs/exporting.md).

``files``: processor time of all threads, the solve included, and bytes of each kind of file of a starting terrain.
``memory``: the most that the process of an export holds, of the largest files of drawn and of real ground.
``drawing``: the latencies of ``esker bench stream`` on a terrain of a server, alone and while the same server makes the
largest export of another terrain, in turns; each is the median of the rounds.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import Any, Final

import psutil

from bench.room import _serving, stream
from esker import templates
from esker.api.terrain import Terrain
from esker.contract import ExportRequest
from esker.exporting import wire
from esker.exporting.formats import FORMATS, export
from esker.exporting.ground import Extent
from esker.patchwork.raster import rasters
from esker.solve.solver import Solver
from esker.version import VERSION

SCENE: Final = "alpine-ridge"
WANTED: Final = {"format": "png16", "samples": 4097, "detail": True}
LARGEST: Final[tuple[tuple[str, dict[str, Any]], ...]] = tuple(
    (scene, {"format": kind, "samples": samples, "detail": detail})
    for scene in (SCENE, "rainier")
    for kind, samples, detail in (
        ("png16", 4097, False),
        ("png16", 4097, True),
        ("geotiff", 4033, True),
        ("masks", 4097, True),
        ("glb", 1025, True),
        ("map_pdf", 2049, True),
        ("stl", 1025, True),
    )
)
LOOK_SECONDS: Final = 0.02
SHOWN: Final = ("first_coarse_tile_ms", "level_4_preview_ms")


def measure_files(solver: Solver, sizes: list[int]) -> dict[str, Any]:
    """Returns processor seconds, bytes, and bytes a sample of each kind and size, with and without detail."""
    out: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(prefix="esker-bench-") as folder:
        for samples in sizes:
            for kind, form in FORMATS.items():
                for detail in (False, True):
                    if samples > form.most or (form.covers and not detail):
                        continue
                    terrain = Terrain.from_document(templates.load(SCENE).document, solver=solver)
                    path = Path(folder) / f"a{form.suffixes[0]}"
                    began = time.process_time()
                    export(terrain, path, kind, Extent.of(None, samples), detail=detail, step=lambda *_: None)
                    size = path.stat().st_size
                    out[f"{kind}_{samples}{'_detail' if detail else ''}"] = {
                        "cpu_s": round(time.process_time() - began, 2),
                        "bytes": size,
                        "bytes_per_sample": round(size / samples**2, 2),
                    }
    return out


def measure_memory(wanted: tuple[tuple[str, dict[str, Any]], ...] = LARGEST) -> dict[str, Any]:
    """Returns the most memory, MiB, and the seconds of the process that makes each file, as a server starts it."""
    out: dict[str, Any] = {}
    for scene, asked in wanted:
        with tempfile.TemporaryDirectory(prefix="esker-bench-") as folder:
            grids, template = Path(folder) / "grids", templates.load(scene)
            for content, raster in template.rasters().items():
                rasters.write(grids / content, raster)
            (Path(folder) / "made").mkdir()
            task = wire.Task(
                document=template.document,
                wanted=ExportRequest.model_validate(asked),
                grids=str(grids),
                folder=str(Path(folder) / "made"),
                name="a",
            )
            took, most, last = asyncio.run(_watched(wire.task_line(task)))
        if not isinstance(last, wire.Made):
            raise RuntimeError(f"{scene}, {asked}: {last}")
        detail = "_detail" if asked["detail"] else ""
        name = f"{scene}_{asked['format']}_{asked['samples']}{detail}"
        out[name] = {"memory_mib": most >> 20, "s": round(took, 1)}
    return out


async def _watched(line: str) -> tuple[float, int, Any]:
    """Runs the process of one export: seconds, most bytes resident, and what it said last."""
    began, most = time.monotonic(), 0
    child = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "esker.api.export_child",
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert child.stdin is not None
    assert child.stdout is not None
    child.stdin.write(line.encode() + b"\n")
    said = asyncio.create_task(child.stdout.read())
    watched = psutil.Process(child.pid)
    while not said.done():
        with suppress(psutil.Error):
            most = max(most, watched.memory_info().rss)
        await asyncio.sleep(LOOK_SECONDS)
    await child.wait()
    lines = (await said).splitlines()
    return time.monotonic() - began, most, wire.LINE.validate_json(lines[-1]) if lines else None


@contextmanager
def exporting(base: str, terrain: str, secret: str) -> Iterator[list[str]]:
    """Has the server make one export after the other; gives the names of those that came to their end."""
    stop, done = threading.Event(), []

    def ask(method: str, path: str, body: Any = None) -> Any:
        headers = {"Authorization": f"Bearer {secret}", "Content-Type": "application/json"}
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"{base}/api/terrains/{terrain}{path}", data, headers, method=method)
        with urllib.request.urlopen(request, timeout=30) as answer:
            return json.loads(answer.read() or b"null")

    def work() -> None:
        while not stop.is_set():
            job = ask("POST", "/exports", WANTED)["id"]
            while not stop.wait(0.2) and (answer := ask("GET", f"/exports/{job}"))["stage"] not in ("done", "failed"):
                pass
            if stop.is_set():
                ask("DELETE", f"/exports/{job}")
            else:
                done.append(f"{answer['stage']} {answer['file']}")

    worker = threading.Thread(target=work)
    worker.start()
    try:
        time.sleep(4.0)  # until it computes
        yield done
    finally:
        stop.set()
        worker.join()


def measure_drawing(rounds: int, appends: int) -> dict[str, Any]:
    """Medians of p50 and p99 over the rounds, alone and beside an export."""
    found: dict[str, list[dict[str, Any]]] = {"alone": [], "exporting": []}
    for _ in range(rounds):
        with _serving.server() as base:
            other = _serving.upload(base, templates.load(SCENE).document)
            found["alone"].append(asyncio.run(stream._draw(base, *_serving.upload(base, stream.fifty()), appends)))
            with exporting(base, *other):
                drawn = asyncio.run(stream._draw(base, *_serving.upload(base, stream.fifty()), appends))
            found["exporting"].append(drawn)
    return {
        name: {
            f"{how}.{what}": {q: round(median(r[how][what][q] for r in runs), 1) for q in ("p50", "p99")}
            for how in ("at_rest", "drawing")
            for what in SHOWN
        }
        for name, runs in found.items()
    }


def main(argv: list[str]) -> int:
    """``esker bench export [--json] [--samples N ...] [--rounds N] [--appends N]``."""
    parser = argparse.ArgumentParser(prog="esker bench export", description=__doc__)
    parser.add_argument("--samples", type=int, action="append", help="default: 1025, 2049, 4097")
    parser.add_argument("--rounds", type=int, default=3, help="of drawing; 0: only the files")
    parser.add_argument("--appends", type=int, default=40)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    arguments = parser.parse_args(argv)
    solver = Solver()
    result: dict[str, Any] = {
        "bench": "export",
        "version": VERSION,
        "machine": _serving.machine(solver.device_name),
        "scene": SCENE,
        "files": measure_files(solver, arguments.samples or [1025, 2049, 4097]),
    }
    if not arguments.samples:
        result["memory"] = measure_memory()
    if arguments.rounds:
        result["drawing"] = measure_drawing(arguments.rounds, arguments.appends)
    if arguments.json:
        sys.stdout.write(json.dumps(result, indent=1) + "\n")
    else:
        for part in ("files", "memory", "drawing"):
            for key, value in result.get(part, {}).items():
                sys.stdout.write(f"{part}.{key}: {value}\n")
    return 0
