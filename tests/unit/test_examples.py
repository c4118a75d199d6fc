"""Examples in docstrings run, and give what they print (SPEC H500)."""

from __future__ import annotations

import doctest
import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "backend"
USERS = {
    "esker.api.strokes": {"Stroke.profile", "Stroke.level", "Stroke.paint"},
    "esker.api.terrain": {"Terrain", "Terrain.add", "Terrain.assemble", "Terrain.heights", "Terrain.window"},
    "esker.api.terrain_layers": {"TerrainLayers.add_grid", "TerrainLayers.sample"},
    "esker.api.terrain_water": {"TerrainWater.rivers", "TerrainWater.watershed", "TerrainWater.raindrop"},
    "esker.api.live.client": {"connect"},
    "esker.solve.solver": {"Solver"},
}
"""What people call first, and what therefore has an example."""
SERVED = {"esker.api.live.client"}
"""Modules whose examples need a server: ``tests/sync/test_client.py`` runs them."""


def written() -> list[str]:
    """Modules that have an example."""
    paths = sorted(path for path in PACKAGE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8"))
    return [".".join(path.relative_to(PACKAGE).with_suffix("").parts) for path in paths]


def failures(name: str, given: Mapping[str, object] | None = None) -> str:
    """What the examples of a module gave that they do not print; ``given`` are names that they use."""
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    report: list[str] = []
    for each in examples(name):
        each.globs.update(given or {})
        runner.run(each, out=report.append)
    return "".join(report)


def examples(name: str) -> list[doctest.DocTest]:
    """The examples of a module, each docstring's together."""
    found: Any = doctest.DocTestFinder(exclude_empty=True).find(importlib.import_module(name))
    return [each for each in found if each.examples]


@pytest.mark.parametrize("name", sorted({*written()} - SERVED))
def test_examples_give_what_they_print(name: str) -> None:
    """SPEC H500."""
    assert failures(name) == ""


@pytest.mark.parametrize("name", USERS)
def test_what_people_call_has_an_example(name: str) -> None:
    """SPEC H500."""
    assert {each.name.removeprefix(f"{name}.") for each in examples(name)} >= USERS[name]


def test_examples_are_pasted_as_they_stand() -> None:
    """SPEC H510: none is left out of the run."""
    assert set(written()) >= SERVED
    assert [name for name in written() for each in examples(name) for one in each.examples if one.options] == []


def test_a_wrong_example_is_noticed() -> None:
    wrong = doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "wrong", None, None)
    assert doctest.DocTestRunner(verbose=False).run(wrong, out=lambda _: None).failed == 1
