"""Which device solves, and what happens when there is none (SPEC S19)."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from esker import grid
from esker.contract import Channel
from esker.solve import device, pocl_cpu
from esker.solve.device import open_device
from esker.solve.faults import NoDeviceError
from esker.solve.solver import Solver
from tests.solver.scenes import ENDLESS, PINNED, SCENES, SETTINGS, SIZE


@pytest.mark.parametrize("settings", [SETTINGS, ENDLESS, PINNED], ids=["reach", "endless", "pinned"])
@pytest.mark.parametrize("scene", ["five", "loops", "cross"])
def test_numpy_gives_the_same(solver: Solver, scene: str, settings: object) -> None:
    assert isinstance(settings, type(SETTINGS))
    twin = Solver(device="numpy")
    a, b = solver.solve(SCENES[scene], settings, 2)[2], twin.solve(SCENES[scene], settings, 2)[2]
    error = np.abs(a - b)
    assert np.quantile(error, 0.99) < grid.quantum(2, SIZE)
    assert error.max() < 1e-3 * np.ptp(b), "beyond ties of the rasteriser"


def test_numpy_says_so() -> None:
    twin = Solver(device="NumPy")
    assert twin.device_name == "NumPy float64 (no OpenCL device)"
    results = [r for r in twin.steps(SCENES["one"], SETTINGS, 1) if r is not None and r.channel == Channel.HEIGHT]
    assert [r.level for r in results if r.settled] == [0, 1]
    assert results[-1].heights.dtype == np.float32
    assert twin.solve(SCENES["one"], SETTINGS, 1)[1].max() > 200
    assert not twin.solve([], SETTINGS, 1)[1].any()


def test_without_opencl_numpy_serves(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    def nothing() -> list[tuple[str, object]]:
        raise RuntimeError("no platform has a device")

    monkeypatch.setattr(device, "_devices", nothing)
    assert Solver().device_name.startswith("NumPy")
    assert "NumPy" in caplog.text
    with pytest.raises(NoDeviceError, match="numpy"):
        open_device("radeon")


def test_a_device_that_does_not_work_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(name: str, _: object) -> device.Device:
        raise RuntimeError(f"{name} is broken")

    monkeypatch.setattr(device, "_devices", lambda: [("Broken One", None)])
    monkeypatch.setattr(device, "_open", broken)
    assert open_device() is None
    with pytest.raises(NoDeviceError, match="does not work"):
        open_device("broken")


def test_a_missing_device_lists_what_there_is(device: device.Device) -> None:
    with pytest.raises(NoDeviceError) as error:
        Solver(device="no such thing")
    assert device.name in str(error.value)
    assert Solver(device=device.name[:8].upper()).device_name == device.name


def test_import_touches_no_device() -> None:
    """SPEC H4: importing the solver loads no OpenCL."""
    code = "import esker, esker.terrain, esker.solve.solver, sys; sys.exit('pyopencl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_cpu_level(tmp_path: Path) -> None:
    """The names that PoCL's compiler is given for processors that it does not know."""
    for flags, name in (
        ("fpu avx2 fma bmi2 f16c avx512f avx512bw avx512cd avx512dq avx512vl", "skylake-avx512"),
        ("fpu sse2 avx avx2 fma bmi2 f16c", "haswell"),
        ("fpu sse2", "x86-64"),
        ("fpu sse2 avx f16c", "sandybridge"),
        ("fpu sse2 avx avx2 fma bmi2 f16c avx512f avx512cd", None),
        ("fpu sse2 avx avx2", None),
        ("swp half thumb", None),
    ):
        info = tmp_path / "cpuinfo"
        info.write_text(f"processor : 0\nflags : {flags}\n\nprocessor : 1\nflags : other\n")
        assert pocl_cpu.cpu_level(info) == name


def test_what_pocl_compiles_is_kept_by_processor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S28: code for one processor is never found by another."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folders = []
    for level in ("skylake-avx512", "haswell"):
        monkeypatch.setattr(pocl_cpu, "cpu_level", lambda level=level: level)
        folders.append(pocl_cpu.cache_folder())
    assert len(set(folders)) == 2
    assert all(folder is not None and Path(folder).is_dir() for folder in folders)
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert pocl_cpu.cache_folder() is None


@pytest.mark.parametrize("given", [{}, {"POCL_CACHE_DIR": "/mine"}, {"POCL_KERNEL_CACHE": "1"}])
def test_pocl_is_set_up_unless_somebody_did(monkeypatch: pytest.MonkeyPatch, given: dict[str, str]) -> None:
    environment = {"HOME": "/nowhere"} | given
    monkeypatch.setattr("os.environ", environment)
    monkeypatch.setattr(device, "_devices", list)
    monkeypatch.setattr(pocl_cpu, "cache_folder", lambda: None)
    assert device.candidates(threads=3) == ["numpy"]
    assert environment["POCL_MAX_PTHREAD_COUNT"] == "3"
    assert environment.get("POCL_KERNEL_CACHE") == ("0" if not given else given.get("POCL_KERNEL_CACHE"))


def test_threads_change_nothing(solver: Solver) -> None:
    """SPEC S15: another process with two threads gives the same bits."""
    code = (
        "import sys, numpy as np; from esker.solve.solver import Solver; from tests.solver.scenes import *;"
        "h = Solver(threads=2).solve(SCENES['five'], SETTINGS, 2)[2]; sys.stdout.buffer.write(h.tobytes())"
    )
    root = Path(__file__).resolve().parents[2]
    out = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, cwd=root).stdout
    here = solver.solve(SCENES["five"], SETTINGS, 2)[2]
    assert np.array_equal(np.frombuffer(out, dtype=np.float32).reshape(here.shape), here)
