"""The solver's figures as tables for README and docs/solver.md, from the committed result of ``bench solve``."""

from __future__ import annotations

import re
from typing import Any

from bench.solver import gpu_model
from esker import grid
from esker.contract import TILE_CELLS

PEERS = {
    "pyamg_ruge_stuben": "PyAMG Ruge–Stüben + CG",
    "pyamg_smoothed_aggregation": "PyAMG smoothed aggregation + CG",
    "superlu": "SuperLU",
    "cholmod": "CHOLMOD",
}
SCENE = "fifty"
MARK = "<!-- {}: written by `python -m bench.report` -->"
END = "<!-- end -->"


def number(ms: float) -> str:
    """Milliseconds in a table: two significant digits below ten."""
    return f"{ms:.1f}" if ms < 10 else f"{ms:,.0f}"


def _rows(solve: dict[str, Any], threads: str) -> dict[str, Any]:
    rows: dict[str, Any] = solve["threads"][threads]["scenes"][SCENE]
    return rows


def ours(row: dict[str, Any], target: str) -> float:
    """Coarsening, full multigrid and the fewest cycles to an accuracy, milliseconds."""
    return float(row[target]["ms"]["least"] + row["coarsen_heights_ms"]["least"])


def worst(solve: dict[str, Any], size: str, key: str) -> float:
    """The largest value over the scenes of the gallery at one size."""
    return max(float(rows[size][key]) for rows in solve["accuracy"].values() if size in rows)


def peer_ms(figures: dict[str, Any], target: str) -> float | None:
    """Set-up and solve, or None where the peer did not get there."""
    row = figures.get("solve", {}).get(target)
    return None if row is None else float(figures["set_up_ms"] + row["ms"])


def rows(solve: dict[str, Any]) -> list[tuple[str, str, str]]:
    """README: what, figure, and what it is compared with in the same run."""
    one, two = _rows(solve, "1"), _rows(solve, "2")
    fine, peers = two["1025"], solve["peers"]["levels"]["1025"]
    beside = "; ".join(
        f"{PEERS[name]} {number(ms)} ms"
        for name in ("pyamg_ruge_stuben", "cholmod")
        if (ms := peer_ms(peers[name], "preview")) is not None
    )
    sizes = sorted({int(n) for scene in solve["accuracy"].values() for n in scene})
    rest = max(worst(solve, str(n), "rest_of_quantum") for n in sizes)
    factor = max(worst(solve, str(n), f"{s}_factor") for n in sizes for s in ("height", "gradient"))
    span = f"{len(solve['accuracy'])} scenes, {sizes[0]}² to {sizes[-1]}²"
    edit, settled = one["1025"]["after_edit_ms"], one["1025"]["from_rest_ms"]["settled"]
    return [
        ("solver, 1025², 50 strokes: first level after an edit", f"{number(edit['level_0'])} ms", ""),
        ("… all five levels as previews", f"{number(edit['level_4'])} ms", ""),
        ("… settled, strokes rasterised already", f"{number(settled)} ms", ""),
        ("… heights to 10⁻³ of the relief, two threads", f"{number(ours(fine, 'heights_to_target'))} ms", beside),
        ("… largest convergence factor", f"{factor:.2f}", span),
        ("… largest error at rest, in quantisation steps", f"{rest:.2f}", span),
    ]


def accuracy(solve: dict[str, Any]) -> str:
    """Worst of the gallery per size."""
    out = [
        "| grid | factor, gradient / height | finest preview / relief | full multigrid + 3 cycles / relief | at rest, "
        "in quanta | float32 floor / relief |",
        "|---|---|---|---|---|---|",
    ]
    for n in sorted({int(n) for scene in solve["accuracy"].values() for n in scene}):
        size = str(n)
        three = max(rows[size]["curve_of_relief"][3] for rows in solve["accuracy"].values() if size in rows)
        factors = f"{worst(solve, size, 'gradient_factor'):.2f} / {worst(solve, size, 'height_factor'):.2f}"
        cells = (worst(solve, size, "preview_of_relief"), three)
        floor = worst(solve, size, "floor_of_relief")
        out.append(
            f"| {size}² | {factors} | {cells[0]:.1e} | {cells[1]:.1e} | {worst(solve, size, 'rest_of_quantum'):.2f} "
            f"| {floor:.1e} |"
        )
    return "\n".join(out)


def times(solve: dict[str, Any]) -> str:
    """Fifty strokes: set-up, previews and rest, one thread / two."""
    out = [
        "| grid | set-up, everything | heights: full multigrid + 3 | two steps, previews | settled, raster known "
        "| after a one-stroke edit: level 0 | finest preview |",
        "|---|---|---|---|---|---|---|",
    ]
    for size in _rows(solve, "1"):
        pair = [_rows(solve, count)[size] for count in ("1", "2")]

        def both(*path: str, pair: list[dict[str, Any]] = pair) -> str:
            values = []
            for row in pair:
                value: Any = row
                for key in path:
                    value = value[key] if key != "last" else value[max(value)]
                values.append(number(value))
            return " / ".join(values)

        out.append(
            f"| {size}² | {both('set_up_ms', 'least')} | {both('heights_fmg_3', 'ms', 'least')} "
            f"| {both('two_step', 'ms', 'least')} | {both('from_rest_ms', 'settled')} "
            f"| {both('after_edit_ms', 'level_0')} | {both('after_edit_ms', 'last')} |"
        )
    return "\n".join(out)


def bandwidth(solve: dict[str, Any]) -> str:
    """Bytes by model and the share of a copy that a cycle reaches."""
    copies = [f"{solve['threads'][count]['copy_gb_per_s']:.0f}" for count in ("1", "2")]
    out = [
        f"| grid | height cycle, MB by model | ms | share of copy ({' / '.join(copies)} GB/s) "
        "| gradient cycle, MB | ms | share |",
        "|---|---|---|---|---|---|---|",
    ]
    for size in _rows(solve, "1"):
        pair = [_rows(solve, count)[size] for count in ("1", "2")]
        cells = []
        for name in ("height_cycle", "gradient_cycle"):
            cells.append(f"{pair[0][name]['model_mb']:,.0f}")
            cells.append(" / ".join(number(row[name]["ms"]["least"]) for row in pair))
            cells.append(" / ".join(f"{row[name]['share_of_copy']:.2f}" for row in pair))
        out.append(f"| {size}² | {' | '.join(cells)} |")
    return "\n".join(out)


def peers(solve: dict[str, Any]) -> str:
    """Milliseconds to 10^-3 of the relief and to rest, set-up included, and how many times ours with two threads."""
    out = [
        "| grid | solver | to 10⁻³, ms | × ours | to rest, ms | × ours | peak memory |",
        "|---|---|---|---|---|---|---|",
    ]
    for size, level in solve["peers"]["levels"].items():
        mine = _rows(solve, "2")[size]
        a, b = (number(ours(mine, target)) for target in ("heights_to_target", "heights_to_rest"))
        out.append(f"| {size}² | Esker, two threads | {a} | 1 | {b} | 1 | |")
        for name, label in PEERS.items():
            figures = level[name]
            if "solve" not in figures or not figures["solve"]:
                limits = f"{figures.get('limit_gib', 0):g} GiB, {figures.get('limit_s', 0):g} s"
                out.append(f"| {size}² | {label} | {figures['failed']} (limits {limits}) | | | | |")
                continue
            cells = []
            for target in ("preview", "rest"):
                ms = peer_ms(figures, target)
                cells += ["–", ""] if ms is None else [number(ms), f"{figures['times_ours']['2'][target]:,.0f}"]
            out.append(f"| {size}² | {label} | {' | '.join(cells)} | {figures['peak_gib']:.1f} GiB |")
    return "\n".join(out)


def aims(solve: dict[str, Any]) -> str:
    """DESIGN 15's aims beside what was reached, with two threads."""
    two = _rows(solve, "2")
    levels = solve["peers"]["levels"]
    shares = [row["height_cycle"]["share_of_copy"] for size, row in two.items() if int(size) >= 1025]
    out = ["| aim | reached |", "|---|---|"]
    for size, aim in (("1025", 20), ("4097", 250)):
        if size in two:
            row = two[size]["two_step"]
            out.append(f"| two steps at {size}²: {aim} ms | {number(row['ms']['least'])} ms ({row['cycles']} cycles) |")
    out.append(
        f"| height cycle at ≥ 60 % of copy bandwidth, 1025² and above | {min(shares):.0%} to {max(shares):.0%} |"
    )
    for name, aim in (("pyamg_ruge_stuben", 200), ("cholmod", 290)):
        times = levels.get("1025", {}).get(name, {}).get("times_ours", {}).get("2", {})
        if "preview" in times:
            out.append(f"| ≥ {aim} × {PEERS[name]}, 1025², 10⁻³ of the relief | {times['preview']:,.0f} × |")
    return "\n".join(out)


def card(solve: dict[str, Any]) -> str:
    """What ``esker doctor --report`` measured on a graphics card, beside the time that the bytes alone take."""
    report = solve["card"]
    bench, soak = report["bench"], report["soak"]
    same = "every bit" if soak["from_new_quanta"] == 0 else "not every bit"
    out = [
        f"{bench['device']}, {report['when']}: a copy within its memory moves {bench['copy_gb_per_s']:,.0f} GB/s. "
        f"A soak of {soak['seconds']:.0f} s edited and settled {grid.samples(soak['level'])}² {soak['edits']:,} times: "
        f"first preview {number(soak['first_preview_ms']['p50'])} ms, at rest {number(soak['settled_ms']['p50'])} ms "
        f"(medians), {same} that of a new solver.",
        "",
        "| grid | two steps | bytes alone | a height cycle, share of copy | all levels at rest |",
        "|---|---|---|---|---|",
    ]
    for size, row in bench["scenes"][SCENE].items():
        model = gpu_model.two_step((int(size) // TILE_CELLS).bit_length() - 1)
        floor = 1e3 * model["gigabytes"] / bench["copy_gb_per_s"]
        out.append(
            f"| {size}² | {number(row['two_step']['ms']['least'])} ms | {floor:.2f} ms "
            f"| {row['height_cycle']['share_of_copy']:.0%} | {number(row['from_rest_ms']['settled'])} ms |"
        )
    return "\n".join(out)


def ties(solve: dict[str, Any]) -> str:
    """Returns what float32 decides another way than float64, over the gallery, where it was counted."""
    found = [(int(n), row["ties"]) for rows in solve["accuracy"].values() for n, row in rows.items() if "ties" in row]
    if not found:
        return "Ties were not counted in this run."
    n = max(size for size, _ in found)
    rows = [row for size, row in found if size == n]
    counts = [row["samples"] for row in rows]
    most = max(row["error_of_relief"] for row in rows)
    away = max(row["error_elsewhere_of_relief"] for row in rows)
    return (
        f"At {n}² {min(counts)} to {max(counts)} of {n * n:,} samples of a scene are ties; the ground differs there by "
        f"at most {most:.1e} of the relief, and by {away:.1e} more than three samples away."
    )


def machine(solve: dict[str, Any]) -> str:
    """Returns what the figures were measured on, part by part."""
    lines = []
    for part, run in solve["runs"].items():
        quick = ", quick" if run["quick"] else ""
        lines.append(f"{part}: {run['started']}, load {run['load_before']} before{quick}")
    run = next(iter(solve["runs"].values()))
    devices = solve["threads"]["2"]["device"]
    return f"{run['cpu']}, {run['cores']} cores, {run['memory_gib']:.0f} GiB; {devices}. " + "; ".join(lines) + "."


TABLES = {"machine": machine, "accuracy": accuracy, "times": times, "bandwidth": bandwidth, "peers": peers}
TABLES |= {"ties": ties, "aims": aims, "card": card}


def document(text: str, solve: dict[str, Any]) -> str:
    """A document with every table renewed. Raises ValueError when one has no place in it."""
    for name, make in TABLES.items():
        begin = MARK.format(name)
        pattern = re.compile(re.escape(begin) + r".*?" + re.escape(END), re.S)
        if not pattern.search(text):
            raise ValueError(f"there is no place for the table of {name}")
        table = f"{begin}\n\n{make(solve)}\n\n{END}"
        text = pattern.sub(lambda _, table=table: table, text, count=1)  # type: ignore[misc]
    return text
