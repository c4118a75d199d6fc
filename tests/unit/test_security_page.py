"""Every point of the reviews has its rules and its tests (docs/security.md, "Point by point")."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def rows() -> list[list[str]]:
    text = (ROOT / "docs/security.md").read_text(encoding="utf-8").split("## Point by point")[1].split("\n## ")[0]
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[1:]]


def test_every_point_has_rules_and_tests_that_are_there() -> None:
    """SPEC H7: all 25, and what came since."""
    spec = "\n".join(
        path.read_text(encoding="utf-8") for path in [*ROOT.glob("tests/spec/*.md"), ROOT / "tests/SPEC.md"]
    )
    known = set(re.findall(r"^- \*\*([A-Z]+\d+)\*\*", spec, re.M))
    found = rows()
    assert [row[0] for row in found[:25]] == [str(n) for n in range(1, 26)]
    assert len(found) > 25
    for point, _, rules, tests in found:
        assert rules, point
        assert set(rules.split(", ")) <= known, (point, set(rules.split(", ")) - known)
        named = re.findall(r"`(tests/\S+\.py)`(?: `(test_\w+)`)?", tests)
        assert named, point
        for path, name in named:
            text = (ROOT / path).read_text(encoding="utf-8")
            assert f"def {name or 'test_'}" in text, (point, path, name)
