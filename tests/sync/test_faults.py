"""Devices that fail under a room: it says so, goes on with less, loses no op, and comes back (SPEC P75 to P80)."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from esker import contract as c
from esker.events import Preview, Settled
from esker.server.run import diagnose
from esker.session.ground import recovery
from esker.session.ground.recovery import Backoff, Devices, Fault
from esker.session.ground.repairs import AGAIN, GIVEN_UP
from esker.solve.multigrid import DivergedError
from esker.solve.opencl.faults import (
    BuildError,
    DeviceError,
    DeviceLostError,
    NoDeviceError,
    OutOfDeviceMemoryError,
)
from esker.store.journal import Journal
from tests.sync.harness import LiveServer, Peer, PlainSolver, set_op, stroke

ROOT = Path(__file__).resolve().parents[2]
NUMPY = "NumPy float64 (no OpenCL device)"


class Sick(PlainSolver):
    """A solver on a device that fails when ``fault`` says so, given the level about to be finished."""

    def __init__(self, device: str, fault: Callable[[int], Exception | None]) -> None:
        self.device_name, self.fault = device, fault

    def steps(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, **_: Any
    ) -> Iterator[Preview | Settled]:
        for result in super().steps(strokes, settings, levels):
            error = self.fault(result.level)
            if error is not None:
                raise error
            yield result

    def prove(self) -> None:
        if error := self.fault(1):
            raise error


class Clinic:
    """Devices whose health the test decides, and a server that uses them."""

    def __init__(self, data: Path, names: tuple[str, ...], unmakeable: tuple[str, ...]) -> None:
        self.names, self.made = names, list[str]()
        self.faults: dict[str, Callable[[int], Exception | None]] = {}
        self.unmakeable = set(unmakeable)
        self.server = LiveServer(data, factory=self.factory, level=2, refine=2)

    def factory(self, device: str | None) -> Any:
        """As the real one: None is the best device that works."""
        found = next((x for x in self.names if x not in self.unmakeable and device in (None, x)), None)
        if found is None:
            raise NoDeviceError(f"{device} does not work.")

        def fault(level: int) -> Exception | None:
            return self.faults[found](level) if found in self.faults else None

        made = Sick(NUMPY if found == "numpy" else found, fault)
        made.prove()
        self.made.append(found)
        return made


Build = Callable[..., tuple[Clinic, Peer]]


@pytest.fixture
def clinic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Build]:
    """Opens a server with a member in a new terrain."""
    opened: list[LiveServer] = []

    def build(
        names: tuple[str, ...] = ("gpu", "cpu", "numpy"), retry: float = 60.0, unmakeable: tuple[str, ...] = ()
    ) -> tuple[Clinic, Peer]:
        monkeypatch.setattr("esker.server.run.candidates", lambda _: list(names))
        monkeypatch.setattr(recovery, "RETRY_SECONDS", retry)
        monkeypatch.setattr("esker.session.ground.worker.IDLE_CHECK", 0.05)
        monkeypatch.setattr("esker.session.ground.machine.AGAIN_AFTER", 0.1)
        monkeypatch.setattr("esker.session.ground.repairs.PROVE_EVERY", 0.05)
        clinic = Clinic(tmp_path, names, unmakeable)
        clinic.server.__enter__()
        opened.append(clinic.server)
        peer = clinic.server.join(*clinic.server.create())
        return clinic, peer

    yield build
    for server in opened:
        server.stop()


def note(peer: Peer, *words: str) -> str:
    """The first note of the solver, heard or still to come, that has all these words."""
    heard = [m for m in peer.seen if m["type"] == "progress"]
    while True:
        found = str((heard.pop(0) if heard else peer.wait("progress"))["note"])
        if all(word in found for word in words):
            return found


def draw(peer: Peer, first: int, count: int = 5) -> None:
    """Ops one after the other, each acknowledged although the device is failing."""
    for n in range(first, first + count):
        peer.ops((f"c1:{n}", stroke() if n == 1 else set_op(first=[100, 100, float(n)])))
        assert peer.wait("ack")["ids"] == [f"c1:{n}"]


def finest(frames: list[bytes], clock: int) -> int:
    """The finest level of all frames of ``clock`` or later. On a busy machine a peer hears late of ground before it."""
    heads = [np.frombuffer(each[: c.FRAME_HEADER.itemsize], c.FRAME_HEADER)[0] for each in frames]
    return max(int(head["level"]) for head in heads if head["clock"] >= clock)


@pytest.mark.parametrize("error", [DeviceLostError, BuildError, DeviceError])
def test_the_next_device_takes_over_from_one_that_fails(clinic: Build, error: type[DeviceError]) -> None:
    ward, peer = clinic()
    peer.at_rest(0)
    ward.faults["gpu"] = lambda level: error("gpu broke while solving.") if level == 1 else None
    draw(peer, 1)
    said = note(peer, "gpu broke", "cpu")
    assert said == "gpu broke while solving. The solver now runs on cpu and goes on."
    draw(peer, 6)
    peer.at_rest(10)
    assert ward.made == ["gpu", "cpu"]
    peer.close()


def test_numpy_takes_over_when_no_other_device_can_be_made(clinic: Build) -> None:
    ward, peer = clinic()
    peer.at_rest(0)
    ward.unmakeable.add("cpu")
    ward.faults["gpu"] = lambda _: DeviceLostError("gpu was lost.")
    draw(peer, 1)
    note(peer, "gpu was lost", NUMPY)
    peer.at_rest(5)
    assert ward.made == ["gpu", "numpy"]
    peer.close()


class Poison(Sick):
    """A device that works, on which a stroke of more than 500 m cannot be computed."""

    error: Exception = OverflowError(34, "Numerical result out of range")

    def steps(self, strokes: Sequence[c.Stroke], *given: Any, **more: Any) -> Iterator[Preview | Settled]:
        if any(abs(s.first[2]) > 500 for s in strokes):
            raise self.error
        yield from super().steps(strokes, *given, **more)


@pytest.mark.parametrize(
    "error",
    [
        OverflowError(34, "Numerical result out of range"),
        ValueError("x"),
        TypeError("x"),
        RuntimeError("what is this?"),
        DeviceError("CL_INVALID_KERNEL_ARGS"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_a_job_that_cannot_be_computed_takes_the_device_from_nobody(
    clinic: Build, error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC P220, P221: it is tried three times, then it waits for a change. Other rooms go on where they were."""
    monkeypatch.setattr("tests.sync.test_faults.Sick", Poison)
    monkeypatch.setattr(Poison, "error", error)
    ward, peer = clinic()
    other = ward.server.join(*ward.server.create(), client="c2")
    peer.at_rest(0)
    other.at_rest(0)
    peer.ops(("c1:1", stroke()), ("c1:2", set_op(first=[100, 100, 600.0])))
    assert note(peer, "tried again") == AGAIN
    assert note(peer, "waits") == GIVEN_UP
    for n in range(1, 4):
        other.ops((f"c2:{n}", stroke() if n == 1 else set_op(first=[100, 100, float(n)])))
        other.at_rest(n)
    assert ward.made == ["gpu"], "nobody was moved"
    assert not any("runs on" in m["note"] for m in other.seen if m["type"] == "progress")
    peer.ops(("c1:3", set_op(first=[100, 100, 5.0])))
    peer.at_rest(3)
    peer.close()
    other.close()


def test_a_device_that_one_job_broke_is_opened_again(clinic: Build) -> None:
    """SPEC P221: a context that is lost is not a device that is lost."""
    ward, peer = clinic()
    peer.at_rest(0)
    broken = [DeviceLostError("gpu was lost.")] * 2
    ward.faults["gpu"] = lambda _: broken.pop() if broken else None
    draw(peer, 1)
    peer.at_rest(5)
    assert ward.made == ["gpu", "gpu"]
    assert not any("runs on" in m["note"] for m in peer.seen if m["type"] == "progress")
    peer.close()


def test_errors_nobody_knows_are_proved_before_the_device_is_left(clinic: Build) -> None:
    ward, peer = clinic()
    peer.at_rest(0)
    ward.faults["gpu"] = lambda _: RuntimeError("what is this?")
    peer.ops(("c1:1", stroke()))
    note(peer, "what is this?", "cpu")
    peer.at_rest(1)
    peer.close()


def test_equations_that_diverge_are_no_fault_of_the_device(clinic: Build) -> None:
    """SPEC P80: however often it happens."""
    ward, peer = clinic()
    peer.at_rest(0)
    ward.faults["gpu"] = lambda _: DivergedError()
    for n in range(1, 6):
        draw(peer, n, 1)
        assert note(peer, "not be settled") == str(DivergedError())
        peer.seen.clear()
    ward.faults.clear()
    draw(peer, 6)
    peer.at_rest(10)
    assert ward.made == ["gpu"]
    peer.close()


@pytest.mark.parametrize("names", [("numpy",), ("gpu", "numpy")])
def test_without_a_device_that_works_the_room_says_so(clinic: Build, names: tuple[str, ...]) -> None:
    _, peer = clinic(names, unmakeable=("gpu",))
    assert peer.welcome["device"] == NUMPY
    assert note(peer, "NumPy").startswith(f"The solver runs on {NUMPY}")
    draw(peer, 1)
    peer.at_rest(5)
    peer.close()


def test_the_better_device_is_used_again_when_it_works_again(clinic: Build) -> None:
    ward, peer = clinic(retry=0.3)
    peer.at_rest(0)
    ward.faults["gpu"] = lambda _: DeviceLostError("gpu was lost.")
    ward.unmakeable.add("gpu")
    draw(peer, 1)
    note(peer, "gpu was lost", "cpu")
    peer.at_rest(5)
    ward.faults.clear()
    ward.unmakeable.clear()
    assert note(peer, "again") == "The solver runs on gpu again."
    draw(peer, 6)
    peer.at_rest(10)
    assert ward.made == ["gpu", "cpu", "gpu"]
    peer.close()


def test_what_does_not_fit_is_solved_coarser_and_finer_again_later(clinic: Build) -> None:
    ward, peer = clinic(retry=0.5)
    peer.at_rest(0)
    ward.faults["gpu"] = lambda level: OutOfDeviceMemoryError("too big") if level > 1 else None
    draw(peer, 1)
    said = note(peer, "too little memory")
    assert said == "gpu has too little memory for level 2: the ground is shown up to level 1 for now."
    peer.at_rest(5)
    before = len(peer.frames)
    peer.ops(("c1:6", set_op(first=[100, 100, 77.0])))
    peer.at_rest(6)
    peer.say("ping", t=1)
    peer.wait("pong")
    assert finest(peer.frames[before:], 6) <= 1
    ward.faults.clear()
    deadline = time.monotonic() + 60
    while finest(peer.frames[before:], 6) < 2:
        assert time.monotonic() < deadline
        peer.say("ping", t=2)
        peer.wait("pong")
        time.sleep(0.02)
    assert ward.made == ["gpu"], "the device itself is all right"
    peer.close()


def test_a_device_without_memory_for_anything_is_left(clinic: Build) -> None:
    ward, peer = clinic()
    peer.at_rest(0)
    ward.faults["gpu"] = lambda _: OutOfDeviceMemoryError("gpu is full.")
    draw(peer, 1)
    note(peer, "gpu is full", "cpu")
    peer.at_rest(5)
    peer.close()


def test_killed_while_the_device_fails_nothing_acknowledged_is_lost(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.sync.fault_child", str(tmp_path)]
    acked: list[str] = []
    with subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as child:
        assert child.stdout is not None
        place = json.loads(child.stdout.readline())
        peer = Peer(_connect(place["port"]))
        peer.say("hello", protocol=c.PROTOCOL_VERSION, terrain=place["terrain"], secret=place["secret"], client="c1")
        peer.wait("welcome")
        noted = False
        n = 0
        while not noted or n < 40:
            n += 1
            peer.ops((f"c1:{n}", stroke() if n == 1 else set_op(first=[100, 100, float(n)])))
            while (message := peer.wait("ack", "progress"))["type"] != "ack":
                noted |= bool(message["note"])
            acked += message["ids"]
        for k in range(n + 1, n + 4):  # and some more that nobody will acknowledge
            peer.ops((f"c1:{k}", set_op(first=[100, 100, float(k)])))
        child.send_signal(signal.SIGKILL)
        child.wait()
    peer.closed()
    journal = Journal(tmp_path)
    loaded = journal.load(place["terrain"])
    assert loaded is not None
    rows = {f"{row.client}:{row.counter}": row.clock for row in journal.rows(place["terrain"], 0)}
    assert [op for op in acked if op not in rows] == []
    assert loaded.document.strokes["s1"].first[2] >= len(acked)
    journal.close()


def _connect(port: int) -> Any:
    from websockets.sync.client import connect

    protocols: Any = [c.SUBPROTOCOL]
    options: Any = {"max_size": None, "compression": None, "proxy": None, "ping_interval": None}
    opening: Any = connect(f"ws://127.0.0.1:{port}/ws", subprotocols=protocols, **options)
    return opening.__enter__()


# --- the policy alone -----------------------------------------------------------------------------------------------


def test_what_an_exception_means() -> None:
    assert diagnose(OutOfDeviceMemoryError("x")) == Fault.MEMORY
    assert diagnose(MemoryError()) == Fault.MEMORY
    for kind in (DeviceLostError, BuildError, NoDeviceError, DeviceError):
        assert diagnose(kind("x")) == Fault.DEVICE
    assert diagnose(DivergedError()) == Fault.JOB
    for flaw in (OverflowError, ZeroDivisionError, FloatingPointError, ValueError, TypeError, IndexError, KeyError):
        assert diagnose(flaw("x")) == Fault.FLAW, "no device would do better"
    assert diagnose(RuntimeError("x")) == Fault.UNKNOWN


def test_trying_again_takes_longer_each_time_until_it_works() -> None:
    backoff, now, waits = Backoff(), 0.0, []
    for _ in range(7):
        backoff.failed(now)
        assert backoff.at is not None
        waits.append(backoff.at - now)
        assert not backoff.due(backoff.at - 1)
        now = backoff.at
        assert backoff.due(now)
    assert waits == [60, 120, 240, 480, 960, 960, 960]
    backoff.clear()
    assert not backoff.due(now + 1e6)
    backoff.failed(now)
    assert backoff.due(now + 60)


def test_devices_are_tried_in_order_and_the_one_asked_for_is_the_best() -> None:
    names = ["gpu", "cpu", "old", "numpy"]
    devices = Devices(None, lambda: names)
    devices.opened("gpu", 0.0)
    assert (devices.current, devices.second_best, devices.others()) == ("gpu", False, ["cpu", "old", "numpy"])
    devices.left("cpu", 0.0)
    assert (devices.better(), devices.others()) == (["gpu"], ["old", "numpy"])
    devices.left("numpy", 0.0)
    assert devices.better() == ["gpu", "cpu", "old"]
    assert not devices.blame(Fault.DEVICE), "NumPy is never left"
    asked = Devices("old", lambda: names)
    asked.opened("old", 0.0)
    assert (asked.second_best, asked.others()) == (False, ["gpu", "cpu", "numpy"])
    asked.left("gpu", 0.0)
    assert asked.better() == ["old"]
    numpy = Devices("numpy", lambda: names)
    numpy.opened(NUMPY, 0.0)
    assert not numpy.second_best, "it was asked for"
