"""The process that reads: bounds, cancelling, progress, and what is left when it ends badly (SPEC G30 to G33)."""

from __future__ import annotations

import asyncio
import io
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from esker import contract as c
from esker.api import uploads
from esker.importing import limits, run, wire
from esker.patchwork.raster import rasters
from tests.importing import make_files
from tests.importing.conftest import PLACE, SIZE_M


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """196 million samples in a few kilobytes: reading them takes seconds."""
    path = tmp_path_factory.mktemp("large") / "large.tif"
    make_files.sparse_legal(path)
    return path


def readers() -> list[psutil.Process]:
    """Processes of ours that read files."""
    found = []
    for child in psutil.Process().children(recursive=True):
        try:
            if "esker.importing" in child.cmdline() and child.status() != psutil.STATUS_ZOMBIE:
                found.append(child)
        except psutil.NoSuchProcess:
            continue
    return found


def test_convert_and_progress(files: Path, tmp_path: Path) -> None:
    """SPEC G33: a whole raster at its digest, nothing else beside it, progress that never falls."""
    steps: list[tuple[str, float]] = []
    out = tmp_path / "raster"
    layer = asyncio.run(
        run.convert(
            files / "little.tif",
            c.ImportAnswers(),
            PLACE,
            SIZE_M,
            out,
            lambda s, x: steps.append((s, x)),
            name="Hill.tif",
        )
    )
    assert rasters.read(out).digest == layer.content
    assert (layer.name, layer.facts.file) == ("Hill", "Hill.tif")
    assert os.listdir(tmp_path) == ["raster"]
    shares = [share for _, share in steps]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    stages = list(dict.fromkeys(stage for stage, _ in steps))
    assert stages == ["reading", "mipmaps", "errors", "saving"]


def test_refused_conversion_leaves_nothing(files: Path, tmp_path: Path) -> None:
    """SPEC G31."""
    with pytest.raises(run.ImportRefused, match="data are broken"):
        asyncio.run(run.convert(files / "corrupt.tif", c.ImportAnswers(), PLACE, SIZE_M, tmp_path / "raster"))
    assert os.listdir(tmp_path) == []
    assert readers() == []


@pytest.mark.parametrize("how", ["event", "task"])
def test_cancel(how: str, large: Path, tmp_path: Path) -> None:
    """SPEC G31: at once, with nothing left, neither files nor a process."""

    async def cancelled() -> float:
        cancel, running = asyncio.Event(), asyncio.Event()
        work = asyncio.create_task(
            run.convert(
                large, c.ImportAnswers(answers={"place": "middle"}), None, SIZE_M, tmp_path / "raster",
                lambda *_: running.set(), cancel,
            )
        )  # fmt: skip
        await asyncio.wait_for(running.wait(), 60)
        assert readers()
        start = time.monotonic()
        if how == "event":
            cancel.set()
        else:
            work.cancel()
        with pytest.raises(run.ImportCancelled if how == "event" else asyncio.CancelledError):
            await work
        return time.monotonic() - start

    assert asyncio.run(cancelled()) < 5.0
    assert os.listdir(tmp_path) == []
    assert readers() == []


def test_too_long(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC G30: the wall clock."""
    monkeypatch.setitem(limits.WALL_SECONDS, "inspect", 0.3)
    report = asyncio.run(run.inspect(large, "large.tif"))
    assert (report.verdict, report.refusal) == ("refused", "Reading it took too long.")
    assert readers() == []


@pytest.mark.parametrize("program", ["/bin/false", "/bin/cat", "/bin/yes"])
def test_a_reader_that_dies_or_talks_nonsense(program: str, files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC G30: a sentence in any case."""
    monkeypatch.setattr(sys, "executable", program)
    report = asyncio.run(run.inspect(files / "little.tif", "little.tif"))
    assert (report.verdict, report.refusal) == ("refused", run.STOPPED)


def test_a_reader_that_is_killed(large: Path) -> None:
    """SPEC G30: by whatever, for instance for memory."""

    async def killed() -> c.ImportReport:
        started = asyncio.Event()
        work = asyncio.create_task(run.inspect(large, "large.tif", on_progress=lambda *_: started.set()))
        await asyncio.wait_for(started.wait(), 60)
        for reader in readers():
            reader.send_signal(signal.SIGKILL)
        return await work

    assert asyncio.run(killed()).refusal == run.STOPPED


def test_memory_is_bounded() -> None:
    """SPEC G30: more than 1 GiB of its own is not to be had."""
    code = (
        "from esker.importing import limits; limits.apply('convert'); import numpy\n"
        "numpy.ones(60_000_000)\n"
        "try: numpy.ones(140_000_000)\n"
        "except MemoryError: print('bounded')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=limits.environment())
    assert done.stdout == "bounded\n", done.stderr


def test_it_ends_with_its_parent(large: Path) -> None:
    """SPEC G32: when its stdin ends, so does it."""
    task = wire.Task(task="inspect", path=str(large), name="large.tif", workdir="/nonexistent")
    with subprocess.Popen(
        [sys.executable, "-m", "esker.importing"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=limits.environment(),
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(task.model_dump_json().encode() + b"\n")
        process.stdin.flush()
        assert b"reading" in process.stdout.readline()
        process.stdin.close()
        assert process.wait(5) == 9


def test_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC G32."""
    monkeypatch.setenv("ESKER_SECRET", "x")
    monkeypatch.setenv("GDAL_DRIVER_PATH", "/tmp")
    found = limits.environment()
    assert "ESKER_SECRET" not in found
    assert found["GDAL_DRIVER_PATH"] == "disable"


def test_the_server_side_loads_no_reader() -> None:
    """Neither GDAL nor PROJ is ever in the server's own process."""
    code = "import sys, esker.importing.run; assert not {'rasterio', 'pyproj', 'numba'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("width", "height", "turn", "size"),
    [(1000.0, 500.0, 0.0, 1000.0), (1001.0, 500.0, 0.0, 1010.0), (1000.0, 1000.0, 45.0, 1420.0), (5.0, 5.0, 0.0, 64.0),
     (4e5, 4e5, 0.0, 65536.0), (65520.0, 100.0, 0.0, 65536.0)],
)  # fmt: skip
def test_size_of_a_terrain_made_from_a_file(width: float, height: float, turn: float, size: float) -> None:
    report = c.ImportReport(verdict="good", file="a", width_m=width, height_m=height, rotation_deg=turn)
    assert run.suggest_size(report) == size


def test_a_terrain_made_from_a_file_grows_for_its_heights() -> None:
    """SPEC G14: up to twice; where that is not enough, it is asked about."""
    report = c.ImportReport(verdict="good", file="a", width_m=400.0, height_m=400.0, low_m=0.0, high_m=2500.0)
    assert run.suggest_size(report) == 500.0
    assert run.suggest_size(report.model_copy(update={"high_m": 5000.0})) == 400.0


def test_place_of_a_terrain_made_from_a_file() -> None:
    report = c.ImportReport(verdict="good", file="a", at=(46.2, -122.2))
    assert run.suggest_place(report) == c.Place(lat_deg=46.2, lon_deg=-122.2)
    assert run.suggest_place(c.ImportReport(verdict="good", file="a")) is None


def test_a_full_disk_is_told(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC G31: a reader that ends where the disk is full was not stopped by its file; nothing is left."""
    monkeypatch.setattr(shutil, "disk_usage", lambda _path: shutil._ntuple_diskusage(1 << 30, 1 << 30, 0))
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(run.ImportRefused, match="no room"):
        asyncio.run(run.convert(files / "little.tif", c.ImportAnswers(), PLACE, SIZE_M, tmp_path / "raster"))
    assert os.listdir(tmp_path) == []


def test_a_file_that_changes_while_it_is_sent() -> None:
    """SPEC G30: one that grows is sent as long as it was, one that shrinks is an error at once, not a wait."""
    seen: list[int] = []
    grown = uploads._CountedBody(io.BytesIO(b"12345678"), 5, seen.append)
    assert (grown.read(4), grown.read(4), grown.read(4)) == (b"1234", b"5", b"")
    assert seen[:2] == [4, 5]
    shrunk = uploads._CountedBody(io.BytesIO(b"123"), 5, seen.append)
    assert shrunk.read(4) == b"123"
    with pytest.raises(OSError, match="shorter"):
        shrunk.read(4)
