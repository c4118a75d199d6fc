"""Conversion of large GeoTIFF files in the process that reads them, with its bounds (docs/importing.md).

``esker bench importing --json``. Float32 GeoTIFFs of 1,025, 4,097 and 14,000 samples a side (the last is the largest
square that may be declared), compressed with deflate and predictor 3, in tiles of 512 and in strips of one row: seconds
to inspect and to convert by the clock and of processor time, bytes and samples a second, greatest memory of the process
(``anonymous``: its own; ``resident``: with pages of mapped files, which the system takes back), greatest disk in the
work folder beside the file, how many steps of progress came and the longest silence between two, and how long a
cancelled conversion takes to be gone in each stage (of striped files only while it reads: the rest is the same work).
Heights: ``_patchwork_data``. ``--quick``: no 14,000.

What was measured is kept in ``--work`` after each file. When it is stopped (Ctrl-C, a signal to end), or once
``--minutes`` are over before the next file, it prints what it has, names what is ``left_out`` and ends with status 1;
the same command then goes on where it was. A whole run leaves files of heights there, for the next, and nothing else.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import resource
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Coroutine
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil
import rasterio
from rasterio.transform import Affine
from rasterio.windows import Window

from bench.ground import _patchwork_data as data
from bench.room import _serving
from esker import contract as c
from esker.importing import run
from esker.version import VERSION

SIDES: Final = (1025, 4097, 14_000)
LAYOUTS: Final[dict[str, dict[str, Any]]] = {
    "tiled": {"tiled": True, "blockxsize": 512, "blockysize": 512},
    "striped": {"tiled": False, "blockysize": 1},
}
SPAN_M: Final = 56_000.0
"""Side of all grids on the ground: 4 m at 14,000 samples."""
PLACE: Final = c.Place(lat_deg=46.85, lon_deg=-121.75)
"""In UTM zone 10 and off its meridian, so that the grid is turned and gets a net."""
CORNER: Final = (570_000.0, 5_220_000.0)
SIZE_M: Final = 65_536.0
STAGES: Final[tuple[c.ImportStage, ...]] = ("reading", "mipmaps", "errors")
EVERY_S: Final = 0.02
STEPS_A_METRE: Final = 8
"""Heights are rounded to so many steps: in decimetres, which are no sums of powers of two, 14,000 x 14,000 samples
would be 3 % more than may be uploaded."""
BAND: Final = 512
"""Rows that are written at a time."""
MINUTES: Final = 8.0
KEPT: Final = "measured.json"
Result = dict[str, dict[str, Any]]
"""Results by samples a side, then by layout."""


def say(text: str) -> None:
    """Progress, for people, beside the result."""
    print(time.strftime("%H:%M:%S"), text, file=sys.stderr, flush=True)


def make(side: int, layout: str, folder: Path, puget: Path | None) -> Path:
    """A GeoTIFF of ``side`` x ``side`` float32 heights; kept ones are taken."""
    path = folder / f"{side}-{layout}.tif"
    if path.exists():
        return path
    heights = np.load(data.make(next(n for n in data.SIDES if n >= side), folder, puget), mmap_mode="r")
    step = SPAN_M / (side - 1)
    partial = path.with_suffix(".part")
    with rasterio.open(
        partial, "w", driver="GTiff", width=side, height=side, count=1, dtype="float32", crs="EPSG:32610",
        transform=Affine(step, 0.0, CORNER[0] - step / 2, 0.0, -step, CORNER[1] + step / 2),
        compress="deflate", predictor=3, zlevel=6, num_threads="all_cpus", **LAYOUTS[layout],
    ) as out:  # fmt: skip
        for top in range(0, side, BAND):
            rows = np.asarray(heights[side - min(top + BAND, side) : side - top, :side])[::-1]
            out.write(
                np.rint(rows * np.float32(STEPS_A_METRE)) / np.float32(STEPS_A_METRE),
                1,
                window=Window(0, top, side, len(rows)),
            )
    partial.rename(path)
    return path


class Watch(threading.Thread):
    """Greatest memory of the processes that read, and greatest disk of a folder, while it runs."""

    def __init__(self, folder: Path) -> None:
        super().__init__(daemon=True)
        self._folder, self._over = folder, threading.Event()
        self.most = {"RssAnon": 0.0, "VmRSS": 0.0, "disk": 0.0}

    def run(self) -> None:
        """Looks every ``EVERY_S``; at the disk less often."""
        us, count, reader = psutil.Process(), 0, None
        while not self._over.wait(EVERY_S):
            if reader is None or not reader.is_running():
                reader = next((p for p in us.children() if _reads(p)), None)
            if reader is not None:
                self._memory(reader.pid)
            if count % 10 == 0:
                self.most["disk"] = max(self.most["disk"], _disk(self._folder))
            count += 1

    def _memory(self, pid: int) -> None:
        try:
            lines = Path(f"/proc/{pid}/status").read_text().splitlines()
        except OSError:  # it has just ended
            return
        for line in lines:
            name, _, value = line.partition(":")
            if name in self.most:
                self.most[name] = max(self.most[name], int(value.split()[0]) / 1024)

    def stop(self) -> dict[str, float]:
        """Ends it."""
        self._over.set()
        self.join()
        self.most["disk"] = max(self.most["disk"], _disk(self._folder))
        return {
            "anonymous_mib": self.most["RssAnon"],
            "resident_mib": self.most["VmRSS"],
            "disk_mib": self.most["disk"],
        }


def _reads(process: psutil.Process) -> bool:
    try:
        return "esker.importing" in process.cmdline()
    except psutil.Error:
        return False


def _disk(folder: Path) -> float:
    """MiB that the files in a folder really take."""
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_blocks * 512
        except OSError:  # it has gone meanwhile
            continue
    return total / 2**20


class Steps:
    """What a conversion says of its progress, and when."""

    def __init__(self) -> None:
        self.count = 0
        self.silence_s = 0.0
        self.seconds: dict[str, float] = {}
        self._stage, self._last = "starting", time.perf_counter()

    def __call__(self, stage: c.ImportStage, _share: float) -> None:
        """Notes a step. ``run.convert`` calls it."""
        self._to(stage)
        self.count += 1

    def end(self) -> dict[str, Any]:
        """Ends the record and returns it."""
        self._to("end")
        return {"steps": self.count, "longest_silence_s": self.silence_s, "stages_s": self.seconds}

    def _to(self, stage: str) -> None:
        now = time.perf_counter()
        passed = now - self._last
        self.silence_s = max(self.silence_s, passed)
        self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + passed
        self._stage, self._last = stage, now


def timed(work: Coroutine[Any, Any, Any], samples: int, file_bytes: int, folder: Path) -> dict[str, Any]:
    """Runs one task of the reader: seconds, rates, memory and disk."""
    watch = Watch(folder)
    watch.start()
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    try:
        asyncio.run(work)
    finally:
        seconds = time.perf_counter() - start
        most = watch.stop()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {
        "s": seconds, "cpu_s": cpu_s, "samples_per_s": samples / seconds, "file_bytes_per_s": file_bytes / seconds,
        "raw_bytes_per_s": 4 * samples / seconds, **most,
    }  # fmt: skip


async def inspected(path: Path) -> None:
    """An inspection that finds nothing to ask. Raises RuntimeError."""
    report = await run.inspect(path, path.name, place=PLACE, size_m=SIZE_M)
    if report.verdict != "good":
        raise RuntimeError(f"{path.name}: {report.verdict}: {report.refusal or report.questions}")


async def cancelled(path: Path, out: Path, stage: c.ImportStage) -> float:
    """Seconds from asking a conversion to stop, halfway through ``stage``, until its process and files are gone."""
    cancel, asked = asyncio.Event(), [0.0]

    def progress(now: c.ImportStage, _share: float) -> None:
        if now == stage and not cancel.is_set():
            asked[0] = time.perf_counter()
            cancel.set()

    try:
        await run.convert(path, c.ImportAnswers(), PLACE, SIZE_M, out, progress, cancel)
    except run.ImportCancelled:
        if out.exists() or not asked[0]:
            raise RuntimeError("a cancelled conversion left something") from None
        return time.perf_counter() - asked[0]
    raise RuntimeError("it was over before it could be cancelled")


def measure(side: int, layout: str, folder: Path, puget: Path | None) -> dict[str, Any]:
    """One file: inspected, converted, cancelled."""
    path = make(side, layout, folder, puget)
    size, samples = path.stat().st_size, side * side
    work = folder / "work"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    inspection = timed(inspected(path), samples, size, work)
    steps = Steps()
    out = work / "raster"
    conversion = timed(
        run.convert(path, c.ImportAnswers(), PLACE, SIZE_M, out, steps), samples, size, work
    ) | steps.end()  # fmt: skip
    conversion["raster_bytes"] = sum(file.stat().st_size for file in out.iterdir())
    shutil.rmtree(out)
    stages = () if side == SIDES[0] else STAGES if layout == "tiled" else STAGES[:1]
    stops = {stage: asyncio.run(cancelled(path, out, stage)) for stage in stages}
    shutil.rmtree(work)
    say(f"{side} {layout}: {inspection['s']:.1f} s + {conversion['s']:.1f} s, {conversion['anonymous_mib']:.0f} MiB")
    return {
        "file_bytes": size, "file_may_be_uploaded": size <= c.MAX_GRID_BYTES, "samples": samples,
        "inspect": inspection, "convert": conversion, "cancel_s": stops,
    }  # fmt: skip


def kept(folder: Path, what: dict[str, Any]) -> Result:
    """Returns what a run that was stopped has measured of ``what`` (version, machine, data); nothing of anything
    else."""
    try:
        found = json.loads((folder / KEPT).read_text())
    except (OSError, ValueError):
        return {}
    return found["files"] if found.get("what") == what else {}


def keep(folder: Path, what: dict[str, Any], files: Result) -> None:
    """Writes what ``kept`` reads, whole or not at all."""
    partial = folder / f"{KEPT}.part"
    partial.write_text(json.dumps({"what": what, "files": files}))
    partial.replace(folder / KEPT)


def run_all(sides: tuple[int, ...], folder: Path, puget: Path | None, minutes: float) -> tuple[Result, list[str]]:
    """Returns what is measured, and what is left out: for want of time, or because somebody stopped it."""
    what = {"version": VERSION, "cpu": _serving.machine()["cpu"], "data": data.first(puget)[1]}
    found, until = kept(folder, what), time.monotonic() + 60 * minutes
    wanted = [(side, layout) for side in sides for layout in LAYOUTS]
    stopped = False
    for side, layout in wanted:
        if stopped or layout in found.get(str(side), {}):
            continue
        if time.monotonic() > until:
            break
        try:
            measured = measure(side, layout, folder, puget)
        except KeyboardInterrupt:
            say("stopped")
            stopped = True
            continue
        finally:
            shutil.rmtree(folder / "work", ignore_errors=True)
        found.setdefault(str(side), {})[layout] = measured
        keep(folder, what, found)
    left = [f"{side} {layout}" for side, layout in wanted if layout not in found.get(str(side), {})]
    if not left:
        (folder / KEPT).unlink(missing_ok=True)
    return {str(side): found[str(side)] for side in sides if str(side) in found}, left


def _interrupt(_signal: int, _frame: object) -> None:
    """A signal to end is Ctrl-C."""
    raise KeyboardInterrupt


def main(argv: list[str]) -> int:
    """``esker bench importing [--json] [--quick] [--minutes N] [--puget FILE] [--work FOLDER]``."""
    parser = argparse.ArgumentParser(prog="esker bench importing", description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--json", action="store_true", help="print the result as JSON, indented")
    parser.add_argument("--quick", action="store_true", help="no 14,000: does it work?")
    parser.add_argument("--side", type=int, choices=SIDES, help="only this one")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="no file is begun after so many")
    parser.add_argument("--puget", type=Path, help="ps_height_1k.png of the Large Geometric Models Archive")
    parser.add_argument("--work", type=Path, help="where 4 GB of grids and files are made and kept")
    options = parser.parse_args(argv)
    before = signal.signal(signal.SIGTERM, _interrupt)
    machine = _serving.machine()
    folder = options.work or Path(tempfile.mkdtemp(prefix="esker-importing-"))
    folder.mkdir(parents=True, exist_ok=True)
    sides = (options.side,) if options.side else SIDES[: 2 if options.quick else 3]
    try:
        files, left = run_all(sides, folder, options.puget, options.minutes)
    finally:
        signal.signal(signal.SIGTERM, before)
        if options.work is None:
            shutil.rmtree(folder, ignore_errors=True)
    result = {"bench": "importing", "version": VERSION, "machine": machine, "data": data.first(options.puget)[1],
              "quick": options.quick, "files": files, "left_out": left}  # fmt: skip
    sys.stdout.write(json.dumps(result, indent=1 if options.json else None) + "\n")
    return 1 if left else 0
