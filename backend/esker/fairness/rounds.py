"""Who had a turn longest ago, where keys have turns one after another (SPEC A445). Pure.

A key is an address in the form of ``shares.homes``, or a thing that has turns for itself alone.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Final

MOST_HOMES: Final = 4_096
"""Most keys that are remembered; the key whose turn was longest ago is forgotten first."""


class Rounds:
    """Numbers turns, and remembers of each key its last."""

    def __init__(self, most: int = MOST_HOMES) -> None:
        self._most, self._turns = most, 0
        self._last: dict[Hashable, int] = {}
        """Numbers of the last turns of keys, the oldest first."""

    def __len__(self) -> int:
        return len(self._last)

    def last(self, key: Hashable) -> int:
        """Returns the number of the last turn of a key, 0 where none is known: the lowest is next."""
        return self._last.get(key, 0)

    def took(self, key: Hashable) -> int:
        """Notes that a key has a turn now, and returns its number."""
        self._turns += 1
        self._last.pop(key, None)
        self._last[key] = self._turns
        while len(self._last) > self._most:
            del self._last[next(iter(self._last))]
        return self._turns
