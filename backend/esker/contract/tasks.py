"""A task: what pupils are asked to make of a terrain, and how one sees how far they are (docs/teaching.md)."""

from __future__ import annotations

import base64
import binascii
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field, StringConstraints

from esker.contract.constants import MAX_SIZE_M, MIN_SIZE_M, UNSEEN
from esker.contract.values import Line, Metres, Name, Wire

TASK_LEVEL: Final = 2
"""Ground is scored by the samples of this level, and targets have no finer ones."""
MAX_TASK_TEXT: Final = 4_000
MAX_TARGET_CHARACTERS: Final = 40_000
"""A target fits the message that sets it, with its text beside it."""
MAX_TASK_PICTURES: Final = 2
MAX_PICTURE_CHARACTERS: Final = 28_000
MAX_PICTURE_SIDE: Final = 1_024
"""Pixels of a side of a picture: a small file may declare a picture that fills a page's memory."""
MAX_TASK_LINE: Final = 64
"""Points of a path whose slope counts."""
MIN_PROFILE_SAMPLES: Final = 2
MAX_PROFILE_SAMPLES: Final = 257
MIN_TARGET_STEP_M: Final = 1e-4
MIN_TOLERANCE_M: Final = 0.01
TOLERANCES_OFF: Final = 5.0
"""Ground that is off by so many tolerances counts nothing; within one it counts whole, in between linearly."""
RING_SHARE: Final = 1.0 / 90.0
"""The ring around a point that a task names, as a share of the domain's side: what counts there is the best of its
samples, for nobody draws to the sample."""
MAX_GRADE: Final = 10.0
MIN_AMOUNT: Final = 1.0
MAX_AMOUNT: Final = 1e15
"""Square or cubic metres that a rule may ask for."""

_TEXT: Final = {code: None for first, last in UNSEEN.items() for code in range(first, last + 1)} | {9: " ", 10: "\n"}
_PNG: Final = b"\x89PNG\r\n\x1a\n"


def plain_text(text: str) -> str:
    """A text of paragraphs that shows all that is in it (``values.plain``); its line ends stay."""
    return text.translate(_TEXT)


def sides(data: bytes) -> tuple[int, int] | None:
    """Width and height that a PNG or WebP declares; None for anything else. Nothing is decoded."""
    if data[:8] == _PNG and data[12:16] == b"IHDR" and len(data) > 24:
        return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    if data[:4] != b"RIFF" or data[8:12] != b"WEBP" or len(data) < 30:
        return None
    match data[12:16]:
        case b"VP8 " if data[23:26] == b"\x9d\x01\x2a":
            return int.from_bytes(data[26:28], "little") & 0x3FFF, int.from_bytes(data[28:30], "little") & 0x3FFF
        case b"VP8L" if data[20] == 0x2F:
            bits = int.from_bytes(data[21:25], "little")
            return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
        case b"VP8X":
            return int.from_bytes(data[24:27], "little") + 1, int.from_bytes(data[27:30], "little") + 1
    return None


def _small(picture: str) -> str:
    try:
        found = sides(base64.b64decode(picture, validate=True))
    except (binascii.Error, ValueError):
        found = None
    if found is None:
        raise ValueError("a picture of a task is a PNG or a WebP")
    if not all(0 < side <= MAX_PICTURE_SIDE for side in found):
        raise ValueError(f"a picture of a task has at most {MAX_PICTURE_SIDE} pixels a side")
    return picture


Picture = Annotated[
    str,
    StringConstraints(pattern=r"^[A-Za-z0-9+/]+={0,2}$", max_length=MAX_PICTURE_CHARACTERS),
    AfterValidator(_small),
]
"""A PNG or WebP in base64. The server reads the sides that it declares and decodes nothing."""
TaskText = Annotated[str, StringConstraints(max_length=MAX_TASK_TEXT), AfterValidator(plain_text)]
Point = tuple[Metres, Metres]
Tolerance = Annotated[float, Field(ge=MIN_TOLERANCE_M, le=MAX_SIZE_M, allow_inf_nan=False)]
Amount = Annotated[float, Field(ge=MIN_AMOUNT, le=MAX_AMOUNT, allow_inf_nan=False)]
Side = Annotated[float, Field(ge=MIN_SIZE_M, le=MAX_SIZE_M, allow_inf_nan=False)]


class Target(Wire):
    """Ground that is to be reached: all samples of a level, as heights ``low_m + step_m * k``.

    ``data``: base64 of the k (``tasks/target.py`` has the bytes); ``size_m``: side of the terrain that it was made of.
    No stroke of that terrain is in it.
    """

    size_m: Side
    level: Annotated[int, Field(ge=0, le=TASK_LEVEL)]
    low_m: Metres
    step_m: Annotated[float, Field(ge=MIN_TARGET_STEP_M, le=MAX_SIZE_M, allow_inf_nan=False)]
    data: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9+/]+={0,2}$", max_length=MAX_TARGET_CHARACTERS)]


class TerrainGoal(Wire):
    """The ground is to be that of the target; what is within ``tolerance_m`` counts whole."""

    type: Literal["terrain"] = "terrain"
    target: Target
    tolerance_m: Tolerance


class ContoursGoal(Wire):
    """As ``TerrainGoal``, but pages show the target by its contours, ``interval_m`` apart."""

    type: Literal["contours"] = "contours"
    target: Target
    tolerance_m: Tolerance
    interval_m: Tolerance


class ProfileGoal(Wire):
    """Along the straight line from ``first`` to ``last`` the ground is to have ``heights``, evenly apart."""

    type: Literal["profile"] = "profile"
    first: Point
    last: Point
    heights: Annotated[tuple[Metres, ...], Field(min_length=MIN_PROFILE_SAMPLES, max_length=MAX_PROFILE_SAMPLES)]
    tolerance_m: Tolerance


class VolumeGoal(Wire):
    """The basin around ``point`` is to hold ``at_least_m3`` of water that stands no higher than ``level_m``."""

    type: Literal["volume"] = "volume"
    point: Point
    level_m: Metres
    at_least_m3: Amount


class SlopeGoal(Wire):
    """The path is nowhere to be steeper than ``at_most``, rise over run."""

    type: Literal["slope"] = "slope"
    path: Annotated[tuple[Point, ...], Field(min_length=2, max_length=MAX_TASK_LINE)]
    at_most: Annotated[float, Field(ge=0.001, le=MAX_GRADE, allow_inf_nan=False)]


class AreaGoal(Wire):
    """An area that is to be above ``level_m``; ``dry``: ground counts too where a sea at that level does not come."""

    type: Literal["area"] = "area"
    level_m: Metres
    at_least_m2: Amount
    dry: bool = False


class WatershedGoal(Wire):
    """Rain from at least so much ground is to run through ``point``."""

    type: Literal["watershed"] = "watershed"
    point: Point
    at_least_m2: Amount


Goal = Annotated[
    TerrainGoal | ContoursGoal | ProfileGoal | VolumeGoal | SlopeGoal | AreaGoal | WatershedGoal,
    Field(discriminator="type"),
]


class Task(Wire):
    """What pupils are asked. ``text``: plain paragraphs; ``difference``: whether they may see where the ground is too
    high and too low. Without a goal nothing is scored."""

    title: Name = ""
    text: TaskText = ""
    goal: Goal | None = None
    difference: bool = True


class Score(Wire):
    """How far a terrain is with its task, at the settled ground of a clock: to everybody in it, after their welcome and
    when it changes. ``points``: 0 to 100, None: nothing is scored; ``text`` says why it is so many."""

    type: Literal["score"] = "score"
    clock: Annotated[int, Field(ge=0)]
    points: Annotated[int, Field(ge=0, le=100)] | None = None
    text: Line = ""
    figures: Annotated[tuple[float, ...], Field(max_length=4)] = ()
    """Numbers of the sentence, for pages of another language; which ones, the goal says (docs/tasks.md)."""
