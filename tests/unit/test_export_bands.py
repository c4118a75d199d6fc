"""What an export holds in memory: bands of rows, and no solve of a finest level (SPEC X391)."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.ground.export import measure_memory
from esker import Terrain, contract
from esker.api import export_child
from esker.contract import ExportRequest
from esker.exporting import formats, ground, wire
from esker.exporting.ground import Extent, bands, take
from esker.solve.solver import Solver
from tests.unit.test_exports import LEVEL, SIZE, exported, terrain

__all__ = ["terrain"]

MADE: tuple[tuple[str, dict[str, Any]], ...] = (
    ("png", {"detail": False, "global_level": 1}),
    ("zip", {}),
    ("zip", {"weights": True}),
)
"""Files with all that is made in bands of rows."""


def test_heights_without_detail_are_refined_above_what_is_solved_as_a_whole(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC X391: the file has what the page shows but for its detail, and agrees with windows to the bit."""
    path = exported(terrain, tmp_path, "a.npy", detail=False, global_level=1)
    whole = terrain.window(LEVEL, 0, 0, SIZE, SIZE, global_level=1).heights
    np.testing.assert_array_equal(np.load(path), whole)
    assert np.abs(whole - terrain.heights(LEVEL)).max() > 0
    part = exported(terrain, tmp_path, "b.npy", detail=False, global_level=1, window=(64, 64, 192, 128))
    np.testing.assert_array_equal(np.load(part), whole[32:65, 32:97])


def test_no_export_solves_a_finer_level_as_a_whole(terrain: Terrain, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC X391: a solve of the finest level takes gigabytes."""
    solved: list[int] = []
    heights = Terrain.heights

    def watched(self: Terrain, level: int) -> Any:
        solved.append(level)
        return heights(self, level)

    monkeypatch.setattr(Terrain, "heights", watched)
    for masks in (False, True):
        take(terrain, Extent.of(3, None), detail=False, masks=masks, solved=True, global_level=1, refined_level=2)
    assert solved == []


@pytest.mark.parametrize(
    ("start", "stop", "columns"), [(0, 4097, 4097), (100, 4097, 4097), (7, 8, 1), (5, 300, 1 << 21), (0, 257, 257)]
)
def test_bands_are_whole_rows_of_tiles(start: int, stop: int, columns: int) -> None:
    """SPEC X391."""
    found = list(bands(start, stop, columns))
    assert [found[0][0], *(end for _, end in found)] == [*(begin for begin, _ in found), stop]
    assert found[0][0] == start
    for begin, end in found:
        assert 0 < (end - begin) * columns <= max(ground.BAND_SAMPLES, columns)
        if ground.BAND_SAMPLES // columns >= contract.TILE_CELLS:
            assert end == stop or end % contract.TILE_CELLS == 0


def test_files_are_the_same_in_bands_of_any_size(
    terrain: Terrain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC X391: what is made of a file's rows does not depend on how many are made at once."""
    once = [exported(terrain, tmp_path, f"once{k}.{end}", **more).read_bytes() for k, (end, more) in enumerate(MADE)]
    monkeypatch.setattr(ground, "BAND_SAMPLES", 100 * 257)
    again = [exported(terrain, tmp_path, f"again{k}.{end}", **more).read_bytes() for k, (end, more) in enumerate(MADE)]
    for k, (end, _) in enumerate(MADE):
        if end == "zip":
            with zipfile.ZipFile(tmp_path / f"once{k}.zip") as one, zipfile.ZipFile(tmp_path / f"again{k}.zip") as two:
                assert {name: one.read(name) for name in one.namelist()} == {n: two.read(n) for n in two.namelist()}
        else:
            assert once[k] == again[k]


def test_a_window_has_a_bound(terrain: Terrain, tmp_path: Path) -> None:
    """SPEC X8: rather a sentence than all the memory."""
    for detail in (False, True):
        with pytest.raises(ValueError, match=r"that window holds 524,289 x 524,289 samples of level 13"):
            exported(terrain, tmp_path, "a.npy", level=13, window=(0, 0, SIZE, SIZE), detail=detail)


def test_the_solver_s_memory_goes_before_what_needs_memory_of_its_own(
    terrain: Terrain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC X391: before masks are made of the detail, and before the file is written."""
    said: list[object] = []

    def exporting(*_: object, step: Callable[[str, float], None], **__: object) -> None:
        for stage, share in (("detail", 0.5), ("detail", 1.0), ("writing", 0.0), ("writing", 0.5)):
            step(stage, share)
            said.append(share)

    monkeypatch.setattr(formats, "export", exporting)
    monkeypatch.setattr(Solver, "tidy", lambda _, now: said.append(now))
    task = wire.Task(
        document=terrain.document,
        wanted=ExportRequest(format="npy", samples=257),
        grids="",
        folder=str(tmp_path),
        name="a",
    )
    export_child._made(task, "numpy", {}, export_child.Out())
    assert said == [0.5, math.inf, 1.0, math.inf, 0.0, 0.5]


def test_the_benchmark_tells_what_a_process_holds() -> None:
    """What docs/exporting.md says of memory is measured on the process that a server starts."""
    (found,) = measure_memory((("alpine-ridge", {"format": "png16", "samples": 257, "detail": False}),)).values()
    assert 50 < found["memory_mib"] < 1000
    with pytest.raises(RuntimeError, match=r"alpine-ridge.*300"):
        measure_memory((("alpine-ridge", {"format": "png16", "samples": 300, "detail": False}),))
