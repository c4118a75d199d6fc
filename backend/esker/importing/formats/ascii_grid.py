"""Esri ASCII grids, read strictly: GDAL takes ``1,5`` for 15 in places, and allocates by the header."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from esker.importing.placement.georef import Georef, check_affine
from esker.importing.refusal import ImportRefused
from esker.importing.source import PIECE_SAMPLES, Piece, Source, check_shape

BOM: Final = b"\xef\xbb\xbf"
KEYS: Final = frozenset(
    {"ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "dx", "dy", "nodata_value"}
)
MAX_HEADER_BYTES: Final = 4096
CHUNK_BYTES: Final = 1 << 20
NUMBER: Final = re.compile(rb"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)


@dataclass(eq=False)
class AsciiSource(Source):
    """An Esri ASCII grid; ``start``: where the samples begin; ``comma``: decimals are written with commas."""

    path: Path = field(default_factory=Path)
    start: int = 0
    comma: bool = False

    def pieces(self) -> Iterator[Piece]:
        """See ``Source.pieces``. Raises ImportRefused for what is no number, and for too few or too many samples."""
        height = max(1, PIECE_SAMPLES // self.cols)
        row, rest = 0, np.zeros(0)
        with self.path.open("rb") as file:
            file.seek(self.start)
            for numbers in self._numbers(file):
                rest = np.concatenate([rest, numbers])
                if rest.size > (self.rows - row) * self.cols:
                    raise ImportRefused(
                        f"It holds more samples than the {self.cols} x {self.rows} that its header declares."
                    )
                whole = rest.size // self.cols
                if whole >= height or row + whole == self.rows:
                    for first in range(0, whole, height):
                        part = rest[first * self.cols : min(whole, first + height) * self.cols]
                        yield self._piece(row + first, part)
                    row, rest = row + whole, rest[whole * self.cols :]
        whole = rest.size // self.cols
        if row + whole < self.rows or rest.size % self.cols:
            have = row * self.cols + rest.size
            raise ImportRefused(
                f"It ends early: {have:,} of the {self.rows * self.cols:,} samples that its header declares."
            )

    def _piece(self, row: int, numbers: np.ndarray) -> Piece:
        values = numbers.reshape(-1, self.cols)
        valid = np.ones(values.shape, np.bool_) if self.nodata is None else values != self.nodata
        return Piece(row, 0, values, valid)

    def _numbers(self, file: BinaryIO) -> Iterator[np.ndarray]:
        tail = b""
        while True:
            chunk = file.read(CHUNK_BYTES)
            text = tail + chunk
            if chunk:  # a number may go on in the next chunk
                cut = max(text.rfind(white) for white in (b" ", b"\n", b"\t", b"\r")) + 1
                text, tail = text[:cut], text[cut:]
                if len(tail) > MAX_HEADER_BYTES:
                    raise ImportRefused("It holds text where samples should be.")
            if text.strip():
                yield self._parse(text)
            if not chunk:
                return

    def _parse(self, text: bytes) -> np.ndarray:
        if b"_" in text or (b"," in text and (b"." in text or not self.comma)):
            raise ImportRefused(
                "Commas and points are mixed in its numbers, so that 1,5 could be 15 or 1.5. Use points only."
            )
        if self.comma:
            if re.search(rb",[^\s,]*,", text):
                raise ImportRefused("Its numbers are separated by commas; an Esri ASCII grid has blanks between them.")
            text = text.replace(b",", b".")
        try:
            return np.array(text.split()).astype(np.float64)
        except ValueError as error:
            bad = next((word for word in text.split() if not NUMBER.fullmatch(word)), b"?")
            raise ImportRefused(f"{bad[:20].decode('ascii', 'replace')!r} among its samples is no number.") from error


def _number(word: bytes, key: str) -> float:
    if not NUMBER.fullmatch(word):
        raise ImportRefused(f"{word[:20].decode('ascii', 'replace')!r} in its header line {key} is no number.")
    return float(word.replace(b",", b"."))


def _header(head: bytes) -> tuple[dict[str, float], int, bool]:
    """Header values by key, where the samples begin, and whether decimals have commas."""
    values: dict[str, float] = {}
    position = len(BOM) if head.startswith(BOM) else 0
    comma = False
    while True:
        match = re.compile(rb"\s*([A-Za-z_]+)[ \t]+(\S+)[ \t]*(?=[\r\n]|$)").match(head, position)
        if match is None:
            break
        key = match.group(1).decode().lower()
        if key in ("nan", "inf", "infinity"):
            break
        if key not in KEYS:
            raise ImportRefused(f"Its header has a line {key[:20]!r} that Esri ASCII grids do not have.")
        if key in values:
            raise ImportRefused(f"Its header says {key} twice.")
        values[key] = _number(match.group(2), key)
        comma = comma or b"," in match.group(2)
        position = match.end()
    return values, position, comma


def _count(values: dict[str, float], key: str) -> int:
    if key not in values or not math.isfinite(values[key]) or values[key] != int(values[key]):
        raise ImportRefused(f"Its header does not say {key}, or not as a whole number.")
    return int(values[key])


def open_ascii(path: Path) -> AsciiSource:
    """Reads the header of an Esri ASCII grid (keys in any order and case). Raises ImportRefused."""
    with path.open("rb") as file:
        head = file.read(MAX_HEADER_BYTES)
    values, start, comma = _header(head)
    rows, cols = _count(values, "nrows"), _count(values, "ncols")
    notes = []
    if comma or b"," in head[start:]:
        comma = True
        notes.append("Its decimals are written with commas: 1,5 is read as 1.5.")
    step_x = values.get("cellsize", values.get("dx", math.nan))
    step_y = values.get("cellsize", values.get("dy", math.nan))
    if not (step_x > 0.0 and step_y > 0.0 and math.isfinite(step_x) and math.isfinite(step_y)):
        raise ImportRefused("Its header does not say a positive cellsize.")
    nodata = values.get("nodata_value")
    if nodata is None:
        notes.append("It does not declare a nodata value.")
    west = values.get("xllcenter", values.get("xllcorner", 0.0) + 0.5 * step_x)
    south = values.get("yllcenter", values.get("yllcorner", 0.0) + 0.5 * step_y)
    affine = (step_x, 0.0, west, 0.0, -step_y, south + (rows - 1) * step_y)
    check_shape(rows, cols)
    return AsciiSource(
        format="Esri ASCII grid",
        rows=rows,
        cols=cols,
        dtype="text",
        georef=Georef(None, check_affine(affine)),
        nodata=nodata,
        notes=notes,
        path=path,
        start=start,
        comma=comma,
    )
