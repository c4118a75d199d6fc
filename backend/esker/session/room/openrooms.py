"""Places for open terrains: so many on a server, half of them for one address at most (decision 31)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from esker.fairness.shares import Full, Place, Places, Share, Who
from esker.process import memory, system
from esker.session.room.core import Denied

ROOM_BYTES: Final = 128 << 20
"""The server may open one room for each so many bytes of its memory: twice what a drawn room takes."""
GIVE_BACK_SECONDS: Final = 5.0
FEWEST, MOST = 8, 256
FULL: Final = "This server has as many terrains open as it can hold. Your page tries again by itself."
YOURS: Final = "Many terrains are open from your address. Close some pages; yours comes back by itself."


def share() -> Share:
    """Returns how many rooms may be open, in all and by one address."""
    total = max(FEWEST, min(MOST, memory.available_bytes() // ROOM_BYTES))
    return Share(total, address=max(FEWEST // 2, total // 2), network=max(FEWEST // 2, total // 2))


class OpenRooms:
    """The places of open rooms. ``sleep(terrain)`` closes a room that nobody is in and says whether it could."""

    def __init__(
        self,
        sleep: Callable[[str], bool],
        bound: Share | None = None,
        rest: Callable[[str], bool] = lambda _: False,
    ) -> None:
        """``rest(terrain)`` closes a room in which nobody has done anything for long, and says whether the room could
        be closed."""
        self._places = Places(bound or share())
        self._sleep, self._rest = sleep, rest
        self._held: dict[str, Place] = {}
        """Places by terrain; the least recently used one comes first."""

    def __len__(self) -> int:
        return len(self._held)

    def take(self, terrain: str, who: Who) -> None:
        """A place for a room that is to be opened. Raises Denied (rate_limited).

        Where there is none, rooms that nobody is in are closed, longest unused first, then rooms in which nobody has
        done anything for long: of who asks, where it is the share of who asks.
        """
        who = Who(who.address)
        while True:
            try:
                place = self._places.take(who)
            except Full as full:
                mine = [other for other in self._held if not full.yours or self._of(other, who)]
                if not any(close(other) for close in (self._sleep, self._rest) for other in mine):
                    raise Denied("rate_limited", YOURS if full.yours else FULL) from None
                continue
            self._held[terrain] = place
            return

    def _of(self, terrain: str, who: Who) -> bool:
        return self._held[terrain].who.site == who.site

    def used(self, terrain: str) -> None:
        """Notes that somebody came into the room."""
        place = self._held.pop(terrain, None)
        if place is not None:
            self._held[terrain] = place

    def release(self, terrain: str) -> None:
        """Gives the place of a closed room back."""
        place = self._held.pop(terrain, None)
        if place is not None:
            place.release()


class ClosedRooms:
    """The memory of rooms that were closed, which are freed when nobody holds them. Lives in one event loop."""

    def __init__(self) -> None:
        self._timer: asyncio.TimerHandle | None = None
        self._is_over = False

    def give_back_soon(self) -> None:
        """Gives it back to the system soon, once for all rooms that close within a while."""
        if self._timer is None and not self._is_over:
            self._timer = asyncio.get_running_loop().call_later(GIVE_BACK_SECONDS, self._give_back)

    def end(self) -> None:
        """Gives nothing back from now on: the server ends, and its loop takes no more work for other threads."""
        self._is_over = True
        if self._timer is not None:
            self._timer.cancel()

    def _give_back(self) -> None:
        self._timer = None
        asyncio.get_running_loop().run_in_executor(None, system.give_memory_back)
