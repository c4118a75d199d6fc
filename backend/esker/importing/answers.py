"""Answers that have a meaning of their own, and those that a place given by hand implies."""

from __future__ import annotations

from typing import Final

from esker import contract as c

FIT: Final = "fit"
MIDDLE: Final = "middle"
STOP: Final = "stop"
NONE: Final = "none"
FEET: Final = "feet"
METRES: Final = "metres"
SHIFT: Final = "shift"
KEEP: Final = "keep"


def given(answers: c.ImportAnswers) -> dict[str, str]:
    """Answers by question id, with those that a place given by hand answers too."""
    found = dict(answers.answers)
    if answers.spacing_m is not None:
        found.setdefault("size", FIT)
    if answers.anchor is not None:
        found.setdefault("place", MIDDLE)
    if answers.lift_m is not None or answers.scale is not None:
        found["height"] = KEEP
    return found
