"""What files leave open or seem to say wrongly: the questions, their defaults, and what answers mean."""

from __future__ import annotations

import math
import re
from typing import Final

from esker import contract as c
from esker.importing.answers import FEET, FIT, METRES, MIDDLE, NONE, SHIFT, STOP
from esker.importing.refusal import ImportRefused
from esker.importing.scan import Scan
from esker.importing.source import Source

NODATA_CODES: Final = frozenset(
    {-9999.0, -99999.0, -999.0, -9999.9, 9999.0, 99999.0, -32768.0, -32767.0, 32767.0, 65535.0, -2147483648.0,
     2147483647.0, 4294967295.0, 255.0, 1e20, 1e30, -3.4028234663852886e38, 3.4028234663852886e38,
     -1.7976931348623157e308, 1.7976931348623157e308}
)  # fmt: skip
EARTH_M: Final = (-12_000.0, 9_500.0)
"""Nothing solid on Earth is lower or higher."""
GAP_SHARE: Final = 0.5
"""A value that stands apart from all others by more than this share of their range may be none of them."""
LOW_GAP_SHARE: Final = 0.1
"""This share is enough for zero and for negative codes: ground comes down to its lowest values little by little."""
MIN_ZERO_SHARE: Final = 1e-3
DECIMETRE: Final = 0.1
EIGHT_BIT_STEP_M: Final = 4.0
ROW_ORDERS: Final = ("north first", "south first")


def number(value: float) -> str:
    """A value as answers write it: 0, -9999, -3.4028234663852886e+38."""
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)


# --- nodata -----------------------------------------------------------------------------------------------------


def suspects(scan: Scan, source: Source) -> tuple[float, ...]:
    """Raw values that stand far apart from all others and are codes for nodata, zero or beyond the Earth."""
    lows, highs = [v for v, _ in scan.lows], [v for v, _ in scan.highs]
    below: tuple[float, ...] = ()
    above: tuple[float, ...] = ()
    for _ in range(2):  # a code at one end hides, by the range that it makes, one at the other
        below = _apart(lows, highs[len(above)] if highs else 0.0, 1.0, scan, source)
        above = _apart(highs, lows[len(below)] if lows else 0.0, -1.0, scan, source)
    return (*below, *above)


def _apart(values: list[float], far: float, sign: float, scan: Scan, source: Source) -> tuple[float, ...]:
    """The longest run of suspicious values at one end that a gap separates from the rest, which reaches to ``far``."""
    for count in range(len(values) - 1, 0, -1):
        ours, rest = values[:count], values[count]
        gap, span = sign * (rest - ours[-1]), sign * (far - rest)
        if span < 0.0:  # the other end is suspicious too and is told apart by itself
            continue
        share = LOW_GAP_SHARE if max(ours) <= 0.0 else GAP_SHARE
        if all(_suspicious(value, scan, source) for value in ours) and gap > max(share * span, 1.0):
            return tuple(ours)
    return ()


def _suspicious(value: float, scan: Scan, source: Source) -> bool:
    if value == 0.0:
        zeros = dict(scan.lows).get(0.0, 0)
        return scan.border_zeros > 0 and zeros >= max(4.0, MIN_ZERO_SHARE * scan.valid)
    height = source.gain * value + source.bias
    return value in NODATA_CODES or (source.measured and not EARTH_M[0] <= height <= EARTH_M[1])


def nodata_question(values: tuple[float, ...], scan: Scan) -> c.ImportQuestion:
    """Asks whether ``values`` are nodata."""
    counts = dict([*scan.lows, *scan.highs])
    share = sum(counts.get(value, 0) for value in values) / (scan.rows * scan.cols)
    text = " ".join(number(value) for value in values)
    plural = "stand" if len(values) > 1 else "stands"
    return c.ImportQuestion(
        id="nodata",
        text=f"{text[:60]} {plural} far apart from all other samples ({share:.2%} of them) and is not declared as "
        "nodata. Leave these samples out?",
        options=(text[:200], NONE),
        default=text[:200],
    )


def parse_nodata(text: str) -> tuple[float, ...]:
    """Raw values to leave out, from "none" or numbers with blanks between them. Raises ImportRefused."""
    if text.strip().lower() in ("", NONE):
        return ()
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        raise ImportRefused(f"{text[:40]!r} is no nodata value; write a number, or none.") from None
    return tuple(value for value in values if math.isfinite(value))


# --- heights ----------------------------------------------------------------------------------------------------


def range_question(scan: Scan, source: Source) -> c.ImportQuestion:
    """Asks how high the lowest and the highest sample of a file without a unit are."""
    low, high = default_range(scan, source)
    return c.ImportQuestion(
        id="range",
        text=f"Its samples run from {number(scan.low)} to {number(scan.high)} without a unit. How high is the lowest "
        "and the highest, in metres? Write low..high.",
        default=f"{low:.10g}..{high:.10g}",
    )


def default_range(scan: Scan, source: Source) -> tuple[float, float]:
    """Metres of the lowest and highest sample when nobody knows.

    Metres as they are where those could be some of the Earth's, but for 8 bits (4 m a step) and 16-bit integers that
    would be higher than any mountain (0.1 m a step, as in the grids of paper 2); other numbers become 0..1000.
    """
    low, high = scan.low, scan.high
    if source.eight_bit:
        return EIGHT_BIT_STEP_M * low, EIGHT_BIT_STEP_M * high
    if EARTH_M[0] <= low and high <= EARTH_M[1]:
        return low, high
    if low >= -32768 and high <= 65535:
        return DECIMETRE * low, DECIMETRE * high
    return 0.0, 1000.0


def parse_range(text: str) -> tuple[float, float]:
    """(low, high) in metres from "low..high" or "low to high". Raises ImportRefused."""
    words = [word for word in re.split(r"\.\.+|\bto\b|\s+", text.strip()) if word]
    try:
        low, high = (float(word) for word in words)
    except ValueError:
        raise ImportRefused(f"{text[:40]!r} is no range of heights; write low..high in metres.") from None
    if not (math.isfinite(low) and math.isfinite(high)) or low > high:
        raise ImportRefused(f"{text[:40]!r} is no range of heights: the first number must be the lower one.")
    return low, high


UNIT: Final = c.ImportQuestion(
    id="unit",
    text="Its coordinates are in feet, and it does not say in what its heights are.",
    options=(FEET, METRES),
    default=FEET,
)

IMAGERY: Final = c.ImportQuestion(
    id="imagery",
    text="It has 8 bits: at most 256 steps of height, as pictures have. Take it as elevation?",
    options=("elevation", STOP),
    default="elevation",
)


def type_question(types: tuple[str, ...]) -> c.ImportQuestion:
    """Asks of which type the samples of a file without a header are."""
    return c.ImportQuestion(
        id="type", text="It has no header. Of which type are its samples?", options=types, default=types[0]
    )


def shape_question(shapes: tuple[str, ...]) -> c.ImportQuestion:
    """Asks how many columns and rows a file without a header has."""
    return c.ImportQuestion(
        id="shape", text="It has no header. How many columns and rows has it?", options=shapes, default=shapes[0]
    )


ROWS: Final = c.ImportQuestion(
    id="rows",
    text="It does not say whether its first row is the northern or the southern one.",
    options=ROW_ORDERS,
    default=ROW_ORDERS[0],
)


def encoding_question(encodings: tuple[str, ...], likely: str) -> c.ImportQuestion:
    """Asks in which code three colours hold heights."""
    text = "It has three colours. In which code do they hold heights?"
    return c.ImportQuestion(id="encoding", text=text, options=encodings, default=likely)


def band_question(bands: int) -> c.ImportQuestion:
    """Asks which of several bands holds the elevation."""
    return c.ImportQuestion(
        id="band",
        text=f"It has {bands} bands. Which one holds the elevation?",
        options=tuple(str(band) for band in range(1, bands + 1)),
        default="1",
    )


LIFT_STEP_M: Final = 100.0


def held_m(size_m: float) -> float:
    """How far from zero the layers of a domain may reach, metres."""
    return c.LAYER_HEIGHT_MARGIN * size_m


def size_for_m(farthest: float) -> int:
    """Side of the smallest domain, whole metres, that holds ground so many metres from zero."""
    return math.ceil(farthest / c.LAYER_HEIGHT_MARGIN)


def height_question(low: float, high: float, size_m: float) -> tuple[c.ImportQuestion, float]:
    """Asks whether to shift heights low..high, metres, that lie too far from zero for a domain; and by how much.

    Raises ImportRefused when no shift by whole hundreds of metres helps: the grid is higher than the domain holds.
    """
    held, farthest = held_m(size_m), max(abs(low), abs(high))
    shift = -LIFT_STEP_M * math.floor(low / LIFT_STEP_M)
    if max(abs(low + shift), abs(high + shift)) > held:
        least = size_for_m(high - low + LIFT_STEP_M)
        raise ImportRefused(
            f"From its lowest to its highest sample it is {high - low:,.0f} m; a terrain {size_m:,.0f} m wide holds "
            f"{held:,.0f} m. Make a terrain at least {least:,.0f} m wide for it."
        )
    way = "Lower" if shift < 0 else "Raise"
    question = c.ImportQuestion(
        id="height",
        text=f"Its heights reach {farthest:,.0f} m from zero; a terrain {size_m:,.0f} m wide holds {held:,.0f} m. "
        f"{way} it by {abs(shift):,.0f} m? As it is, it needs a terrain at least {size_for_m(farthest):,.0f} m wide.",
        options=(SHIFT, STOP),
        default=SHIFT,
    )
    return question, shift


# --- place ------------------------------------------------------------------------------------------------------

SIZE: Final = c.ImportQuestion(
    id="size",
    text="It does not say how large it is. How wide is it on the ground, in metres? (fit: as wide as the terrain)",
    default=FIT,
)


def parse_size(text: str) -> float | None:
    """Width in metres, None for "fit". Raises ImportRefused."""
    if text.strip().lower() in ("", FIT):
        return None
    try:
        width = float(text.strip().removesuffix("m"))
    except ValueError:
        width = math.nan
    if not (math.isfinite(width) and width > 0.0):
        raise ImportRefused(f"{text[:40]!r} is no width; write metres, or fit.")
    return width


def system_question(degrees: bool, reason: str, elsewhere: bool) -> c.ImportQuestion:
    """Asks in which coordinate system a file lies.

    ``reason``: why that is not known; ``elsewhere``: as degrees it would lie outside the terrain, so that placing it by
    hand is the default.
    """
    if degrees:
        text = f"{reason} Its numbers look like degrees (EPSG:4326). In which system does it lie? An EPSG code, or "
        options = ("EPSG:4326", MIDDLE)
        default = MIDDLE if elsewhere else options[0]
        return c.ImportQuestion(id="place", text=text + "middle: laid by hand.", options=options, default=default)
    text = (
        f"{reason} Lay it in the middle of the terrain, to be moved by hand (its numbers taken for metres)? Or give an "
    )
    return c.ImportQuestion(id="place", text=text + "EPSG code.", options=(MIDDLE,), default=MIDDLE)


def far_question(distance_m: float) -> c.ImportQuestion:
    """Asks what to do with a file from elsewhere on Earth."""
    return c.ImportQuestion(
        id="place",
        text=f"It lies {distance_m / 1000:,.0f} km from the middle of this terrain, outside it. Lay it in the middle?",
        options=(MIDDLE, STOP),
        default=MIDDLE,
    )


# --- accuracy ---------------------------------------------------------------------------------------------------

ACCURACY_SHARE: Final = 0.1


def accuracy_m(spacing_m: tuple[float, float], step_m: float | None) -> float:
    """Largest error that a grid is taken to have when nobody says: a tenth of its spacing, and no less than half of
    the step that its heights are rounded to. (SRTM at 90 m: 9 m; its specification says 6 to 16 m.)"""
    guess = max(ACCURACY_SHARE * math.sqrt(spacing_m[0] * spacing_m[1]), 0.5 * (step_m or 0.0))
    return float(f"{guess:.4g}")
