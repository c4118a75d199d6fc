"""A room as a copy of a class: what its members are told, whether it is frozen, and who watches it from the wall."""

from __future__ import annotations

import asyncio
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.session.ground.frames.feed import TileFeed
from esker.session.ground.frames.stream import Stream
from esker.session.ground.ports import FrameOutlet
from esker.session.progress import GroundProgress
from esker.session.room.core import RoomCore

FROZEN: Final = "Your teacher has frozen this terrain. What you draw now is not kept."


class ClassRoom:
    """The part of a ``Room`` that classes need. It adds no timer and no state but ``in_class``."""

    core: RoomCore
    in_class: c.InClass | None = None
    """What its members are told of the class whose copy this is."""
    _feed: TileFeed
    _progress: GroundProgress

    @property
    def frozen(self) -> bool:
        """Whether nobody but owners may change it."""
        return self.in_class is not None and self.in_class.frozen

    def tell_class(self, facts: c.InClass | None) -> None:
        """Something may have changed of the class whose copy this is; where it did, everybody is told."""
        if facts == self.in_class:
            return
        self.in_class = facts
        if facts is not None:
            for member in self.core.members:
                member.outbox.message(facts)

    def watch(self, outlet: FrameOutlet, top: int) -> Stream:
        """The ground up to level ``top`` for somebody who is no member. Watching does not keep a room open."""
        return self._feed.add(outlet, top)

    def unwatch(self, stream: Stream) -> None:
        """Nobody watches by this stream any more."""
        self._feed.remove(stream)

    def watched(self, stream: Stream) -> bytes | None:
        """The binary frame that waits for who watches. No other is made until ``look_again``: what is sent then is the
        ground of that moment, and not one that was kept since."""
        frame = self._feed.sent(stream)
        if frame is not None:
            stream.in_flight = c.BYTE_WINDOW
        return frame

    def look_again(self, stream: Stream) -> None:
        """From now on a frame is made when there is something new."""
        if not stream.frames:
            self._feed.credit(stream, stream.in_flight)

    @property
    def settled(self) -> bool:
        """Whether every level that is solved as a whole is final, for the document as it is."""
        return self._progress.settled and self._progress.clock >= self.core.geometry_clock and not self.core.busy

    async def heights(self, level: int) -> NDArray[np.float32] | None:
        """The ground of a level in metres, row 0 south; None where there is none yet."""
        return await asyncio.wrap_future(self._feed.heights(level))
