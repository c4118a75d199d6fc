"""The one source of every constant, wire format and shared struct (DESIGN 2, 3, 4, 6).

Nothing here does I/O. ``contract_emit.py`` turns this module into the committed TypeScript, WGSL, OpenCL and
GLSL files; a test regenerates them and compares. Change a number here, run ``make generate``, commit both.

Conventions (DESIGN 3): metres, seconds, degrees at the interface; x east, y north, z up; little-endian.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, TypeAdapter

# --- protocol ---------------------------------------------------------------------------------------------------

PROTOCOL_VERSION: Final = 4
SUBPROTOCOL: Final = "esker.4"

# --- grid (DESIGN 3) --------------------------------------------------------------------------------------------

TILE_CELLS: Final = 64
TILE_SAMPLES: Final = 65
PATCH_CELLS: Final = 16
SUBPATCHES: Final = 4
"""Sub-patches along one side of a tile: each 16x16-cell patch is selected and drawn by itself (DESIGN 9)."""
MAX_LEVEL: Final = 6
"""The finest level that may be solved globally (4097 samples a side)."""
DEFAULT_LEVEL: Final = 4
MAX_REFINED_LEVEL: Final = 10
"""The finest level that may be refined tile by tile above the global ones (65,537 samples a side; DESIGN 5.6)."""
DEFAULT_REFINED_LEVEL: Final = 8
MAX_SYNTHESIS_LEVEL: Final = 17
"""The finest level that detail may be synthesised at: cells of 0.8 cm on the largest domain (DESIGN 10)."""
MAX_REFINED_TILES: Final = 512
"""Tiles above the global levels that one client is made to hold at most; the server drops what is least in view."""
QUANTA_PER_CELL: Final = 256
"""Quantisation step of level l: q_l = s_l / 256, so that the slope error is the same at every level (DESIGN 6)."""
DEFAULT_SIZE_M: Final = 4096.0
MIN_SIZE_M: Final = 64.0
MAX_SIZE_M: Final = 65536.0
DEFAULT_REACH_FRACTION: Final = 1.0 / 32.0

# --- solver (DESIGN 5.2, 5.3) -----------------------------------------------------------------------------------

CREST_STIFFNESS: Final = 4.0
SATURATION: Final = 0.12
SPRING_CELLS: Final = 30.0
"""Flank spring a_i = (30 s_l / extent)^2."""
SPRING_FULL_FRACTION: Final = 0.85
CHEBYSHEV_SWEEPS: Final = 4
CHEBYSHEV_LOW: Final = 0.5
CHEBYSHEV_HIGH: Final = 2.0

# --- channels (DESIGN 5.4, 6) -----------------------------------------------------------------------------------

CHANNEL_LEVELS_BELOW: Final = 2
"""Channels are smooth: they are solved and sent up to this many levels below the heights."""
AMPLITUDE_QUANTA_PER_M: Final = 64
ROUGHNESS_QUANTA: Final = 1024
"""Quantisation steps of roughness 1. Channels have the same step on every level."""
BIAS_QUANTA: Final = 1024
"""Quantisation steps of a bias of 1: of snow, grass, forest and wetness."""
BASE_AMPLITUDE_M: Final = 0.0
BASE_ROUGHNESS: Final = 0.5
BASE_BIAS: Final = 0.0
"""What the channels are where no stroke says otherwise."""

SURVEY_QUANTA: Final = 256
"""Quantisation steps of one level of the survey channel."""
BASE_SURVEY: Final = -1.0
"""The survey channel where no elevation grid lies: below level 0, so that no detail is held back there."""

# --- elevation grids (DESIGN 11) --------------------------------------------------------------------------------

PATCH_SAMPLES: Final = 32
PATCH_KERNEL_CELLS: Final = 28
PATCH_MARGIN_CELLS: Final = 1.5
"""A patch has 32 x 32 samples (31 cells); its kernel is the 28 cells in the middle."""
MAX_LAYERS: Final = 64
MAX_GRID_SAMPLES: Final = 200_000_000
"""Samples that a file may declare."""
MAX_GRID_BYTES: Final = 256 * 1024 * 1024
"""Bytes of an uploaded elevation file."""
MIN_GRID_SIDE: Final = 4
MAX_GRID_SPACING_M: Final = 100_000.0
MIN_GRID_SPACING_M: Final = 0.001
MAX_VERTICAL_SCALE: Final = 1_000.0
LAYER_HEIGHT_MARGIN: Final = 64.0
"""A layer's heights are within so many sides of the domain of zero: more quanta than 2^30 no tile holds."""

# --- detail (DESIGN 10) -----------------------------------------------------------------------------------------

DEFAULT_DETAIL: Final = 1.0
MAX_DETAIL: Final = 4.0
"""Strength of the natural detail: 0 takes it away, 1 is the rule's own."""

# --- stroke defaults (DESIGN 5.2, 12) ---------------------------------------------------------------------------

DEFAULT_SLOPE_DEG: Final = 35.0
DEFAULT_EXTENT_FRACTION: Final = 1.0 / 2.0
"""Default flank extent as a fraction of the domain. So generous that a high flank is never cut off in a cliff: the band
ends where it meets the base anyway."""
MAX_SLOPE_DEG: Final = 85.0

# --- limits (DESIGN 4); settings may lower them, never raise them --------------------------------------------------

MAX_STROKES: Final = 5_000
MAX_POINTS_PER_STROKE: Final = 4_096
MAX_POINTS_PER_APPEND: Final = 256
MAX_MESSAGE_BYTES: Final = 64 * 1024
MAX_OPS_PER_SECOND: Final = 120
OPS_BURST: Final = 240
MAX_PRESENCE_PER_SECOND: Final = 30
MAX_VIEWS_PER_SECOND: Final = 60
MAX_MEMBERS: Final = 200
MAX_NAME_LENGTH: Final = 80
MAX_OPS_PER_MESSAGE: Final = 256
MAX_OPS_PER_GROUP: Final = 64
DOMAIN_MARGIN: Final = 10.0
"""Points farther than ten times the domain size from its origin are refused."""
PRESENCE_HZ: Final = 20
TICK_MS: Final = 33
BYTE_WINDOW: Final = 1 * 1024 * 1024
"""Tile bytes that may be in flight to one client before it returns credits (DESIGN 8)."""
MAX_BACKLOG_BYTES: Final = 3 * 1024 * 1024
"""Control bytes queued for a client that does not read; above it the client is closed and resumes."""
STALL_SECONDS: Final = 8.0
"""A client whose socket accepted nothing for this long while bytes were waiting is evicted."""
DEFAULT_TAU_PX: Final = 1.5

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
Name = Annotated[str, StringConstraints(max_length=MAX_NAME_LENGTH)]
Secret = Annotated[str, StringConstraints(min_length=1, max_length=128)]
Line = Annotated[str, StringConstraints(max_length=240)]
Colour = Annotated[str, StringConstraints(pattern=r"^#[0-9a-f]{6}$")]
Clock = Annotated[int, Field(ge=0, le=2**53)]

StrokeKind = Literal["profile", "level", "paint"]
PaintChannel = Literal["roughness", "amplitude", "snow", "grass", "forest", "wetness"]
FlankShape = Literal["straight", "concave", "convex"]
Border = Literal["free", "pinned"]
Look = Literal["natural", "alpine", "desert", "paper"]
Rule = Literal["landscape", "smooth", "plain"]
Role = Literal["owner", "edit", "view"]
Which = Literal["first", "last"]


class Wire(BaseModel):
    """Base of every wire value: immutable, no unknown fields, no silent coercion, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


# --- document (DESIGN 4) ----------------------------------------------------------------------------------------


class Flank(Wire):
    """One side of a cross-section. ``slope_deg`` None lets the diffusion decide; ``extent_m`` bounds the band."""

    slope_deg: Annotated[float, Field(ge=0, le=MAX_SLOPE_DEG, allow_inf_nan=False)] | None = DEFAULT_SLOPE_DEG
    extent_m: Length = DEFAULT_SIZE_M * DEFAULT_EXTENT_FRACTION
    shape: FlankShape = "concave"


class Paint(Wire):
    """What a paint stroke says of one channel within ``radius_m`` (horizontal metres) of its line.

    ``value``: -1 takes all of it away, 0 is the base, 1 asks for all of it (docs/protocol.md, "Paint").
    """

    channel: PaintChannel
    value: Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)]
    radius_m: Length


class Stroke(Wire):
    """One stroke (immutable). Curve points live in the frame of the anchors, so moving an anchor re-projects.

    ``profile``: curve point (u, w) is ``lerp(first, last, u) + (0, 0, w)``: u along first->last (0..1 between the
    anchors, outside allowed), w metres above the straight line between the anchors.
    ``level``: curve point (u, v) is ``first.xy + u*d + v*perp(d)`` at height ``first.z``, where
    ``d = last.xy - first.xy`` and ``perp((x, y)) = (-y, x)`` (left of the direction of travel).
    ``paint``: the line of a brush, in the frame of ``level``; it lies on the ground, and no height follows from it.
    Strokes of this kind have ``paint``, and no others; flanks, plateau, amplitude and roughness mean nothing to them.
    ``left``/``right`` are the flanks left and right of the direction of travel; None means no flank on that side.
    """

    id: Id
    author: Name = ""
    kind: StrokeKind
    first: Vec3
    last: Vec3
    curve: Annotated[tuple[CurvePoint, ...], Field(max_length=MAX_POINTS_PER_STROKE)]
    left: Flank | None = None
    right: Flank | None = None
    plateau_radius_m: Length = 0.0
    amplitude_m: Length = 0.0
    roughness: Unit = 0.5
    paint: Paint | None = None
    locked: bool = False
    hidden: bool = False
    label: Name = ""
    finished: bool = False


class StrokeFields(Wire):
    """The fields that ``stroke.set`` may change. Absent means unchanged (see ``model_fields_set``)."""

    first: Vec3 | None = None
    last: Vec3 | None = None
    curve: Annotated[tuple[CurvePoint, ...], Field(max_length=MAX_POINTS_PER_STROKE)] | None = None
    left: Flank | None = None
    right: Flank | None = None
    plateau_radius_m: Length | None = None
    amplitude_m: Length | None = None
    roughness: Unit | None = None
    paint: Paint | None = None
    locked: bool | None = None
    hidden: bool | None = None
    label: Name | None = None


NULLABLE_STROKE_FIELDS: Final = frozenset({"left", "right", "paint"})
"""Fields of ``StrokeFields`` for which an explicit null is a value (no flank, no paint), not an error."""


class GridFacts(Wire):
    """What a stored elevation grid is, whatever its place. Immutable: it belongs to the content.

    ``rows`` x ``cols`` samples; ``low_m``, ``high_m``: of its valid samples, before scale and lift; ``valid``: share of
    samples that are valid; ``geo``: it came with a place on Earth; ``crs``: that of the file, as a person writes it.
    """

    rows: Annotated[int, Field(ge=MIN_GRID_SIDE, le=MAX_GRID_SAMPLES)]
    cols: Annotated[int, Field(ge=MIN_GRID_SIDE, le=MAX_GRID_SAMPLES)]
    low_m: Metres
    high_m: Metres
    valid: Unit = 1.0
    geo: bool = False
    crs: Name = ""
    format: Name = ""
    file: Name = ""


Step = Annotated[float, Field(ge=MIN_GRID_SPACING_M, le=MAX_GRID_SPACING_M, allow_inf_nan=False)]
Turn = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)]
Stretch = Annotated[float, Field(ge=-MAX_VERTICAL_SCALE, le=MAX_VERTICAL_SCALE, allow_inf_nan=False)]
Priority = Annotated[int, Field(ge=-(10**6), le=10**6)]


class Layer(Wire):
    """An elevation layer: a stored grid, laid on the terrain (DESIGN 11, paper 2 section 3.1).

    Sample [row, col] lies at ``anchor + R(rotation_deg) (col * spacing_m[0], row * spacing_m[1])``: ``anchor`` is the
    world position of sample [0, 0], the rotation counter-clockwise, rows go north at rotation 0. (A grid that came with
    a place on Earth also bends a little; that is part of the content.) Height = ``scale`` * sample + ``lift_m``.
    ``accuracy_m``: largest error of the grid anywhere, metres. ``priority``: of overlapping layers that say different
    things the greater is the newer survey and is believed. ``content`` names the stored grid.
    """

    id: Id
    content: Digest
    facts: GridFacts
    author: Name = ""
    name: Name = ""
    anchor: tuple[Metres, Metres]
    rotation_deg: Turn = 0.0
    spacing_m: tuple[Step, Step]
    scale: Stretch = 1.0
    lift_m: Metres = 0.0
    accuracy_m: Length
    priority: Priority = 0
    hidden: bool = False
    outline: Unit = 0.35
    """How strongly the footprint is drawn, 0 (not at all) to 1."""
    source: Line = ""
    licence: Line = ""


class LayerFields(Wire):
    """The fields that ``layer.set`` may change. Absent means unchanged."""

    name: Name | None = None
    anchor: tuple[Metres, Metres] | None = None
    rotation_deg: Turn | None = None
    spacing_m: tuple[Step, Step] | None = None
    scale: Stretch | None = None
    lift_m: Metres | None = None
    accuracy_m: Length | None = None
    priority: Priority | None = None
    hidden: bool | None = None
    outline: Unit | None = None
    source: Line | None = None
    licence: Line | None = None


class Place(Wire):
    """Where on Earth the middle of the domain lies. The terrain's frame is the transverse Mercator projection of
    WGS 84 around it, scale 1 there, y to the north; files with a place on Earth are laid by it."""

    lat_deg: Annotated[float, Field(ge=-89, le=89, allow_inf_nan=False)]
    lon_deg: Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)]


class TerrainSettings(Wire):
    """Settings of a terrain. ``reach_m`` None is infinity: the papers' pure, global diffusion (DESIGN 5.1).

    ``detail`` and ``rule`` are of the synthesis (DESIGN 10): no solved height depends on them.
    """

    size_m: Annotated[float, Field(ge=MIN_SIZE_M, le=MAX_SIZE_M)] = DEFAULT_SIZE_M
    title: Name = "Untitled terrain"
    reach_m: Annotated[float, Field(gt=0, le=ABSOLUTE_BOUND_M)] | None = DEFAULT_SIZE_M * DEFAULT_REACH_FRACTION
    border: Border = "free"
    sea_level_m: Metres | None = None
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    look: Look = "natural"
    detail: Annotated[float, Field(ge=0, le=MAX_DETAIL, allow_inf_nan=False)] = DEFAULT_DETAIL
    rule: Rule = "landscape"
    sun_azimuth_deg: Annotated[float, Field(ge=0, le=360)] = 115.0
    sun_elevation_deg: Annotated[float, Field(ge=0, le=90)] = 24.0
    place: Place | None = None


class TerrainFields(Wire):
    """The settings that ``terrain.set`` may change (the size is fixed at birth)."""

    title: Name | None = None
    reach_m: Annotated[float, Field(gt=0, le=ABSOLUTE_BOUND_M)] | None = None
    border: Border | None = None
    sea_level_m: Metres | None = None
    seed: Annotated[int, Field(ge=0, lt=2**32)] | None = None
    look: Look | None = None
    detail: Annotated[float, Field(ge=0, le=MAX_DETAIL, allow_inf_nan=False)] | None = None
    rule: Rule | None = None
    sun_azimuth_deg: Annotated[float, Field(ge=0, le=360)] | None = None
    sun_elevation_deg: Annotated[float, Field(ge=0, le=90)] | None = None
    place: Place | None = None


NULLABLE_TERRAIN_FIELDS: Final = frozenset({"reach_m", "sea_level_m", "place"})


class Document(Wire):
    """A whole terrain at one clock. ``deleted`` and ``deleted_layers`` keep what was removed, for undo."""

    id: Id
    clock: Clock = 0
    settings: TerrainSettings = TerrainSettings()
    strokes: tuple[Stroke, ...] = ()
    deleted: tuple[Stroke, ...] = ()
    layers: tuple[Layer, ...] = ()
    deleted_layers: tuple[Layer, ...] = ()


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
    "server_error",
    "shutting_down",
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
    "server_error": 4500,
    "shutting_down": 4501,
}
"""Websocket close codes. 4000..4008 and 4011 are final for the page; it reconnects after any other."""


# --- messages: client to server ---------------------------------------------------------------------------------


class Hello(Wire):
    """First message on a socket. ``clock`` asks to resume: the server answers with the missing ops if it can."""

    type: Literal["hello"] = "hello"
    protocol: int
    terrain: Id
    secret: Secret
    client: Id
    name: Name = ""
    colour: Colour | None = None
    clock: Clock | None = None


class Ops(Wire):
    type: Literal["ops"] = "ops"
    ops: Annotated[tuple[OpEnvelope, ...], Field(min_length=1, max_length=MAX_OPS_PER_MESSAGE)]


class View(Wire):
    """The camera, from which the server selects the tiles this client needs (DESIGN 7)."""

    type: Literal["view"] = "view"
    eye: Vec3
    target: Vec3
    fov_deg: Annotated[float, Field(gt=1, lt=170)] = 50.0
    width: Annotated[int, Field(ge=1, le=16384)] = 1024
    height: Annotated[int, Field(ge=1, le=16384)] = 768
    tau_px: Annotated[float, Field(ge=0.25, le=64)] = DEFAULT_TAU_PX


class Presence(Wire):
    """Ephemeral: never journaled, never on the document clock."""

    type: Literal["presence"] = "presence"
    cursor: Vec3 | None = None
    tool: Annotated[str, StringConstraints(max_length=24)] = ""
    stroke: Id | None = None
    eye: Vec3 | None = None
    target: Vec3 | None = None


class Credit(Wire):
    """Bytes of tile frames that the client has applied since its last credit."""

    type: Literal["credit"] = "credit"
    bytes: Annotated[int, Field(ge=0, le=2**31)]


class Rename(Wire):
    type: Literal["rename"] = "rename"
    name: Name
    colour: Colour | None = None


class Ping(Wire):
    type: Literal["ping"] = "ping"
    t: float


ClientMessage = Annotated[Hello | Ops | View | Presence | Credit | Rename | Ping, Field(discriminator="type")]

# --- messages: server to client ---------------------------------------------------------------------------------


class Member(Wire):
    client: Id
    name: Name
    colour: Colour
    role: Role


class Welcome(Wire):
    """Answer to ``hello``: either ``document`` (a snapshot) or ``ops`` (what was missed since the client's clock)."""

    type: Literal["welcome"] = "welcome"
    protocol: int
    server: str
    client: Id
    role: Role
    colour: Colour
    levels: int
    """Finest globally solved level G."""
    finest: int
    """Finest level that tiles are refined to where somebody looks; G when nothing is refined."""
    clock: Clock
    document: Document | None = None
    ops: tuple[OrderedOp, ...] | None = None
    members: tuple[Member, ...]
    device: str


class Ack(Wire):
    """These ops are committed to the journal. ``clocks[i]`` belongs to ``ids[i]``; sent to their author.

    For ops ordered now it follows the ``ordered`` message that carries them. For an op sent again that the journal
    already holds (a resume), it comes alone: the client got the op itself in ``welcome``.
    """

    type: Literal["ack"] = "ack"
    ids: tuple[OpId, ...]
    clocks: tuple[Clock, ...]


class Reject(Wire):
    type: Literal["reject"] = "reject"
    id: OpId
    code: RejectCode
    message: str


class OpsBroadcast(Wire):
    """What one tick committed, in clock order, without gaps, the same text for every member.

    It holds the reader's own ops too: apply them to the confirmed document at their place and drop them from the
    unconfirmed ones (by id); the ``ack`` that follows then names ids that are no longer pending, which is fine.
    """

    type: Literal["ordered"] = "ordered"
    ops: tuple[OrderedOp, ...]


class Members(Wire):
    type: Literal["members"] = "members"
    members: tuple[Member, ...]


class MemberPresence(Wire):
    client: Id
    cursor: Vec3 | None = None
    tool: str = ""
    stroke: Id | None = None
    eye: Vec3 | None = None
    target: Vec3 | None = None


class PresenceBroadcast(Wire):
    type: Literal["presences"] = "presences"
    members: tuple[MemberPresence, ...]


class Progress(Wire):
    """Where the solver stands. ``settled`` is true when every level is final for ``clock``."""

    type: Literal["progress"] = "progress"
    clock: Clock
    level: int
    of: int
    settled: bool
    note: str = ""
    refining: Annotated[int, Field(ge=0)] = 0
    """Tiles above the global levels that somebody looks at and that are still to be made."""


class ErrorMessage(Wire):
    type: Literal["error"] = "error"
    code: CloseCode
    message: str
    fatal: bool


class Pong(Wire):
    type: Literal["pong"] = "pong"
    t: float


class ImportQuestion(Wire):
    """Something that a file does not say, or seems to say wrongly.

    ``id``: "nodata" | "place" | "size" | "range" | "imagery" | "accuracy" | ...; ``options``: values that may be
    answered (empty: any number); ``default``: what is taken when nobody answers otherwise.
    """

    id: Annotated[str, StringConstraints(max_length=24)]
    text: Line
    options: tuple[Line, ...] = ()
    default: Line = ""


class ImportReport(Wire):
    """What an elevation file is and what would happen (``esker import --check``). ``verdict``: good, ask or refused.

    ``spacing_m``, ``rotation_deg``, ``width_m``, ``height_m``: on the ground. ``at``: WGS 84 of its middle, (lat, lon).
    ``preview``: 32 rows (south first) of 32 heights, 0..255 between low and high, -1 where there is none.
    """

    verdict: Literal["good", "ask", "refused"]
    file: Name
    format: Name = ""
    rows: int = 0
    cols: int = 0
    dtype: Name = ""
    crs: Name = ""
    spacing_m: tuple[float, float] | None = None
    rotation_deg: float = 0.0
    width_m: float | None = None
    height_m: float | None = None
    at: tuple[float, float] | None = None
    low_m: float | None = None
    high_m: float | None = None
    valid: float | None = None
    nodata: float | None = None
    accuracy_m: float | None = None
    notes: tuple[Line, ...] = ()
    questions: tuple[ImportQuestion, ...] = ()
    refusal: Line = ""
    preview: tuple[tuple[int, ...], ...] = ()


ImportStage = Literal["upload", "reading", "question", "mipmaps", "errors", "saving", "done", "refused", "cancelled"]


class ImportStatus(Wire):
    """Where an import stands. ``share``: 0..1 of all the work; ``layer``: its id once it is done."""

    id: Id
    stage: ImportStage
    share: Unit = 0.0
    text: Line = ""
    report: ImportReport | None = None
    layer: Id | None = None


class ImportAnswers(Wire):
    """How an import goes on: answers by question id, and where to lay a grid that has no place of its own."""

    answers: dict[Annotated[str, StringConstraints(max_length=24)], Line] = {}
    anchor: tuple[Metres, Metres] | None = None
    rotation_deg: Turn | None = None
    spacing_m: tuple[Step, Step] | None = None
    scale: Stretch | None = None
    lift_m: Metres | None = None
    accuracy_m: Length | None = None
    name: Name | None = None
    source: Line | None = None
    licence: Line | None = None


class Importing(Wire):
    """Somebody brings in an elevation file: for everybody to see. Sent at each stage, at most 5 times a second."""

    type: Literal["importing"] = "importing"
    author: Name
    file: Name
    status: ImportStatus


ServerMessage = Annotated[
    Welcome | Ack | Reject | OpsBroadcast | Members | PresenceBroadcast | Progress | ErrorMessage | Pong | Importing,
    Field(discriminator="type"),
]

OP: Final[TypeAdapter[Any]] = TypeAdapter(Op)
CLIENT_MESSAGE: Final[TypeAdapter[Any]] = TypeAdapter(ClientMessage)
SERVER_MESSAGE: Final[TypeAdapter[Any]] = TypeAdapter(ServerMessage)

# --- binary frames (DESIGN 6) -----------------------------------------------------------------------------------

FRAME_MAGIC: Final = 0x4B53  # "SK" on the wire


class FrameKind(IntEnum):
    """What a binary frame means for the tiles of its level that it does not carry.

    LEVEL: the level is complete for this clock; held tiles of the level that are neither carried nor dropped are
    confirmed as they are. FILL: only adds tiles (the view moved); says nothing of the others.
    """

    LEVEL = 0
    FILL = 1


class Predictor(IntEnum):
    """What a tile's residual adds to: nothing; the parent; the tile as held, moved along with its parent; as held."""

    ZERO = 0
    PARENT = 1
    PREVIOUS = 2
    HELD = 3


class Filter(IntEnum):
    """How a tile's residual was made smaller before it was coded: what is left of a sample after taking away ...

    NONE: nothing. ROW: the one to its west; in the first column the one to its south. PLANE: west + south - south-west.
    What lies outside the tile is zero.
    """

    NONE = 0
    ROW = 1
    PLANE = 2


class Channel(IntEnum):
    HEIGHT = 0
    AMPLITUDE = 1
    ROUGHNESS = 2
    SNOW = 3
    GRASS = 4
    FOREST = 5
    WETNESS = 6
    BASE = 7
    """The elevation layers' ground, in the quanta of heights: what is drawn is HEIGHT + BASE."""
    SURVEY = 8
    """Level whose spacing is that of the finest elevation data here; detail begins below it."""


FRAME_HEADER: Final = np.dtype(
    [
        ("magic", "<u2"),
        ("protocol", "u1"),
        ("kind", "u1"),
        ("level", "u1"),
        ("channel", "u1"),
        ("flags", "<u2"),
        ("clock", "<u4"),
        ("tiles", "<u2"),
        ("drops", "<u2"),
    ]
)
"""Starts a binary frame: then ``drops`` x TILE_DROP, then ``tiles`` x (TILE_HEADER, payload of ``bytes`` bytes).
flags bit 0: the level is final (settled) for this clock."""
FRAME_SETTLED: Final = 1

TILE_DROP: Final = np.dtype([("x", "<u2"), ("y", "<u2")])
"""A tile of this level that the client must forget: its content changed and is not being sent."""

TILE_HEADER: Final = np.dtype(
    [
        ("x", "<u2"),
        ("y", "<u2"),
        ("predictor", "u1"),
        ("planes", "u1"),
        ("filter", "u1"),
        ("reserved", "u1"),
        ("version", "<u4"),
        ("base_version", "<u4"),
        ("bytes", "<u4"),
    ]
)
"""``version``: of this tile; ``base_version``: of the parent (or previous) tile that it was predicted from;
``planes``: byte planes before deflate (0..4; 0: no residual and no payload). Bounds and errors of the 16-cell
sub-patches follow from the samples and the parent, both of which the decoder holds, so they do not travel
(docs/decisions/0003-derived-bounds.md)."""
