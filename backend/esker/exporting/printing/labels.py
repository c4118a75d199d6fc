"""Heights written into index contours: where a line is straight, in a gap of it, never upside down."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.exporting.printing.drawing import CAP_HEIGHT, Colour, Text, width_of

SIZE_MM: Final = 2.1
PAD_MM: Final = 0.7
APART_MM: Final = 20.0
"""From one label to the next, of whichever line."""
EVERY_MM: Final = 90.0
"""Along one line."""
SHORTEST_MM: Final = 26.0
BEND_MM: Final = 0.35
"""How far a line may bend away under its words."""
TRIES: Final = 12

Points = NDArray[np.float64]


class Labels:
    """The labels of one map, in the order in which they found room."""

    def __init__(self, box: tuple[float, float, float, float]) -> None:
        self.texts: list[Text] = []
        self._box = box
        self._taken: list[tuple[float, float]] = []

    def cut(self, line: Points, words: str, colour: Colour) -> list[Points]:
        """Writes ``words`` into a line where they fit; returns what is left of the line beside them."""
        step = np.hypot(*np.diff(line, axis=0).T)
        along = np.concatenate([[0.0], np.cumsum(step)])
        total = float(along[-1])
        half = 0.5 * width_of(words, SIZE_MM) + PAD_MM
        if total < max(SHORTEST_MM, 6 * half):
            return [line]
        gaps: list[tuple[float, float]] = []
        for part in range(max(1, round(total / EVERY_MM))):
            each = total / max(1, round(total / EVERY_MM))
            best = self._best(line, along, (part * each + half, (part + 1) * each - half), half)
            if best is not None:
                self._write(line, along, (best - half, best + half), words, colour)
                gaps.append((best - half, best + half))
        return list(_without(line, along, gaps))

    def _best(self, line: Points, along: Points, span: tuple[float, float], half: float) -> float | None:
        """The straightest of a few places of a stretch, None where the line bends everywhere or others are near."""
        found: tuple[float, float] | None = None
        for at in np.linspace(*span, TRIES) if span[1] > span[0] else ():
            begin, middle, end = (_at(line, along, at + k) for k in (-half, 0.0, half))
            x, y = middle
            x0, y0, x1, y1 = self._box
            if not (x0 + half < x < x1 - half and y0 + half < y < y1 - half):
                continue
            if any(math.hypot(x - a, y - b) < APART_MM for a, b in self._taken):
                continue
            chord = end - begin
            length = float(np.hypot(*chord)) or 1e-9
            quarters = [_at(line, along, at + k * half) - begin for k in (-0.5, 0.0, 0.5)]
            bend = max(abs(float(chord[0] * q[1] - chord[1] * q[0])) / length for q in quarters)
            if bend < BEND_MM and length > 1.7 * half and (found is None or bend < found[0]):
                found = bend, float(at)
        return None if found is None else found[1]

    def _write(self, line: Points, along: Points, span: tuple[float, float], words: str, colour: Colour) -> None:
        begin, end = _at(line, along, span[0]), _at(line, along, span[1])
        dx, dy = (float(v) for v in end - begin)
        if dx < 0 or (dx == 0 and dy > 0):
            dx, dy = -dx, -dy
        angle = math.degrees(math.atan2(-dy, dx))
        x, y = (float(v) for v in 0.5 * (begin + end))
        down = 0.5 * CAP_HEIGHT * SIZE_MM
        turn = math.radians(angle)
        self.texts.append(
            Text(x + down * math.sin(turn), y + down * math.cos(turn), words, SIZE_MM, "middle",
                 angle_deg=angle, colour=colour)
        )  # fmt: skip
        self._taken.append((x, y))


def _at(line: Points, along: Points, s: float) -> Points:
    """The place at a length of a line."""
    return np.array([np.interp(s, along, line[:, 0]), np.interp(s, along, line[:, 1])])


def _without(line: Points, along: Points, gaps: list[tuple[float, float]]) -> list[Points]:
    """The line without stretches of it, which rise and do not overlap."""
    cuts = [0.0, *(edge for gap in gaps for edge in gap), float(along[-1])]
    out = []
    for begin, end in zip(cuts[::2], cuts[1::2], strict=True):
        inner = line[(along > begin) & (along < end)]
        piece = np.concatenate([_at(line, along, begin)[None], inner, _at(line, along, end)[None]])
        if end > begin:
            out.append(piece)
    return out
