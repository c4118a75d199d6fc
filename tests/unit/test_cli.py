"""The command line: start, refusals at the start, stop (SPEC P60 to P64, J8)."""

from __future__ import annotations

import importlib.util
import inspect
import os
import signal
import socket
import subprocess
import sys
import tomllib
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from esker.cli import main as cli
from esker.cli.main import NOT_MEASURED
from esker.keeper.private import Private
from esker.version import VERSION

ROOT = Path(__file__).resolve().parents[2]


def _esker(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "esker", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)


@contextmanager
def _serving(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A server process and its owner's link, which stands in no log and in a private file."""
    command = [sys.executable, "-m", "esker", "serve", "--port", "0", "--device", "numpy", *arguments]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            for line in process.stdout:
                assert "#" not in line, "no secret where nobody sits"
                if "esker link" in line:
                    data = arguments[arguments.index("--data") + 1]
                    content = Private(Path(data)).read()
                    assert content is not None
                    assert content.lesson is not None
                    yield process, f"{content.base}/t/{content.lesson.terrain}#{content.lesson.owner}"
                    break
            else:
                assert process.stderr is not None
                pytest.fail(process.stderr.read())
        finally:
            process.kill()


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"esker {VERSION}\n"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["version"] == VERSION


def test_without_a_command_it_helps(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    assert "serve" in capsys.readouterr().out


def test_bench_lists_and_names_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bench"]) == 0
    listed = capsys.readouterr().out.split()
    assert "fanout" in listed
    for name in listed:
        main = importlib.import_module(cli.benchmarks()[name]).main
        assert list(inspect.signature(main).parameters), f"{name} takes no arguments, so it does not measure"
    assert not NOT_MEASURED.intersection(listed)
    for name in NOT_MEASURED:
        assert list((ROOT / "bench").rglob(f"{name}.py")), name
    with pytest.raises(SystemExit) as end:
        cli.main(["bench", "--help"])
    assert end.value.code == 0
    assert "NAME" in capsys.readouterr().out
    assert cli.main(["bench", "nonsense"]) == 1
    assert "fanout" in capsys.readouterr().err


def test_bad_settings_are_one_sentence() -> None:
    done = _esker("serve", "--level", "9")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "level" in done.stderr


def test_a_port_in_use_is_one_sentence(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        done = _esker("serve", "--port", port, "--data", str(tmp_path / "data"))
    assert done.returncode == 1
    assert port in done.stderr
    assert "--port" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_damaged_database_is_refused_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "backup").mkdir()
    good = tmp_path / "backup" / "esker-20260101-000000.db"
    good.write_bytes(b"")
    (tmp_path / "esker.db").write_bytes(b"damaged" * 1000)
    done = _esker("serve", "--port", "0", "--data", str(tmp_path))
    assert done.returncode == 1
    assert str(good) in done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "esker.db").read_bytes() == b"damaged" * 1000


def test_it_serves_and_stops_when_told(tmp_path: Path) -> None:
    with _serving("--data", str(tmp_path)) as (process, link):
        base = link.split("/t/")[0]
        with urllib.request.urlopen(f"{base}/healthz", timeout=10) as answer:
            assert b"NumPy" in answer.read()
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) in (0, -signal.SIGTERM)
        assert process.stderr is not None
        log = process.stderr.read()
        assert "NumPy" in log, "the start log names the device"
        assert "everything is saved" in log
        assert link.split("#")[1] not in log, "no secret in the log"
    assert list((tmp_path / "backup").glob("esker-*.db"))


def test_what_the_server_writes_is_its_users_alone(tmp_path: Path) -> None:
    """SPEC P285: database, log of it, backups, previews, grids: whatever the umask was."""
    before = os.umask(0)
    try:
        with _serving("--data", str(tmp_path / "data"), "--lan") as (process, _):
            process.send_signal(signal.SIGTERM)
            process.wait(20)
    finally:
        os.umask(before)
    written = [tmp_path / "data", *(tmp_path / "data").rglob("*")]
    assert {"esker.db", "esker-ca.key"} <= {path.name for path in written}
    assert [path for path in written if path.stat().st_mode & 0o077] == []


def test_lan_prints_on_a_terminal_how_all_come_in(tmp_path: Path) -> None:
    """A real terminal: what is shown on the projector comes last, is no owner's link, and names its scheme."""
    import pty

    command = [sys.executable, "-m", "esker", "serve", "--port", "0", "--device", "numpy", "--lan"]
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [*command, "--data", str(tmp_path)], cwd=ROOT, stdout=theirs, stderr=subprocess.DEVNULL
    ) as process:
        os.close(theirs)
        text = ""
        with suppress(OSError):  # how a terminal says that its program has ended
            while text.count("█") < 100:
                text += os.read(ours, 65536).decode(errors="ignore")
        process.kill()
    os.close(ours)
    content = Private(tmp_path).read()
    assert content is not None
    assert content.lesson is not None
    assert "/esker-ca.pem" in text
    private, public = text.index(content.lesson.owner), text.index(content.lesson.edit)
    assert text.index("PRIVATE") < private < public < text.index("█")
    assert f"https://{content.base.removeprefix('https://')}/t/" in text
