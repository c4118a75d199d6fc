"""A contour map to scale on one page of paper: what is drawn where, in millimetres."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import PaperOptions
from esker.exporting.ground import Ground
from esker.exporting.printing.contours import contour, interval_for, steep_cells
from esker.exporting.printing.drawing import CannotPrint, Clip, Colour, Drawing, Path, Text
from esker.exporting.printing.labels import Labels
from esker.exporting.printing.legend import INDEX_MM, LEGEND_MM, LINE_MM, draw_legend, metres

PAPERS: Final = {"a4": (210.0, 297.0), "a3": (297.0, 420.0)}
MARGIN_MM: Final = 12.0
EDGE_MM: Final = 8.0
"""Beside the map, for the numbers of its grid."""
HEAD_MM: Final = 16.0
ABOVE: Final = 0.35
"""Share of the paper that is left over which lies above the map."""
INDEX_EVERY: Final = 5
ROUND: Final = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.5, 10.0)
"""Scales are one of these times a power of ten."""
SHORTEST_MM: Final = 2.0
"""Shorter contours are specks."""
MOST_LINES: Final = 400
MOST_CROSSINGS: Final = 3_000_000
"""Points of all contours together: of ground that is nothing but noise each sample would have hundreds, and the map
would be made for hours."""
INK: Final[Colour] = (0.13, 0.13, 0.14)
EARTH: Final[Colour] = (0.58, 0.37, 0.20)
SEA_LINE: Final[Colour] = (0.30, 0.50, 0.66)
SEA: Final[Colour] = (0.86, 0.93, 0.97)
GRID: Final[Colour] = (0.62, 0.68, 0.72)


@dataclass(frozen=True)
class Frame:
    """Where the ground lies on the page. ``scale``: its denominator; ``box``: of the map, millimetres."""

    width_mm: float
    height_mm: float
    scale: float
    box: tuple[float, float, float, float]

    def place(self, ground: Ground, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Millimetres of places given in samples."""
        per = 1000.0 * ground.spacing_m / self.scale
        x0, _, _, y1 = self.box
        return np.stack([x0 + per * samples[:, 0], y1 - per * samples[:, 1]], axis=1)


def frame_of(ground: Ground, wanted: PaperOptions) -> Frame:
    """The page of a ground, turned where that is much wider than tall. Raises CannotPrint for a scale at which the map
    is larger than the paper."""
    rows, columns = ground.heights.shape
    if rows < 2 or columns < 2:
        raise CannotPrint("A map needs at least two samples a side: take a larger window or a finer level.")
    w_m, h_m = (columns - 1) * ground.spacing_m, (rows - 1) * ground.spacing_m
    wide, tall = PAPERS[wanted.size]
    if w_m > 1.2 * h_m:
        wide, tall = tall, wide
    free_w = wide - 2 * (MARGIN_MM + EDGE_MM)
    free_h = tall - 2 * MARGIN_MM - HEAD_MM - LEGEND_MM - EDGE_MM
    least = 1000.0 * max(w_m / free_w, h_m / free_h)
    scale = float(wanted.scale) if wanted.scale else _rounded(least)
    if scale < least:
        raise CannotPrint(
            f"At 1 : {metres(scale)} this map is larger than {wanted.size.upper()} paper."
            f" Take 1 : {metres(_rounded(least))} or a smaller scale."
        )
    w, h = 1000.0 * w_m / scale, 1000.0 * h_m / scale
    spare = tall - 2 * MARGIN_MM - HEAD_MM - LEGEND_MM - h
    x0, y0 = 0.5 * (wide - w), MARGIN_MM + HEAD_MM + ABOVE * spare
    return Frame(wide, tall, scale, (x0, y0, x0 + w, y0 + h))


def _rounded(least: float) -> float:
    power = 10.0 ** math.floor(math.log10(least))
    return next(k * power for k in ROUND if k * power >= least * (1 - 1e-12))


def contour_map(ground: Ground, wanted: PaperOptions, today: datetime.date) -> Drawing:
    """The map: ground under water, contours with their heights, grid, frame, title and legend. Raises CannotPrint."""
    frame = frame_of(ground, wanted)
    low, high = ground.range_m
    every = wanted.interval_m or interval_for(high - low)
    if (high - low) / every > MOST_LINES:
        raise CannotPrint(f"An interval of {every:g} m gives more than {MOST_LINES} contours here. Take a larger one.")
    if _crossings(ground.heights, every) > MOST_CROSSINGS:
        raise CannotPrint(f"The ground is too rough for contours every {every:g} m. Take more, or fewer samples.")
    title = ground.settings.title or "Terrain"
    made = Drawing(frame.width_mm, frame.height_mm, title)
    labels = Labels(frame.box)
    inside: list[Path | Text] = [*_water(ground, frame), *_contours(ground, frame, every, labels)]
    made.shapes.append(Clip(frame.box, inside))
    made.shapes.extend(_grid(ground, frame))
    made.shapes.extend(labels.texts)
    made.shapes.extend(_summit(ground, frame))
    made.shapes.append(Path([_box(frame.box)], 0.35, INK, closed=True))
    draw_legend(made, ground, frame.box, frame.scale, every, INDEX_EVERY, today)
    return made


def _crossings(heights: NDArray[np.float32], every: float) -> float:
    """About how many points contours at this interval have together: each is where one crosses an edge of the grid."""
    return sum(float(np.abs(np.diff(heights, axis=axis)).sum(dtype=np.float64)) for axis in (0, 1)) / every


def _box(box: tuple[float, float, float, float]) -> NDArray[np.float64]:
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def _water(ground: Ground, frame: Frame) -> list[Path]:
    """Sea and lakes as areas, with their shore."""
    mask = ground.masks.get("water")
    if mask is None or not mask.any():
        return []
    # Dry ground around it closes every shore; a page that is all water is closed by it too.
    ringed = np.pad(mask.astype(np.float32), 1, constant_values=0.0)
    rings = [frame.place(ground, line.points - 1.0) for line in contour(ringed, 127.5)]
    return [Path(rings, 0.18, SEA_LINE, fill=SEA, closed=True)]


def _contours(ground: Ground, frame: Frame, every: float, labels: Labels) -> list[Path]:
    low, high = ground.range_m
    keep = steep_cells(ground.heights if ground.solved is None else ground.solved, every) & ~_lake_cells(ground)
    sea = ground.settings.sea_level_m
    first, last = math.ceil(low / every), math.floor(high / every)
    out: list[Path] = []
    for index in (True, False):
        for number in range(first, last + 1):
            if (number % INDEX_EVERY == 0) is not index:
                continue
            level = number * every
            colour = SEA_LINE if sea is not None and level < sea else EARTH
            found = contour(ground.heights, level, keep)
            lines = [line for line in (frame.place(ground, one.points) for one in found) if _length(line) > SHORTEST_MM]
            if index:
                lines = [piece for line in lines for piece in labels.cut(line, metres(level), colour)]
            if lines:
                out.append(Path(lines, INDEX_MM if index else LINE_MM, colour))
    return out


def _length(line: NDArray[np.float64]) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _lake_cells(ground: Ground) -> NDArray[np.bool_]:
    """Cells under lakes: their bed has no contours, the sea's has."""
    rows, columns = ground.heights.shape
    mask = ground.masks.get("water")
    if mask is None:
        return np.zeros((rows - 1, columns - 1), dtype=bool)
    sea = ground.settings.sea_level_m
    lake = (mask > 0) if sea is None else (mask > 0) & (ground.heights >= np.float32(sea))
    cells: NDArray[np.bool_] = lake[:-1, :-1] & lake[1:, :-1] & lake[:-1, 1:] & lake[1:, 1:]
    return cells


def _grid(ground: Ground, frame: Frame) -> list[Path | Text]:
    """Lines at round metres, with their numbers outside the frame."""
    x0, y0, x1, y1 = frame.box
    per = 1000.0 / frame.scale
    w_m, h_m = (x1 - x0) / per, (y1 - y0) / per
    step = interval_for(max(w_m, h_m), 9)
    lines: list[NDArray[np.float64]] = []
    out: list[Path | Text] = []
    for number in range(math.ceil(ground.x_m / step - 1e-9), math.floor((ground.x_m + w_m) / step + 1e-9) + 1):
        x = x0 + (number * step - ground.x_m) * per
        lines.append(np.array([[x, y0], [x, y1]]))
        out.append(Text(x, y1 + 3.4, metres(number * step), 2.3, "middle", colour=INK))
    for number in range(math.ceil(ground.y_m / step - 1e-9), math.floor((ground.y_m + h_m) / step + 1e-9) + 1):
        y = y1 - (number * step - ground.y_m) * per
        lines.append(np.array([[x0, y], [x1, y]]))
        out.append(Text(x0 - 1.2, y + 0.8, metres(number * step), 2.3, "end", colour=INK))
    return [Path(lines, 0.08, GRID), *out]


def _summit(ground: Ground, frame: Frame) -> list[Path | Text]:
    """A triangle and the height on the highest sample, where the ground is not flat."""
    low, high = ground.range_m
    if high - low <= 0:
        return []
    row, column = np.unravel_index(int(ground.heights.argmax()), ground.heights.shape)
    ((x, y),) = frame.place(ground, np.array([[float(column), float(row)]]))
    x0, _, x1, _ = frame.box
    mark = np.array([[x - 0.9, y + 0.6], [x + 0.9, y + 0.6], [x, y - 1.0]])
    right = x < 0.5 * (x0 + x1)
    words = Text(
        x + (1.6 if right else -1.6), y + 0.7, f"{high:.0f}", 2.5, "start" if right else "end", bold=True, colour=INK
    )
    return [Path([mark], 0.0, fill=INK, closed=True), words]
