"""Esri ASCII grids, read strictly (SPEC G2, G6)."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

from esker.importing.formats import ascii_grid
from esker.importing.refusal import ImportRefused
from tests.importing.conftest import KEPT, look, take

HEAD = "ncols 5\nnrows 4\nxllcorner 10\nyllcorner 20\ncellsize 2\nNODATA_value -9999\n"
BODY = "\n".join(" ".join(f"{10 * r + q}.5" for q in range(5)) for r in range(4))


def _file(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "grid.asc"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def _values(path: Path) -> np.ndarray:
    source = ascii_grid.open_ascii(path)
    return np.concatenate([np.where(p.valid, p.values, np.nan) for p in source.pieces()])


def test_plain(tmp_path: Path) -> None:
    values = _values(_file(tmp_path, HEAD + BODY))
    assert np.array_equal(values, 10 * np.arange(4)[:, None] + np.arange(5) + 0.5)


@pytest.mark.parametrize("newline", ["\r\n", "\n", "\r"])
def test_decimal_commas_and_a_byte_order_mark(newline: str, tmp_path: Path) -> None:
    """SPEC G6: 1,5 is 1.5, with a note."""
    text = (HEAD.replace("cellsize 2", "cellsize 2,0") + BODY.replace(".", ",")).replace("\n", newline)
    path = _file(tmp_path, b"\xef\xbb\xbf" + text.encode())
    assert np.array_equal(_values(path), 10 * np.arange(4)[:, None] + np.arange(5) + 0.5)
    assert any("1,5 is read as 1.5" in note for note in look(path).report.notes)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (HEAD + BODY.replace("0.5", "0,5", 1), "mixed"),
        (HEAD + BODY.replace(".5 ", ","), "mixed|separated"),
        (HEAD + "1,234,567 " + " ".join(["1"] * 19), "separated"),
        (HEAD + BODY.replace("0.5", "1_0", 1), "mixed|number"),
        (HEAD + BODY.replace("0.5", "abc", 1), "'abc'"),
        (HEAD + BODY.replace("0.5", "0x10", 1), "number"),
        (HEAD + BODY[:-5], "ends early"),
        (HEAD, "ends early"),
        (HEAD + BODY + " 7", "more samples"),
        (HEAD.replace("cellsize 2", "cellsize 0") + BODY, "cellsize"),
        (HEAD.replace("cellsize 2", "cellsize -2") + BODY, "cellsize"),
        (HEAD.replace("cellsize 2\n", "") + BODY, "cellsize"),
        (HEAD.replace("ncols 5", "ncols 5.5") + BODY, "ncols"),
        (HEAD.replace("ncols 5", "ncols -5") + BODY, "samples"),
        (HEAD.replace("ncols 5\n", "") + BODY, "ncols"),
        ("ncols 5\n" + HEAD + BODY, "twice"),
        ("ncols 5\nfoo 3\n" + HEAD + BODY, "'foo'"),
        (HEAD.replace("ncols 5", "ncols 2000000").replace("nrows 4", "nrows 2000000") + BODY, "at most 200,000,000"),
        (HEAD + "9" * 100_000, "text where samples|number|ends early"),
    ],
)
def test_refusals(text: str, reason: str, tmp_path: Path) -> None:
    """SPEC G2, G6: each with its reason."""
    with pytest.raises(ImportRefused, match=reason):
        look(_file(tmp_path, text))


def test_no_grid_becomes_fifteen(tmp_path: Path) -> None:
    """SPEC G6: the kept file with commas is either read as it is meant or refused."""
    with contextlib.suppress(ImportRefused):
        assert np.nanmax(_values(KEPT / "comma_bom.asc")) == 5.5


def test_centre_and_corner(tmp_path: Path) -> None:
    """xllcenter is the place of a sample, xllcorner that of its cell's corner."""
    corner = ascii_grid.open_ascii(_file(tmp_path, HEAD + BODY)).georef
    centre = ascii_grid.open_ascii(
        _file(tmp_path, HEAD.replace("corner 1", "center 1").replace("corner 2", "center 2") + BODY)
    ).georef
    assert corner is not None
    assert centre is not None
    assert corner.affine == (2.0, 0.0, 11.0, 0.0, -2.0, 27.0)
    assert centre.affine == (2.0, 0.0, 10.0, 0.0, -2.0, 26.0)


def test_numbers_across_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A number that a chunk cuts in two stays one number."""
    monkeypatch.setattr(ascii_grid, "CHUNK_BYTES", 7)
    monkeypatch.setattr(ascii_grid, "PIECE_SAMPLES", 5)
    values = _values(_file(tmp_path, HEAD + BODY))
    assert np.array_equal(values, 10 * np.arange(4)[:, None] + np.arange(5) + 0.5)


def test_sample_watershed(tmp_path: Path) -> None:
    """A real grid in metres, half of it nodata."""
    report = look(KEPT / "hugo_site.asc").report
    assert (report.low_m, report.high_m, report.spacing_m) == (1660.0, 1711.0, (10.0, 10.0))
    layer, raster = take(KEPT / "hugo_site.asc", tmp_path / "raster")
    assert raster.valid == pytest.approx(0.515, abs=1e-3)
    assert not layer.facts.geo
