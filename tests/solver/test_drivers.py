"""Drivers of graphics cards build their kernels in a child process first (SPEC S410). PoCL passes for one here."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from esker.server.run import Assembly
from esker.server.settings import Settings
from esker.solve.opencl import device, prepare
from esker.solve.opencl.faults import NoDeviceError
from esker.solve.opencl.pocl import home
from tests.solver.pretending import NAME

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(home.site() is None, reason="PoCL's wheel is not installed")


class Card:
    """What is asked of a device before it is opened."""

    def __init__(self, version: str = "OpenCL 3.0 CUDA 12.4", driver_version: str = "550.1 ") -> None:
        self.version, self.driver_version = version, driver_version


@pytest.fixture
def card(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, request: pytest.FixtureRequest) -> Card:
    """A card before PoCL's CPU, whose driver does as the test's parameter says; nothing is known of it."""
    opened = device.open_device("pocl")
    assert opened is not None
    cpu = (opened.name, opened.context.devices[0])
    made = Card()
    monkeypatch.setattr(device, "_devices", lambda: [(NAME, made), cpu])
    monkeypatch.setattr(prepare, "MODULE", "tests.solver.pretending")
    monkeypatch.setattr(prepare, "_drivers", lambda: tmp_path / "drivers")
    monkeypatch.setattr(prepare._state, "drivers", {})
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("PRETEND", request.param)
    return made


@pytest.mark.parametrize(
    ("card", "why"),
    [
        ("abort", r"the compiler ended \(-6\)"),
        ("refuse", r"OpenCL device Pretend One does not work: error: no such intrinsic"),
        ("hang", r"not compiled within 3 s"),
    ],
    indirect=["card"],
)
def test_a_driver_that_fails_ends_nothing_and_the_cpu_serves(
    card: Card, why: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """SPEC S410: said in one line; the next start asks no child, nor does who wants this very device."""
    monkeypatch.setattr(prepare, "SECONDS", 3.0)
    steps: list[str] = []
    device.ready(None, None, lambda step: steps.append(step.said))
    assert f"Compiling kernels for {NAME}, once for its driver" in steps
    found = device.open_device()
    assert found is not None
    assert found.name.startswith("PoCL")
    (said,) = [line for line in caplog.messages if line.startswith(f"Kernels for {NAME}")]
    assert said == steps[-1]
    monkeypatch.setattr(prepare, "bounded", None)
    prepare._state.drivers.clear()
    with pytest.raises(NoDeviceError, match=why):
        device.open_device(NAME)


@pytest.mark.parametrize("card", ["abort"], indirect=True)
def test_without_a_cpu_device_numpy_serves_and_the_server_lives(
    card: Card, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """SPEC S410."""
    monkeypatch.setattr(device, "_devices", lambda: [(NAME, card)])
    assembly = Assembly(Settings(data=tmp_path / "data", port=0, level=1))
    try:
        assert assembly._worker is not None
        assert assembly._worker.device_name.startswith("NumPy")
    finally:
        assembly.close()


@pytest.mark.parametrize("card", ["works"], indirect=True)
def test_a_driver_that_works_is_asked_once_a_version(
    card: Card, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """SPEC S410."""
    monkeypatch.setenv("ESKER_KERNELS", "rows")  # PoCL has compiled these; they are built all the same
    children = []
    bounded = prepare.bounded

    def counted(*arguments: object, **named: object) -> dict[str, object]:
        children.append(arguments)
        return bounded(*arguments, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(prepare, "bounded", counted)
    with caplog.at_level(logging.INFO, "esker.solve.opencl.prepare"):
        for release, times in (("1", 1), ("1", 1), ("2", 2)):
            prepare._state.drivers.clear()
            assert prepare.driver(NAME, release, None) is None, caplog.text
            assert len(children) == times


def test_a_distributions_pocl_is_a_driver_like_any_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S580: nothing is settled for it, so it was left for NumPy on machines without the wheel."""
    theirs = Card("OpenCL 3.0 PoCL HSTR: cpu-x86_64-pc-linux-gnu-skylake-avx512", "5.0+debian")
    assert device._is_pocl(theirs)
    monkeypatch.setattr(home, "site", lambda: None)
    assert not device._is_pocl(theirs)
    monkeypatch.setattr(prepare, "ready", None)
    device._agree(theirs)
