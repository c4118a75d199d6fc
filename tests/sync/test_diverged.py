"""Ground that did not converge is never shown as settled: neither a message nor a frame says so (SPEC S441)."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from esker import Terrain
from esker.api.terrain import Stroke as Make
from esker.contract import Channel
from esker.solve.multigrid import DivergedError
from esker.solve.reference import NumpySystem
from esker.solve.solver import Solver
from esker.tiles.codec.frame import FrameHead, read_frame
from esker.tiles.codec.rivers import is_rivers
from tests.sync.harness import LiveServer, Peer, set_op, stroke


def diverging(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on every cycle changes the ground more than the one before."""
    sizes = (2.0**k for k in itertools.count())
    monkeypatch.setattr(NumpySystem, "change", lambda *_: next(sizes))


def ground(peer: Peer) -> list[FrameHead]:
    """What has come of the heights; asks for the rest that is on its way."""
    peer.say("ping", t=1)
    peer.wait("pong")
    heads = [read_frame(frame)[0] for frame in peer.frames if not is_rivers(frame)]
    return [head for head in heads if head.channel == Channel.HEIGHT]


def test_a_room_shows_what_diverged_as_a_preview_for_ever(tmp_path: Path) -> None:
    solver = Solver("numpy", max_level=1)
    with LiveServer(tmp_path, solver, level=1) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        peer.settled(0)
        with pytest.MonkeyPatch.context() as patch:
            diverging(patch)
            for n in (1, 2, 3):
                peer.seen.clear()
                peer.ops((f"c1:{n}", stroke(height=100.0) if n == 1 else set_op(first=[100, 100, 100.0 + n])))
                # A solve may fail before anything of it is shown: then the sentence comes with the ground of clock 0.
                noted = False
                while not noted:
                    said = peer.wait("progress")
                    assert said["clock"] < 1 or not said["settled"]
                    noted = said["note"] == str(DivergedError())
                assert not any(head.settled for head in ground(peer) if head.clock >= 1)
            late = server.join(terrain, secret, "c2")
            heard = late.wait("progress")
            assert heard["clock"] < 1 or not heard["settled"]
            assert not any(head.settled for head in ground(late) if head.clock >= 1)
        peer.ops(("c1:4", set_op(first=[100, 100, 300.0])))
        peer.settled(4)
        late.settled(4)
        for member in (peer, late):
            member.close()


def test_python_gets_an_error_and_no_heights(monkeypatch: pytest.MonkeyPatch) -> None:
    terrain = Terrain(solver=Solver("numpy", max_level=1))
    terrain.add(Make.profile([(900, 1000, 200), (3000, 2100, 100)]))
    right = terrain.heights(1)
    terrain.add(Make.profile([(900, 3000, 200), (3000, 2100, 100)]))
    with monkeypatch.context() as patch:
        diverging(patch)
        for _ in range(2):
            with pytest.raises(DivergedError):
                terrain.heights(1)
    assert (terrain.heights(1) != right).any()
