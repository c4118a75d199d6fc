"""A page as PDF 1.4 (ISO 32000-1): one content stream of vectors, and the reader's own Helvetica."""

from __future__ import annotations

import math
import zlib
from pathlib import Path as File
from typing import Final

from esker.exporting.printing.drawing import Clip, Drawing, Path, Text, width_of
from esker.version import VERSION

POINTS: Final = 72.0 / 25.4
"""Points in a millimetre."""
UNKNOWN: Final = "\u00b7"
"""Stands for a letter that Windows-1252, the encoding of the page's font, does not have."""


def write_drawing(path: File, drawing: Drawing) -> None:
    """Writes the file. Raises OSError."""
    content = zlib.compress(_content(drawing).encode("cp1252"), 6)
    box = f"[0 0 {drawing.width_mm * POINTS:.3f} {drawing.height_mm * POINTS:.3f}]"
    font = "<< /Type /Font /Subtype /Type1 /BaseFont /%s /Encoding /WinAnsiEncoding >>"
    title = drawing.title.encode("utf-16-be").hex().upper()
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        (
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R"
            " /Resources << /Font << /F1 5 0 R /F2 6 0 R >> >> >>"
        ).encode(),
        b"<< /Length %d /Filter /FlateDecode >>\nstream\n" % len(content) + content + b"\nendstream",
        (font % "Helvetica").encode(),
        (font % "Helvetica-Bold").encode(),
        f"<< /Title <FEFF{title}> /Producer (Esker {VERSION}) >>".encode(),
    ]
    out = bytearray(b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n")
    places = []
    for number, body in enumerate(objects, 1):
        places.append(len(out))
        out += b"%d 0 obj\n" % number + body + b"\nendobj\n"
    start = len(out)
    out += b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    out += b"".join(b"%010d 00000 n \n" % place for place in places)
    out += b"trailer\n<< /Size %d /Root 1 0 R /Info 7 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (len(objects) + 1, start)
    path.write_bytes(bytes(out))


def _content(drawing: Drawing) -> str:
    """The page's operators. Millimetres from the top left become points from the bottom left."""
    out = [f"{POINTS:.6f} 0 0 {-POINTS:.6f} 0 {drawing.height_mm * POINTS:.3f} cm 1 j 1 J"]
    for shape in drawing.shapes:
        if isinstance(shape, Clip):
            x0, y0, x1, y1 = shape.box
            out.append(f"q {x0:.3f} {y0:.3f} {x1 - x0:.3f} {y1 - y0:.3f} re W n")
            out += [_operators(inner) for inner in shape.shapes]
            out.append("Q")
        else:
            out.append(_operators(shape))
    return "\n".join(out)


def _operators(shape: Path | Text) -> str:
    return _path(shape) if isinstance(shape, Path) else _text(shape)


def _path(shape: Path) -> str:
    out = []
    for ring in shape.rings:
        (x, y), *rest = ring
        out.append(f"{x:.2f} {y:.2f} m " + " ".join(f"{px:.2f} {py:.2f} l" for px, py in rest))
        if shape.closed:
            out.append("h")
    paint = {(True, True): "B*", (True, False): "f*", (False, True): "S", (False, False): "n"}
    before = "" if shape.fill is None else "{:.3f} {:.3f} {:.3f} rg ".format(*shape.fill)
    if shape.width_mm > 0:
        before += "{:.3f} {:.3f} {:.3f} RG {:g} w ".format(*shape.colour, shape.width_mm)
    return before + " ".join(out) + " " + paint[shape.fill is not None, shape.width_mm > 0]


def _text(shape: Text) -> str:
    words = "".join(c if _known(c) else UNKNOWN for c in shape.text if c >= " ")
    back = {"start": 0.0, "middle": 0.5, "end": 1.0}[shape.anchor] * width_of(words, shape.size_mm)
    c, s = math.cos(math.radians(shape.angle_deg)), math.sin(math.radians(shape.angle_deg))
    x, y = shape.x - back * c, shape.y + back * s
    coded = words.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
    colour = "{:.3f} {:.3f} {:.3f} rg".format(*shape.colour)
    # The page's y points down, letters stand up.
    return (
        f"BT {colour} /F{2 if shape.bold else 1} {shape.size_mm:g} Tf"
        f" {c:.5f} {-s:.5f} {-s:.5f} {-c:.5f} {x:.3f} {y:.3f} Tm ({coded}) Tj ET"
    )


def _known(letter: str) -> bool:
    try:
        letter.encode("cp1252")
    except UnicodeEncodeError:
        return False
    return True
