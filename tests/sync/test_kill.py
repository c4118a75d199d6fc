"""SIGKILL at random moments under load loses nothing that was acknowledged (SPEC J10; DESIGN 13, 14)."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from esker.store.journal import Journal

ROOT = Path(__file__).resolve().parents[2]
KILLS = 50
PARTS = 5


def _life(data: Path, first: int, seconds: float) -> dict[str, int]:
    """Runs a room until it is killed ``seconds`` after its first acknowledgement; what it acknowledged."""
    command = [sys.executable, str(ROOT / "tests" / "sync" / "kill_child.py"), str(data), str(first)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stderr is not None
        head = child.stdout.readline()
        if not head:
            pytest.fail(child.stderr.read().decode())
        time.sleep(seconds)
        child.send_signal(signal.SIGKILL)
        text = (head + child.stdout.read()).decode()
        child.stderr.read()
    # The last line may be cut in two by the kill: then nobody has read it as an acknowledgement.
    lines = text.split("\n")[:-1]
    return {op_id: int(clock) for op_id, clock in (line.split() for line in lines)}


@pytest.mark.parametrize("part", range(PARTS))
def test_killed_under_load(part: int, tmp_path: Path) -> None:
    rng = random.Random(part)
    acked: dict[str, int] = {}
    for _ in range(KILLS // PARTS):
        first = max((int(op_id.split(":")[1]) for op_id in acked), default=-1)
        new = _life(tmp_path, (first // 1000 + 1) * 1000 if acked else 0, rng.uniform(0, 0.12))
        assert new
        assert not acked.keys() & new.keys()
        acked |= new
    journal = Journal(tmp_path)  # raises when the file is damaged
    loaded = journal.load("t")  # raises when the journal does not replay
    assert loaded is not None
    rows = {f"{row.client}:{row.counter}": row.clock for row in journal.rows("t", 0)}
    lost = {op_id: clock for op_id, clock in acked.items() if rows.get(op_id) != clock}
    assert lost == {}
    assert sorted(rows.values()) == list(range(1, len(rows) + 1))
    assert loaded.document.clock == len(rows)
    assert len(acked) > 100
    journal.close()
