"""Tiles to the clients, flow control, readers that do not read, solvers that fail (SPEC P50 to P56)."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from esker import contract as c
from esker.events import Preview, Settled
from esker.grid import TileKey
from esker.tiles.decoder import FrameDecoder
from tests.sync.harness import PATIENCE, LiveServer, PlainSolver, height_level, set_op, sleeping_member, stroke


def _clock(frame: bytes) -> int:
    return int(np.frombuffer(frame[: c.FRAME_HEADER.itemsize], c.FRAME_HEADER)["clock"][0])


def test_the_ground_arrives_settled(server: LiveServer) -> None:
    terrain, secret = server.create()
    peer = server.join(terrain, secret)
    peer.ops(("c1:1", stroke(height=250.0)))
    peer.settled(1)
    time.sleep(0.2)
    peer.say("ping", t=1)
    peer.wait("pong")
    decoder = FrameDecoder()
    for frame in peer.frames:
        decoder.decode(frame)
    step = c.DEFAULT_SIZE_M / 64 / c.QUANTA_PER_CELL
    np.testing.assert_array_equal(decoder.held[TileKey(0, 0, 0)].samples, np.round(250.0 / step))
    peer.close()


def test_an_op_that_leaves_the_ground_alone_needs_no_solve(server: LiveServer) -> None:
    terrain, secret = server.create()
    peer = server.join(terrain, secret)
    peer.ops(("c1:1", stroke()))
    peer.settled(1)
    peer.ops(("c1:2", {"type": "terrain.set", "fields": {"title": "x"}}))
    peer.settled(2)
    assert max(map(_clock, peer.frames)) <= 1
    peer.close()


def test_without_credit_the_window_closes(tmp_path: Path) -> None:
    """A client that reads but never gives credit gets at most one window of tiles and every op."""
    window = c.BYTE_WINDOW

    class Noise(PlainSolver):
        def steps(
            self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, **_: Any
        ) -> Iterator[Preview | Settled]:
            rng = np.random.default_rng(len(strokes))
            for level in super().steps(strokes, settings, levels):
                heights = rng.uniform(0, 1000, level.heights.shape).astype(np.float32)
                yield height_level(level.level, heights, level.settled)

    with LiveServer(tmp_path, Noise(), level=2) as server:
        terrain, secret = server.create()
        greedy, modest = server.join(terrain, secret, "g"), server.join(terrain, secret, "m")

        def read() -> None:
            while True:
                message = modest.ws.recv()
                if isinstance(message, bytes):
                    modest.frames.append(message)
                    modest.say("credit", bytes=len(message))
                elif json.loads(message)["type"] == "pong":
                    return

        def had() -> int:
            return sum(map(len, modest.frames))

        reader = threading.Thread(target=read)
        reader.start()
        count = 0
        while count < 25 or had() < 2.5 * window:
            assert count < 1_000, "the scene must be big enough to matter"
            before, deadline = had(), time.monotonic() + PATIENCE
            greedy.ops((f"g:{count}", stroke(f"s{count}")))
            greedy.wait("ack")
            count += 1
            while had() == before:
                assert time.monotonic() < deadline, "the ground of a change does not come"
                time.sleep(0.005)
        modest.say("ping", t=0)
        reader.join(PATIENCE)
        assert not reader.is_alive()
        # What came to the modest one last may have been ground of the change before.
        greedy.at_rest(count)
        deadline = time.monotonic() + PATIENCE
        while sum(map(len, greedy.frames)) < window and time.monotonic() < deadline:
            greedy.say("ping", t=0)  # a pong passes frames that wait for a reader
            greedy.wait("pong")
            time.sleep(0.01)
        greedy.say("ping", t=0)
        greedy.wait("pong")
        sent = sum(map(len, greedy.frames))
        biggest = max(map(len, greedy.frames))
        assert window <= sent <= window + biggest
        ops = [o["id"] for m in greedy.seen if m["type"] == "ordered" for o in m["ops"]]
        assert ops == [f"g:{i}" for i in range(count)]
        # Credit opens the window, and what comes is the newest ground.
        frames = len(greedy.frames)
        greedy.say("credit", bytes=sent)
        deadline = time.monotonic() + PATIENCE
        while len(greedy.frames) == frames:
            assert time.monotonic() < deadline
            greedy.say("ping", t=0)
            greedy.wait("pong")
            time.sleep(0.01)
        assert _clock(greedy.frames[frames]) == count
        greedy.close()
        modest.close()


def test_a_reader_that_never_reads_is_evicted_and_hurts_nobody(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(c, "STALL_SECONDS", 3.0)
    with LiveServer(tmp_path, level=1) as server:
        terrain, secret = server.create()
        witness = server.join(terrain, secret, "w")
        witness.ops(("w:0", stroke()))
        witness.wait("ack")
        sleeper = sleeping_member(server.port, terrain, secret)
        base = psutil.Process().memory_info().rss
        curve = [[i / 1000, 0.123456789] for i in range(1000)]
        gone = False
        slowest = 0.0
        started = time.monotonic()
        i = 0
        while not gone and time.monotonic() - started < 15:
            i += 1
            sent = time.monotonic()
            witness.ops((f"w:{i}", set_op(curve=curve)))
            while f"w:{i}" not in (message := witness.wait("ack", "members")).get("ids", ()):
                gone |= "members" in message and len(message["members"]) == 1
            slowest = max(slowest, time.monotonic() - sent)
            time.sleep(0.005)
            if i % 20 == 0:
                witness.say("ping", t=i)
        witness.close()
        sleeper.close()
        assert gone, "the sleeper is still a member"
        assert time.monotonic() - started < 10
        assert slowest < 2.0, "who waits for the sleeper waits until it is evicted"
        assert psutil.Process().memory_info().rss - base < 40e6, "the client's own share is in this process too"


class Failing(PlainSolver):
    """Fails while ``broken`` is set."""

    def __init__(self) -> None:
        self.broken = False
        self.calls = 0

    def steps(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, **_: Any
    ) -> Iterator[Preview | Settled]:
        for level in super().steps(strokes, settings, levels):
            self.calls += 1
            if self.broken:
                raise RuntimeError("CL_OUT_OF_RESOURCES")
            yield level


def test_a_failing_solver_is_told_and_tried_again(tmp_path: Path) -> None:
    solver = Failing()
    with LiveServer(tmp_path, solver) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        peer.settled(0)
        solver.broken = True
        peer.ops(("c1:1", stroke()))
        peer.wait("ack")
        note = peer.wait("progress")
        while not note["note"]:
            note = peer.wait("progress")
        assert "tried again" in note["note"]
        solver.broken = False
        peer.ops(("c1:2", set_op(hidden=True)))
        peer.settled(2)
        peer.close()


def test_after_three_failures_numpy_takes_over(tmp_path: Path) -> None:
    from esker.session.ground.worker import Job, Worker

    made: list[str | None] = []
    notes: list[str] = []
    done = threading.Event()

    def factory(device: str | None) -> Any:
        made.append(device)
        if device == "numpy":
            return PlainSolver()
        solver = Failing()
        solver.broken = True
        return solver

    worker = Worker(factory, "gpu")
    worker.start()

    def deliver(_: int, level: Any) -> None:
        if level.settled:
            done.set()

    client = worker.add(0, deliver, notes.append)
    for clock in range(1, 4):
        count = len(notes)
        worker.request(client, Job(clock, (), c.TerrainSettings()))
        deadline = time.monotonic() + 60
        while len(notes) == count:
            assert time.monotonic() < deadline
            time.sleep(0.001)
    assert done.wait(5), "the job that failed is solved by the other solver"
    assert made == ["gpu", "numpy"]
    assert "arithmetic" in notes[2]
    worker.stop()
