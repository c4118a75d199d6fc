"""Refined tiles and the other channels, from a solver to a client over a real socket (SPEC P66 to P69)."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import contract as c
from esker import grid
from esker.events import ChannelLevel, Done, SolveEvent
from esker.grid import TileKey
from esker.server.settings import BadSetting, Settings, from_environment
from esker.tiles.decoder import FrameDecoder
from tests.sync.harness import LiveServer, Peer, PlainSolver, height_level, set_op, stroke

SIZE = c.DEFAULT_SIZE_M
NEAR = c.View(eye=(1800.0, 1900.0, 12.0), target=(1803.0, 1960.0, 4.0), width=400, height=300, tau_px=4.0)


def ground(x: NDArray[np.float64], y: NDArray[np.float64], height: float) -> NDArray[np.float32]:
    """A roof with its crest near the eye; as high as the strokes say."""
    return np.asarray(height - 0.8 * np.abs(x - 1801.3 - 0.05 * y + 95.0), dtype=np.float32)


@dataclass(frozen=True)
class Basis:
    height: float


@dataclass(frozen=True)
class Level:
    level: int
    heights: NDArray[np.float32]
    settled: bool
    channel: c.Channel = c.Channel.HEIGHT
    basis: Basis | None = None


@dataclass(frozen=True)
class Tile:
    key: TileKey
    heights: NDArray[np.float32]
    content: bytes
    base: NDArray[np.float32] | None = None


class RoofRefiner:
    def __init__(self, height: float, log: list[TileKey]) -> None:
        self.height, self.log = height, log

    def tiles(self, keys: Sequence[TileKey], _: object) -> Iterator[Tile | None]:
        for key in keys:
            yield None
            time.sleep(0.01)
            step = SIZE / (64 << key.level)
            y, x = (np.arange(65) + 64 * np.array([[key.y], [key.x]])) * step
            self.log.append(key)
            yield Tile(key, ground(x[None, :], y[:, None], self.height), f"{key}{self.height}".encode())


class RoofSolver:
    """Solves and refines arithmetic: every sample is a function of its place and of the strokes' heights."""

    device_name = "arithmetic"

    def __init__(self) -> None:
        self.made: list[TileKey] = []

    def steps(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, basis: bool = False
    ) -> Iterator[SolveEvent]:
        assert settings.size_m == SIZE
        top = levels or 0
        height = float(sum(s.first[2] for s in strokes))
        for settled in (False, True):
            for level in range(top + 1):
                n = grid.samples(level)
                y, x = np.mgrid[0:n, 0:n] * (SIZE / (n - 1))
                yield height_level(level, ground(x, y, height), settled)
        yield from self.channels(strokes)
        yield Done(Basis(height) if basis else None)

    def channels(self, strokes: Sequence[c.Stroke], *_: Any) -> Iterator[SolveEvent]:
        amplitude = float(sum(s.amplitude_m for s in strokes))
        for channel, value in ((c.Channel.AMPLITUDE, amplitude), (c.Channel.ROUGHNESS, 0.5)):
            yield ChannelLevel(0, np.full((65, 65), value, dtype=np.float32), channel)

    def refiner(self, basis: Basis) -> RoofRefiner:
        return RoofRefiner(basis.height, self.made)


def follow(peer: Peer, decoder: FrameDecoder, clock: int, timeout: float = 90, refined: int = 0) -> None:
    """Decodes and gives credit until the ground is settled at ``clock`` and nothing is left to refine.

    ``refined``: tiles above level 1 that must have come: where the server knows them all it has nothing to tell first.
    """
    deadline = time.monotonic() + timeout
    quiet = False
    while not quiet:
        try:
            message = peer.ws.recv(timeout=0.5)
        except TimeoutError:
            last: dict[str, Any] = next((m for m in reversed(peer.seen) if m["type"] == "progress"), {})
            quiet = last.get("settled", False) and last["clock"] >= clock and last["refining"] == 0
            quiet = quiet and sum(key.level > 1 for key in decoder.held) >= refined
            assert quiet or time.monotonic() < deadline, last
            continue
        if isinstance(message, bytes):
            decoder.decode(message)
            peer.say("credit", bytes=len(message))
        else:
            peer.seen.append(json.loads(message))


def check(decoder: FrameDecoder, height: float) -> list[int]:
    """Every tile is the ground, to the rounding; returns how many of each level are held."""
    counts = [0] * (c.MAX_REFINED_LEVEL + 1)
    for key, tile in decoder.held.items():
        step = SIZE / (64 << key.level)
        y, x = (np.arange(65) + 64 * np.array([[key.y], [key.x]])) * step
        want = np.rint(ground(x[None, :], y[:, None], height) * np.float32(1 / grid.quantum(key.level, SIZE)))
        np.testing.assert_array_equal(tile.samples, want, err_msg=str(key))
        counts[key.level] += 1
    return counts


def test_refined_tiles_come_where_one_looks_and_follow_edits(tmp_path: Path) -> None:
    solver = RoofSolver()
    with LiveServer(tmp_path, solver, level=1, refine=5) as server:
        terrain, secret = server.create()
        peer, decoder = server.join(terrain, secret), FrameDecoder()
        assert (peer.welcome["levels"], peer.welcome["finest"]) == (1, 5)
        peer.ops(("c1:1", stroke(height=20.0)))
        follow(peer, decoder, 1)
        assert check(decoder, 20.0)[2:] == [0] * 9, "nobody looks"
        peer.say("view", **NEAR.model_dump(mode="json", exclude={"type"}))
        follow(peer, decoder, 1)
        near = check(decoder, 20.0)
        assert all(near[2:6])
        assert near[5] < 100
        made = len(solver.made)
        assert made == len(set(solver.made)), "each tile is made once"
        peer.ops(("c1:2", set_op(first=[100.0, 100.0, 26.0])))
        follow(peer, decoder, 2)
        assert check(decoder, 26.0)[2] > 0
        told = [m["refining"] for m in peer.seen if m["type"] == "progress" and m["settled"] and m["clock"] == 2]
        assert told[0] > 0, "the ground is not at rest while tiles are wanted"
        assert told[-1] == 0
        second, other = server.join(terrain, secret, "c2"), FrameDecoder()
        second.say("view", **NEAR.model_dump(mode="json", exclude={"type"}))
        made = len(solver.made)
        follow(second, other, 2, refined=sum(check(decoder, 26.0)[2:6]))
        assert check(other, 26.0)[2:6] == check(decoder, 26.0)[2:6]
        assert len(solver.made) == made, "what one has is there for the other"
        peer.close()
        second.close()


def test_the_finest_level_is_a_setting() -> None:
    assert Settings().refine == c.DEFAULT_REFINED_LEVEL
    assert from_environment({"ESKER_REFINE": "10", "ESKER_LEVEL": "3"}).refine == 10
    with pytest.raises(BadSetting, match="refine must lie between 0 and 10"):
        from_environment({"ESKER_REFINE": "11"})


@pytest.mark.parametrize(("level", "refine", "finest"), [(1, 5, 5), (2, 1, 2), (2, 2, 2)])
def test_nothing_is_refined_below_the_global_levels(tmp_path: Path, level: int, refine: int, finest: int) -> None:
    with LiveServer(tmp_path, RoofSolver(), level=level, refine=refine) as server:
        peer = server.join(*server.create())
        assert (peer.welcome["levels"], peer.welcome["finest"]) == (level, finest)
        peer.close()


def test_a_solver_that_cannot_refine_serves_its_levels(tmp_path: Path) -> None:
    with LiveServer(tmp_path, PlainSolver(), level=1, refine=5) as server:
        terrain, secret = server.create()
        peer, decoder = server.join(terrain, secret), FrameDecoder()
        peer.say("view", **NEAR.model_dump(mode="json", exclude={"type"}))
        peer.ops(("c1:1", stroke(height=20.0)))
        follow(peer, decoder, 1)
        assert {key.level for key in decoder.held} == {0, 1}
        peer.close()


def test_channels_arrive(tmp_path: Path) -> None:
    with LiveServer(tmp_path, RoofSolver(), level=1, refine=1) as server:
        terrain, secret = server.create()
        peer, decoder = server.join(terrain, secret), FrameDecoder()
        peer.ops(("c1:1", stroke(height=20.0)), ("c1:2", set_op(amplitude_m=12.5)))
        follow(peer, decoder, 2)
        root = TileKey(0, 0, 0)
        assert not decoder.channels[c.Channel.ROUGHNESS], "nobody asks anything of it"
        assert np.unique(decoder.channels[c.Channel.AMPLITUDE][root].samples).tolist() == [
            12.5 * c.AMPLITUDE_QUANTA_PER_M
        ]
        peer.ops(("c1:3", set_op(amplitude_m=0.0)))
        follow(peer, decoder, 3)
        assert not decoder.channels[c.Channel.AMPLITUDE][root].samples.any()
        late, fresh = server.join(terrain, secret, "late"), FrameDecoder()
        follow(late, fresh, 3)
        assert not fresh.channels[c.Channel.SNOW]
        for guest in (peer, late):
            guest.close()


def test_paint_leaves_the_refined_ground_alone(tmp_path: Path) -> None:
    """SPEC P81: no height is solved, sent or refined again, and the ground is final for the new clock."""
    solver = RoofSolver()
    with LiveServer(tmp_path, solver, level=1, refine=3) as server:
        terrain, secret = server.create()
        peer, decoder = server.join(terrain, secret), FrameDecoder()
        peer.say("view", **NEAR.model_dump(mode="json", exclude={"type"}))
        peer.ops(("c1:1", stroke(height=20.0)))
        follow(peer, decoder, 1)
        made, held = list(solver.made), dict(decoder.held)
        assert made
        peer.ops(("c1:2", set_op(amplitude_m=12.5)))
        follow(peer, decoder, 2)
        assert decoder.channels[c.Channel.AMPLITUDE][TileKey(0, 0, 0)].samples.any()
        assert solver.made == made
        assert decoder.held == held
        peer.say("view", **(NEAR.model_dump(mode="json", exclude={"type"}) | {"tau_px": 0.5}))
        # The ground was final before the view came nearer: what is asked for now has to arrive first.
        follow(peer, decoder, 2, refined=1 + sum(key.level > 1 for key in held))
        assert len(solver.made) > len(made), "refinement goes on from the same ground"
        assert len(decoder.held) > len(held)
        peer.close()
