"""SIGKILL at random moments under load loses nothing that was acknowledged (SPEC J10; DESIGN 13, 14)."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from esker.store.journal import Journal

ROOT = Path(__file__).resolve().parents[2]
KILLS = 50
PARTS = 5
MOST_LIVES = 20 * KILLS // PARTS
"""Lives after which a part gives up: hardly anything was acknowledged in any of them."""
MOST_ACKS = 40
LONGEST = 0.01
"""Seconds from an acknowledgement to the kill, at most: about as long as the next commit takes."""


@pytest.fixture(scope="module")
def zygote() -> Iterator[subprocess.Popen[str]]:
    """What the lives are forked from."""
    command = [sys.executable, "-m", "tests.sync.kill_child"]
    with subprocess.Popen(
        command, cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        yield process
        assert process.stdin is not None
        process.stdin.close()


def _life(zygote: subprocess.Popen[str], data: Path, first: int, acks: int, seconds: float) -> dict[str, int]:
    """Runs a room until it is killed ``seconds`` after its acknowledgement of this number; what it acknowledged."""
    assert zygote.stdin is not None
    assert zygote.stdout is not None
    assert zygote.stderr is not None
    zygote.stdin.write(f"{data} {first}\n")
    zygote.stdin.flush()
    child = int(zygote.stderr.readline())
    lines = []
    for _ in range(acks):
        lines.append(zygote.stdout.readline())
        if lines[-1] == "gone\n":
            pytest.fail("A life ended by itself: run tests/sync/kill_child.py to see why.")
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    # The last line may be cut in two by the kill: then nobody has read it as an acknowledgement.
    while not (line := zygote.stdout.readline()).endswith("gone\n"):
        lines.append(line)
    return {op_id: int(clock) for op_id, clock in map(str.split, lines)}


@pytest.mark.parametrize("part", range(PARTS))
def test_killed_under_load(zygote: subprocess.Popen[str], part: int, tmp_path: Path) -> None:
    rng = random.Random(part)
    acked: dict[str, int] = {}
    lives = 0
    while lives < KILLS // PARTS or len(acked) <= 100:
        assert lives < MOST_LIVES, len(acked)
        first = max((int(op_id.split(":")[1]) for op_id in acked), default=-1)
        acks, seconds = rng.randint(1, MOST_ACKS), rng.uniform(0, LONGEST)
        new = _life(zygote, tmp_path, (first // 1000 + 1) * 1000 if acked else 0, acks, seconds)
        assert new
        assert not acked.keys() & new.keys()
        acked |= new
        lives += 1
    journal = Journal(tmp_path)  # raises when the file is damaged
    loaded = journal.load("t")  # raises when the journal does not replay
    assert loaded is not None
    rows = {f"{row.client}:{row.counter}": row.clock for row in journal.rows("t", 0)}
    lost = {op_id: clock for op_id, clock in acked.items() if rows.get(op_id) != clock}
    assert lost == {}
    assert sorted(rows.values()) == list(range(1, len(rows) + 1))
    assert loaded.document.clock == len(rows)
    journal.close()
