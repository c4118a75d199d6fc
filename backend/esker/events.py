"""What a solve tells as it goes on: the events that a solver yields and that the ground of a room follows.

``solve`` makes them and ``session/ground`` reads them; neither knows the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.contract import Channel

__all__ = ["PAUSE", "BaseLevel", "ChannelLevel", "Done", "Level", "Pause", "Preview", "Settled", "SolveEvent", "pauses"]


@dataclass(frozen=True)
class Pause:
    """The work may be left here, for a while or for good."""


@dataclass(frozen=True)
class Level:
    """One level of something. heights: (N_l, N_l) float32, row 0 south, read-only; metres, or the channel's unit."""

    level: int
    heights: NDArray[np.float32]

    @property
    def channel(self) -> Channel:
        """What ``heights`` holds."""
        return Channel.HEIGHT

    @property
    def settled(self) -> bool:
        """Whether it is final for what is solved."""
        return True


@dataclass(frozen=True)
class Preview(Level):
    """Heights that later events correct, in metres above the base."""

    @property
    def settled(self) -> bool:
        """It is not final."""
        return False


@dataclass(frozen=True)
class Settled(Level):
    """Heights that are final for these strokes, and the injection of the next finer level."""


@dataclass(frozen=True)
class ChannelLevel(Level):
    """A channel other than the heights, final; the same array as last time if nothing of it changed.

    more: the next event is at hand, so that nobody waits for it: it comes with the same turn.
    """

    of: Channel
    more: bool = False

    @property
    def channel(self) -> Channel:
        """What ``heights`` holds."""
        return self.of


@dataclass(frozen=True)
class BaseLevel(ChannelLevel):
    """A level of the elevation layers: their ground (BASE), or how fine their data are (SURVEY)."""


@dataclass(frozen=True)
class Done:
    """The solve has come to its end. basis: what refinement starts from, where the solve was asked for it."""

    basis: Any = None


PAUSE = Pause()


def pauses(work: Iterator[None]) -> Iterator[Pause]:
    """Work that gives nothing, and can be left wherever it yields."""
    for _ in work:
        yield PAUSE


SolveEvent = Pause | Preview | Settled | ChannelLevel | BaseLevel | Done
