"""What figures of a siege say together: medians, what the machine does by itself, which aims do not hold."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import deepcopy
from statistics import median
from typing import Any, Final

import numpy as np

TIMES: Final = {"ack_p99_ms": 2.0, "tile_p50_ms": 2.0, "settling_s": 3.0}
"""Aims: times what the same room has without an attack, while it goes on and after it."""
MOST_MEMORY_MB: Final = 2147
"""2 GiB, of the server and its children; pages that they share count for each."""


def floor(alone: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Returns the medians of what was measured without an attack, and how many times them the worst was.

    So much the machine does by itself: of an attack that costs less nothing is known.
    """
    medians = {key: round(float(np.median([figures[key] for figures in alone])), 2) for key in TIMES}
    worst = {key: max(figures[key] for figures in alone) for key in TIMES}
    times = {key: round(worst[key] / medians[key], 2) for key in TIMES if medians[key]}
    return medians | {"times_measured": len(alone), "floor": times}


def judged(runs: dict[str, Any]) -> dict[str, list[str]]:
    """Adds ``times_alone`` and ``times_beside_nothing`` to each run, during and after: times what the people had
    without an attack, and times that or what they had beside as busy a process, whichever is more. Returns which aims
    do not hold of the latter, in words, by run."""
    alone, wrong = runs["alone"], dict[str, list[str]]()
    for name, figures in runs.items():
        if name == "alone":
            continue
        said = wrong.setdefault(name, [])
        nothing = figures.get("nothing", {})
        for when, found in (("", figures), (" afterwards", figures.get("after", {}))):
            times = {key: round(found[key] / alone[key], 2) for key in TIMES if found.get(key) and alone[key]}
            found |= {"times_alone": times} if times else {}
            beside = {
                key: round(found[key] / max(alone[key], nothing.get(key, 0.0)), 2)
                for key in TIMES
                if found.get(key) and alone[key]
            }
            found |= {"times_beside_nothing": beside} if beside else {}
            said += [
                f"{key}{when}: {beside[key]} times, aim {most}"
                for key, most in TIMES.items()
                if beside.get(key, 0) > most
            ]
        memory = figures["server"]["memory_mb"]
        said += [f"memory: {memory} MB, aim {MOST_MEMORY_MB}"] if memory > MOST_MEMORY_MB else []
        lost = figures["closed"] + figures["unanswered"]
        said += [f"{lost} of the people's changes or connections were lost"] if lost else []
    return {name: said for name, said in wrong.items() if said}


def unsure(runs: dict[str, Any]) -> list[str]:
    """Returns which attacks are to be measured again: whose aims do not hold, or would not without what the machine had
    beside a process that sends nothing. Two measurements may both have met a disk that stood still."""
    copy = deepcopy(runs)
    missed = judged(copy)
    both = {name: (run, run.get("after", {})) for name, run in copy.items() if name != "alone"}
    return [
        name
        for name, parts in both.items()
        if name in missed
        or any(part.get("times_alone", {}).get(key, 0) > TIMES[key] for part in parts for key in TIMES)
    ]


def merged(
    before: dict[str, Any], runs: dict[str, Any], missed: dict[str, list[str]]
) -> tuple[dict[str, Any], dict[str, list[str]]]:
    """Rows and misses of an earlier result with newer ones in their place. The figures without an attack are the
    newest; the floor is the worst of all pieces, each of whose rows was compared with its own."""
    alone, known = runs["alone"], before["runs"].get("alone", {})
    worst = {key: max(alone["floor"].get(key, 1.0), known.get("floor", {}).get(key, 1.0)) for key in TIMES}
    alone |= {"floor": worst, "times_measured": alone["times_measured"] + known.get("times_measured", 0)}
    return before["runs"] | runs, {k: v for k, v in before["missed"].items() if k not in runs} | missed


def middle(measured: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Returns one row out of several of the same attack: of times the middle, of what was lost all, of what was taken
    of the machine, and of what the disk took, the most."""
    row = measured[0] | _times(measured)
    row |= {key: sum(one[key] for one in measured) for key in ("acks", "refused", "unanswered", "closed")}
    row |= {part: _most(one[part] for one in measured) for part in ("server", "disk")}
    afterwards = [one["after"] for one in measured]
    row["after"] = _most(_numbers(after) for after in afterwards) | _times(afterwards)
    row["after"]["disk"] = _most(after["disk"] for after in afterwards)
    row["nothing"] = _times([one["nothing"] for one in measured])
    row["measured"] = [{key: one[key] for key in (*TIMES, "disk")} for one in measured]
    return row


def _times(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    return {key: round(median(row[key] for row in rows), 2) for key in TIMES}


def _numbers(row: dict[str, Any]) -> dict[str, float]:
    return {key: value for key, value in row.items() if not isinstance(value, dict)}


def _most(rows: Iterable[dict[str, float]]) -> dict[str, float]:
    most: dict[str, float] = {}
    for row in rows:
        most |= {key: max(value, most.get(key, value)) for key, value in row.items()}
    return most
