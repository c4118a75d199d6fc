"""Constants: protocol, grid, solver, channels, elevation grids, detail, limits (DESIGN 2 to 6, 10, 11)."""

from __future__ import annotations

from typing import Final

# --- protocol ---------------------------------------------------------------------------------------------------

PROTOCOL_VERSION: Final = 10
SUBPROTOCOL: Final = "esker.10"

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
MIN_REACH_M: Final = MIN_SIZE_M / 4096
"""A cell of the finest global level on the smallest domain; no solver takes a reach below such a cell."""

CURRENT_EDITION: Final = 3
"""By which edition of the rules ground follows from strokes of a new terrain; each keeps that of its birth. 1: jagged
profiles are smoothed from their first end. 2: from their middle, so that they are the same drawn from the other end.
3: differences of strokes are taken in pairs, elevation grids go on with the bend at their borders."""

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
FAR_QUANTA: Final = 1024
"""Quantisation steps of the channel of distances, of which 1 is ``fractal.FAR_SHARE`` of the domain's side."""
BASE_FAR: Final = 1.0
"""The channel of distances where no stroke fixes the ground: so far away that no gully is held."""

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
EDGE_POINTS: Final = 32
"""Points that tell how the edge of a grid bends, eight a side."""
MAX_GRID_SPACING_M: Final = 100_000.0
MIN_GRID_SPACING_M: Final = 0.001
MAX_VERTICAL_SCALE: Final = 1_000.0
LAYER_HEIGHT_MARGIN: Final = 5.0
"""A layer's heights are within so many sides of the domain of zero. Tiles of level 10 hold 16 sides (2^28 quanta);
strokes reach ``DOMAIN_MARGIN`` = 10, so their offsets from any layer fit, with a side to spare for what overshoots."""

# --- detail (DESIGN 10) -----------------------------------------------------------------------------------------

DEFAULT_DETAIL: Final = 1.0
MAX_DETAIL: Final = 4.0
"""Strength of the natural detail: 0 takes it away, 1 is the rule's own."""
DEFAULT_EROSION: Final = 0.0
"""Strength of the gullies of documents that do not say: those of before there were any keep their ground."""
BORN_EROSION: Final = 1.0
BORN_HOLD: Final = 0.9
"""Strength of the gullies of new terrains, and how strictly their crests keep their height: a little less than wholly
looks less ruled."""
MAX_EROSION: Final = 2.0
MIN_EROSION_SCALE: Final = 7.0
DEFAULT_EROSION_SCALE: Final = 10.0
MAX_EROSION_SCALE: Final = 14.0
"""Wavelength of the gullies of a level, in its cells: shorter waves are not resolved, longer ones are no gullies."""
DEFAULT_HOLD: Final = 1.0
"""How strictly what strokes fix keeps its height under gullies and noise: 1 wholly, 0 not at all."""

# --- lakes (docs/renderer.md, "Lakes") ---------------------------------------------------------------------------

LAKE_LEVEL: Final = 2
"""Basins are those of the solved ground of this level."""
LAKE_LEAST_SAMPLES: Final = 4
"""Smaller basins stay dry."""
LAKE_FREEBOARD_CELLS: Final = 0.06
LAKE_FREEBOARD_SHARE: Final = 0.25
"""A lake stays below its outlet by so much of a cell, at most this share of its depth: finer ground is not as even."""
LAKE_SHORE_SAMPLES: Final = 3
"""Ground so many samples around a lake is told of it: finer ground may be lower there."""
LAKE_FULL_FETCH_M: Final = 3000.0
"""Wind that has come over so much water raises the waves of the sea."""
NO_LAKE: Final = -1.0e9
"""Level where there is no lake, metres."""
DEFAULT_LAKES_FRACTION: Final = 1.0 / 1024.0
"""Least depth of a basin that fills, in sides of the domain, where a person says no other."""

# --- trees, rocks and tufts (docs/renderer.md, "Instances") -------------------------------------------------------

TREE_NEAR_M: Final = 130.0
"""Trees nearer than this are meshes, further ones boards that turn to the eye."""
SOIL_M: Final = 8.0
"""What grows is read on the level whose samples are about so far apart: none comes or goes as finer tiles arrive."""
MOST_NEAR_TREES: Final = 8192
MOST_FAR_TREES: Final = 40960
MOST_ROCKS: Final = 8192
MOST_TUFTS: Final = 16384
"""Instances of one sort that a picture has room for."""

# --- rivers (docs/water.md) ---------------------------------------------------------------------------------------

RIVER_AREA_SHARE: Final = 1.0 / 16.0
"""A river drains at least the square of so much of the domain's side, where a terrain asks for one time the rivers."""
MAX_RIVERS: Final = 4.0
"""How many times as many rivers a terrain may ask for. With more of them water that runs side by side down the even
flank of a coarse level would be rivers."""
DEFAULT_RIVERS: Final = 1.0
"""What a new terrain asks for; 0 is none, and what documents say that are older than rivers."""
MIN_WETNESS: Final = 0.1
MAX_WETNESS: Final = 10.0
DEFAULT_WETNESS: Final = 1.0
"""How many times as much water rivers carry as those of the same area in the mean of the United States."""
RIVER_FALL_SHARE: Final = 1.0 / 256.0
"""A river has come down by at least so much of the domain's side: where all is level there is none."""

# --- stroke defaults (DESIGN 5.2, 12) ---------------------------------------------------------------------------

DEFAULT_SLOPE_DEG: Final = 35.0
DEFAULT_EXTENT_FRACTION: Final = 1.0 / 2.0
"""Default flank extent as a fraction of the domain. So generous that a high flank is never cut off in a cliff: the band
ends where it meets the base anyway."""
MAX_SLOPE_DEG: Final = 85.0

# --- limits (DESIGN 4); settings may lower them, never raise them --------------------------------------------------

MAX_STROKES: Final = 5_000
MAX_POINTS_PER_STROKE: Final = 4_096
MAX_COURSE_POINTS: Final = 512
"""Points of a river, road or ridge that was drawn over the ground: each has a handle."""
DEFAULT_COURSE_GRADE: Final = 0.08
"""Steepest grade of a new road, as a tangent: what lorries climb."""
MIN_COURSE_GRADE: Final = 0.005
MAX_POINTS_PER_TERRAIN: Final = 500_000
"""Points of a terrain's strokes together, and again of its tombstones: everybody who comes in is sent them all."""
MAX_POINTS_PER_APPEND: Final = 256
MAX_MESSAGE_BYTES: Final = 64 * 1024
MAX_OPS_PER_SECOND: Final = 120
OPS_BURST: Final = 240
MAX_PRESENCE_PER_SECOND: Final = 30
MAX_VIEWS_PER_SECOND: Final = 60
MAX_SEEKS_PER_SECOND: Final = 15
MAX_MEMBERS: Final = 200
MAX_HISTORY_ROOMS: Final = 8
"""People of one server who look at the past at the same time: each has a solve and tiles of their own."""
HISTORY_IDLE_SECONDS: Final = 600.0
"""Who looks at the past and neither moves the view nor goes to another clock for so long makes room for others."""
MAX_HISTORY_OPS: Final = 100_000
"""Ops that the list of the history reaches back; earlier clocks can be looked at and copied all the same."""
MAX_HISTORY_PAGE: Final = 200
MAX_NAMED: Final = 3
"""People whom a sentence of the server names."""
MAX_NAME_LENGTH: Final = 80
UNSEEN: Final = {
    0x00: 0x1F, 0x7F: 0x9F, 0x061C: 0x061C, 0x200B: 0x200B, 0x200E: 0x200F, 0x2028: 0x202E, 0x2060: 0x206F,
    0xFEFF: 0xFEFF, 0xFFF9: 0xFFFB,
}  # fmt: skip
"""Characters, by the first of a range its last, that names lose: controls, what turns the direction of text around, and
what takes no room. What joins letters and emoji (U+200C, U+200D) stays. Tabs and line ends become spaces."""
MAX_PEOPLE: Final = 200
"""People that one message of a conductor may name."""
MAX_GROUPS: Final = 24
"""Groups of people that a lesson has."""
MAX_GROUP_NAME: Final = 40
MAX_GROUPED: Final = 400
"""People in all groups of a lesson together."""
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
MOVED_WITHIN_MS: Final = 1_500
"""Whoever is told that a terrain moves comes back after a time drawn from so many milliseconds: all of a room come
spread over it."""
DEFAULT_TAU_PX: Final = 1.5
