"""Contour maps on paper and solids for printers, checked against shapes that one can work out (SPEC N40 to N48)."""

from __future__ import annotations

import datetime
import re
import struct
import zlib
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import ValidationError

from esker import Stroke, Terrain, contract
from esker.cli import main as command_line
from esker.contract import ExportRequest, ModelOptions, PaperOptions, TerrainSettings
from esker.exporting import formats
from esker.exporting.ground import Ground
from esker.exporting.printing import layout, pdf, svg
from esker.exporting.printing.contours import contour, steep_cells
from esker.exporting.printing.drawing import CannotPrint, Clip, Drawing, Text
from esker.exporting.printing.drawing import Path as Shape
from esker.exporting.printing.layout import EARTH, contour_map, frame_of
from esker.exporting.printing.solid import HEADER_BYTES, TRIANGLE, corners, write_solid

TODAY = datetime.date(2026, 11, 25)
SVG = "{http://www.w3.org/2000/svg}"


def ground_of(heights: Any, spacing: float = 10.0, **more: Any) -> Ground:
    z = np.asarray(heights, dtype=np.float32)
    size = (max(z.shape) - 1) * spacing
    return Ground(z, 0.0, 0.0, spacing, TerrainSettings(size_m=max(size, 64.0), title="Kegel <&> (1)"), **more)


def cone(n: int = 65, spacing: float = 10.0, top: float = 100.0, tangent: float = 0.5) -> Ground:
    """A cone over the middle of the ground."""
    at = (np.arange(n) - (n - 1) / 2) * spacing
    return ground_of(top - tangent * np.hypot(at[None, :], at[:, None]), spacing)


def shapes(drawing: Drawing) -> list[Shape | Text]:
    """All shapes of a page, those inside of clips too."""
    return [inner for shape in drawing.shapes for inner in (shape.shapes if isinstance(shape, Clip) else [shape])]


@given(
    st.integers(3, 12),
    st.integers(3, 12),
    st.lists(st.integers(-3, 3), min_size=144, max_size=144),
    st.sampled_from([-2.5, 0.0, 0.5, 1.0]),
)
@settings(max_examples=200, deadline=None)
def test_lines_part_what_is_above_from_what_is_below(rows: int, columns: int, values: list[int], level: float) -> None:
    """SPEC N40: every crossed edge belongs to one line exactly; lines end at the border only, or not at all."""
    z = np.array(values[: rows * columns], dtype=np.float32).reshape(rows, columns)
    above = z >= level
    crossed = int((above[:, 1:] != above[:, :-1]).sum() + (above[1:] != above[:-1]).sum())
    found = contour(z, level)
    points = [tuple(p) for line in found for p in (line.points[:-1] if line.closed else line.points)]
    assert len(points) == crossed
    for line in found:
        for x, y in () if line.closed else line.points[[0, -1]]:
            assert x in (0, columns - 1) or y in (0, rows - 1)
        for x, y in line.points:
            i, j = min(int(y), rows - 2), min(int(x), columns - 2)
            cell = z[i : i + 2, j : j + 2]
            assert cell.min() <= level <= cell.max()


def test_contours_of_a_cone_are_circles() -> None:
    """SPEC N40: at their height, to a sagitta of a cell."""
    ground = cone()
    for level in (20.0, 50.0, 80.0):
        (line,) = contour(ground.heights, level)
        assert line.closed
        away = np.hypot(*(line.points - 32.0).T) * ground.spacing_m
        radius = (100.0 - level) / 0.5
        assert np.abs(away - radius).max() < 10.0**2 / (8 * radius) + 1.0


def test_flat_ground_has_no_contours() -> None:
    """SPEC N42: neither exactly at the height of a contour, nor under the noise of the detail."""
    noise = np.random.default_rng(7).normal(0.0, 0.4, (65, 65)).astype(np.float32)
    assert contour(np.zeros((9, 9), dtype=np.float32), 0.0) == []
    plain = ground_of(noise, solved=np.zeros((65, 65), dtype=np.float32))
    lines = [s for s in shapes(contour_map(plain, PaperOptions(interval_m=5), TODAY)) if isinstance(s, Shape)]
    assert not any(s.colour == EARTH and len(s.rings) and s.rings[0].shape[0] > 2 for s in lines)
    assert contour(noise, 0.0), "without the solved ground there would be lines"
    # Beside a slope they stay where the slope is.
    slope = np.maximum(np.arange(65, dtype=np.float32) - 32.0, 0.0)[None, :].repeat(65, axis=0)
    kept = steep_cells(slope, 5.0)
    assert not kept[:, :30].any()
    assert kept[:, 33:].all()


@pytest.mark.parametrize(
    ("wanted", "scale"),
    [(PaperOptions(), 4000), (PaperOptions(size="a3"), 2500), (PaperOptions(scale=10_000), 10_000)],
)
def test_a_map_is_to_scale(wanted: PaperOptions, scale: float) -> None:
    """SPEC N41: millimetres on paper times the scale are metres on the ground; the map lies on its paper."""
    ground = cone()
    frame = frame_of(ground, wanted)
    x0, y0, x1, y1 = frame.box
    assert frame.scale == scale
    assert (x1 - x0) * scale / 1000 == pytest.approx(640.0)
    assert min(x0, y0, frame.width_mm - x1, frame.height_mm - y1) > 0
    assert (frame.width_mm, frame.height_mm) == ((297.0, 420.0) if wanted.size == "a3" else (210.0, 297.0))
    made = contour_map(ground, wanted.model_copy(update={"interval_m": 20.0}), TODAY)
    rings = [ring for s in shapes(made) if isinstance(s, Shape) and s.colour == EARTH for ring in s.rings]
    whole = [ring for ring in rings if len(ring) > 2 and np.array_equal(ring[0], ring[-1])]
    # The contour of 80 m lies 40 m around the summit.
    assert min(float(np.ptp(ring[:, 0])) for ring in whole) == pytest.approx(80.0 * 1000 / scale, rel=0.02)


def test_a_map_says_what_one_needs() -> None:
    """SPEC N41: title, scale, interval, index contours with their heights the right way up, date, north."""
    made = contour_map(cone(), PaperOptions(interval_m=4), TODAY)
    texts = [s for s in shapes(made) if isinstance(s, Text)]
    words = [t.text for t in texts]
    for said in ("Kegel <&> (1)", "1 : 4\u00a0000", "Contours every 4 m", "Each fifth stronger: every 20 m", "N"):
        assert said in words
    assert any("25 November 2026" in w for w in words)
    heights = [t for t in texts if t.angle_deg != 0 or t.text in ("20", "40", "60", "0")]
    on_lines = [t for t in heights if t.colour == EARTH]
    assert on_lines
    assert all(int(t.text.replace("\u2212", "-")) % 20 == 0 for t in on_lines)
    assert all(-90 <= t.angle_deg <= 90 for t in texts)


def test_the_svg_is_in_millimetres(tmp_path: Path) -> None:
    """SPEC N43."""
    svg.write_drawing(tmp_path / "a.svg", contour_map(cone(), PaperOptions(), TODAY))
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == ("210mm", "297mm", "0 0 210 297")
    assert root.findtext(f"{SVG}title") == "Kegel <&> (1)"
    assert any(t.text == "Kegel <&> (1)" for t in root.iter(f"{SVG}text"))
    assert all("nan" not in (p.get("d") or "") for p in root.iter(f"{SVG}path"))


def test_the_pdf_is_whole(tmp_path: Path) -> None:
    """SPEC N43: its table says where each object begins, its page is the paper, and letters it lacks are marked."""
    made = contour_map(cone(), PaperOptions(size="a3"), TODAY)
    made.shapes.append(Text(10, 10, "\u5c71 Gr\u00fc\u00df (a\\b)", 4.0))
    pdf.write_drawing(tmp_path / "a.pdf", made)
    data = (tmp_path / "a.pdf").read_bytes()
    start = int(re.search(rb"startxref\n(\d+)\n%%EOF\n$", data)[1])  # type: ignore[index]
    assert data[start:].startswith(b"xref\n0 8\n")
    rows = data[start:].split(b"\n")[3:10]
    for number, row in enumerate(rows, 1):
        assert data[int(row[:10]) :].startswith(b"%d 0 obj\n" % number)
    width, height = re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", data).groups()  # type: ignore[union-attr]
    assert float(width) / 72 * 25.4 == pytest.approx(297, abs=0.01)
    assert float(height) / 72 * 25.4 == pytest.approx(420, abs=0.01)
    (length,) = re.search(rb"/Length (\d+)", data).groups()  # type: ignore[union-attr]
    begin = data.index(b"stream\n") + 7
    text = zlib.decompress(data[begin : begin + int(length)]).decode("cp1252")
    assert "(\u00b7 Gr\u00fc\u00df \\(a\\\\b\\)) Tj" in text
    assert "nan" not in text
    assert text.count("\nq ") == text.count("\nQ") == 1


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    """SPEC N44: with a sentence that says what does."""
    with pytest.raises(CannotPrint, match=r"At 1 : 1.000 this map is larger than A4 paper\. Take 1 : 4.000 or"):
        contour_map(cone(), PaperOptions(scale=1000), TODAY)
    with pytest.raises(CannotPrint, match="more than 400 contours"):
        contour_map(cone(), PaperOptions(interval_m=0.1), TODAY)
    with pytest.raises(CannotPrint, match="at least two samples"):
        contour_map(ground_of([[1.0, 2.0]]), PaperOptions(), TODAY)
    with pytest.raises(CannotPrint, match="2 to 1025 samples"):
        corners(ground_of([[1.0], [2.0]]), ModelOptions())
    with pytest.raises(CannotPrint, match="without a height"):
        corners(ground_of([[1.0, np.nan], [1.0, 1.0]]), ModelOptions())
    assert formats.refusal(ExportRequest(format="png16", paper=PaperOptions())) == formats.ONLY_MAPS
    assert formats.refusal(ExportRequest(format="map_pdf", model=ModelOptions())) == formats.ONLY_SOLIDS
    assert "A solid has at most 1025" in formats.refusal(ExportRequest(format="stl", samples=2049))
    assert "A contour map has at most 2049" in formats.refusal(ExportRequest(format="map_svg", samples=4097))
    terrain = Terrain(size_m=512)
    for name, more in (("a.png", {"paper": PaperOptions()}), ("a.svg", {"model": ModelOptions()})):
        with pytest.raises(ValueError, match=r"^Only"):
            terrain.export(tmp_path / name, level=1, **more)
    with pytest.raises(CannotPrint):
        terrain.export(tmp_path / "a.svg", level=1, paper=PaperOptions(scale=10))
    assert list(tmp_path.iterdir()) == []


def test_ground_that_is_noise_is_refused_before_it_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC X381: a map of it took the one place in which exports are made, for hours and gigabytes."""
    noise = np.random.default_rng(1).uniform(0, 1000, (257, 257))
    monkeypatch.setattr(layout, "contour", lambda *_: pytest.fail("it was drawn"))
    with pytest.raises(CannotPrint, match="too rough"):
        contour_map(ground_of(noise), PaperOptions(interval_m=4.0), TODAY)
    monkeypatch.undo()
    mild = contour_map(cone(257), PaperOptions(interval_m=4.0), TODAY)
    points = sum(len(line) for shape in shapes(mild) if isinstance(shape, Shape) for line in shape.rings)
    assert points < layout.MOST_CROSSINGS


@pytest.mark.parametrize("size", ["a4", "a3"])
@pytest.mark.parametrize("scale", [0, 1, 50_000_000])
@pytest.mark.parametrize("interval", [0.0, 5e-324, 1e-300, 1e-3, 10_000.0])
@pytest.mark.parametrize("heights", [[[0.0] * 9] * 9, [[k * 4e3 - n * 5e3 for k in range(9)] for n in range(9)]])
def test_numbers_of_a_map_at_their_ends(
    tmp_path: Path, size: Any, scale: int, interval: float, heights: list[list[float]]
) -> None:
    """SPEC X382: it is drawn, or refused."""
    try:
        made = contour_map(ground_of(heights, 3.0), PaperOptions(size=size, scale=scale, interval_m=interval), TODAY)
    except CannotPrint:
        return
    svg.write_drawing(tmp_path / "a.svg", made)
    pdf.write_drawing(tmp_path / "a.pdf", made)
    assert "nan" not in (tmp_path / "a.svg").read_text()
    ElementTree.parse(tmp_path / "a.svg")


@pytest.mark.parametrize("width", [10.0, 2000.0])
@pytest.mark.parametrize("base", [0.2, 200.0])
@pytest.mark.parametrize("exaggeration", [0.1, 20.0])
def test_numbers_of_a_solid_at_their_ends(tmp_path: Path, width: float, base: float, exaggeration: float) -> None:
    """SPEC X382."""
    options = ModelOptions(width_mm=width, base_mm=base, exaggeration=exaggeration)
    write_solid(tmp_path / "a.stl", ground_of([[k * 4e3 - n * 5e3 for k in range(9)] for n in range(9)], 3.0), options)
    made = solid_of(tmp_path / "a.stl")
    assert np.isfinite(made["corners"]).all()
    for field, values in (("width_mm", (9.9, 2000.1)), ("base_mm", (0.1, 201)), ("exaggeration", (0.09, 20.1))):
        for value in (*values, float("nan"), float("inf")):
            with pytest.raises(ValidationError):
                ModelOptions.model_validate({field: value})


def solid_of(path: Path) -> NDArray[Any]:
    data = path.read_bytes()
    (count,) = struct.unpack_from("<I", data, HEADER_BYTES)
    assert len(data) == HEADER_BYTES + 4 + count * TRIANGLE.itemsize
    assert TRIANGLE.itemsize == 50
    return np.frombuffer(data, dtype=TRIANGLE, offset=HEADER_BYTES + 4)


@given(st.integers(2, 9), st.integers(2, 9), st.lists(st.integers(-40, 40), min_size=81, max_size=81))
@settings(max_examples=60, deadline=None)
def test_a_solid_is_watertight(rows: int, columns: int, values: list[int]) -> None:
    """SPEC N45: each edge belongs to two triangles that run along it in opposite directions, and to no more; they are
    one surface of genus 0 whose volume is that of ground and base."""
    z = np.array(values[: rows * columns], dtype=np.float32).reshape(rows, columns)
    found = corners(ground_of(z, 5.0), ModelOptions(width_mm=80, base_mm=2))
    names: dict[tuple[float, ...], int] = {}
    ids = [[names.setdefault(tuple(p), len(names)) for p in t.tolist()] for t in found]
    edges = Counter((t[k], t[(k + 1) % 3]) for t in ids for k in range(3))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    assert len(names) - len(edges) // 2 + len(ids) == 2
    a, b, c = (found[:, k].astype(np.float64) for k in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 0
    volume = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6
    per = 80 / (max(rows, columns) - 1)
    tall = (z - z.min()).astype(np.float64) * per / 5.0 + 2.0
    cells = (tall[:-1, :-1] + tall[1:, 1:]) / 3 + (tall[:-1, 1:] + tall[1:, :-1]) / 6
    assert volume == pytest.approx(per**2 * cells.sum(), rel=1e-4)


def test_a_solid_has_its_size(tmp_path: Path) -> None:
    """SPEC N46: width, base and heights in millimetres, normals outwards and of length 1."""
    write_solid(tmp_path / "a.stl", cone(), ModelOptions(width_mm=160, base_mm=4, exaggeration=2))
    made = solid_of(tmp_path / "a.stl")
    points = made["corners"].reshape(-1, 3)
    ground = cone()
    relief = float(np.ptp(ground.heights)) * 160 / 640 * 2
    np.testing.assert_allclose(points.min(axis=0), 0, atol=1e-6)
    np.testing.assert_allclose(points.max(axis=0), [160, 160, 4 + relief], rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(made["normal"], axis=1), 1, atol=1e-5)
    top = made[: 2 * 64 * 64]
    assert (top["normal"][:, 2] > 0).all()
    assert points.dtype == np.dtype("<f4")


def test_maps_and_solids_of_a_terrain(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """SPEC N47: the command line makes what Python makes, and refuses what does not belong to the file."""
    made = Terrain(size_m=512)
    made.add(Stroke.profile([(60, 250, 0), (250, 280, 130), (440, 250, 0)], left=(35, 250), right=(45, 250)))
    made.settings = made.settings.model_copy(update={"sea_level_m": 1.0})
    made.save(tmp_path / "a.esker")
    args = ["export", str(tmp_path / "a.esker"), "-q", "--level", "2", "-o"]
    assert command_line.main([*args, str(tmp_path / "a.svg"), "--paper", "a3", "--interval", "10"]) == 0
    made.export(tmp_path / "b.svg", level=2, paper=PaperOptions(size="a3", interval_m=10))
    assert (tmp_path / "a.svg").read_text() == (tmp_path / "b.svg").read_text()
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    assert any(path.get("fill") == "#dbedf7" for path in root.iter(f"{SVG}path")), "the sea"
    assert command_line.main([*args, str(tmp_path / "a.stl"), "--width", "100", "--exaggeration", "3"]) == 0
    assert solid_of(tmp_path / "a.stl")["corners"][..., 0].max() == pytest.approx(100)
    for name, more, says in (
        ("a.stl", ["--paper", "a3"], "Only contour maps"),
        ("a.svg", ["--base", "3"], "Only solids"),
        ("c.stl", ["--width", "1"], "--width"),
    ):
        with pytest.raises(SystemExit):
            command_line.main([*args, str(tmp_path / name), *more])
        assert says in capsys.readouterr().err
    assert command_line.main([*args, str(tmp_path / "c.pdf"), "--scale", "100"]) == 1
    assert "larger than A4 paper" in capsys.readouterr().err
    assert contract.EXPORT_LEVELS["257"] == 2
