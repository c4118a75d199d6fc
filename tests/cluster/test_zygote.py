"""Servers that are forked are processes like others: what they say, how they end, what they are given."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

import pytest

from esker.version import VERSION
from tests import zygote


def test_a_fork_runs_the_command_with_a_log_of_its_own(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text("before\n")
    forks = [zygote.start("esker", [argument], {}, log) for argument in ("--version", "--nonsense")]
    assert [fork.wait(60) for fork in forks] == [0, 2]
    assert [fork.poll() for fork in forks] == [0, 2]
    before, *said = log.read_text().splitlines()
    assert before == "before"
    assert f"esker {VERSION}" in said
    assert any("--nonsense" in line for line in said)


def test_a_fork_has_the_environment_that_it_is_given(tmp_path: Path) -> None:
    fork = zygote.start("esker", ["serve"], {"ESKER_LEVEL": "of one fork"}, tmp_path / "log")
    assert fork.wait(60) == 1
    assert "of one fork" in (tmp_path / "log").read_text()
    fork = zygote.start("esker", ["--version"], {}, tmp_path / "log")
    assert fork.wait(60) == 0


def test_a_fork_serves_until_a_signal_ends_it(tmp_path: Path) -> None:
    """SIGTERM is obeyed as by any server, SIGKILL ends another at once; each is told apart from the other."""
    arguments = ["serve", "--port", "0", "--device", "numpy", "--level", "1", "--data"]
    logs = [tmp_path / "a", tmp_path / "b"]
    forks = [
        zygote.start("esker", [*arguments, str(tmp_path / log.stem / "data")], {}, log.with_suffix(".log"))
        for log in logs
    ]
    with pytest.raises(subprocess.TimeoutExpired):
        forks[0].wait(0.1)
    assert forks[0].poll() is None
    forks[1].kill()
    assert forks[1].wait(60) == -signal.SIGKILL
    forks[0].send_signal(signal.SIGTERM)
    assert forks[0].wait(60) == 0
