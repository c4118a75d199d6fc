"""``esker import``: what it prints and how it ends, alone and against a server (SPEC G34)."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from esker import connect
from esker.api import uploads
from esker.api.http import refusal
from esker.cli import import_files, main
from tests.elsewhere.test_elsewhere import private_link
from tests.importing.conftest import HERE, KEPT


@pytest.mark.parametrize(
    ("names", "status"),
    [(["little.tif"], 0), (["no_crs.tif", "little.tif"], 2), (["corrupt.tif", "no_crs.tif"], 3)],
)
def test_check_ends_with_its_verdict(
    names: list[str], status: int, files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of several files the worst verdict counts."""
    assert main.main(["import", "--check", *(str(files / name) for name in names)]) == status
    out = capsys.readouterr().out
    assert all(f"{name}: " in out for name in names)


def test_check_says_what_it_is(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import_files.main(["--check", str(files / "rotated.tif"), str(files / "no_crs.tif"), str(KEPT / "gray8.png")])
    out = capsys.readouterr().out
    assert "GeoTIFF, 48 x 60 samples, int16, EPSG:32605" in out
    assert "62.97 x 92.95 m apart, 2.96 km x 5.484 km, turned by -26.13°" in out
    assert re.search(r"middle at 19\.\d+° N, 155\.\d+° W", out)
    assert "--answer place=…   EPSG:4326 (default) | middle" in out
    assert "gray8.png: 3 questions" in out


def test_answers_and_json(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(files / "no_crs.tif")
    assert import_files.main(["--check", "--json", path, "--answer", "place=EPSG:4326"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "good"
    by_hand = ["--spacing", "5", "5", "--anchor", "0", "0", "--answer", "range=0..100"]
    assert import_files.main(["--check", str(files / "heights16.png"), *by_hand]) == 0


def test_what_goes_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert import_files.main(["--check", str(tmp_path / "none.tif")]) == 1
    assert import_files.main(["--check", str(tmp_path), "--answer", "nonsense"]) == 1
    assert import_files.main([str(KEPT / "hugo_site.asc"), "--into", "nonsense"]) == 1
    assert import_files.main([str(KEPT / "hugo_site.asc"), "--into", "http://127.0.0.1:1/t/a#b"]) == 1
    assert import_files.main(["--check", str(tmp_path), "--accuracy", "-3"]) == 1
    errors = capsys.readouterr().err
    assert "there is no file" in errors
    assert "ID=VALUE" in errors
    assert "accuracy_m" in errors


@pytest.fixture(scope="module")
def link(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A link to a new terrain on a real server."""
    data = tmp_path_factory.mktemp("data")
    serve = [
        sys.executable,
        "-m",
        "esker",
        "serve",
        "--port",
        "0",
        "--device",
        "numpy",
        "--level",
        "0",
        "--data",
        str(data),
    ]
    with subprocess.Popen(serve, cwd=HERE.parents[1], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert any("esker link" in line for line in process.stdout), "it says where the link is, and no pipe has it"
            yield private_link(data)
        finally:
            process.kill()


def test_into_a_terrain(link: str, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Good files are laid, questions end with 2 and leave nothing, answers are taken, broken files are refused."""
    into = ["--into", link]
    assert import_files.main([str(files / "little.tif"), *into, "--accuracy", "3", "--licence", "none needed"]) == 0
    assert "laid as layer" in capsys.readouterr().out
    assert import_files.main([str(files / "void_no_tag.tif"), *into]) == 2
    assert "--answer nodata=…" in capsys.readouterr().out
    assert import_files.main([str(files / "void_no_tag.tif"), *into, "--defaults", "--answer", "other=1"]) == 0
    assert "does not ask for 'other'" in capsys.readouterr().err
    assert import_files.main([str(files / "corrupt.tif"), *into]) == 3
    with connect(link) as terrain:
        layers = terrain.document.layers
    assert [layer.name for layer in layers] == ["little", "void_no_tag"]
    assert (layers[0].accuracy_m, layers[0].licence) == (3.0, "none needed")
    assert layers[1].facts.valid < 1.0


def test_a_link_that_does_not_open(link: str, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """That is about the link, not about the file."""
    assert import_files.main([str(files / "little.tif"), "--into", link + "x"]) == 1
    assert "link" in capsys.readouterr().err


def test_cancel(link: str, files: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Ctrl-C stops the import on the server: the next one may begin at once."""

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(uploads.Uploads, "follow", interrupted)
        assert import_files.main([str(files / "little.tif"), "--into", link]) == 1
    assert "cancelled" in capsys.readouterr().err
    assert import_files.main([str(files / "corrupt.tif"), "--into", link]) == 3  # and not 1 for an import still open


def test_refusals_that_are_not_the_server_s() -> None:
    """A proxy's page becomes a sentence too."""
    found = refusal(502, b"<html>Bad gateway</html>")
    assert "502" in str(found)
    assert found.status == 502
