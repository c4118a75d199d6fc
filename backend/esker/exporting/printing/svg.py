"""A page as SVG 1.1: its numbers are millimetres, and its size says so."""

from __future__ import annotations

from pathlib import Path as File
from xml.sax.saxutils import escape, quoteattr

from esker.exporting.printing.drawing import Clip, Colour, Drawing, Path, Text


def write_drawing(path: File, drawing: Drawing) -> None:
    """Writes the file. Raises OSError."""
    w, h = drawing.width_mm, drawing.height_mm
    out = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{w:g}mm" height="{h:g}mm" viewBox="0 0 {w:g} {h:g}"'
        ' font-family="Helvetica, Arial, sans-serif" stroke-linejoin="round" stroke-linecap="round">',
        f"<title>{escape(drawing.title)}</title>",
        f'<rect width="{w:g}" height="{h:g}" fill="#fff"/>',
    ]
    for number, shape in enumerate(drawing.shapes):
        if isinstance(shape, Clip):
            x0, y0, x1, y1 = shape.box
            out.append(
                f'<clipPath id="c{number}"><rect x="{x0:.3f}" y="{y0:.3f}" width="{x1 - x0:.3f}"'
                f' height="{y1 - y0:.3f}"/></clipPath><g clip-path="url(#c{number})">'
            )
            out += [_element(inner) for inner in shape.shapes]
            out.append("</g>")
        else:
            out.append(_element(shape))
    out.append("</svg>")
    path.write_text("\n".join(out) + "\n", encoding="utf-8")


def _element(shape: Path | Text) -> str:
    return _path(shape) if isinstance(shape, Path) else _text(shape)


def _path(shape: Path) -> str:
    end = "Z" if shape.closed else ""
    d = "".join("M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in ring) + end for ring in shape.rings)
    fill = "none" if shape.fill is None else _hex(shape.fill)
    stroke = f' stroke="{_hex(shape.colour)}" stroke-width="{shape.width_mm:g}"' if shape.width_mm > 0 else ""
    return f'<path d="{d}" fill="{fill}" fill-rule="evenodd"{stroke}/>'


def _text(shape: Text) -> str:
    turn = f' transform="rotate({-shape.angle_deg:.2f} {shape.x:.2f} {shape.y:.2f})"' if shape.angle_deg else ""
    bold = ' font-weight="bold"' if shape.bold else ""
    words = "".join(c for c in shape.text if c >= " ")
    return (
        f'<text x="{shape.x:.2f}" y="{shape.y:.2f}" font-size="{shape.size_mm:g}" text-anchor={quoteattr(shape.anchor)}'
        f' fill="{_hex(shape.colour)}"{bold}{turn}>{escape(words)}</text>'
    )


def _hex(colour: Colour) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in colour)
