"""A class: one code, a copy of a terrain for everyone, and the wall on which all copies are seen (docs/teaching.md)."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field, StringConstraints, TypeAdapter

from esker.contract.constants import DEFAULT_LEVEL
from esker.contract.document import TerrainSettings
from esker.contract.tasks import Score
from esker.contract.values import Id, Line, Name, Secret, Wire

MAX_PUPILS: Final = 60
"""Devices that one class takes, and so its copies."""
DEFAULT_PUPILS: Final = 40
MAX_TOGETHER: Final = 4
"""Devices that share a copy."""
MAX_CLASSES: Final = 8
"""Classes of one terrain that are not deleted."""
WALL_LEVEL: Final = 1
"""The wall draws each copy from its tiles up to this level."""
WALL_CLOSE_LEVEL: Final = 3
"""Those of copies that are compared."""
WALL_PACE_MS: Final = 500
"""A copy's ground goes to a wall at most so often, and what is told of the copies too."""
MAX_COMPARED: Final = 2

Number = Annotated[int, Field(ge=1, le=MAX_PUPILS)]
"""A copy of a class, counted from one."""
SeatSecret = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{32,128}$")]
"""The secret of a device's seat, 192 random bits at least, which the device makes. It is the secret of its link."""


class Shown(Wire):
    """The copy that everybody is to look at, by a link to look."""

    terrain: Id
    secret: Secret
    name: Line


class InClass(Wire):
    """What a page in a copy of a class is told of the class: after its welcome, and when it changes.

    ``names``: of those whose copy it is. ``frozen``: nobody but owners changes this copy. ``show``: the page goes there
    to look, and comes back when it is null again.
    """

    type: Literal["class"] = "class"
    lesson: Id
    title: Name
    number: int
    names: tuple[Name, ...]
    frozen: bool
    show: Shown | None = None


class WallHello(Wire):
    """First message on the socket of a wall. ``terrain``: the one that the class was made from; ``secret``: of an
    owner's link to it."""

    type: Literal["wall"] = "wall"
    protocol: int
    terrain: Id
    secret: Secret
    lesson: Id


class WallFocus(Wire):
    """These copies come up to WALL_CLOSE_LEVEL, all others up to WALL_LEVEL."""

    type: Literal["focus"] = "focus"
    numbers: Annotated[tuple[Number, ...], Field(max_length=MAX_COMPARED)] = ()


WallMessage = Annotated[WallHello | WallFocus, Field(discriminator="type")]


class WallCopy(Wire):
    """One copy as the wall shows it. ``last``: when somebody last changed it, seconds since 1970, None: nobody has.

    ``online``: devices that have it open, owners not counted; ``settings``: what its picture depends on, without the
    task. ``score``: None where nothing is scored, or not yet.
    """

    number: int
    terrain: Id
    names: tuple[Name, ...]
    online: int
    last: float | None
    strokes: int
    frozen: bool
    settings: TerrainSettings
    score: Score | None = None


class Wall(Wire):
    """The class, and those of its copies of which something changed since the last message; all of them at first.

    ``code`` opens the class for ``expires_s`` seconds more; None: the door is closed. ``show``: the copy that everybody
    is shown. ``ended``: when it was deleted.
    """

    type: Literal["wall"] = "wall"
    lesson: Id
    title: Name
    code: str | None
    expires_s: float
    together: int
    places: int
    pupils: int
    show: int | None
    copies: tuple[WallCopy, ...]


WALL_MESSAGE: Final[TypeAdapter[Any]] = TypeAdapter(WallMessage)
WALL_HEADER: Final = np.dtype([("number", "<u2"), ("fresh", "u1"), ("spare", "u1")])
"""Before each frame of tiles on the wall's socket. ``fresh`` 1: what was held of this copy is to be forgotten first."""

assert WALL_CLOSE_LEVEL <= DEFAULT_LEVEL
