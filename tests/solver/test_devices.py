"""Which device solves, and what happens when there is none (SPEC S19)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from esker import grid
from esker.events import Preview, Settled
from esker.solve.opencl import device
from esker.solve.opencl.device import open_device
from esker.solve.opencl.faults import NoDeviceError
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
    results = [r for r in twin.steps(SCENES["one"], SETTINGS, 1) if isinstance(r, Preview | Settled)]
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
    code = "import esker, esker.api.terrain, esker.solve.solver, sys; sys.exit('pyopencl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_pocl_gets_its_threads_unless_somebody_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.environ", {"HOME": "/nowhere"})
    monkeypatch.setattr(device, "_devices", list)
    assert device.candidates(threads=3) == ["numpy"]
    assert os.environ["POCL_MAX_PTHREAD_COUNT"] == "3"


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
