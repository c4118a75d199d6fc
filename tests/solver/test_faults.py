"""Devices that fail: typed errors, and a solver that can be used afterwards (SPEC S23 to S25, S27)."""

from __future__ import annotations

import numpy as np
import pyopencl as cl
import pytest

from esker.solve.opencl import device as devices
from esker.solve.opencl import program_text, proof
from esker.solve.opencl.device import Device, candidates, open_device
from esker.solve.opencl.faults import (
    BuildError,
    DeviceError,
    DeviceLostError,
    NoDeviceError,
    OutOfDeviceMemoryError,
    classify,
    guarded,
)
from esker.solve.opencl.gpu_levels import GpuWorkspace
from esker.solve.opencl.levels import ClWorkspace
from esker.solve.solver import Solver
from tests.solver.failing import (
    BUILD_FAILURE,
    INVALID_VALUE,
    LOST,
    NO_MEMORY,
    OUT_OF_RESOURCES,
    STROKES,
    Failing,
    error,
    heights,
    held,
)
from tests.solver.scenes import SETTINGS


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (NO_MEMORY, OutOfDeviceMemoryError),
        (-6, OutOfDeviceMemoryError),
        (-61, OutOfDeviceMemoryError),
        (OUT_OF_RESOURCES, OutOfDeviceMemoryError),
        (-2, DeviceLostError),
        (LOST, DeviceLostError),
        (-9999, DeviceLostError),
        (BUILD_FAILURE, BuildError),
        (-46, BuildError),
        (INVALID_VALUE, DeviceError),
        (-54, DeviceError),
    ],
)
def test_codes(device: Device, monkeypatch: pytest.MonkeyPatch, code: int, kind: type[DeviceError]) -> None:
    """SPEC S24. The queue of this device lives, so "out of resources" can only mean memory."""
    monkeypatch.setattr(devices, "_opened", {device.name: device})
    found = classify(error(code), device)
    assert type(found) is kind
    assert found.device == device.name
    assert str(found).startswith(device.name)
    assert str(found).endswith(").")
    assert (device.name in devices._opened) == (kind is not DeviceLostError)


def test_other_errors_pass(device: Device) -> None:
    assert classify(ValueError("no"), device) is None
    with pytest.raises(ZeroDivisionError), guarded(device):
        raise ZeroDivisionError
    with pytest.raises(BuildError, match="mine"), guarded(device):
        raise BuildError("mine")


def test_out_of_resources_on_a_dead_queue_is_a_lost_device(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S24: drivers say "out of resources" to everything once a fault has killed the context."""
    monkeypatch.setattr(devices, "_opened", dict(devices._opened))
    monkeypatch.setattr(cl, "enqueue_copy", Failing(cl.enqueue_copy, OUT_OF_RESOURCES))
    assert isinstance(classify(error(OUT_OF_RESOURCES), device), DeviceLostError)
    assert device.name not in devices._opened, "the next opening makes a new context"


@pytest.mark.parametrize("after", [0, 3, 40])
@pytest.mark.parametrize(("code", "kind"), [(LOST, DeviceLostError), (INVALID_VALUE, DeviceError)])
def test_a_fault_in_the_middle_of_a_solve(
    fresh: Solver, monkeypatch: pytest.MonkeyPatch, after: int, code: int, kind: type[DeviceError]
) -> None:
    """SPEC S25: the error is typed, nothing of the failed solve is kept, the next one gives the same bits."""
    expected, before = heights(fresh), held(fresh)
    monkeypatch.setattr(devices, "_opened", dict(devices._opened))
    with monkeypatch.context() as patch:
        failing = Failing(cl.enqueue_nd_range_kernel, code, after)
        patch.setattr(cl, "enqueue_nd_range_kernel", failing)
        with pytest.raises(kind) as caught:
            heights(fresh) if after else fresh.solve(STROKES[1:], SETTINGS, 2)
    assert failing.calls == after + 1
    assert isinstance(caught.value.__cause__, cl.Error)
    assert fresh._pool.idle == []
    assert held(fresh) == 0, "even though the error, with its frames, is still here"
    assert np.array_equal(heights(fresh), expected)
    assert held(fresh) == before


def test_a_fault_while_reading(fresh: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S25: drivers report late, where somebody waits."""
    expected = heights(fresh)
    with monkeypatch.context() as patch:
        patch.setattr(devices, "_opened", dict(devices._opened))
        patch.setattr(cl, "enqueue_copy", Failing(cl.enqueue_copy, LOST, 1))
        with pytest.raises(DeviceLostError):
            heights(fresh)
    assert np.array_equal(heights(fresh), expected)


def test_build_failure(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    """SPEC S23: kernels that do not compile are a BuildError; without a wish NumPy serves."""
    monkeypatch.setattr(devices, "_opened", {})
    monkeypatch.setattr(program_text, "source", lambda _: "kernel void broken( { }")
    name = candidates()[0]
    if name == "numpy":
        pytest.skip("no OpenCL device")
    found = devices.listed(None)[0]
    with pytest.raises(BuildError, match=r"could not compile the solver's kernels \(.*error: .*\)\.$"):
        devices._open(*found)
    with pytest.raises(NoDeviceError, match="does not work"):
        open_device(name)
    assert Solver().device_name.startswith("NumPy")
    assert "could not compile" in caplog.text
    assert devices._opened == {}


def test_a_program_without_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program_text, "source", lambda _: "kernel void other(global float *a) { a[0] = 1.0f; }")
    with pytest.raises(BuildError, match="without kernels"):
        devices._open(*devices.listed(None)[0])


def test_no_platform(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    """SPEC S19, S23: OpenCL without any platform, and none at all."""
    monkeypatch.setattr(devices, "_opened", {})
    for failure in (list, Failing(cl.get_platforms, -1001)):
        caplog.clear()
        monkeypatch.setattr(cl, "get_platforms", failure)
        assert candidates() == ["numpy"]
        assert Solver().device_name.startswith("NumPy")
        assert "NumPy" in caplog.text
        with pytest.raises(NoDeviceError, match="numpy"):
            Solver(device="pocl")


def test_a_device_that_computes_nonsense_is_not_used(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """SPEC S27."""
    monkeypatch.setattr(devices, "_opened", {})
    for workspace in (ClWorkspace, GpuWorkspace):
        monkeypatch.setattr(workspace, "guide", lambda *_: None)
    assert Solver().device_name.startswith("NumPy")
    assert "computes another ground than NumPy" in caplog.text


def test_proof() -> None:
    """SPEC S27: NaN is no proof."""
    device = Device("it", None, None, None, 1)
    twin = np.ones((3, 3), dtype=np.float32)
    twin[1, 1] = 100
    proof.compare(device, twin + 0.05, twin)
    for wrong in (twin + 0.2, np.full_like(twin, np.nan)):
        with pytest.raises(DeviceError, match="another ground"):
            proof.compare(device, wrong, twin)
