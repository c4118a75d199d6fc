"""Stroke sets to the tables that the rasteriser reads (DESIGN 5.2, 5.5, 5.6): of a whole level, or of a window of bins.

Strokes are ordered by id, so no result depends on the order of edits.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Generator, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np

from esker import grid
from esker.contract import DEFAULT_REACH_FRACTION, MAX_REFINED_LEVEL, MAX_STROKES, Stroke, TerrainSettings
from esker.document.strokes import world_points
from esker.solve.base import SIDES_LEVEL, Base, BaseUnderStroke, bounds_of
from esker.solve.constraints import dirty
from esker.solve.constraints.channel_targets import Layer
from esker.solve.constraints.packing import Packed, Shape, join, pack_one, reach_m, shape_for, window_of
from esker.solve.constraints.tables import (
    BIN,
    BinBox,
    Floats,
    Tables,
    Window,
    bins,
    defines,
    everything,
    union,
    whole,
)

__all__ = [
    "BIN",
    "BinBox",
    "Packer",
    "Shapes",
    "Tables",
    "Window",
    "WindowPacker",
    "bins",
    "defines",
    "driven",
    "everything",
    "pack",
    "whole",
]

T = TypeVar("T")

SettingsKey = tuple[float, float | None, str, int]
SHAPES = MAX_STROKES
"""Strokes that are kept ready, some kilobytes each: all of one terrain, as one more than there is place for would have
all of them made again at each change."""
AT_A_STRETCH = 16
"""Strokes that are packed without a pause, some ten milliseconds."""


def driven(work: Generator[Any, None, T]) -> T:
    """Runs a generator to its end. Returns what it returns."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            found: T = end.value
            return found


def pack(
    strokes: Sequence[Stroke],
    settings: TerrainSettings,
    level: int,
    layer: Layer | None = None,
    base: Base | None = None,
) -> Tables:
    """The tables of a stroke set at one level. The order of ``strokes`` does not matter."""
    return Packer(level, layer).pack(strokes, settings, base)[0]


class Packer:
    """Packs stroke sets of one level for the heights or one layer, reusing what did not change since the last one."""

    def __init__(self, level: int, layer: Layer | None = None) -> None:
        self.level, self.layer = level, layer
        self.shapes: Shapes | None = None
        """Shapes that other packers made ready, for the heights."""
        self._settings: SettingsKey | None = None
        self._base: Base | None = None
        self._packed: dict[str, tuple[Stroke, Packed | None]] = {}
        self._rastered = True
        self.earliest: str | None = None
        """The least id among strokes of the last set that are new, changed or gone; None where all count as such."""
        self.order: list[str] = []
        """Ids of the strokes of the last set's tables, ascending."""

    def unchanged_count(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> int:
        """How many strokes of this set were in the last one; -1 when nothing of it can be kept."""
        if self._settings != _settings_key(settings):
            return -1
        return sum(1 for s in strokes if s.id in self._packed and self._packed[s.id][0] is s)

    def shared_ids(self, strokes: Sequence[Stroke]) -> int:
        """How many strokes of this set the last one had too, be it with other points."""
        return sum(1 for s in strokes if s.id in self._packed)

    def pack(
        self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None
    ) -> tuple[Tables, Window | None]:
        """The bins whose constraints may differ from the last set's (None: no bin does), and what reaches them."""
        return driven(self.packing(strokes, settings, base))

    def packing(
        self, strokes: Sequence[Stroke], settings: TerrainSettings, base: Base | None = None
    ) -> Generator[None, None, tuple[Tables, Window | None]]:
        """``pack``, which may be left between strokes, or for good: then it is still the last set that is packed."""
        s, box = grid.spacing(self.level, settings.size_m), whole(self.level)
        fresh = self._settings != _settings_key(settings) or (self._base is None) != (base is None)
        moved = None if fresh else _moved(self._base, base)
        stale = _all if fresh else _stale(self._base, base, moved, 2 * grid.spacing(SIDES_LEVEL, settings.size_m))
        old = {} if fresh else self._packed
        new: dict[str, tuple[Stroke, Packed | None]] = {}
        made = 0
        for stroke in sorted(strokes, key=lambda k: k.id):
            known = old.get(stroke.id)
            if known is not None and (known[0] is stroke or known[0] == stroke) and not stale(stroke):
                new[stroke.id] = (stroke, known[1])
                continue
            shape = _ready(self.shapes, self.layer)(stroke, settings, base)
            new[stroke.id] = (stroke, None if shape is None else pack_one(shape, s, box))
            made += 1
            if made % AT_A_STRETCH == 0:
                yield
        anew = fresh or not self._rastered
        window = everything(box) if anew else _changed(old, new, box)
        self.earliest = None if anew or moved is not None else _earliest(old, new)
        self._rastered = True
        if moved is not None:
            window = union([w for w in (window, _bins_of(moved, s, box)) if w is not None])
        self._settings, self._packed, self._base = _settings_key(settings), new, base
        meeting = {key: p for key, (_, p) in new.items() if p is not None and _meet(p, window)}
        self.order = list(meeting)
        return _tables(self.level, _settings_key(settings), list(meeting.values()), box), window

    def is_light(self, most: float) -> bool:
        """Returns whether a bin of the last set has ``most`` strokes on average, or fewer."""
        left = most * bins(grid.samples(self.level)) ** 2
        for _, packed in self._packed.values():
            left -= 0 if packed is None else int((packed.window.spans[:, 1] - packed.window.spans[:, 0]).sum())
            if left < 0:
                return False
        return True

    def unrastered(self) -> None:
        """Says that packed strokes are in no raster any more: the next window is all of them."""
        self._rastered = False

    def again(self) -> tuple[Tables, Window, Base | None]:
        """Returns the tables and the window of the last set, as if nothing of it were in a raster, and its base.

        Raises RuntimeError where there is no last set.
        """
        if self._settings is None:
            raise RuntimeError("no strokes were packed yet")
        box = whole(self.level)
        meeting = {key: p for key, (_, p) in self._packed.items() if p is not None}
        self._rastered, self.earliest, self.order = True, None, list(meeting)
        return _tables(self.level, self._settings, list(meeting.values()), box), everything(box), self._base

    def forget(self) -> None:
        """Make the next set a fresh one."""
        self._settings, self._packed, self._base = None, {}, None


def _settings_key(settings: TerrainSettings) -> SettingsKey:
    return settings.size_m, settings.reach_m, settings.border, settings.edition


def _same(one: Base | None, other: Base | None) -> bool:
    return one is other or (one is not None and other is not None and one.digest == other.digest)


def _meet(packed: Packed, window: Window | None) -> bool:
    """Returns whether a stroke can reach the rectangle around a window."""
    if window is None:
        return False
    (r0, r1, c0, c1), (s0, s1, d0, d1) = packed.window.bounds, window.bounds
    return r0 < s1 and s0 < r1 and c0 < d1 and d0 < c1


def _moved(old: Base | None, new: Base | None) -> grid.Rect | None:
    """Where two bases differ; None: nowhere, or there is none."""
    return None if old is None or new is None or _same(old, new) else new.changed(old)


def _stale(old: Base | None, new: Base | None, moved: grid.Rect | None, margin: float) -> Callable[[Stroke], bool]:
    """Returns whether a stroke that was packed over one base may be wrong over another that differs in a rectangle."""
    if old is None or new is None or moved is None:
        return _none
    if bounds_of(old) != bounds_of(new):
        return _all

    def near(stroke: Stroke) -> bool:
        plan = world_points(stroke)[:, :2]
        if len(plan) == 0:
            return False
        (x0, y0), (x1, y1) = plan.min(axis=0), plan.max(axis=0)
        return grid.Rect(x0, y0, x1, y1).grown(stroke.plateau_radius_m + margin).intersects(moved)

    return near


def _all(_: Stroke) -> bool:
    """Nothing that was packed serves."""
    return True


def _none(_: Stroke) -> bool:
    """All that was packed serves."""
    return False


def _bins_of(rect: grid.Rect, s: float, box: BinBox) -> Window | None:
    """The bins of a rectangle, and of the samples right beside it."""
    low, high = (np.array([[v / s] for v in corner]) for corner in ((rect.x0, rect.y0), (rect.x1, rect.y1)))
    return window_of(low, high, 1.0, box)


def _changed(
    old: dict[str, tuple[Stroke, Packed | None]], new: dict[str, tuple[Stroke, Packed | None]], box: BinBox
) -> Window | None:
    """Bins that strokes only in one of the sets, or the parts that differ of those in both, can reach."""
    nothing = (None, None)
    pairs = [(old.get(key, nothing)[1], new.get(key, nothing)[1]) for key in old.keys() | new.keys()]
    windows = [dirty.changed(a, b, box) for a, b in pairs if a is not b]
    return union([w for w in windows if w is not None])


def _earliest(old: dict[str, tuple[Stroke, Packed | None]], new: dict[str, tuple[Stroke, Packed | None]]) -> str | None:
    """The least id of a stroke that is not packed the same in both sets."""
    nothing = (None, None)
    differ = (key for key in old.keys() | new.keys() if old.get(key, nothing)[1] is not new.get(key, nothing)[1])
    return min(differ, default=None)


def _tables(level: int, settings: SettingsKey, packed: list[Packed], box: BinBox) -> Tables:
    size_m, reach, border, edition = settings
    return Tables(
        level=level,
        size_m=size_m,
        box=box,
        reach_m=reach,
        exit_length_m=min(reach or math.inf, size_m * DEFAULT_REACH_FRACTION),
        pinned=border == "pinned",
        edition=edition,
        **join(packed, box),
    )


class Shapes:
    """Strokes ready to be packed for the heights, least recently used dropped first: when one of a hundred has changed,
    the others need not be made ready again."""

    def __init__(self, most: int = SHAPES) -> None:
        self.most = most
        self._held: OrderedDict[tuple[object, ...], tuple[Stroke, Shape | None]] = OrderedDict()

    def of(self, stroke: Stroke, settings: TerrainSettings, base: Base | None) -> Shape | None:
        """``shape_for`` of a stroke, which is known again by being the same object."""
        key = id(stroke), *_settings_key(settings), None if base is None else base.digest
        if key not in self._held:
            self._held[key] = stroke, shape_for(None, stroke, settings, base)
            while len(self._held) > self.most:
                self._held.popitem(last=False)
        self._held.move_to_end(key)
        return self._held[key][1]


def _ready(
    shapes: Shapes | None, layer: Layer | None
) -> Callable[[Stroke, TerrainSettings, Base | None], Shape | None]:
    """Returns the function that makes a stroke ready to be packed."""
    return partial(shape_for, layer) if shapes is None or layer is not None else shapes.of


class WindowPacker:
    """Packs windows of one stroke set, for the heights or one layer, at any level, also above the global ones
    (DESIGN 5.6).

    Costs what lies near the window: strokes are culled by their bounding boxes, then their segments. What a bin of a
    window gets is, to the bit, what it gets in any other window and in the whole level.
    """

    def __init__(
        self,
        strokes: Sequence[Stroke],
        settings: TerrainSettings,
        layer: Layer | None = None,
        base: Base | None = None,
        shapes: Shapes | None = None,
    ) -> None:
        """``shapes``: what was made ready before, for the heights."""
        self._settings = settings
        ready = _ready(shapes, layer)
        pairs = [(s, ready(s, settings, base)) for s in sorted(strokes, key=lambda k: k.id)]
        self._strokes = [s for s, shape in pairs if shape is not None]
        self._shapes: list[Shape] = [shape for _, shape in pairs if shape is not None]
        plan = [shape.crest.points[:, :2] for shape in self._shapes]
        self._low = np.array([p.min(axis=0) for p in plan]).reshape(-1, 2)
        self._high = np.array([p.max(axis=0) for p in plan]).reshape(-1, 2)
        self._reach: dict[int, Floats] = {}

    def pack(self, level: int, box: BinBox) -> Tables:
        """The tables of the bins of ``box``. Raises ValueError for a level outside 0..MAX_REFINED_LEVEL or a box that
        is empty or sticks out of the level."""
        return driven(self.packing(level, box))

    def packing(self, level: int, box: BinBox) -> Generator[None, None, Tables]:
        """``pack``, which may be left between strokes."""
        s = grid.spacing(level, self._settings.size_m)
        packed = []
        for k in self._near(level, box):
            packed.append(pack_one(self._shapes[k], s, box))
            yield
        return _tables(level, _settings_key(self._settings), [p for p in packed if p is not None], box)

    @property
    def grounds(self) -> dict[str, BaseUnderStroke]:
        """The base under each stroke, by the stroke's id."""
        return {stroke.id: shape.ground for stroke, shape in zip(self._strokes, self._shapes, strict=True)}

    def reaching(self, level: int, box: BinBox) -> list[Stroke]:
        """The strokes, by id, that may reach the bins of ``box``, at this or any finer level. Raises like ``pack``."""
        return [self._strokes[k] for k in self._near(level, box)]

    def _near(self, level: int, box: BinBox) -> list[int]:
        if not 0 <= level <= MAX_REFINED_LEVEL:
            raise ValueError(f"level must be 0..{MAX_REFINED_LEVEL}, not {level}")
        by0, by1, bx0, bx1 = box
        count = bins(grid.samples(level))
        if not (0 <= by0 < by1 <= count and 0 <= bx0 < bx1 <= count):
            raise ValueError(f"bins {box} are not within the {count} x {count} of level {level}")
        s = grid.spacing(level, self._settings.size_m)
        if level not in self._reach:
            self._reach[level] = np.array([reach_m(shape, s) for shape in self._shapes]).reshape(-1, 1)
        low, high = np.array([bx0, by0]) * BIN * s, np.array([bx1, by1]) * BIN * s
        reach = self._reach[level]
        return [int(k) for k in np.flatnonzero(((self._high + reach >= low) & (self._low - reach <= high)).all(axis=1))]
