"""SIGKILL at any moment of an import leaves the terrain without the layer or with all of it (SPEC J13, J14)."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from esker.contract import MAX_LAYERS
from esker.patchwork.raster import rasters
from esker.process import system
from esker.store.grids import GridStore
from esker.store.journal import Journal

ROOT = Path(__file__).resolve().parents[2]
KILLS = 30
MOST_LIVES = 20 * KILLS
"""Lives after which the test gives up: kills did not strike where they were meant to."""
LONGEST = 0.15
"""Seconds from the beginning, or from the end of an import, to the kill, at most: about as long as an import takes."""


def _killed(zygote: subprocess.Popen[str], data: Path, seed: int, imports: int, seconds: float) -> list[str]:
    """One life over ``data``, killed so long after so many imports; the layers that it said were done."""
    assert zygote.stdin is not None
    assert zygote.stdout is not None
    assert zygote.stderr is not None
    zygote.stdin.write(f"{data} {seed}\n")
    zygote.stdin.flush()
    child = int(zygote.stderr.readline())
    assert zygote.stdout.readline() == "ready\n"
    lines = [zygote.stdout.readline().rstrip("\n") for _ in range(imports)]
    assert "gone" not in lines, "a life ended by itself: run tests/sync/import_child.py to see why"
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    while (line := zygote.stdout.readline().rstrip("\n")) != "gone" and not line.endswith("gone"):
        lines.append(line)
    return [line for line in lines if line]


def test_killed_while_importing(tmp_path: Path) -> None:
    rng = random.Random(11)
    said: list[str] = []
    lives = left_over = 0
    command = [sys.executable, "-m", "tests.sync.import_child"]
    with subprocess.Popen(
        command, cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as zygote:
        # Every second life ends some imports before it is killed, however slow the machine is.
        while lives < KILLS or len(said) <= KILLS / 4 or left_over <= KILLS / 6:
            assert lives < MOST_LIVES, (len(said), left_over)
            said += _killed(zygote, tmp_path, lives, lives % 2, rng.uniform(0, LONGEST))
            left_over += _check(tmp_path, said, lives)
            lives += 1
        assert zygote.stdin is not None
        zygote.stdin.close()


def test_a_grid_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J14: no kill shows what a machine without power would have lost."""
    store, raster = GridStore(tmp_path), rasters.build(np.add.outer(np.arange(40.0), np.arange(50.0)))
    named = store.path(raster.digest)
    synced: list[tuple[str, bool]] = []
    sync = system.sync

    def noted(path: Path) -> None:
        synced.append((path.name, named.exists()))
        sync(path)

    monkeypatch.setattr(system, "sync", noted)
    store.put(raster)
    before = {name for name, has_name in synced if not has_name}
    assert before == {"raster", *(path.name for path in named.iterdir())}
    assert synced[-1] == (store.folder.name, True), "the name itself, then"


def _check(data: Path, said: list[str], lives: int) -> bool:
    """The state that a kill left; whether it left something over, and so struck in the middle of an import."""
    journal, grids = Journal(data), GridStore(data)
    try:
        loaded = journal.load("t")
        assert loaded is not None
        layers = loaded.document.layers | loaded.document.deleted_layers
        assert len(loaded.document.deleted_layers) <= MAX_LAYERS
        assert len(loaded.document.layers) <= lives + 1, "each life deletes what it imported before it imports the next"
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
