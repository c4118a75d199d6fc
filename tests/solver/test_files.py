"""Archives, offline terrains and the command line (SPEC S20, S21; DESIGN 5.7)."""

from __future__ import annotations

import io
import json
import math
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import esker
from esker import Stroke, Terrain
from esker.cli import solve
from esker.contract import Document, Flank, TerrainSettings
from esker.document import archive
from esker.document.archive import ArchiveError
from esker.document.strokes import world_points
from esker.events import PAUSE, Preview, Settled, SolveEvent
from esker.exporting.heightmap import quantised
from esker.solve.constraints.crest import crest_of
from tests.solver.scenes import SCENES, mixed

DOCUMENT = Document(
    id="t1", clock=7, settings=TerrainSettings(size_m=2048.0, reach_m=None, title="Höhe"), strokes=tuple(mixed(6))
)


def zipped(**members: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in members.items():
            file.writestr(name.replace("_", "."), data)
    return out.getvalue()


HEADER = json.dumps({"format": "esker-terrain", "version": 1}).encode()
NEWER = json.dumps({"format": "esker-terrain", "version": archive.VERSION + 1}).encode()
BODY = DOCUMENT.model_dump_json().encode()


def test_archive_round_trip() -> None:
    """SPEC S20."""
    data = archive.dumps(DOCUMENT)
    assert archive.loads(data) == DOCUMENT
    assert archive.dumps(archive.loads(data)) == data
    assert archive.loads(zipped(esker_json=HEADER, document_json=BODY, layers_bin=b"later")) == DOCUMENT


def test_a_file_from_before_paint_opens_unchanged() -> None:
    """SPEC S20: version 1 knew neither paint nor detail; what it does not say has the defaults."""
    body = DOCUMENT.model_dump(mode="json")
    for stroke in body["strokes"]:
        del stroke["paint"]
    for name in ("detail", "rule"):
        del body["settings"][name]
    found = archive.loads(zipped(esker_json=HEADER, document_json=json.dumps(body).encode()))
    assert found == DOCUMENT
    assert (found.settings.detail, found.settings.rule) == (1.0, "landscape")
    painted = DOCUMENT.model_copy(update={"strokes": (*DOCUMENT.strokes, Stroke.paint([(1, 2), (3, 4)], "snow"))})
    assert archive.loads(archive.dumps(painted)) == painted


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "not an .esker file"),
        (b"PK\x03\x04 but no zip", "not an .esker file"),
        (archive.dumps(DOCUMENT)[:-40], "not an .esker file"),
        (zipped(readme_txt=b"hello"), "has no esker.json"),
        (zipped(esker_json=HEADER), "has no document.json"),
        (zipped(esker_json=b"{", document_json=BODY), "damaged"),
        (zipped(esker_json=b"[]", document_json=BODY), "not an .esker file"),
        (zipped(esker_json=NEWER, document_json=BODY), "newer"),
        (zipped(esker_json=HEADER, document_json=b'{"id": "t", "strokes": 3}'), "strokes"),
        (zipped(esker_json=HEADER, document_json=b'{"id": "t", "clock": NaN}'), "not valid"),
        (zipped(esker_json=HEADER, document_json=b" " * 40_000_000), "unpacks to more"),
        (zipped(esker_json=b" " * 1_000_000, document_json=BODY), "unpacks to more"),
    ],
)
def test_hostile_archives(data: bytes, says: str) -> None:
    """SPEC S20."""
    with pytest.raises(ArchiveError, match=says):
        archive.loads(data)


def test_an_archive_that_lies_about_its_size() -> None:
    """The declared size is small, the stream is not: reading stops at the bound or at the checksum."""
    data = bytearray(zipped(esker_json=HEADER, document_json=b" " * 5_000_000))
    size = (5_000_000).to_bytes(4, "little")
    while (at := data.find(size)) >= 0:
        data[at : at + 4] = (100).to_bytes(4, "little")
    with pytest.raises(ArchiveError):
        archive.loads(bytes(data))


def test_an_archive_that_is_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive, "MAX_ARCHIVE_BYTES", 100)
    with pytest.raises(ArchiveError, match="larger"):
        archive.loads(archive.dumps(DOCUMENT))


@given(st.integers(0, 10**6), st.integers(0, 255))
@settings(max_examples=200, deadline=None)
def test_flipped_bytes_raise_or_change_nothing(at: int, value: int) -> None:
    data = bytearray(archive.dumps(DOCUMENT))
    data[at % len(data)] = value
    try:
        out = archive.loads(bytes(data))
    except ArchiveError:
        return
    assert out == DOCUMENT


def test_a_member_that_begins_before_the_file(tmp_path: Path) -> None:
    """Byte 100,000 turned to 1 by the test above: the directory of parts says so."""
    data = bytearray(archive.dumps(DOCUMENT))
    data[data.rindex(b"PK\x05\x06") + 18] ^= 1  # where the directory begins
    with pytest.raises(ArchiveError, match="damaged"):
        archive.loads(bytes(data))
    file = tmp_path / "a.esker"
    file.write_bytes(data)
    with file.open("rb") as opened, pytest.raises(ArchiveError, match="damaged"):
        archive.unpack(opened, tmp_path)


def test_terrain_of_the_design(tmp_path: Path) -> None:
    """The example of DESIGN 5.7."""
    t = Terrain(size_m=4096)
    name = t.add(
        Stroke.profile([(500, 2000, 0), (2000, 2200, 900), (3500, 2000, 0)], left=(35, 300), right=(50, 200), id="a")
    )
    h = t.heights(level=2)
    assert name == "a"
    assert h.shape == (257, 257)
    assert h.dtype == np.float32
    assert h.max() == pytest.approx(900, abs=12)
    assert t.heights(level=2) is h, "nothing changed, nothing is solved"
    t.save(tmp_path / "t.esker")
    again = Terrain.load(tmp_path / "t.esker")
    assert again.strokes == t.strokes
    assert again.settings == t.settings
    assert np.array_equal(again.heights(level=2), h)
    t.remove("a")
    assert not t.heights(level=2).any()
    with pytest.raises(KeyError):
        t.remove("a")


def test_terrain_settings() -> None:
    assert Terrain(1024).settings.reach_m == 32
    assert Terrain(reach_m=math.inf).settings.reach_m is None
    assert Terrain(border="pinned").settings.border == "pinned"
    with pytest.raises(ValueError, match="size_m"):
        Terrain(size_m=1)


def test_profile_takes_world_points() -> None:
    """Points are projected on the vertical plane through the first and the last."""
    points = [(100, 100, 5), (600, 350, 80), (1100, 600, 20)]
    s = Stroke.profile(points, left=(30, 200), right=None, plateau_radius_m=10, amplitude_m=3, roughness=0.2)
    assert np.allclose(world_points(s), points)
    assert s.left == Flank(slope_deg=30, extent_m=200, shape="straight")
    assert s.right is None
    assert (s.plateau_radius_m, s.amplitude_m, s.roughness) == (10, 3, 0.2)
    assert s.finished


def test_level_takes_world_points() -> None:
    """A loop's second anchor is its farthest point; all heights are the first's."""
    a = np.linspace(0, 2 * math.pi, 50)
    points = np.column_stack([1000 + 300 * np.cos(a), 1000 + 300 * np.sin(a), np.linspace(200, 300, 50)])
    s = Stroke.level(points, left=None, right=(30, 100))
    assert np.allclose(world_points(s)[:, :2], points[:, :2])
    assert (world_points(s)[:, 2] == 200).all()
    assert s.last[:2] == pytest.approx((700, 1000), abs=20)
    crest = crest_of(s)
    assert crest is not None
    assert crest.closed
    line = Stroke.level([(0, 0, 10), (500, 100, 99), (900, 0, 5)])
    assert line.last == (900, 0, 10)


@pytest.mark.parametrize("points", [[], [(0, 0)], [(0, 0, math.nan)], [(0, 0, 1e30)]])
def test_bad_points(points: list[tuple[float, ...]]) -> None:
    with pytest.raises(ValueError, match=r"points|value|less than"):
        Stroke.profile(points)


def test_public_names() -> None:
    assert esker.Terrain is Terrain
    assert esker.__version__
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = esker.nothing


@pytest.mark.parametrize("kind", ["esker", "json"])
def test_solve_command(tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    """SPEC S21."""
    document = Document(id="t", strokes=tuple(SCENES["one"]))
    source, out = tmp_path / f"t.{kind}", tmp_path / "h.npy"
    source.write_bytes(archive.dumps(document) if kind == "esker" else document.model_dump_json().encode())
    assert solve.main([str(source), "--level", "1", "-o", str(out)]) == 0
    heights = np.load(out)
    assert np.array_equal(heights, Terrain.from_document(document).heights(1))
    assert "settled" in capsys.readouterr().err


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize("kind", ["png", "r16"])
def test_heightmaps_of_sixteen_bits(tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    """SPEC S21: other programs read the heights that the terrain has, to half a step, north first."""
    import rasterio

    terrain = Terrain.from_document(Document(id="t", strokes=tuple(SCENES["one"])))
    source, out = tmp_path / "t.esker", tmp_path / f"h.{kind}"
    terrain.save(source)
    assert solve.main([str(source), "--level", "1", "-q", "-o", str(out)]) == 0
    found = re.search(r"^129 x 129 samples, north first: 0 is (\S+) m, 65535 is (\S+) m$", capsys.readouterr().out)
    assert found
    low, high = map(float, found.groups())
    if kind == "png":
        with rasterio.open(out) as file:
            assert (file.driver, file.dtypes) == ("PNG", ("uint16",))
            steps = file.read(1)
    else:
        steps = np.frombuffer(out.read_bytes(), "<u2").reshape(129, 129)
    heights = terrain.heights(1)
    assert (low, high) == pytest.approx((heights.min(), heights.max()))
    assert (steps.min(), steps.max()) == (0, 65535)
    step = (high - low) / 65535
    np.testing.assert_allclose(low + steps[::-1] * step, heights, rtol=0, atol=0.51 * step)
    assert not quantised(np.full((3, 2), 7, dtype=np.float32)).any(), "a plain has no range"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def walk(progress: solve.Progress, cycles: int, now: list[float]) -> None:
    """What a solve of level 2 reports, a tenth of a second a step."""
    ground = np.zeros((2, 2), dtype=np.float32)
    steps: list[SolveEvent] = [*(Preview(level, ground) for level in range(3)), *[PAUSE] * cycles]
    for result in [*steps, Settled(2, ground)]:
        now[0] += 0.1
        progress.step(result)


@pytest.mark.parametrize("cycles", [3, 10, 40])
def test_progress_on_a_terminal(cycles: int) -> None:
    """SPEC S21: one line that changes; the share rises and stays below 100 % until the end."""
    now, stream = [0.0], Terminal()
    progress = solve.Progress(stream, 2, lambda: now[0])
    progress.show()
    walk(progress, cycles, now)
    assert 0.2 < progress.share() < 1
    progress.close("done")
    text = stream.getvalue()
    assert text.count("\n") == 1
    assert text.endswith("\r\x1b[Kdone\n")
    shares = [int(s) for s in re.findall(r"(\d+) %", text)]
    assert shares == sorted(shares)
    assert "rasterising" in text
    assert "level 2 (257 x 257): settling" in text
    assert re.search(r"about \d+\.\d s left", text)


def test_progress_in_a_log() -> None:
    """Plain lines: one a level, and while nothing else is said one every two seconds."""
    now, stream = [0.0], io.StringIO()
    progress = solve.Progress(stream, 2, lambda: now[0])
    walk(progress, 45, now)
    progress.close("done")
    text = stream.getvalue()
    assert "\r" not in text
    assert "\x1b" not in text
    assert text.count("preview after") == 3
    assert text.count("settling") == 2
    assert "level 2 (257 x 257) settled after 4.9 s" not in text
    assert "level 2 (257 x 257) settled after 4.90 s" in text


def test_solve_command_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, out = tmp_path / "t.json", str(tmp_path / "h.npy")
    good.write_text(DOCUMENT.model_dump_json())
    bad = tmp_path / "bad.json"
    bad.write_text("{")
    for argv, says in (
        ([str(tmp_path / "none.esker"), "-o", out], "no file"),
        ([str(bad), "-o", out], "not valid"),
        ([str(good), "-o", str(tmp_path / "h.tif")], "r16"),
        ([str(good), "-o", str(tmp_path / "no" / "h.npy")], "no folder"),
        ([str(good), "-o", out, "--device", "abacus"], "abacus"),
    ):
        assert solve.main(argv) == 1
        assert says in capsys.readouterr().err
    with pytest.raises(SystemExit):
        solve.main([str(good), "-o", out, "--level", "9"])
