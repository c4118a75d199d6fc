"""The tiles of one client on their way: its window, and the frames that wait for it (DESIGN 8, "Flow control")."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Final

from esker import contract as c
from esker.session.ground.ports import FrameOutlet

SEEN_BYTES: Final = c.BYTE_WINDOW // 2
"""Who has applied so many bytes is no newcomer, though the ground may not have stood still for a moment yet."""
BATCH_BYTES: Final = 48 << 10
"""Frames of one client are made in one go up to this size: each hand-over to the loop and back costs a millisecond."""
FIRST_BATCH_BYTES: Final = 12 << 10
"""Those of a newcomer up to this: tiles that nobody was sent yet take long to code, and others wait meanwhile."""


@dataclass(eq=False)
class Stream:
    """The tiles of one client: its window, and the encoded frames that wait for the socket."""

    outbox: FrameOutlet
    top: int | None = None
    """The finest level of somebody who only watches, None: of a client with a view."""
    view: c.View | None = None
    in_flight: int = 0
    applied: int = 0
    """Bytes that the client has said it applied."""
    hungry: bool = True
    busy: bool = False
    newcomer: bool = True
    """Whether the client has not applied a first whole view: its frames come behind those of others (SPEC P642)."""
    whole: bool = False
    """Whether a whole view was made for it once."""
    gone: bool = False
    """Whether the client left. What waits to be made for it is not made. The tile thread reads it."""
    rivers: bytes | None = None
    """The newest frame of rivers, until it is sent: behind all tiles."""
    frames: deque[bytes] = field(default_factory=deque)

    @property
    def ready(self) -> bool:
        """Whether a frame may be made for this client now."""
        free = not self.frames and not self.busy and self.in_flight < c.BYTE_WINDOW
        return self.hungry and free and self.outbox.closing is None

    @property
    def most(self) -> int:
        """Bytes that may be made for this client in one go."""
        return min(FIRST_BATCH_BYTES if self.newcomer else BATCH_BYTES, c.BYTE_WINDOW - self.in_flight)

    def credit(self, count: int) -> None:
        """Takes note that the client has applied so many bytes."""
        count = min(count, self.in_flight)
        self.in_flight -= count
        self.applied += count
        self._arrive()

    def made(self, some: bool) -> None:
        """Takes note that frames were made, or with ``some`` False that there was nothing more to make."""
        self.busy = False
        self.hungry |= some
        # In a room without ground there is nothing to make, and nothing was seen.
        self.whole |= not some and self.in_flight + self.applied > 0
        self._arrive()

    def _arrive(self) -> None:
        has_all = self.whole and self.in_flight == 0
        self.newcomer &= not has_all and self.applied < SEEN_BYTES
