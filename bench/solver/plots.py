"""Pictures of docs/solver.md from committed results alone: ``python -m bench.solver.plots``.

Reads bench/results/solve.json and solve-maps.npz, writes docs/pictures/solver-*.svg|png. Transparent, in colours that
read on light and dark pages. Needs matplotlib (``pip install 'esker[bench]'``).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench import report

PICTURES = report.ROOT / "docs" / "pictures"
MAPS = report.RESULTS / "solve-maps.npz"

INK = "#7d8590"
"""Text and axes: enough contrast on white and on near-black."""
BLUE, ORANGE, GREEN, RED, VIOLET = "#3b82c4", "#d9822b", "#3f9e6d", "#cc4b5a", "#8d6bc0"
STYLE: Any = {
    "font.size": 9,
    "font.family": "DejaVu Sans",
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": INK,
    "grid.alpha": 0.22,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "savefig.transparent": True,
    "svg.hashsalt": "esker",
}
NAMES = {
    "pyamg_ruge_stuben": "PyAMG, Ruge–Stüben + CG",
    "pyamg_smoothed_aggregation": "PyAMG, smoothed aggregation + CG",
    "superlu": "SuperLU (SciPy)",
    "cholmod": "CHOLMOD (cvxopt)",
}
PEER_COLOURS = {
    "pyamg_ruge_stuben": ORANGE,
    "pyamg_smoothed_aggregation": RED,
    "superlu": VIOLET,
    "cholmod": GREEN,
}


def _figure(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> Any:
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams.update(mpl.rcParamsDefault)
    mpl.rcParams.update(STYLE)
    from matplotlib import pyplot

    return pyplot.subplots(rows, columns, figsize=(width, height), layout="constrained", **options)


def _save(figure: Any, path: Path) -> None:
    from matplotlib import pyplot

    options: dict[str, Any] = {"metadata": {"Date": None}} if path.suffix == ".svg" else {"dpi": 115}
    figure.savefig(path, **options)
    pyplot.close(figure)


def convergence(accuracy: dict[str, Any], path: Path) -> None:
    """Left: error after each cycle, every scene and size. Right: asymptotic factors over the size."""
    figure, (left, right) = _figure(9.2, 3.9, 1, 2, width_ratios=(1.25, 1))
    sizes = sorted({int(n) for rows in accuracy.values() for n in rows})
    shades = {n: _shade(k / max(len(sizes) - 1, 1)) for k, n in enumerate(sizes)}
    for rows in accuracy.values():
        for n, row in rows.items():
            curve = row["curve_of_relief"]
            left.semilogy(range(len(curve)), curve, color=shades[int(n)], lw=0.9, alpha=0.75)
    cycles = np.arange(0, 13)
    left.semilogy(cycles, 0.4**cycles, color=INK, lw=1, ls=":")
    left.text(6.0, 1.25 * 0.4**6.0, "0.4 a cycle", ha="left", va="bottom", fontsize=8)
    left.axhline(1e-3, color=INK, lw=0.8, ls="--")
    left.text(12.1, 1.15e-3, "preview: 10⁻³", ha="right", fontsize=8)
    left.axhline(2e-6, color=INK, lw=0.8, ls="--")
    left.text(12.1, 2.3e-6, "float32 floor asked for: 2·10⁻⁶", ha="right", fontsize=8)
    for n, shade in shades.items():
        left.plot([], [], color=shade, label=f"{n}²")
    left.legend(loc="lower left")
    left.set(xlabel="cycles after full multigrid", ylabel="largest error / relief", xlim=(0, 12.2), ylim=(3e-8, 1))
    left.set_title("Heights, every scene of the gallery", loc="left")
    for rows in accuracy.values():
        n = sorted(int(k) for k in rows)
        for key, colour in (("height_factor", BLUE), ("gradient_factor", ORANGE)):
            right.plot(n, [rows[str(k)][key] for k in n], "o-", color=colour, lw=0.8, ms=3, alpha=0.6)
    right.plot([], [], "o-", color=BLUE, ms=3, label="heights")
    right.plot([], [], "o-", color=ORANGE, ms=3, label="gradients")
    right.axhline(0.4, color=INK, lw=0.8, ls="--")
    right.text(sizes[0], 0.408, "bound: 0.4", fontsize=8)
    right.set_xscale("log", base=2)
    right.set_xticks(sizes, [f"{n}²" for n in sizes])
    right.set(ylim=(0, 0.5), xlabel="samples", ylabel="error after a cycle / before")
    right.set_title("Convergence factor, one line a scene", loc="left")
    right.legend(loc="lower right")
    for axes in (left, right):
        axes.grid(True, which="major")
    _save(figure, path)


def _shade(t: float) -> tuple[float, ...]:
    """A ramp from light orange to deep blue that reads on white and black."""
    a, b = np.array([0.93, 0.60, 0.25]), np.array([0.20, 0.42, 0.80])
    return tuple(float(v) for v in (1 - t) * a + t * b)


def hillshade(heights: NDArray[np.float32], spacing: float) -> NDArray[np.float64]:
    """Soft light from the north-west on (n, n) heights, 0..1: a low sun and the sky."""
    dy, dx = np.gradient(heights.astype(np.float64), spacing)
    normal = np.stack([-dx, -dy, np.ones_like(dx)])
    normal /= np.linalg.norm(normal, axis=0)
    sun = np.array([-1.0, 1.0, 1.4]) / np.linalg.norm([-1.0, 1.0, 1.4])
    return np.asarray(0.68 * np.clip(np.tensordot(sun, normal, 1), 0, 1) + 0.27 * normal[2])


def _power(value: float) -> str:
    """2·10⁻³ for 0.002."""
    digits, exponent = f"{value:.0e}".split("e")
    return f"{digits}·10{str(int(exponent)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def errors(maps: dict[str, NDArray[np.float32]], accuracy: dict[str, Any], size_m: float, path: Path) -> None:
    """Two scenes: the ground, the error of the finest preview and of the settled ground."""
    from matplotlib.colors import LogNorm

    scenes = sorted({name.split(".")[0] for name in maps})
    figure, grid = _figure(9.2, 3.05 * len(scenes), len(scenes), 3, squeeze=False)
    for axes, scene in zip(grid, scenes, strict=True):
        heights = maps[f"{scene}.heights"]
        relief = accuracy[scene]["1025"]["relief_m"]
        shade = hillshade(heights, size_m / len(heights))
        axes[0].imshow(shade, cmap="gray", origin="lower", vmin=0, vmax=1, interpolation="bilinear")
        axes[0].set_title(f"{scene}, relief {relief:.0f} m", loc="left")
        for axis, kind, title in ((axes[1], "preview", "finest preview"), (axes[2], "settled", "settled")):
            share = np.maximum(maps[f"{scene}.{kind}"] / relief, 1e-9)
            picture = axis.imshow(share, cmap="magma", origin="lower", norm=LogNorm(1e-8, 1e-2))
            axis.set_title(f"{title}: error at most {_power(share.max())}", loc="left")
        for axis in axes:
            axis.set(xticks=[], yticks=[])
            axis.spines[:].set_visible(True)
    bar = figure.colorbar(picture, ax=grid, shrink=0.7, pad=0.015)
    bar.set_label("largest error of a 4 × 4 block / relief")
    bar.outline.set_edgecolor(INK)
    _save(figure, path)


def roofline(threads: dict[str, Any], scene: str, path: Path) -> None:
    """Kernels of the finest level under the roofs of copy bandwidth and multiply-add peak, by threads."""
    figure, grid = _figure(9.2, 4.9, 1, len(threads), squeeze=False, sharey=True)
    for axis, (count, run) in zip(grid[0], sorted(threads.items()), strict=True):
        rows = run["scenes"][scene]
        copy, peak = run["copy_gb_per_s"], run["peak_gflop_per_s"]
        x = np.geomspace(0.1, 30, 200)
        axis.loglog(x, np.minimum(x * copy, peak), color=INK, lw=1.4)
        axis.text(0.11, 0.2 * copy, f"copy\n{copy:.0f} GB/s", fontsize=8, va="bottom")
        axis.text(29, peak * 1.08, f"multiply-add {peak:.0f} GFLOP/s", ha="right", fontsize=8, va="bottom")
        shown = [n for n in ("1025", "4097") if n in rows] or [max(rows, key=int)]
        for size in shown:
            for name, figures in rows[size]["kernels"].items():
                colour, marker = _kernel_look(name)
                share = 100 * figures["share_of_copy"]
                filled = size == shown[-1]
                label = f"{name}: {share:.0f} % of copy" if filled else None
                where = figures["flop_per_byte"], figures["gflop_per_s"]
                face = colour if filled else "none"
                axis.plot(*where, marker, color=colour, mfc=face, ms=6, mew=1.2, ls="", label=label)
        axis.set(xlabel="flop / byte, both by model", xlim=(0.1, 30), ylim=(3, 2.2 * peak))
        sizes = f"filled {shown[-1]}²" + (f", hollow {shown[0]}²" if len(shown) > 1 else "")
        axis.set_title(f"{count} thread{'s' if count != '1' else ''} ({sizes})", loc="left")
        axis.grid(True, which="major")
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncol=2, fontsize=7)
    grid[0][0].set_ylabel("GFLOP/s")
    _save(figure, path)


def _kernel_look(name: str) -> tuple[str, str]:
    """Colour by the system that a kernel works on, marker by what it does."""
    colours = {"gradient": ORANGE, "height": BLUE}
    markers = {"first visit": "^", "visit": "o", "bottom": "v", "coarsen": "s", "divergence": "D", "change": "P"}
    marker = next(m for what, m in markers.items() if name.endswith(what))
    return colours.get(name.split(" ")[0], GREEN), marker


def peers(result: dict[str, Any], threads: dict[str, Any], path: Path) -> None:
    """Time to 10^-3 of the relief and to rest over the number of unknowns, set-up included."""
    figure, grid = _figure(9.2, 4.6, 1, 2, sharey=True)
    levels = {int(n): row for n, row in result["levels"].items()}
    sizes = sorted(levels)
    for axis, target, ours, title in (
        (grid[0], "preview", "heights_to_target", "to 10⁻³ of the relief"),
        (grid[1], "rest", "heights_to_rest", "to rest: a quarter of a quantisation step"),
    ):
        for name, label in NAMES.items():
            points = [(n, _peer_ms(levels[n][name], target)) for n in sizes]
            done = [(n, ms) for n, ms in points if ms is not None]
            axis.plot(
                *zip(*done, strict=True), "o-", color=PEER_COLOURS[name], lw=1.2, ms=4, label=label
            ) if done else None
        for count, style in (("1", "--"), ("2", "-")):
            rows = threads[count]["scenes"][result["scene"]]
            ms = [rows[str(n)][ours]["ms"]["least"] + rows[str(n)]["coarsen_heights_ms"]["least"] for n in sizes]
            name = f"Esker, {count} thread{'s' if count != '1' else ''}"
            axis.plot(sizes, ms, f"s{style}", color=BLUE, lw=1.8, ms=4, label=name)
        axis.set_xscale("log", base=2)
        axis.set_yscale("log")
        axis.set_xticks(sizes, [f"{n}²" for n in sizes])
        axis.set_title(f"One height channel {title}", loc="left")
        axis.grid(True, which="major")
    grid[0].set_ylabel("milliseconds, set-up and solve")
    failed = [f"{NAMES[k]} at {n}²: {levels[n][k]['failed']}" for n in sizes for k in NAMES if "failed" in levels[n][k]]
    if failed:
        grid[1].text(0.98, 0.02, "\n".join(failed), transform=grid[1].transAxes, ha="right", va="bottom", fontsize=6.5)
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncol=3)
    _save(figure, path)


def _peer_ms(figures: dict[str, Any], target: str) -> float | None:
    """Set-up and solve, or None where the peer did not get there."""
    row = figures.get("solve", {}).get(target)
    return None if row is None else float(figures["set_up_ms"] + row["ms"])


def draw(result: dict[str, Any], maps: dict[str, NDArray[np.float32]], folder: Path) -> list[Path]:
    """All pictures of one result; the files written."""
    from esker.contract import DEFAULT_SIZE_M

    out = [folder / f"solver-{name}" for name in ("convergence.svg", "error.png", "roofline.svg", "peers.svg")]
    convergence(result["accuracy"], out[0])
    errors(maps, result["accuracy"], DEFAULT_SIZE_M, out[1])
    roofline(result["threads"], result["peers"]["scene"], out[2])
    peers(result["peers"], result["threads"], out[3])
    return out


def main(_argv: list[str]) -> int:
    """Draw from the committed results."""
    with np.load(MAPS) as file:
        maps = {name: file[name].astype(np.float32) for name in file.files}
    for path in draw(report.result("solve"), maps, PICTURES):
        print(path.relative_to(report.ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
