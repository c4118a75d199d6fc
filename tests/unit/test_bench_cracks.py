"""The crack benchmark's bookkeeping: several browsers, one result that goes on where it was stopped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bench.picture import cracks

SEED_VIEWS = sum(kind.views for kind in cracks.KINDS.values())


def reports(found: int = 0) -> dict[str, dict[str, Any]]:
    """What a seed draws; the trees with so many crack pixels."""
    seen: dict[str, dict[str, Any]] = {name: dict.fromkeys(cracks.SUMS, 0) | {"failures": []} for name in cracks.KINDS}
    for name, kind in cracks.KINDS.items():
        seen[name]["views"] = kind.views
    seen["trees"] |= {"cracks": found, "failures": ["view 3: 1"] * found}
    return seen


def test_seeds_are_counted_in_order_whoever_is_first(tmp_path: Path) -> None:
    """A later seed waits for the earlier one, so that a stopped run leaves none out and draws none twice."""
    keep = tmp_path / "cracks.json"
    run = cracks.Run(cracks.load(keep), 3 * SEED_VIEWS - 7, keep)
    first, second, third = run.take(), run.take(), run.take()
    assert (first, second, third) == (1000, 1001, 1002)
    assert run.take() is None
    run.give(1001, reports(found=1), 2.0)
    assert cracks.load(keep)["next_seed"] == 1000
    run.give(1000, reports(), 1.0)
    kept = json.loads(keep.read_text(encoding="utf-8"))
    assert (kept["next_seed"], cracks.views_of(kept), kept["cpu_s"]) == (1002, 2 * SEED_VIEWS, 3.0)
    assert kept["trees"]["failures"] == ["seed 1001: view 3: 1"]
    assert cracks.failed(kept)
    # Stopped here: the third seed is drawn by the next run, and it alone.
    again = cracks.Run(cracks.load(keep), 3 * SEED_VIEWS - 7, keep)
    assert (again.take(), again.take()) == (1002, None)
    assert cracks.Run(kept, SEED_VIEWS, None).take() is None
