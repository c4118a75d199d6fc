"""Whoever has no folder for compiled code has one all the same (SPEC H569)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from esker.process import caches
from esker.solve.opencl.pocl import home

NOBODY = {"HOME": "{}/no/home", "PATH": os.environ["PATH"]}


@pytest.fixture
def nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The environment of somebody without a home; not even the superuser can make a folder inside of a file."""
    (tmp_path / "no").write_text("")
    monkeypatch.setattr("os.environ", {name: text.format(tmp_path) for name, text in NOBODY.items()})
    return tmp_path


def test_a_server_keeps_it_in_its_data_folder(nobody: Path) -> None:
    assert not caches.writable(caches.users())
    caches.keep_in(nobody / "data")
    assert caches.users() == nobody / "data" / ".cache"
    assert home.root() == nobody / "data" / ".cache" / "esker"
    assert caches.LOOPS not in os.environ, "they lie beside the program"
    caches.spare_pyopencl()
    assert caches.NO_PYOPENCL not in os.environ, "it has its place there too"


def test_whose_home_can_be_written_keeps_it_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.environ", {"HOME": str(tmp_path / "home"), "PATH": ""})
    before = dict(os.environ)
    caches.keep_in(tmp_path / "data")
    assert os.environ == before
    assert not (tmp_path / "data").exists()


def test_a_program_that_somebody_else_installed_keeps_its_loops_with_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "package").write_text("")
    monkeypatch.setattr(caches, "PACKAGE", tmp_path / "package")
    monkeypatch.setattr("os.environ", {"HOME": str(tmp_path), "PATH": ""})
    caches.keep_in(tmp_path / "data")
    assert os.environ[caches.LOOPS] == str(tmp_path / ".cache" / "esker" / "loops")


@pytest.mark.skipif(home.site() is None, reason="PoCL's wheel is not installed")
def test_kernels_run_for_somebody_without_a_home(tmp_path: Path) -> None:
    """pyopencl failed at its first kernel, level after level, and the server went on with NumPy."""
    (tmp_path / "no").write_text("")
    env = os.environ | {name: text.format(tmp_path) for name, text in NOBODY.items()} | {home.ROOT: str(home.root())}
    env.pop(caches.CACHES, None)
    script = (
        "from esker.contract import TerrainSettings\n"
        "from esker.solve.solver import Solver\n"
        "settings = TerrainSettings(size_m=4096, reach_m=128, seed=1)\n"
        "print(Solver('PoCL', max_level=0).solve([], settings, 0)[0].shape)"
    )
    done = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "(65, 65)", done.stderr
