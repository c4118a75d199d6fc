"""Revisions: integers that say whether something is still what it was, and which of two things is newer."""

from __future__ import annotations

import itertools

_numbers = itertools.count(1)


def revision() -> int:
    """Returns a number greater than all before, of this process: two lines of changes never have one in common."""
    return next(_numbers)
