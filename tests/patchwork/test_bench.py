"""The benchmark of the patchwork measures what it says (DESIGN 15): all of it, on a small grid."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.ground import (
    _patchwork,
    _patchwork_big,
    _patchwork_cover,
    _patchwork_data,
    _patchwork_gdal,
    importing,
    patchwork,
)
from esker.patchwork.lod import space
from esker.patchwork.query.queries import Index
from esker.patchwork.raster import rasters

SIDE = 257


def test_finer_grids_keep_the_coarser_one_and_its_roughness(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples stay, flat ground stays flat, bands leave no seam, roughness halves with the spacing."""
    coarse, about = _patchwork_data.first(None)
    assert coarse.shape == (1025, 1025)
    assert "Puget Sound" in about
    coarse = np.ascontiguousarray(coarse[100:200, 300:400])
    coarse[:40, :40] = 7.0
    whole, parts = (np.empty((199, 199), np.float32) for _ in range(2))
    _patchwork_data.finer(coarse, 11, whole)
    monkeypatch.setattr(_patchwork_data, "BAND", 17)
    _patchwork_data.finer(coarse, 11, parts)
    assert np.array_equal(whole, parts)
    assert np.abs(whole[::2, ::2] - coarse).max() < 0.051
    assert (whole[:76, :76] == 7.0).all()
    rough = [float(np.abs(np.diff(z[50:], 2, axis=0)).mean()) for z in (coarse, whole[50:])]
    assert 0.3 * rough[0] < rough[1] < rough[0]


def test_everything_is_measured_and_told(tmp_path: Path) -> None:
    """Every figure of the result is there and goes into the tables of docs/patchwork.md and README."""
    heights = np.ascontiguousarray(_patchwork_data.first(None)[0][:SIDE, :SIDE])
    np.save(tmp_path / "heights.npy", heights)
    big = _patchwork_big.main(tmp_path / "heights.npy", tmp_path / "raster")
    assert big["three_stages_s"] > 0
    assert 0.3 < big["bytes_over"]["share"] < 5
    assert big["memory"]["peak_resident_mib"] >= big["memory"]["resident_mib"] > big["memory"]["anonymous_mib"] > 0
    raster = rasters.read(tmp_path / "raster")
    index = Index(space.build([patchwork.whole(raster)]))
    asked = patchwork.queries(index, quick=True)
    assert asked["uniform"]["0"]["patches"] > asked["uniform"]["50"]["patches"] > 0
    assert asked["flight"]["1000 m/s"]["patches"] > 0
    assert asked["rotation"]["90 deg/s"]["bytes_a_frame"] >= 0
    result: dict[str, Any] = {
        "machine": {"cores": 2, "cpu": "a processor", "load_before": 0.0},
        "data": "a part",
        "build": {"4097": big},
        "queries": asked,
        "blend": patchwork.blending(index, quick=True),
        "add": patchwork.adding(raster, quick=True),
        "gdal": _patchwork_gdal.measure(tmp_path, heights, patchwork.SPAN_M, None, quick=True),
        "paper": patchwork.PAPER,
    }
    result["gdal"]["overviews"]["4097"] = result["gdal"]["overviews"].pop(str(SIDE))
    text = _patchwork.document(f"a {_patchwork.BEGIN} old {_patchwork.END} b", result)
    assert "old" not in text
    assert text.count("| bicubic |") == 1
    assert "196.2" not in text
    assert "11.7 s" in text
    assert len(_patchwork.rows(result)) == 3
    with pytest.raises(ValueError, match="no place"):
        _patchwork.document("nothing", result)


def test_what_of_a_file_is_ground_is_counted(tmp_path: Path) -> None:
    """A hole of one sample in 20 x 30: blocks of 7 x 7 hold all but 48 of the rest, rims those, too."""
    heights = np.arange(600.0).reshape(20, 30)
    heights[8, 9] = np.nan
    (tmp_path / "files").mkdir()
    np.save(tmp_path / "files" / "holed.npy", heights)
    np.save(tmp_path / "files" / "plain.npy", np.nan_to_num(heights))
    (tmp_path / "files" / "empty.tif").touch()
    result = _patchwork_cover.main([tmp_path / "files"])
    assert list(result["files"]) == ["holed.npy", "plain.npy"]
    one = result["files"]["holed.npy"]
    assert one["in_blocks"] == pytest.approx(551 / 599)
    assert one["in_all"] == 1
    assert one["rim_patches"] == 4
    text = _patchwork_cover.document(f"a {_patchwork_cover.BEGIN} stale {_patchwork_cover.END} b", result)
    assert "stale" not in text
    assert "| holed.npy | 20 × 30 | 99.8 % | 92.0 % | 100.0 % |" in text
    assert "1 further files" in text
    with pytest.raises(ValueError, match="no place"):
        _patchwork_cover.document("nothing", result)


def test_the_benchmark_of_imports_goes_on_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Stopped at its third file, or out of time, it prints what it has and what is left out; a whole run keeps
    nothing of its own."""
    asked: list[tuple[int, str]] = []
    stop_at = [3]

    def measured(side: int, layout: str, folder: Path, _puget: Path | None) -> dict[str, int]:
        asked.append((side, layout))
        (folder / "work").mkdir()
        if len(asked) == stop_at[0]:
            raise KeyboardInterrupt
        return {"samples": side}

    monkeypatch.setattr(importing, "measure", measured)
    line = ["--work", str(tmp_path)]
    assert importing.main([*line, "--minutes", "0"]) == 1
    assert json.loads(capsys.readouterr().out)["files"] == {}
    assert importing.main(line) == 1
    first = json.loads(capsys.readouterr().out)
    assert first["files"] == {"1025": {"tiled": {"samples": 1025}, "striped": {"samples": 1025}}}
    assert first["left_out"] == ["4097 tiled", "4097 striped", "14000 tiled", "14000 striped"]
    assert [path.name for path in tmp_path.iterdir()] == [importing.KEPT]
    assert importing.main(line) == 0
    second = json.loads(capsys.readouterr().out)
    assert [len(files) for files in second["files"].values()] == [2, 2, 2]
    assert second["left_out"] == []
    assert asked.count((1025, "tiled")) == 1
    assert not list(tmp_path.iterdir())
