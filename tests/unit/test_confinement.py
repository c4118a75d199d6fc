"""What a child that reads strangers' files may see and reach (SPEC J260, J450)."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import esker
from esker.process import confinement, syscalls
from esker.server import upload

PROGRAM = """
import json, os, socket, sys
from pathlib import Path
from esker.process.confinement import confine
read, write, secret, port = Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4])
kept = confine([read], [write])
def can(what):
    try:
        what()
    except OSError:
        return False
    return True
def connect():
    socket.create_connection(("127.0.0.1", port), timeout=5).close()
def datagram():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.sendto(b"x", ("127.0.0.1", port))
import numpy, json.tool, resource
print(json.dumps({"kept": sorted(kept), "read": can(read.read_bytes), "write": can((write / "new").touch),
  "secret": can(secret.read_bytes), "beside": can(lambda: (secret.parent / "x").touch()),
  "list": can(lambda: os.listdir(secret.parent)),
  "network": can(connect), "datagram": can(datagram), "local": can(lambda: socket.socket(socket.AF_UNIX).close()),
  "signal": can(lambda: os.kill(os.getppid(), 0)), "itself": can(lambda: os.kill(os.getpid(), 0)),
  "limit": can(lambda: resource.prlimit(os.getppid(), resource.RLIMIT_CORE, (0, 0))),
  "own_limit": can(lambda: resource.setrlimit(resource.RLIMIT_CORE, (0, 0)))}))
"""


def confined(read: Path, work: Path, secret: Path, *start: str, cwd: Path | None = None) -> dict[str, Any]:
    """What a confined process says of what it can do."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        command = [sys.executable, *start, str(read), str(work), str(secret), str(port)]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60, cwd=cwd)
    return dict(json.loads(done.stdout))


def folders(root: Path) -> tuple[Path, Path, Path]:
    """A stranger's file, a work folder within the data, and a secret of the server's beside it."""
    read, work, secret = root / "file.tif", root / "data" / "grids" / "work", root / "data" / "esker.db"
    read.write_bytes(b"x")
    work.mkdir(parents=True)
    secret.write_bytes(b"secret")
    return read, work, secret


def test_a_confined_process_sees_its_folders_and_no_network(tmp_path: Path) -> None:
    """Where the kernel keeps nothing it says so, and this test then asks only for that."""
    said = confined(*folders(tmp_path), "-c", PROGRAM)
    assert said["read"]
    assert said["write"]
    files, network = "files" in said["kept"], "network" in said["kept"]
    assert (said["secret"], said["beside"], said["list"]) == ((not files),) * 3
    assert said["network"] is (not network)
    if not files:
        pytest.skip("this kernel has no Landlock")


def test_a_confined_process_reaches_no_other_one(tmp_path: Path) -> None:
    """SPEC J450: Landlock leaves UDP, local sockets, signals and limits of others open, on older kernels TCP too."""
    said = confined(*folders(tmp_path), "-c", PROGRAM)
    assert (said["itself"], said["own_limit"]) == (True, True)
    if not (syscalls.known() and sys.platform == "linux"):
        pytest.skip("no filter of system calls is known for this system")
    assert [name for name in ("network", "datagram", "local", "signal", "limit") if said[name]] == []


def test_the_folder_in_which_the_server_runs_is_not_seen(tmp_path: Path) -> None:
    """SPEC J450: ``python -m`` looks for modules there, and ``data`` lies there unless somebody says otherwise."""
    (tmp_path / "reader.py").write_text(PROGRAM)
    said = confined(*folders(tmp_path), "-m", "reader", cwd=tmp_path)
    assert said["read"]
    assert said["write"]
    if "files" in said["kept"]:
        assert (said["secret"], said["beside"], said["list"]) == (False, False, False)


def test_folders_of_modules_are_seen_without_the_data_beside_them(tmp_path: Path) -> None:
    """SPEC J450: a server that was unpacked into one folder with its data."""
    data, modules = tmp_path / "data" / "work", tmp_path / "modules"
    data.mkdir(parents=True)
    modules.mkdir()
    assert confinement._without_surroundings(tmp_path, [data]) == [modules]
    assert confinement._without_surroundings(modules, [data]) == [modules]
    assert confinement._without_surroundings(data, [data]) == [data]


def test_what_the_interpreter_needs_is_not_where_it_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    needed = confinement._python()
    assert tmp_path not in needed
    assert Path(esker.__file__).resolve().parent in needed


CHILDREN = {
    "reading a terrain file": "from esker.server import upload; upload.bound(Path(sys.argv[1]), upload.Loops.KEPT)",
    "reading an elevation file": "from esker.importing import limits; limits.apply('inspect')",
    "exporting": "from esker.api import export_child as made; made._step_back()",
    "drawing": "from esker.render.pictures import previews\na, b = previews.multiprocessing.Pipe(False)\n"
    "previews._begin(a)",
}
LIMITS = """
import json, os, resource as r
kinds = ("DATA", "AS", "CPU", "FSIZE", "NOFILE", "CORE")
print(json.dumps({k: r.getrlimit(getattr(r, "RLIMIT_" + k))[0] for k in kinds} | {"nice": os.nice(0)}))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems are told in bounds.py")
@pytest.mark.parametrize("child", CHILDREN)
def test_every_child_has_bounds(tmp_path: Path, child: str) -> None:
    """SPEC J451. A reader's memory is bounded by the system; what draws or solves may reserve what a card's driver
    asks for, and is the first to go where memory runs out."""
    file = tmp_path / "file"
    file.write_bytes(b"x")
    program = f"import sys\nfrom pathlib import Path\n{CHILDREN[child]}\n{LIMITS}"
    command = [sys.executable, "-c", program, str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    limits = json.loads(done.stdout)
    bounded = {"FSIZE", "NOFILE"} | ({"DATA", "AS", "CPU"} if child.startswith("reading") else set())
    assert {name for name in bounded if limits[name] < 0} == set()
    assert limits["CORE"] == 0
    assert limits["nice"] >= 5


def test_who_reads_a_terrain_file_gets_nothing_of_the_server_s_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC J451: whoever starts a server may have keys of other services there."""
    monkeypatch.setenv("SOMEBODYS_KEY", "secret")
    started: dict[str, Any] = {}

    async def start(*_: Any, **more: Any) -> Any:
        started.update(more)
        raise OSError("not started")

    monkeypatch.setattr(asyncio, "create_subprocess_exec", start)
    with pytest.raises(OSError, match="not started"):
        asyncio.run(upload.read_archive(tmp_path, tmp_path, contextlib.nullcontext))
    assert "SOMEBODYS_KEY" not in started["env"]
    assert "PATH" in started["env"]
