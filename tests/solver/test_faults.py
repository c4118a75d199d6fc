"""Devices that fail: typed errors, and a solver that can be used afterwards (SPEC S23 to S26).

Faults are pyopencl's own exceptions, raised by its functions instead of what they do.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from esker import grid
from esker.contract import MAX_LEVEL
from esker.solve import device as devices
from esker.solve import proof, workspaces
from esker.solve.device import Device, candidates, open_device, row_kernels
from esker.solve.faults import (
    BuildError,
    DeviceError,
    DeviceLostError,
    NoDeviceError,
    OutOfDeviceMemoryError,
    classify,
    guarded,
)
from esker.solve.gpu_levels import GpuWorkspace
from esker.solve.levels import ClWorkspace
from esker.solve.solver import SPARE_SECONDS, Solver
from tests.solver.bases import Analytic, hills
from tests.solver.scenes import SCENES, SETTINGS

ROOT = Path(__file__).resolve().parents[2]
STROKES = SCENES["five"]
NO_MEMORY, OUT_OF_RESOURCES, BUILD_FAILURE, LOST, INVALID_VALUE = -4, -5, -11, -36, -30


def error(code: int, routine: str = "clEnqueueNDRangeKernel") -> cl.Error:
    """What pyopencl raises for a code of OpenCL."""
    kind = cl.MemoryError if code == NO_MEMORY else cl.LogicError if code <= INVALID_VALUE else cl.RuntimeError
    return kind(cl._cl._ErrorRecord(msg="injected", code=code, routine=routine))


class Failing:
    """A function of pyopencl that works ``after`` times and then raises ``code``, ``times`` times."""

    def __init__(self, real: Callable[..., Any], code: int, after: int = 0, times: int = 1 << 30) -> None:
        self.real, self.code, self.after, self.times, self.calls = real, code, after, times, 0

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        self.calls += 1
        if self.after < self.calls <= self.after + self.times:
            raise error(self.code)
        return self.real(*args, **kwargs)


@pytest.fixture(params=["rows", "tiles"])
def used(request: pytest.FixtureRequest) -> Solver:
    """A solver that has solved, with an idle workspace of level 2, on a device of a name of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ESKER_KERNELS", request.param)
        made = Solver()
    if made._device is None:
        pytest.skip("no OpenCL device")
    made._device = replace(made._device, name=f"{request.param} under test")
    made.solve(STROKES, SETTINGS, 2)
    return made


def held(solver: Solver) -> int:
    assert solver._device is not None
    gc.collect()
    return workspaces.held_bytes(solver._device)


def heights(solver: Solver, level: int = 2) -> np.ndarray:
    return solver.solve(STROKES, SETTINGS, level)[level]


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
    used: Solver, monkeypatch: pytest.MonkeyPatch, after: int, code: int, kind: type[DeviceError]
) -> None:
    """SPEC S25: the error is typed, nothing of the failed solve is kept, the next one gives the same bits."""
    expected, before = heights(used), held(used)
    monkeypatch.setattr(devices, "_opened", dict(devices._opened))
    with monkeypatch.context() as patch:
        failing = Failing(cl.enqueue_nd_range_kernel, code, after)
        patch.setattr(cl, "enqueue_nd_range_kernel", failing)
        with pytest.raises(kind) as caught:
            heights(used) if after else used.solve(STROKES[1:], SETTINGS, 2)
    assert failing.calls == after + 1
    assert isinstance(caught.value.__cause__, cl.Error)
    assert used._spare == []
    assert held(used) == 0, "even though the error, with its frames, is still here"
    assert np.array_equal(heights(used), expected)
    assert held(used) == before


def test_a_fault_while_reading(used: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S25: drivers report late, where somebody waits."""
    expected = heights(used)
    with monkeypatch.context() as patch:
        patch.setattr(devices, "_opened", dict(devices._opened))
        patch.setattr(cl, "enqueue_copy", Failing(cl.enqueue_copy, LOST, 1))
        with pytest.raises(DeviceLostError):
            heights(used)
    assert np.array_equal(heights(used), expected)


def test_idle_workspaces_make_room(used: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S26: out of memory once, with idle workspaces around: they are dropped and the solve succeeds."""
    expected = heights(used, 1)
    assert len(used._spare) == 2
    used._spare = [w for w in used._spare if w.top == 2]
    with monkeypatch.context() as patch:
        failing = Failing(cl.Buffer, NO_MEMORY, after=9, times=1)
        patch.setattr(cl, "Buffer", failing)
        assert np.array_equal(heights(used, 1), expected)
    assert failing.calls > 10
    assert [w.top for w in used._spare] == [1]


def test_workspaces_that_nobody_uses_are_given_back(used: Solver) -> None:
    """SPEC S30: those idle for long go, with their memory; the next solve gives the same bits."""
    expected = heights(used, 1)
    before = held(used)
    assert used.tidy() == 0
    assert held(used) == before > 0
    later = time.monotonic() + SPARE_SECONDS + 1
    used._idle_since[used._spare[0]] = later
    assert used.tidy(later) == 1
    assert 0 < held(used) < before
    assert used.tidy(2 * later) == 1
    assert held(used) == 0
    assert np.array_equal(heights(used, 1), expected)


def test_out_of_memory_in_the_middle_of_a_solve(used: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S26: many drivers allocate when a kernel first touches a buffer. Tried again while there is what to drop."""
    expected = heights(used)
    run = used.steps(STROKES, SETTINGS, 1)
    next(run)  # keeps a workspace of its own, so that there is an idle one beside that of the solve that fails
    with monkeypatch.context() as patch:
        failing = Failing(cl.enqueue_nd_range_kernel, NO_MEMORY, after=10, times=1)
        patch.setattr(cl, "enqueue_nd_range_kernel", failing)
        for _ in run:
            pass
        assert failing.calls > 30
    assert [w.top for w in used._spare] == [1]
    with monkeypatch.context() as patch:
        used._spare.clear()
        patch.setattr(cl, "enqueue_nd_range_kernel", Failing(cl.enqueue_nd_range_kernel, NO_MEMORY, after=30))
        with pytest.raises(OutOfDeviceMemoryError):
            heights(used)
    assert np.array_equal(heights(used), expected)


def test_out_of_memory_without_anything_to_drop(used: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    used._spare.clear()
    with monkeypatch.context() as patch:
        failing = Failing(cl.Buffer, NO_MEMORY, after=9)
        patch.setattr(cl, "Buffer", failing)
        with pytest.raises(OutOfDeviceMemoryError, match="too little memory"):
            heights(used)
    assert held(used) == 0
    assert heights(used).max() > 0


@pytest.mark.parametrize("limit", ["memory", "largest"])
def test_a_plan_that_cannot_fit_allocates_nothing(used: Solver, monkeypatch: pytest.MonkeyPatch, limit: str) -> None:
    """SPEC S26."""
    assert used._device is not None
    limits = {"memory": used._device.memory, "largest": used._device.largest} | {limit: 40 << 20}
    small = replace(used._device, name="small one", memory=limits["memory"], largest=limits["largest"])
    monkeypatch.setattr(used, "_device", small)
    used._spare.clear()
    assert heights(used, 1).max() > 0
    with monkeypatch.context() as patch:
        patch.setattr(cl, "Buffer", Failing(cl.Buffer, INVALID_VALUE))
        with pytest.raises(OutOfDeviceMemoryError, match=r"4097².*small one.* MiB"):
            workspaces.new_workspace(small, 6)
    assert held(used) == workspaces.planned_bytes(small, 1)[0]


def test_what_is_held_counts(used: Solver, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S26: two workspaces do not fit where one does; when the first is gone the second does."""
    assert used._device is not None
    needed = workspaces.planned_bytes(used._device, 2)[0]
    tight = replace(used._device, name="tight one", memory=int(1.8 * needed / workspaces.SHARE))
    first = workspaces.new_workspace(tight, 2)
    with pytest.raises(OutOfDeviceMemoryError, match="left"):
        workspaces.new_workspace(tight, 2)
    del first
    gc.collect()
    workspaces.new_workspace(tight, 2)


@pytest.mark.parametrize("top", [0, 1, 3])
def test_the_plan_is_what_is_allocated(used: Solver, monkeypatch: pytest.MonkeyPatch, top: int) -> None:
    """SPEC S26: within the tables and weights, a few kilobytes."""
    assert used._device is not None
    sizes = []

    def counted(context: Any, flags: int, size: int = 0, hostbuf: Any = None) -> Any:
        sizes.append(size)
        return cl._cl.Buffer(context, flags, size, hostbuf)

    monkeypatch.setattr(cl, "Buffer", counted)
    workspaces.new_workspace(used._device, top)
    planned, largest = workspaces.planned_bytes(used._device, top)
    assert 0 <= sum(sizes) - planned < 100_000
    assert largest == max(sizes)


@pytest.mark.parametrize("level", range(3, MAX_LEVEL + 1))
@pytest.mark.parametrize("strips", [1, 8])
@pytest.mark.parametrize("based", [False, True])
def test_what_solves_are_shared_out_by_is_about_the_plan(used: Solver, strips: int, level: int, based: bool) -> None:
    """SPEC S26: a base and a scout included."""
    assert used._device is not None
    device = replace(used._device, strips=strips)
    planned = workspaces.planned_bytes(device, level, based)[0]
    planned += workspaces.planned_bytes(device, grid.SCOUT, based)[0] if level >= grid.SCOUT_FROM else 0
    assert grid.solve_bytes(level, based) == pytest.approx(planned, rel=0.1)


@pytest.mark.parametrize("base", [None, hills()], ids=["a sheet", "hills"])
def test_what_solves_are_shared_out_by_is_what_they_allocate(
    monkeypatch: pytest.MonkeyPatch, base: Analytic | None
) -> None:
    """SPEC S26: the buffers of a solve of level 4 that is the first of its solver."""
    fresh, sizes = Solver(max_level=4), []

    def counted(context: Any, flags: int, size: int = 0, hostbuf: Any = None) -> Any:
        sizes.append(size)
        return cl._cl.Buffer(context, flags, size, hostbuf)

    monkeypatch.setattr(cl, "Buffer", counted)
    steps = fresh.steps(STROKES, SETTINGS, base=base)
    assert next(steps) is not None
    assert sum(sizes) == pytest.approx(grid.solve_bytes(4, base is not None), rel=0.1)
    steps.close()


def test_build_failure(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    """SPEC S23: kernels that do not compile are a BuildError; without a wish NumPy serves."""
    monkeypatch.setattr(devices, "_opened", {})
    monkeypatch.setattr(devices, "_source", lambda _: "kernel void broken( { }")
    name = candidates()[0]
    if name == "numpy":
        pytest.skip("no OpenCL device")
    found = devices._found(None)[0]
    with pytest.raises(BuildError, match=r"could not compile the solver's kernels \(.*error: .*\)\.$"):
        devices._open(*found)
    with pytest.raises(NoDeviceError, match="does not work"):
        open_device(name)
    assert Solver().device_name.startswith("NumPy")
    assert "could not compile" in caplog.text
    assert devices._opened == {}


def test_a_program_without_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(devices, "_source", lambda _: "kernel void other(global float *a) { a[0] = 1.0f; }")
    with pytest.raises(BuildError, match="without kernels"):
        devices._open(*devices._found(None)[0])


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


class Fake:
    """A device as pyopencl describes it."""

    def __init__(self, name: str, kind: int, unified: bool = False, local: int = 48 << 10) -> None:
        self.name, self.type, self.host_unified_memory, self.local_mem_size = name, kind, unified, local
        self.max_work_group_size, self.max_compute_units = 1024, 16


class Platform:
    name = "Vendor"

    def __init__(self, *found: Fake) -> None:
        self.found = found

    def get_devices(self) -> tuple[Fake, ...]:
        return self.found


def test_order_and_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S22: GPUs with memory of their own, CPUs, integrated GPUs, the rest; tiles for all that is no CPU."""
    monkeypatch.delenv("ESKER_KERNELS", raising=False)
    kinds = cl.device_type
    first = Platform(Fake("fpga", kinds.ACCELERATOR), Fake("igpu", kinds.GPU, True), Fake("cpu", kinds.CPU, True))
    second = Platform(Fake("big", kinds.GPU), Fake("big", kinds.GPU), Fake("old", kinds.GPU, local=16 << 10))
    monkeypatch.setattr(cl, "get_platforms", lambda: [first, second])
    assert candidates() == [
        "Vendor big (tile kernels)",
        "Vendor big (tile kernels) #2",
        "Vendor old (row kernels)",
        "Vendor cpu (row kernels)",
        "Vendor igpu (tile kernels)",
        "Vendor fpga (tile kernels)",
        "numpy",
    ]
    monkeypatch.setenv("ESKER_KERNELS", "rows")
    assert candidates()[0] == "Vendor big (row kernels)"
    monkeypatch.setenv("ESKER_KERNELS", "columns")
    with pytest.raises(NoDeviceError, match="ESKER_KERNELS"):
        Solver()


def test_a_broken_platform_hides_no_other(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    """SPEC S23: a driver without its hardware, say."""
    broken, other = Platform(), Platform(Fake("cpu", cl.device_type.CPU, True))
    monkeypatch.setattr(broken, "get_devices", Failing(list, -9999))
    monkeypatch.setattr(cl, "get_platforms", lambda: [broken, other])
    assert candidates()[0].startswith("Vendor cpu")
    assert "lists no devices" in caplog.text


def test_every_candidate_opens_itself() -> None:
    for name in candidates():
        found = open_device(name)
        assert found is None if name == "numpy" else found is not None and found.name == name


def test_row_kernels_beside_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """What has no tile kernels runs row-wise on the same queue."""
    monkeypatch.setenv("ESKER_KERNELS", "tiles")
    tiles = open_device()
    assert tiles is not None
    assert tiles.plan is not None
    rows = row_kernels(tiles)
    assert rows.plan is None
    assert rows.queue is tiles.queue
    assert row_kernels(tiles) is rows
    assert row_kernels(rows) is rows


def mirror(source: Path, target: Path) -> None:
    """A folder like another one, of links to its files."""
    target.mkdir(parents=True)
    for entry in source.iterdir():
        if entry.is_dir() and entry.name != "__pycache__":
            mirror(entry, target / entry.name)
        elif entry.is_file():
            (target / entry.name).symlink_to(entry)


def test_a_processor_without_avx512(tmp_path: Path) -> None:
    """SPEC S2 on narrower vectors: PoCL compiles for haswell, with the built-ins that it has for such processors."""
    site = Path(cl.__file__).parent.parent
    for package in ("pyopencl", "pocl_binary_distribution"):
        if not (site / package).exists():
            pytest.skip("PoCL is not from its wheel")
        mirror(site / package, tmp_path / package)
    library = tmp_path / "pocl_binary_distribution" / ".libs" / "share" / "pocl"
    narrow, wide = (library / f"kernel-x86_64-unknown-linux-gnu-{level}.bc" for level in ("avx2", "avx512"))
    wide.unlink()
    wide.symlink_to(narrow)
    code = (
        "import numpy as np; from esker.solve import pocl_cpu; pocl_cpu.cpu_level = lambda *_: 'haswell';"
        "from esker.solve.solver import Solver; from tests.solver.scenes import *;"
        "x, y = (Solver(name).solve(SCENES['five'], SETTINGS, 2)[2] for name in ('pocl', 'numpy'));"
        "assert np.quantile(np.abs(x - y), 0.99) < 1 / 16, np.abs(x - y).max()"
    )
    env = os.environ | {
        "PYTHONPATH": os.pathsep.join((str(tmp_path), str(ROOT))),
        "POCL_CACHE_DIR": str(tmp_path / "cache"),
        "ESKER_KERNELS": "rows",
    }
    (tmp_path / "cache").mkdir()
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT, env=env, timeout=300)
