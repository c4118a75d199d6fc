"""Operations on a document (DESIGN 4)."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from esker.contract.constants import MAX_OPS_PER_GROUP, MAX_POINTS_PER_APPEND, MAX_POINTS_PER_STROKE
from esker.contract.document import Layer, LayerFields, Stroke, StrokeFields, TerrainFields
from esker.contract.values import Clock, CurvePoint, Id, Name, OpId, Vec3, Which, Wire
from esker.errors import AnswerCode as AnswerCode

# --- operations (DESIGN 4) --------------------------------------------------------------------------------------


class BeginStroke(Wire):
    type: Literal["stroke.begin"] = "stroke.begin"
    stroke: Stroke


class AppendPoints(Wire):
    """Replace the curve from index ``start`` on by ``points`` and move ``last``.

    ``start`` equal to the curve's length appends; a smaller one re-projects the tail, as happens when the plane of
    a profile turns with the pen (DESIGN 12).
    """

    type: Literal["stroke.append"] = "stroke.append"
    stroke: Id
    start: Annotated[int, Field(ge=0, le=MAX_POINTS_PER_STROKE)]
    points: Annotated[tuple[CurvePoint, ...], Field(max_length=MAX_POINTS_PER_APPEND)]
    last: Vec3


class FinishStroke(Wire):
    type: Literal["stroke.finish"] = "stroke.finish"
    stroke: Id


class SetStroke(Wire):
    type: Literal["stroke.set"] = "stroke.set"
    stroke: Id
    fields: StrokeFields


class MoveAnchor(Wire):
    type: Literal["stroke.anchor"] = "stroke.anchor"
    stroke: Id
    which: Which
    to: Vec3


class DeleteStroke(Wire):
    type: Literal["stroke.delete"] = "stroke.delete"
    stroke: Id


class RestoreStroke(Wire):
    type: Literal["stroke.restore"] = "stroke.restore"
    stroke: Id


class SetTerrain(Wire):
    type: Literal["terrain.set"] = "terrain.set"
    fields: TerrainFields


class AddLayer(Wire):
    """Only the server makes this op, when it holds the content: a client that sends it is refused."""

    type: Literal["layer.add"] = "layer.add"
    layer: Layer


class SetLayer(Wire):
    type: Literal["layer.set"] = "layer.set"
    layer: Id
    fields: LayerFields


class DeleteLayer(Wire):
    type: Literal["layer.delete"] = "layer.delete"
    layer: Id


class RestoreLayer(Wire):
    type: Literal["layer.restore"] = "layer.restore"
    layer: Id


SimpleOp = Annotated[
    BeginStroke
    | AppendPoints
    | FinishStroke
    | SetStroke
    | MoveAnchor
    | DeleteStroke
    | RestoreStroke
    | SetTerrain
    | AddLayer
    | SetLayer
    | DeleteLayer
    | RestoreLayer,
    Field(discriminator="type"),
]


class Group(Wire):
    """Operations that apply together or not at all; one tick of the clock."""

    type: Literal["group"] = "group"
    ops: Annotated[tuple[SimpleOp, ...], Field(min_length=1, max_length=MAX_OPS_PER_GROUP)]


Op = Annotated[
    BeginStroke
    | AppendPoints
    | FinishStroke
    | SetStroke
    | MoveAnchor
    | DeleteStroke
    | RestoreStroke
    | SetTerrain
    | AddLayer
    | SetLayer
    | DeleteLayer
    | RestoreLayer
    | Group,
    Field(discriminator="type"),
]


class OpEnvelope(Wire):
    """An operation with the id that makes it idempotent: ``client:counter``."""

    id: OpId
    op: Op


class OrderedOp(Wire):
    """An operation as the server ordered it."""

    clock: Clock
    id: OpId
    author: Name
    op: Op


RejectCode = Literal[
    "malformed",
    "unknown_stroke",
    "duplicate_stroke",
    "deleted_stroke",
    "locked_stroke",
    "too_many_strokes",
    "too_many_points",
    "out_of_domain",
    "bad_index",
    "bad_field",
    "unknown_layer",
    "duplicate_layer",
    "deleted_layer",
    "too_many_layers",
    "server_only",
    "view_only",
    "hands_off",
    "protected",
    "leaders_only",
    "frozen",
    "rate_limited",
    "too_large",
    "unavailable",
]

CloseCode = Literal[
    "bad_protocol",
    "bad_hello",
    "bad_secret",
    "revoked",
    "no_terrain",
    "room_full",
    "too_large",
    "malformed",
    "slow_client",
    "rate_limited",
    "bad_origin",
    "removed",
    "server_error",
    "shutting_down",
    "moved",
]

WS_CLOSE: Final[dict[str, int]] = {
    "bad_protocol": 4000,
    "bad_hello": 4001,
    "bad_secret": 4003,
    "revoked": 4004,
    "no_terrain": 4005,
    "room_full": 4006,
    "too_large": 4007,
    "malformed": 4008,
    "slow_client": 4009,
    "rate_limited": 4010,
    "bad_origin": 4011,
    "removed": 4012,
    "server_error": 4500,
    "shutting_down": 4501,
    "moved": 4502,
}
"""Websocket close codes. 4000..4008, 4011 and 4012 are final for the page; it reconnects after any other."""
