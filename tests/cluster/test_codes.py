"""Guesses of join codes on several nodes (SPEC P585)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from esker.errors import Cannot
from esker.fairness.shares import Rate, Rates
from esker.server.routes.answers import guess


def request(nodes: int, burst: float) -> Any:
    """A request to one of so many nodes, which allows so many wrong codes of everybody."""
    state = SimpleNamespace(
        code_tries=Rates(Rate(1e-9, 1e9)), wrong_codes=Rates(total=Rate(1e-9, burst)), nodes=lambda: nodes
    )
    return SimpleNamespace(app=SimpleNamespace(state=state), client=SimpleNamespace(host="192.0.2.1"))


@pytest.mark.parametrize("nodes", [1, 3, 10])
def test_all_nodes_together_allow_no_more_guesses_than_one(nodes: int) -> None:
    """SPEC P585."""
    asked, wrong = request(nodes, 30.0), 0
    while True:
        try:
            guess(asked, lambda: None)
        except Cannot as refused:
            if refused.status == 429:
                break
            wrong += 1
    assert wrong * nodes == 30
    with pytest.raises(Cannot, match="guessing"):
        guess(asked, lambda: "a right one")
