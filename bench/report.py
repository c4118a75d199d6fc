"""Figures of README and of several pages of docs/ from the committed results.

``python -m bench.report [--check]``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from bench.cluster import _table
from bench.ground import _importing, _patchwork, _patchwork_cover, _refine
from bench.picture import _render
from bench.solver import _solver
from bench.strangers import _siege_table
from esker import resources

ROOT = resources.sources()
RESULTS = ROOT / "bench" / "results"
README = ROOT / "README.md"
SOLVER = ROOT / "docs" / "solver.md"
REFINEMENT = ROOT / "docs" / "refinement.md"
PATCHWORK = ROOT / "docs" / "patchwork.md"
IMPORTING = ROOT / "docs" / "importing.md"
RENDERER = ROOT / "docs" / "renderer.md"
SECURITY = ROOT / "docs" / "security.md"
OPERATIONS = ROOT / "docs" / "operations.md"
BEGIN, END = "<!-- figures: written by `python -m bench.report` -->", "<!-- end of figures -->"


def result(name: str) -> Any:
    """One committed result."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def milliseconds(value: float) -> str:
    """Two significant digits below ten, whole above."""
    return f"{value:.1f} ms" if value < 10 else f"{value:,.0f} ms"


def kilobytes(value: float) -> str:
    """Thousands of bytes."""
    return f"{value / 1000:,.1f} KB" if value < 100_000 else f"{value / 1000:,.0f} KB"


def pair(figures: dict[str, float]) -> str:
    """Median and 99th percentile."""
    return f"{milliseconds(figures['p50'])} / {milliseconds(figures['p99'])}"


def rows() -> list[tuple[str, str, str]]:
    """Returns rows: what was measured, its figure, and what it is compared with in the same run."""
    solve, stream, fanout = result("solve"), result("stream"), result("fanout")
    canvas, flow = stream["scenes"]["fifty"], stream["scenes"]["fifty"]["socket"]
    room, first = fanout["esker"], canvas["first_view_home"]
    return [
        *_solver.rows(solve),
        (
            "append → first coarse tile on the socket, at rest (p50 / p99)",
            pair(flow["at_rest"]["first_coarse_tile_ms"]),
            "",
        ),
        ("append → last tile of level 4, at rest (p50 / p99)", pair(flow["at_rest"]["level_4_preview_ms"]), ""),
        (
            "append → first coarse tile, drawing without a pause (p50 / p99)",
            pair(flow["drawing"]["first_coarse_tile_ms"]),
            "",
        ),
        (
            "first view, 1025², 50 strokes: what it shows / and what a step nearer shows",
            f"{kilobytes(first['shown']['bytes'])} / {kilobytes(first['bytes'])}",
            f"raw uint16: {kilobytes(first['raw_uint16_bytes'])}",
        ),
        (
            "one appended segment",
            kilobytes(canvas["segment_mean"]["bytes"]),
            f"raw uint16: {kilobytes(canvas['segment_mean']['raw_uint16_bytes'])}",
        ),
        ("choosing one viewer's tiles (p50)", f"{canvas['selection_ms']['home']['p50']:.2f} ms", ""),
        (
            "fan-out, 60 clients × 20 ops/s, durable (p50 / p99)",
            pair(room["delay_ms"]),
            f"{room['deliveries_per_s']:,} deliveries/s, {room['server_cores']:.2f} of a core, "
            f"{room['server_rss_mb']:.0f} MB",
        ),
        *_start_rows(result("start")),
        *_render.rows(result("render"), result("cracks")),
        *_patchwork.rows(result("patchwork")),
    ]


def _start_rows(start: Any) -> list[tuple[str, str, str]]:
    """The start of a server, beside the load that the machine had: other work slows compiling more than all else."""
    cold, warm = (start["slowest"][kind]["ready_s"] for kind in ("cold", "warm"))
    most, load = start["bounds"], start["machine"]["load_before"]
    aims = f"aims: {most['cold']:.0f} s / {most['warm']:.0f} s, {most['memory_mb']} MB"
    return [
        (
            "start until it can be drawn on, with empty caches / with full ones",
            f"{cold:.1f} s / {warm:.1f} s, {start['memory_mb']} MB",
            f"{aims}; load of the machine before: {load}",
        )
    ]


def table() -> str:
    """The whole section between the markers."""
    machine = result("stream")["machine"]
    head = (
        f"Measured on {machine['cores']} cores ({machine['cpu']}) with {machine['device']}; no GPU. "
        "Other work ran on the machine at the same time where `load_before` in the files says so.\n\n"
        "| what | measured | beside it |\n|---|---|---|\n"
    )
    return head + "\n".join(f"| {a} | {b} | {c} |" for a, b, c in rows())


def readme(text: str) -> str:
    """The README with the section renewed. Raises ValueError when the markers are missing."""
    if BEGIN not in text or END not in text:
        raise ValueError("README.md has no place for the figures")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    return f"{before}{BEGIN}\n\n{table()}\n\n{END}{after}"


def documents() -> dict[Path, str]:
    """Every document that carries figures, with its text renewed."""
    out = {README: readme(README.read_text(encoding="utf-8"))}
    out[SOLVER] = _solver.document(SOLVER.read_text(encoding="utf-8"), result("solve") | {"card": result("gpu")})
    out[REFINEMENT] = _refine.document(REFINEMENT.read_text(encoding="utf-8"), result("refine"))
    page = _patchwork.document(PATCHWORK.read_text(encoding="utf-8"), result("patchwork"))
    out[PATCHWORK] = _patchwork_cover.document(page, result("patchwork_cover"))
    out[IMPORTING] = _importing.document(IMPORTING.read_text(encoding="utf-8"), result("importing"))
    out[SECURITY] = _siege_table.document(SECURITY.read_text(encoding="utf-8"), result("siege"))
    servers = result("cluster"), result("cluster_simulation")
    out[OPERATIONS] = _table.document(OPERATIONS.read_text(encoding="utf-8"), *servers)
    drawn = (result(name) for name in ("render", "cracks", "flight"))
    out[RENDERER] = _render.document(RENDERER.read_text(encoding="utf-8"), *drawn)
    return out


def main(argv: list[str]) -> int:
    """Write the sections, or with ``--check`` exit with 1 when one is stale."""
    fresh = documents()
    if "--check" in argv:
        return int(any(path.read_text(encoding="utf-8") != text for path, text in fresh.items()))
    for path, text in fresh.items():
        path.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
