"""The benchmark of refined tiles measures what it says (DESIGN 15)."""

from __future__ import annotations

from bench.solver import sparse
from esker import templates
from esker.solve.solver import Solver


def test_a_view_near_a_crest() -> None:
    found = sparse.measure(Solver(max_level=4), templates.load("canyon").document, 5, repeats=1)
    first = found["first_view"]
    assert found["held_by_level"] == {5: first["tiles"]}
    assert 0 < first["tiles"] <= 512
    assert 100 < first["bytes_per_tile"] < 4225
    assert first["bytes"] <= first["bytes_without_filters"]
    assert found["select_refined"]["min_ms"] > 0
    assert 0 <= found["after_an_edit"]["bytes"] < first["bytes"]
