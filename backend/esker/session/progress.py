"""How far the ground of one terrain is, told to everybody in it at a bounded pace (DESIGN 8)."""

from __future__ import annotations

import asyncio
from typing import Final

from esker import contract as c
from esker.session.ground.base_builder import Layers
from esker.session.room.core import RoomCore

PROGRESS_TICK: Final = 0.1
CLOCK_TICK: Final = 0.25


class GroundProgress:
    """The newest progress of a room's ground, and the timer by which its members are told."""

    def __init__(self, core: RoomCore, layers: Layers, levels: int, loop: asyncio.AbstractEventLoop) -> None:
        self._core, self._layers, self._levels, self._loop = core, layers, levels, loop
        self._newest = c.Progress(clock=core.head.clock, level=0, of=levels, settled=False)
        self._timer: asyncio.TimerHandle | None = None
        self._note = ""
        self._refining = 0
        self._closed = False

    @property
    def settled(self) -> bool:
        """Whether the ground that was told of last is final."""
        return self._newest.settled

    @property
    def clock(self) -> int:
        """The clock whose ground was told of last."""
        return self._newest.clock

    def level_taken(self, clock: int, level: int, settled: bool) -> None:
        """Tells people that a level became tiles.

        An op that does not touch the ground leaves an older solve as good as new.
        """
        if clock >= self._core.geometry_clock:
            clock = self._core.head.clock
        refining = self._refining if settled else 0
        self.note(c.Progress(clock=clock, level=level, of=self._levels, settled=settled, refining=refining))

    def refining(self, count: int) -> None:
        """Takes the number of refined tiles that are wanted and not there yet."""
        self._refining = count
        if self._newest.settled and count != self._newest.refining:
            self.note(self._newest.model_copy(update={"refining": count}))

    def tell(self, note: str) -> None:
        """Sends a sentence with the next progress, whatever that is: no level may hide it."""
        self._note = note
        self.again()

    def again(self) -> None:
        """Tells everybody the newest once more: what it is told with has changed."""
        self.note(self._newest)

    def unsettled(self) -> None:
        """Tells everybody that the ground is another from now on."""
        self.note(self._newest.model_copy(update={"settled": False}))

    def note(self, progress: c.Progress) -> None:
        """Takes the newest progress and tells everybody soon."""
        self._newest = progress
        self.soon()

    def soon(self, delay: float = PROGRESS_TICK) -> None:
        """Tells everybody the newest after a while, once."""
        if self._timer is None and not self._closed:
            self._timer = self._loop.call_later(delay, self._send)

    def clock_changed(self) -> None:
        """Tells of a clock at which none of the ground changed: members see the clock from the ops, so there is no
        hurry."""
        self.soon(CLOCK_TICK)

    def newest(self) -> c.Progress:
        """Returns the newest progress. Settled ground is settled for every clock since at which none of it changed."""
        progress, head = self._newest, self._core.head
        unchanged = self._core.geometry_clock <= progress.clock < head.clock
        if progress.settled and unchanged and self._layers.current(head):
            self._newest = progress.model_copy(update={"clock": head.clock})
        return self._newest.model_copy(update={"laying": self._layers.slow})

    def close(self) -> None:
        """Stops the timer."""
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()

    def _send(self) -> None:
        self._timer = None
        text = self.newest().model_copy(update={"note": self._note}).model_dump_json()
        self._note = ""
        for member in self._core.members:
            member.outbox.push(text)
