"""The simulation places terrains as nodes do, with another hash (``esker bench cluster --simulate``)."""

from __future__ import annotations

import numpy as np
import pytest

from bench.cluster import _simulation


def test_terrains_of_the_simulation_move_as_those_of_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P571: only those of a node that goes, and by weight."""
    monkeypatch.setattr(_simulation, "TERRAINS", 20_000)
    before = _simulation.placed(np.ones(10))
    gone = np.ones(10)
    gone[3] = 0.0
    after = _simulation.placed(gone)
    assert set(np.flatnonzero(before != after)) == set(np.flatnonzero(before == 3))
    weights = np.array([1.0, 3.0])
    counts = np.bincount(_simulation.placed(weights), minlength=2)
    assert abs(counts[0] - 5_000) < 5 * (20_000 * 0.25 * 0.75) ** 0.5


def test_terrains_wait_for_the_database_and_for_their_node() -> None:
    costs = {"takes_per_s": 10.0, "open_s": 1.0, "take_1000_ms": 0.0}
    assert _simulation._opened(iter([(0.0, 1), (0.0, 2)]), costs) == pytest.approx([1.1, 1.2])
    many = _simulation._opened(iter([(0.0, 1)] * (_simulation.CORES + 1)), costs)
    assert many[-1] == pytest.approx(2.1)


def test_a_crowd_of_one_node_is_taken_by_a_few_statements() -> None:
    """SPEC P660: what comes while a statement is on its way goes by the next one, which costs more by a thousandth of a
    thousand for each."""
    costs = {"takes_per_s": 10.0, "open_s": 0.0, "take_1000_ms": 10_000.0}
    coming = [(0.0, 1), (0.01, 1), (0.02, 2), (0.03, 1), (0.04, 1)]
    assert _simulation._taken(coming, costs) == pytest.approx([0.1, 0.32, 0.2, 0.32, 0.32])
