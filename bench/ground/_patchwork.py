"""Tables of docs/patchwork.md from the committed results (``bench.report``)."""

from __future__ import annotations

from typing import Any, Final

BEGIN: Final = "<!-- patchwork: written by `python -m bench.report` -->"
END: Final = "<!-- end of patchwork -->"


def document(text: str, result: dict[str, Any]) -> str:
    """The page with its tables renewed. Raises ValueError when the markers are missing."""
    if BEGIN not in text or END not in text:
        raise ValueError("docs/patchwork.md has no place for the tables")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    return f"{before}{BEGIN}\n\n{tables(result)}\n\n{END}{after}"


def rows(result: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Returns rows for the README: what was measured, its figure, and what it is compared with."""
    paper = result["paper"]
    side = max(result["build"], key=int)
    built, uniform = result["build"][side], result["queries"]["uniform"]
    added = result["add"]
    return [
        (
            f"elevation grid of {int(side):,}²: mipmaps, errors, index",
            _seconds(built["three_stages_s"]),
            f"paper 2: {_seconds(paper['build'][side]['total_s'])}; gdaladdo, mipmaps alone: "
            f"{_seconds(result['gdal']['overviews'][side]['s'])}",
        ),
        (
            "uniform queries a second at 50 m / 0 m",
            f"{uniform['50']['per_s']:,.0f} / {uniform['0']['per_s']:,.0f}",
            "paper 2: 800 / 55",
        ),
        (
            "a turned grid of 512² into a live one of 4,097²",
            _ms(added["raster_ms"] + added["model_and_index_ms"]),
            f"gdalwarp into it, cubic: {_ms(result['gdal']['warp']['into_4k_cubic_ms'])}, mipmaps not counted",
        ),
    ]


def tables(result: dict[str, Any]) -> str:
    """All of them."""
    machine = result["machine"]
    return "\n\n".join(
        [
            f"Measured on {machine['cores']} cores ({machine['cpu']}), load {machine['load_before']} before it began; "
            f"grids: {result['data']}, finer ones grown from it by a fractal rule "
            "(`bench/ground/_patchwork_data.py`). The "
            f"paper: {result['paper']['machine']}. {result['gdal']['version']}.",
            _build(result),
            _queries(result),
            _traffic(result["queries"]),
            _blend(result),
            _add(result),
        ]
    )


def _table(head: str, lines: list[list[str]]) -> str:
    rule = "|" + "---|" * (head.count("|") - 1)
    return "\n".join([head, rule, *("| " + " | ".join(line) + " |" for line in lines)])


def _ms(value: float) -> str:
    return f"{value:.2f} ms" if value < 1 else f"{value:.1f} ms" if value < 100 else f"{value:,.0f} ms"


def _seconds(value: float) -> str:
    return _ms(1e3 * value) if value < 1 else f"{value:.1f} s"


def _mb(value: float) -> str:
    return f"{value / 1e6:,.1f} MB"


def _build(result: dict[str, Any]) -> str:
    paper, peer = result["paper"]["build"], result["gdal"]["overviews"]
    lines = []
    for side, own in result["build"].items():
        stages = [_seconds(own[f"{stage}_s"]) for stage in ("mipmaps", "errors", "index", "three_stages")]
        over, n = own["bytes_over"], int(side)
        other = peer.get(side)
        lines.append(
            [
                f"{n:,}²",
                *stages,
                _seconds(paper[side]["total_s"]),
                "" if other is None else _seconds(other["s"]),
                f"{_mb(over['total'])} ({100 * over['share']:.0f} %)",
                ""
                if other is None
                else f"{_mb(other['bytes_over'])} ({100 * other['bytes_over'] / (4 * n * n):.0f} %)",
            ]
        )
    head = "| grid | mipmaps | errors | index | together | paper, together | gdaladdo | bytes over | gdaladdo |"
    text = _table(head, lines)
    largest = result["build"][max(result["build"], key=int)]
    if "memory" in largest:
        memory = largest["memory"]
        text += (
            f"\n\nThe largest out of core: the process itself allocated {memory['anonymous_mib']:,.0f} MiB at most, "
            f"and {_peak(memory):,.0f} MiB were resident with the pages of mapped files{_limit(memory)}. With digest, "
            f"bounds and files {_seconds(largest['with_digest_and_files_s'])} in all."
        )
    return text


def _peak(memory: dict[str, float]) -> float:
    """The kernel's record, or, in older results, the greatest that was seen."""
    return max(memory["resident_mib"], memory.get("peak_resident_mib", 0.0))


def _limit(memory: dict[str, float]) -> str:
    limit = memory.get("data_limit_mib")
    return f"; it was not allowed to allocate more than {limit:,.0f} MiB" if limit else ""


def _queries(result: dict[str, Any]) -> str:
    own, paper = result["queries"], result["paper"]["queries"]
    lines = [
        [f"uniform, {e} m", f"{own['uniform'][e]['per_s']:,.0f} a second", f"{own['uniform'][e]['patches']:,}",
         f"{paper['uniform_per_s'][e]} a second" if e in paper["uniform_per_s"] else ""]
        for e in own["uniform"]
    ]  # fmt: skip
    view = own["view_15km_1px"]
    lines.append(["view of 15 km at 1 px", _ms(view["ms"]), f"{view['patches']:,.0f}",
                  f"{_ms(paper['view']['ms'])}, {paper['view']['patches']} patches"])  # fmt: skip
    return _table(f"| query of {own['samples_a_side']:,}² | | patches | paper |", lines)


def _traffic(own: dict[str, Any]) -> str:
    lines = [
        [f"{kind}, {name}", f"{found['bytes_a_frame']:,.0f}", f"{found['p99']:,.0f}", f"{found['patches']:.0f}"]
        for kind in ("flight", "rotation")
        for name, found in own[kind].items()
    ]
    return (
        _table("| 25 frames a second at 3 px | bytes a frame | 99th percentile | patches |", lines)
        + "\n\nPaper 2, figure 7: a few KB a frame, 70 patches."
    )


def _blend(result: dict[str, Any]) -> str:
    own, paper = result["blend"], result["paper"]["blend"]
    lines = [
        [kind, _ms(own[kind]["compiled_ms"]), _ms(own[kind]["opencl_ms"]) if "opencl_ms" in own[kind] else "",
         _ms(own[kind]["pack_ms"]), _ms(paper[f"{kind}_ms"])]
        for kind in ("bilinear", "bicubic")
    ]  # fmt: skip
    device = f" on {own['device']}" if own["device"] else ""
    return _table(f"| {own['samples']:,} samples | compiled loops | OpenCL{device} | packing | paper |", lines)


def _add(result: dict[str, Any]) -> str:
    own, warp = result["add"], result["gdal"]["warp"]
    lines = [
        ["raster: mipmaps, errors", _ms(own["raster_ms"])],
        ["patches, against those that are there", _ms(own["model_ms"])],
        ["index", _ms(own["index_ms"])],
        ["levels 0 to 4 of the ground, 1,025²", _ms(own["levels_0_to_4_ms"])],
        ["gdalwarp into the grid of 4k, bilinear / cubic",
         f"{_ms(warp['into_4k_bilinear_ms'])} / {_ms(warp['into_4k_cubic_ms'])}"],
        ["gdalwarp into one of 800 x 800 at 10 m, bilinear / cubic",
         f"{_ms(warp['into_10m_bilinear_ms'])} / {_ms(warp['into_10m_cubic_ms'])}"],
        ["virtual raster of two, 1,025² at a quarter by overviews",
         _ms(result["gdal"]["mosaic"]["read_1025_at_a_quarter_ms"])],
    ]  # fmt: skip
    return _table("| a turned grid of 512² at 10 m into a live one of 4,097² at 40 m | |", lines)
