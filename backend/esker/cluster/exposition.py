"""Figures of a server as Prometheus reads them: text, version 0.0.4. Pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

CONTENT_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"
SECONDS: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5)
"""Bounds of durations that people wait for."""


@dataclass
class Histogram:
    """Durations, counted by bounds."""

    bounds: tuple[float, ...] = SECONDS
    counts: list[int] = field(default_factory=list)
    total: float = 0.0

    def __post_init__(self) -> None:
        self.counts = [0] * (len(self.bounds) + 1)

    def note(self, seconds: float) -> None:
        """Counts one duration."""
        self.counts[bisect_left(self.bounds, seconds)] += 1
        self.total += seconds


@dataclass(frozen=True)
class Family:
    """One figure by its name. ``values``: by labels, or a histogram."""

    name: str
    kind: Literal["counter", "gauge", "histogram"]
    help: str
    values: Mapping[tuple[tuple[str, str], ...], float] | Histogram


def one(name: str, kind: Literal["counter", "gauge"], help: str, value: float) -> Family:
    """A figure without labels."""
    return Family(name, kind, help, {(): value})


def text(families: Iterable[Family]) -> str:
    """Returns all of them as text.

    >>> print(text([one("esker_rooms", "gauge", "Open rooms.", 3)]), end="")
    # HELP esker_rooms Open rooms.
    # TYPE esker_rooms gauge
    esker_rooms 3
    """
    return "".join(line + "\n" for family in families for line in _lines(family))


def _lines(family: Family) -> Iterable[str]:
    yield f"# HELP {family.name} {_escaped(family.help, quotes=False)}"
    yield f"# TYPE {family.name} {family.kind}"
    if isinstance(family.values, Histogram):
        below = 0
        for bound, count in zip((*family.values.bounds, "+Inf"), family.values.counts, strict=True):
            below += count
            yield f'{family.name}_bucket{{le="{bound}"}} {below}'
        yield f"{family.name}_sum {_number(family.values.total)}"
        yield f"{family.name}_count {below}"
        return
    for labels, value in family.values.items():
        written = ",".join(f'{name}="{_escaped(text)}"' for name, text in labels)
        yield f"{family.name}{{{written}}} {_number(value)}" if written else f"{family.name} {_number(value)}"


def _number(value: float) -> str:
    return str(int(value)) if float(value).is_integer() else repr(float(value))


def _escaped(text: str, *, quotes: bool = True) -> str:
    """Returns a text as it may stand behind a name or in a label."""
    text = text.replace("\\", "\\\\").replace("\n", "\\n")
    return text.replace('"', '\\"') if quotes else text
