"""Tables of docs/refinement.md from the committed results (``bench.report``)."""

from __future__ import annotations

from typing import Any, Final

BEGIN: Final = "<!-- refinement: written by `python -m bench.report` -->"
END: Final = "<!-- end of refinement -->"
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
ERRORS: Final = ("max", "rms", "max_near", "rms_near", "rms_far")
VIEWS: Final = """\
From nothing until all is made that the server selects for 1024 × 768 pixels, 12 m above the ground: a terrain of 4096 m
refined to level 6, and a world of 65,536 m refined to level 10 with the same strokes around the viewer."""
COSTS: Final = ("lone_tile_cold_ms", "block_of_16_parents_known_ms", "tile_again_ms", "tile_cached_ms")


def document(text: str, result: dict[str, Any]) -> str:
    """The page with its tables renewed. Raises ValueError when the markers are missing."""
    if BEGIN not in text or END not in text:
        raise ValueError("docs/refinement.md has no place for the tables")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    return f"{before}{BEGIN}\n\n{tables(result)}\n\n{END}{after}"


def tables(result: dict[str, Any]) -> str:
    """Errors, costs and views."""
    machine = result["machine"]
    return "\n\n".join(
        [
            f"Measured on {machine['cores']} cores ({machine['cpu']}) with {machine['device']}; load "
            f"{machine['load_before']} before it began.",
            "Errors as a share of the relief, against global solves, from 1025²; near: within 16 cells of a crest.",
            _errors(result["error"]),
            "Milliseconds, of the quickest of several runs:",
            _costs(result["cost"]),
            VIEWS,
            _views(result["view"]),
        ]
    )


def _power(value: float) -> str:
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(_SUPERSCRIPT)}"


def _table(head: str, rows: list[list[str]]) -> str:
    rule = "|" + "---|" * (head.count("|") - 1)
    return "\n".join([head, rule, *("| " + " | ".join(row) + " |" for row in rows)])


def _errors(errors: dict[str, Any]) -> str:
    rows = [
        [scene, f"{to.rsplit(' ', 1)[1]}²", *(_power(found[name]) for name in ERRORS)]
        for scene, steps in errors.items()
        for to, found in steps.items()
        if to != "relief_m"
    ]
    return _table("| scene | to | largest | RMS | largest near | RMS near | RMS far |", rows)


def _costs(costs: dict[str, Any]) -> str:
    rows = [
        [scene, f"{side}²", *(f"{found[name]:.2g}" if found[name] < 10 else f"{found[name]:.0f}" for name in COSTS)]
        for scene, levels in costs.items()
        for side, found in levels.items()
    ]
    head = "| scene | level | lone tile, nothing known | block of 16, parents known | a tile again | from the cache |"
    return _table(head, rows)


def _views(views: dict[str, Any]) -> str:
    rows = []
    for scene, found in views.items():
        small, large = found["4097"], found["65537"]
        rows.append(
            [
                scene,
                *(f"{v['tiles']}, {v['total_ms']:,.0f}, {v['cpu_ms']:,.0f}" for v in (small, large)),
                f"{found['ratio']:.2f}, {found['cpu_ratio']:.2f}",
                f"{found['whole_ms']:,.0f} ms",
            ]
        )
    head = "| scene | 4097²: tiles, ms, CPU ms | 65,537²: tiles, ms, CPU ms | ratio, of CPU time | 4097² as a whole |"
    return _table(head, rows)
