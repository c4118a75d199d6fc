"""The document: strokes, elevation layers, settings (DESIGN 4)."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from esker.contract.constants import (
    CURRENT_EDITION,
    DEFAULT_COURSE_GRADE,
    DEFAULT_DETAIL,
    DEFAULT_EROSION,
    DEFAULT_EROSION_SCALE,
    DEFAULT_EXTENT_FRACTION,
    DEFAULT_HOLD,
    DEFAULT_REACH_FRACTION,
    DEFAULT_SIZE_M,
    DEFAULT_SLOPE_DEG,
    DEFAULT_WETNESS,
    EDGE_POINTS,
    MAX_COURSE_POINTS,
    MAX_DETAIL,
    MAX_EROSION,
    MAX_EROSION_SCALE,
    MAX_GRID_SAMPLES,
    MAX_GRID_SPACING_M,
    MAX_POINTS_PER_STROKE,
    MAX_RIVERS,
    MAX_SIZE_M,
    MAX_SLOPE_DEG,
    MAX_VERTICAL_SCALE,
    MAX_WETNESS,
    MIN_COURSE_GRADE,
    MIN_EROSION_SCALE,
    MIN_GRID_SIDE,
    MIN_GRID_SPACING_M,
    MIN_REACH_M,
    MIN_SIZE_M,
    MIN_WETNESS,
)
from esker.contract.tasks import MAX_TASK_PICTURES, Picture, Task
from esker.contract.values import (
    ABSOLUTE_BOUND_M,
    Border,
    Clock,
    CourseUse,
    CurvePoint,
    Digest,
    FlankShape,
    Id,
    Length,
    Line,
    Look,
    Metres,
    Name,
    PaintChannel,
    Rule,
    StrokeKind,
    Unit,
    Vec3,
    Wire,
)

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


class Course(Wire):
    """What a course stroke is: a line over the ground with a height at each of its points (DESIGN 21).

    ``rises``: metres of each point of the curve above the first anchor; points beyond the last one have its height.
    ``use``: a ``river`` never rises along its way, which the server holds it to; a ``road`` is laid by the page so that
    its steepest grade is ``grade`` (rise over run, as a tangent); a ``ridge`` goes up and down.
    ``depth_m``: how far below (of a ridge: above) the ground the page lays it.
    """

    use: CourseUse
    rises: Annotated[tuple[Metres, ...], Field(max_length=MAX_COURSE_POINTS)] = ()
    grade: Annotated[float, Field(ge=MIN_COURSE_GRADE, le=1, allow_inf_nan=False)] = DEFAULT_COURSE_GRADE
    depth_m: Length = 0.0


class Stroke(Wire):
    """One stroke (immutable). Curve points live in the frame of the anchors, so moving an anchor re-projects.

    ``profile``: curve point (u, w) is ``lerp(first, last, u) + (0, 0, w)``: u along first->last (0..1 between the
    anchors, outside allowed), w metres above the straight line between the anchors.
    ``level``: curve point (u, v) is ``first.xy + u*d + v*perp(d)`` at height ``first.z``, where
    ``d = last.xy - first.xy`` and ``perp((x, y)) = (-y, x)`` (left of the direction of travel).
    ``paint``: the line of a brush, in the frame of ``level``; it lies on the ground, and no height follows from it.
    Strokes of this kind have ``paint``, and no others; flanks, plateau, amplitude and roughness mean nothing to them.
    ``course``: a line in the frame of ``level`` with a height at each of its points. Strokes of this kind have
    ``course``, and no others, hold at most ``MAX_COURSE_POINTS`` points and are never closed; ``plateau_radius_m`` is
    half their width, and a flank without a slope is a bank, where the diffusion alone leads to the line.
    ``left``/``right`` are the flanks left and right of the direction of travel; None means no flank on that side.
    ``yields``: how far the stroke gives way where it meets others: at 0 all count alike, at 1 it only counts where no
    other one says anything. Where a stroke is alone nothing follows from it.
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
    yields: Unit = 0.0
    paint: Paint | None = None
    course: Course | None = None
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
    yields: Unit | None = None
    paint: Paint | None = None
    course: Course | None = None
    locked: bool | None = None
    hidden: bool | None = None
    label: Name | None = None


NULLABLE_STROKE_FIELDS: Final = frozenset({"left", "right", "paint", "course"})
"""Fields of ``StrokeFields`` for which an explicit null is a value (no flank, no paint), not an error."""


class GridFacts(Wire):
    """What a stored elevation grid is, whatever its place. Immutable: it belongs to the content.

    ``rows`` x ``cols`` samples; ``low_m``, ``high_m``: of its valid samples, before scale and lift; ``valid``: share of
    samples that are valid; ``geo``: it came with a place on Earth; ``crs``: that of the file, as a person writes it.
    ``edge``: how the edge bends: displacements in lattice units (columns, rows) of ``EDGE_POINTS`` points of the
    straight one, evenly apart on each side, counter-clockwise from sample [0, 0]; empty where it does not.
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
    edge: Annotated[tuple[CurvePoint, ...], Field(max_length=EDGE_POINTS)] = ()


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


Erosion = Annotated[float, Field(ge=0, le=MAX_EROSION, allow_inf_nan=False)]
ErosionScale = Annotated[float, Field(ge=MIN_EROSION_SCALE, le=MAX_EROSION_SCALE, allow_inf_nan=False)]
Reach = Annotated[float, Field(ge=MIN_REACH_M, le=ABSOLUTE_BOUND_M, allow_inf_nan=False)]
Rivers = Annotated[float, Field(ge=0, le=MAX_RIVERS, allow_inf_nan=False)]
Pictures = Annotated[tuple[Picture, ...], Field(max_length=MAX_TASK_PICTURES)]
Wetness = Annotated[float, Field(ge=MIN_WETNESS, le=MAX_WETNESS, allow_inf_nan=False)]


class TerrainSettings(Wire):
    """Settings of a terrain. ``reach_m`` None is infinity: the papers' pure, global diffusion (DESIGN 5.1).

    ``lakes_m``: basins of the ground that are deeper than this hold a lake, None: none does (docs/renderer.md).
    ``rivers``: how many there are, 0: none; ``wetness``: how many times as much water they carry (docs/water.md).
    ``detail``, ``rule``, ``erosion`` (strength of gullies), ``erosion_scale`` (their wavelength in cells of a level)
    and ``hold`` (how strictly what strokes fix keeps its height) are of the synthesis (DESIGN 10): no solved height
    depends on them. ``edition``: see
    CURRENT_EDITION; documents that do not say have the first. ``task``, with its pictures: what a class is asked.
    """

    size_m: Annotated[float, Field(ge=MIN_SIZE_M, le=MAX_SIZE_M)] = DEFAULT_SIZE_M
    edition: Annotated[int, Field(ge=1, le=CURRENT_EDITION)] = 1
    title: Name = "Untitled terrain"
    reach_m: Reach | None = DEFAULT_SIZE_M * DEFAULT_REACH_FRACTION
    border: Border = "free"
    sea_level_m: Metres | None = None
    lakes_m: Length | None = None
    rivers: Rivers = 0.0
    wetness: Wetness = DEFAULT_WETNESS
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    look: Look = "natural"
    detail: Annotated[float, Field(ge=0, le=MAX_DETAIL, allow_inf_nan=False)] = DEFAULT_DETAIL
    rule: Rule = "landscape"
    erosion: Erosion = DEFAULT_EROSION
    erosion_scale: ErosionScale = DEFAULT_EROSION_SCALE
    hold: Unit = DEFAULT_HOLD
    sun_azimuth_deg: Annotated[float, Field(ge=0, le=360)] = 115.0
    sun_elevation_deg: Annotated[float, Field(ge=0, le=90)] = 24.0
    place: Place | None = None
    task: Task | None = None
    task_pictures: Pictures = ()


class TerrainFields(Wire):
    """The settings that ``terrain.set`` may change (the size is fixed at birth)."""

    title: Name | None = None
    reach_m: Reach | None = None
    border: Border | None = None
    sea_level_m: Metres | None = None
    lakes_m: Length | None = None
    rivers: Rivers | None = None
    wetness: Wetness | None = None
    seed: Annotated[int, Field(ge=0, lt=2**32)] | None = None
    look: Look | None = None
    detail: Annotated[float, Field(ge=0, le=MAX_DETAIL, allow_inf_nan=False)] | None = None
    rule: Rule | None = None
    erosion: Erosion | None = None
    erosion_scale: ErosionScale | None = None
    hold: Unit | None = None
    sun_azimuth_deg: Annotated[float, Field(ge=0, le=360)] | None = None
    sun_elevation_deg: Annotated[float, Field(ge=0, le=90)] | None = None
    place: Place | None = None
    task: Task | None = None
    task_pictures: Pictures | None = None


NULLABLE_TERRAIN_FIELDS: Final = frozenset({"reach_m", "sea_level_m", "lakes_m", "place", "task"})


class Document(Wire):
    """A whole terrain at one clock. ``deleted`` and ``deleted_layers`` keep what was removed, for undo."""

    id: Id
    clock: Clock = 0
    settings: TerrainSettings = TerrainSettings()
    strokes: tuple[Stroke, ...] = ()
    deleted: tuple[Stroke, ...] = ()
    layers: tuple[Layer, ...] = ()
    deleted_layers: tuple[Layer, ...] = ()
