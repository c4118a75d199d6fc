"""Readers of strangers' files load compiled loops and change none that another process loads (SPEC A446, A447)."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from esker import contract as c
from esker.importing import limits, warm, wire
from esker.patchwork import kept_loops
from esker.process import caches, confinement
from tests.importing.conftest import PLACE, SIZE_M

FILES = Path(__file__).parent / "files"
ATTACK = """
import json, os, sys
from pathlib import Path
from esker.importing import limits
file, work, data = map(Path, sys.argv[1:4])
kept = limits.kept_loops.folder()
limits.keep_to(file, [work])
def can(path):
    try:
        path.write_bytes(b"cosmic ray")
    except OSError:
        return False
    return True
import esker
package = Path(esker.__file__).parent
targets = [*package.rglob("__pycache__"), package, kept, *kept.rglob("*.nbi"), data]
written = [str(p) for p in targets if can(p if p.is_file() else p / "planted.pyc")]
link = next((work / limits.LOOPS).rglob("*.nbi"), None)
print(json.dumps({"written": written, "through": link is not None and can(link), "own": can(work / "own"),
  "reads": link is None or link.is_symlink() and len(link.read_bytes()) > 0}))
"""


@pytest.fixture
def work(tmp_path: Path) -> Path:
    asyncio.run(warm.loops())
    (tmp_path / "data" / "work").mkdir(parents=True)
    return tmp_path / "data" / "work"


def reader(*arguments: object, task: str = "") -> str:
    """What a reader says. Its stdin stays open until then: by its end it knows that the server is gone."""
    pipe = subprocess.PIPE
    command = [sys.executable, *map(str, arguments)]
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, env=limits.environment()) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(f"{task}\n".encode())
        process.stdin.flush()
        return process.stdout.read().decode()


def test_a_reader_that_runs_a_stranger_s_code_leaves_nothing_that_the_server_loads(work: Path) -> None:
    """SPEC A446: readers could write to every folder of compiled modules and loops, which the next start runs."""
    said = json.loads(reader("-c", ATTACK, FILES / "gray8.png", work, work.parent))
    assert said["own"]
    assert said["reads"]
    if not confinement.possible():
        pytest.skip("this kernel has no Landlock")
    assert said["written"] == []
    assert not said["through"], "nor by the links that lead there"


@pytest.mark.parametrize("name", ["hugo_site.asc", "rio_rotated.tif"])
def test_what_readers_run_has_been_compiled_before(work: Path, name: str) -> None:
    """SPEC A447: with a folder of its own a reader would compile for half a minute, each time anew."""
    assert warm.record().exists()
    answers = c.ImportAnswers(answers={"place": "middle", "outside": "middle"})
    task = wire.Task(
        task="convert", path=str(FILES / name), name=name, workdir=str(work), out_dir=str(work / "out"),
        answers=answers, place=PLACE, size_m=SIZE_M,
    )  # fmt: skip
    said = reader("-m", "esker.importing", task=task.model_dump_json())
    assert '"type":"converted"' in said, said
    own = work / limits.LOOPS
    found = list(own.rglob("*.nb[ic]"))
    assert any(path.is_symlink() for path in found)
    assert [str(path.relative_to(own)) for path in found if not path.is_symlink()] == []


def test_a_folder_of_one_s_own_finds_what_was_kept_and_changes_none_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC A446."""
    kept, own = tmp_path / "kept", tmp_path / "own"
    (kept / "room").mkdir(parents=True)
    (kept / "room" / "loop.nbi").write_bytes(b"index")
    (kept / "room" / "notes.txt").write_bytes(b"no loop")
    monkeypatch.setenv(caches.LOOPS, str(kept))
    kept_loops.use_own(own)
    assert os.environ[caches.LOOPS] == str(own)
    assert (own / "room" / "loop.nbi").read_bytes() == b"index"
    assert not (own / "room" / "notes.txt").exists()
    fresh = own / "room" / "fresh"
    fresh.write_bytes(b"other")
    fresh.replace(own / "room" / "loop.nbi")  # as numba writes
    assert (kept / "room" / "loop.nbi").read_bytes() == b"index"


def test_where_nothing_was_kept_a_reader_has_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC A446."""
    monkeypatch.setenv(caches.LOOPS, str(tmp_path / "nothing"))
    kept_loops.use_own(tmp_path / "own")
    assert list((tmp_path / "own").iterdir()) == []
