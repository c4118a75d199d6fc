"""Kinds of values that fields have, with their bounds, and the base of every wire value."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints

from esker.contract.constants import DOMAIN_MARGIN, MAX_NAME_LENGTH, MAX_SIZE_M, UNSEEN

# --- texts ------------------------------------------------------------------------------------------------------

_PLAIN: Final = {code: None for first, last in UNSEEN.items() for code in range(first, last + 1)} | dict.fromkeys(
    (9, 10, 13), " "
)


def plain(text: str) -> str:
    """A text that shows all that is in it, in the order in which it is: without the characters of ``UNSEEN``.

    They are taken out rather than refused, so that a journal from before this opens.
    """
    return text if text.isprintable() else text.translate(_PLAIN)


# --- scalar types -----------------------------------------------------------------------------------------------

ABSOLUTE_BOUND_M: Final = DOMAIN_MARGIN * MAX_SIZE_M
Metres = Annotated[float, Field(ge=-ABSOLUTE_BOUND_M, le=ABSOLUTE_BOUND_M, allow_inf_nan=False)]
Length = Annotated[float, Field(ge=0, le=ABSOLUTE_BOUND_M, allow_inf_nan=False)]
Unit = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
FrameCoord = Annotated[float, Field(ge=-1e7, le=1e7, allow_inf_nan=False)]
Vec3 = tuple[Metres, Metres, Metres]
CurvePoint = tuple[FrameCoord, FrameCoord]
Id = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,40}$")]
Digest = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
OpId = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,40}:[0-9]{1,12}$")]
Name = Annotated[str, StringConstraints(max_length=MAX_NAME_LENGTH), AfterValidator(plain)]
Secret = Annotated[str, StringConstraints(min_length=1, max_length=128)]
Token = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{1,16}\.[0-9a-f]{64}$")]
Ticket = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{1,16}-[0-9a-f]{16}\.[0-9a-f]{64}$")]
Line = Annotated[str, StringConstraints(max_length=240), AfterValidator(plain)]
Colour = Annotated[str, StringConstraints(pattern=r"^#[0-9a-f]{6}$")]
Clock = Annotated[int, Field(ge=0, le=2**53)]

StrokeKind = Literal["profile", "level", "paint", "course"]
CourseUse = Literal["river", "road", "ridge"]
PaintChannel = Literal["roughness", "amplitude", "snow", "grass", "forest", "wetness", "erosion"]
FlankShape = Literal["straight", "concave", "convex"]
Border = Literal["free", "pinned"]
Look = Literal["natural", "alpine", "desert", "paper"]
Rule = Literal["landscape", "smooth", "plain"]
Role = Literal["owner", "edit", "view"]
Which = Literal["first", "last"]
Animals = Literal["", "en", "de"]


class Wire(BaseModel):
    """Base of every wire value: immutable, no unknown fields, no silent coercion, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
