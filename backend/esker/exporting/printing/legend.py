"""Title and legend of a contour map: scale and its bar, north, interval, water, place, date."""

from __future__ import annotations

import datetime
from typing import Final

import numpy as np

from esker.exporting.ground import Ground
from esker.exporting.printing.contours import interval_for
from esker.exporting.printing.drawing import Colour, Drawing, Path, Text

LEGEND_MM: Final = 40.0
LINE_MM, INDEX_MM = 0.14, 0.32
BAR_MM: Final = 70.0
INK: Final[Colour] = (0.13, 0.13, 0.14)
QUIET: Final[Colour] = (0.38, 0.39, 0.41)
EARTH: Final[Colour] = (0.58, 0.37, 0.20)
TITLE_MM: Final = 7.0
LONGEST: Final = 60
"""Letters of a title on one line."""


def metres(value: float) -> str:
    """A number with narrow spaces between thousands, as many digits as it needs, and a true minus."""
    text = f"{value:,.2f}".rstrip("0").rstrip(".").replace(",", "\u00a0")
    return text.replace("-", "\u2212") if text not in ("-0", "") else "0"


def draw_legend(
    made: Drawing, ground: Ground, box: tuple[float, float, float, float], scale: float, every: float, index: int,
    today: datetime.date,
) -> None:  # fmt: skip
    """Adds what stands around the map."""
    x0, y0, x1, y1 = box
    low, high = ground.range_m
    title = ground.settings.title or "Terrain"
    size = TITLE_MM if len(title) < 36 else 4.6
    shown = title if len(title) <= LONGEST else title[: LONGEST - 1] + "\u2026"
    made.shapes.append(Text(x0, y0 - 8.5, shown, size, bold=True, colour=INK))
    made.shapes.append(
        Text(x0, y0 - 3.0, f"Contour map, {metres(round(low))} to {metres(round(high))} m", 3.2, colour=QUIET)
    )
    _north(made, x1 - 4.0, y0 - 3.0)
    top = y1 + 12.0
    made.shapes.append(Text(x0, top, f"1 : {metres(scale)}", 5.2, bold=True, colour=INK))
    _bar(made, x0, top + 5.0, scale)
    x = x0 + BAR_MM + 22.0
    step = f"{metres(every)} m" if every >= 0.01 else f"{every:.2g} m"
    for row, (width, words) in enumerate(
        (
            (LINE_MM, f"Contours every {step}"),
            (INDEX_MM, f"Each {_nth(index)} stronger: every {metres(every * index)} m"),
        )
    ):
        y = top - 1.4 + 5.0 * row
        made.shapes.append(Path([np.array([[x, y - 0.9], [x + 9.0, y - 0.9]])], width, EARTH))
        made.shapes.append(Text(x + 11.0, y, words, 2.9, colour=INK))
    for row, words in enumerate(_facts(ground, today)):
        made.shapes.append(Text(x, top + 9.4 + 4.4 * row, words, 2.6, colour=QUIET))


def _facts(ground: Ground, today: datetime.date) -> list[str]:
    facts = []
    if (place := ground.settings.place) is not None:
        ns, ew = "N" if place.lat_deg >= 0 else "S", "E" if place.lon_deg >= 0 else "W"
        facts.append(f"Middle: {abs(place.lat_deg):.4f}\u00b0 {ns}, {abs(place.lon_deg):.4f}\u00b0 {ew}")
    facts.append("Grid: metres from the south-western corner")
    facts.append(f"{today.day} {today:%B %Y}, made with Esker. Print at 100 %.")
    return facts


def _nth(number: int) -> str:
    return {2: "second", 4: "fourth", 5: "fifth", 10: "tenth"}.get(number, f"{number}th")


def _north(made: Drawing, x: float, y: float) -> None:
    """An arrow that points up; the letter under its tip is clear of it."""
    left = np.array([[x, y - 9.0], [x - 2.2, y], [x, y - 1.6]])
    right = np.array([[x, y - 9.0], [x + 2.2, y], [x, y - 1.6]])
    made.shapes.append(Path([left], 0.2, INK, fill=INK, closed=True))
    made.shapes.append(Path([right], 0.2, INK, fill=(1.0, 1.0, 1.0), closed=True))
    made.shapes.append(Text(x - 4.6, y - 4.0, "N", 3.4, "middle", bold=True, colour=INK))


def _bar(made: Drawing, x: float, y: float, scale: float) -> None:
    """Four parts of a round length, in turns black and white."""
    part_m = interval_for(BAR_MM * scale / 1000.0, 4)
    while 4 * part_m * 1000.0 / scale > BAR_MM * 1.05:
        part_m /= 2.0
    part = part_m * 1000.0 / scale
    unit, per = ("km", 1000.0) if 4 * part_m >= 4000 else ("m", 1.0)
    for number in range(4):
        left = x + number * part
        cell = np.array([[left, y], [left + part, y], [left + part, y + 1.6], [left, y + 1.6]])
        made.shapes.append(Path([cell], 0.18, INK, fill=INK if number % 2 == 0 else (1.0, 1.0, 1.0), closed=True))
    for number in (0, 1, 2, 4):
        words = metres(number * part_m / per) + (f" {unit}" if number == 4 else "")
        made.shapes.append(Text(x + number * part, y + 5.0, words, 2.6, "middle" if number else "start", colour=INK))
