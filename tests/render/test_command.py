"""``esker render`` (SPEC V6)."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from esker import templates
from esker.api.terrain import Stroke, Terrain
from esker.cli import render
from esker.contract import Document
from esker.render.pictures.studio import open_terrain
from tests.sync.harness import LiveServer

SMALL = ["--size", "96x64", "--plain", "--level", "1", "--refine", "1", "--tau", "4", "--device", "numpy"]


@pytest.fixture
def terrain(tmp_path: Path) -> Path:
    made = Terrain(size_m=1024)
    made.add(Stroke.profile([(200, 500, 0), (500, 520, 260), (800, 500, 0)]))
    path = tmp_path / "ridge.esker"
    made.save(path)
    return path


def test_a_picture_and_its_progress(terrain: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "ridge.png"
    assert render.main([str(terrain), "-o", str(out), *SMALL, "--camera", "orbit:200,25,1500", "--sun", "90,30"]) == 0
    with Image.open(out) as picture:
        assert picture.size == (96, 64)
        assert len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0)) > 200
    said = capsys.readouterr().err
    assert "solving on" in said
    assert "drawing: 100%" in said
    assert list(tmp_path.glob(".*")) == []


def test_a_turntable_has_its_pictures(terrain: Path, tmp_path: Path) -> None:
    out = tmp_path / "around.webp"
    assert render.main([str(terrain), "-o", str(out), *SMALL, "--turntable", "3", "-q"]) == 0
    with Image.open(out) as moving:
        assert getattr(moving, "n_frames", 1) == 3
        frames = []
        for k in range(3):
            moving.seek(k)
            frames.append(np.asarray(moving.convert("RGB")).astype(int))
    assert np.abs(frames[0] - frames[1]).mean() > 1
    folder = tmp_path / "stills"
    assert render.main([str(terrain), "-o", str(folder), *SMALL, "--turntable", "2", "-q"]) == 0
    assert [p.name for p in sorted(folder.iterdir())] == ["0000.png", "0001.png"]


WRONG = {
    ("nothing-of-this-name", "-o", "x.png"): "There is no file, starting terrain or link 'nothing-of-this-name'",
    ("canyon", "-o", "x.bmp"): "not as '.bmp'",
    ("canyon", "-o", "no/such/folder/x.png"): "There is no folder",
    ("canyon", "-o", "x.png", "--camera", "somewhere"): "'somewhere' is no camera",
    ("canyon", "-o", "x.png", "--camera", "eye:1,2,3"): "An eye needs a target",
    ("canyon", "-o", "x.png", "--camera", "eye:1,2,3,target:1,2,3"): "the same place",
    ("canyon", "-o", "x.png", "--tau", "0"): "above 0 pixels",
    ("canyon", "-o", "x.txt", "--turntable", "4"): "A turntable is written as",
    ("canyon", "-o", "x.gif", "--turntable", "1"): "2 to 3600 pictures",
    ("canyon", "-o", "x.gif", "--turntable", "4", "--camera", "eye:1,2,target:3,4"): "a view that turns",
}


@pytest.mark.parametrize("arguments", list(WRONG), ids=" ".join)
def test_what_is_wrong_is_said(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    small = [a for k, a in enumerate(SMALL) if "--tau" not in (a, SMALL[k - 1]) or "--tau" not in arguments]
    assert render.main([*arguments, *small, "-q"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("esker render: ")
    assert WRONG[arguments] in said
    assert list(tmp_path.iterdir()) == []


def test_mp4_without_ffmpeg_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert render.main(["canyon", "-o", str(tmp_path / "x.mp4"), "--turntable", "4"]) == 1
    assert "MP4 needs the program ffmpeg" in capsys.readouterr().err


def test_no_opengl_is_said_before_anything_is_solved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(**_: object) -> None:
        raise ImportError("libEGL.so.1: cannot open shared object file")

    monkeypatch.setattr(moderngl, "create_context", fail)
    monkeypatch.setattr("esker.solve.solver.Solver.__init__", fail)
    assert render.main(["canyon", "-o", str(tmp_path / "x.png")]) == 1
    said = capsys.readouterr().err
    assert "Pictures need OpenGL 4.3 by EGL" in said
    assert "libEGL.so.1" in said
    assert "apt install" in said


def test_a_terrain_is_found_by_template_and_link(tmp_path: Path) -> None:
    assert open_terrain("canyon").document == templates.load("canyon").document
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        found = open_terrain(f"{server.base}/t/{terrain}#{secret}").document
        assert isinstance(found, Document)
        assert found.id == terrain
