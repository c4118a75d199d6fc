"""Which devices there are and with which kernels, in which order they are tried (SPEC S2, S22, S23)."""

from __future__ import annotations

import pyopencl as cl
import pytest

from esker.solve.opencl.device import candidates, open_device, row_kernels
from esker.solve.opencl.faults import NoDeviceError
from esker.solve.solver import Solver
from tests.solver.failing import Failing


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
