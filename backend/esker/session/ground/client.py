"""The view that the solver's thread has of a room."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from esker.events import Level, Preview
from esker.session.ground.ports import Refinement
from esker.session.ground.recovery import Backoff
from esker.session.ground.states import Ground
from esker.session.ground.work import Work

Deliver = Callable[[int, Level], None]


@dataclass(eq=False)
class Client:
    """A room as the worker sees it: whom it calls, its ground, and what is open for it.

    ``levels``: the finest level that it wants. ``backoff``: when that is tried again, after there was no memory for it.
    ``notified``: what the room was notified of the device.
    """

    levels: int
    deliver: Deliver
    tell: Callable[[str], None]
    refinement: Refinement | None = None
    limit: Callable[[int], None] | None = None
    confirm: Callable[[int, int], None] | None = None
    note: Callable[[int, Preview], None] | None = None
    ground: Ground = field(init=False)
    work: Work = field(default_factory=Work)
    backoff: Backoff = field(default_factory=Backoff)
    notified: str = ""

    def __post_init__(self) -> None:
        self.ground = Ground(self.levels)
