"""SIGKILL at any moment of an import leaves the terrain without the layer or with all of it (SPEC J13)."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from esker.contract import MAX_LAYERS
from esker.patchwork.raster import rasters
from esker.store.grids import GridStore
from esker.store.journal import Journal

ROOT = Path(__file__).resolve().parents[2]
KILLS = 30
LONGEST = 0.3
"""Seconds from the first import to the kill, at most: some imports take place in it."""


def _killed(zygote: subprocess.Popen[str], data: Path, seed: int, seconds: float) -> list[str]:
    """One life over ``data``; the layers that it said were done."""
    assert zygote.stdin is not None
    assert zygote.stdout is not None
    assert zygote.stderr is not None
    zygote.stdin.write(f"{data} {seed}\n")
    zygote.stdin.flush()
    child = int(zygote.stderr.readline())
    assert zygote.stdout.readline() == "ready\n"
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    lines: list[str] = []
    while (line := zygote.stdout.readline().rstrip("\n")) != "gone" and not line.endswith("gone"):
        lines.append(line)
    return [line for line in lines if line]


def test_killed_while_importing(tmp_path: Path) -> None:
    rng = random.Random(11)
    said: list[str] = []
    left_over = 0
    command = [sys.executable, "-m", "tests.sync.import_child"]
    with subprocess.Popen(
        command, cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as zygote:
        for seed in range(KILLS):
            said += _killed(zygote, tmp_path, seed, rng.uniform(0, LONGEST))
            left_over += _check(tmp_path, said)
        assert zygote.stdin is not None
        zygote.stdin.close()
    assert len(said) > KILLS / 4, "imports came to their end between the kills"
    assert left_over > KILLS / 6, "kills struck in the middle of imports"


def _check(data: Path, said: list[str]) -> bool:
    """The state that a kill left; whether it left something over."""
    journal, grids = Journal(data), GridStore(data)
    try:
        loaded = journal.load("t")
        assert loaded is not None
        layers = loaded.document.layers | loaded.document.deleted_layers
        assert len(loaded.document.deleted_layers) <= MAX_LAYERS
        assert len(loaded.document.layers) <= KILLS, "each life deletes what it imported before it imports the next"
        rows = journal.rows("t", 0)
        missing = [layer for layer in said if not any(f'"{layer}"' in row.op for row in rows)]
        assert missing == [], "an import that was said to be done is lost"
        before = set(grids.folder.iterdir())
        grids.sweep(journal.grids())
        after = set(grids.folder.iterdir())
        for layer in layers.values():
            assert rasters.verify(grids.read(layer.content)), "a layer is there without all of its grid"
        kept = {path.name for path in after} - {".trash"}
        assert kept == journal.grids("t"), "nothing is kept that no layer ever was"
        return before != after
    finally:
        journal.close()
