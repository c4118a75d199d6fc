"""Tables of docs/renderer.md and rows of the README from the committed results (``bench.report``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

BEGIN: Final = "<!-- renderer: written by `python -m bench.report` -->"
END: Final = "<!-- end of renderer -->"
NAMES: Final = {
    "three-webgl": "three.js, WebGL, one mesh",
    "three-webgl-displacement": "three.js, WebGL, displaced",
    "three-webgpu": "three.js, WebGPU, one mesh",
}
# The kinds of views of ``esker bench cracks``, as the tables name them.
CRACK_KINDS: Final = {
    "trees": "random trees",
    "metres_from_the_ground": "metres from the ground",
    "a_metre_from_the_ground": "a metre from the ground",
}


def document(text: str, render: dict[str, Any], cracks: dict[str, Any], flight: dict[str, Any]) -> str:
    """The page with its tables renewed. Raises ValueError when the markers are missing."""
    if BEGIN not in text or END not in text:
        raise ValueError("docs/renderer.md has no place for the tables")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    parts = [_camera(name, figures) for name, figures in render["cameras"].items()]
    parts += [_growth(render["growth"]), _hidden(render["hidden"]), _cracks(cracks), _flight(flight)]
    head = f"{render['browser'].split('.')[0]}, {_adapter(render)}, {render['machine']['cores']} cores, load before "
    head = f"Chromium {head}{render['machine']['load_before']}; milliseconds of the GPU process a frame, still view."
    return f"{before}{BEGIN}\n\n{head}\n\n" + "\n\n".join(parts) + f"\n\n{END}{after}"


def rows(render: dict[str, Any], cracks: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Returns rows for the README: what was measured, its figure, and what it is compared with."""
    air = render["cameras"]["air"]
    ours = air["ours"]["lambert"]
    out = []
    best = air["verdict"].get("for_three")
    if best is not None:
        row = ours[best]
        out.append(
            (
                f"a frame of a 1025² map, software adapter, {row['pixels_off_percent']:.2f} % of pixels off by 8/255",
                f"{row['still_gpu_process_ms']:.0f} ms of processor time",
                f"three.js: {_ms(air['peers'].get('three-webgl', {}))}; CesiumJS at 2 px: "
                f"{_ms(air['peers'].get('cesium sse 2', {}))}",
            )
        )
    views = sum(cracks[kind]["views"] for kind in CRACK_KINDS if kind in cracks)
    pixels = sum(cracks[kind]["cracks"] for kind in CRACK_KINDS if kind in cracks)
    bad = sum(len(cracks[kind]["failures"]) for kind in CRACK_KINDS if kind in cracks)
    where = f"in {bad} of them: docs/renderer.md tells what is known" if bad else ""
    out.append((f"crack pixels in {views:,} random views", f"{pixels:,}", where))
    return out


def _adapter(render: dict[str, Any]) -> str:
    return str(next(iter(render["cameras"].values()))["ours"]["adapter"])


def _ms(figures: dict[str, Any]) -> str:
    return (
        f"{figures['still_gpu_process_ms']:.0f} ms" if "still_gpu_process_ms" in figures else "could not draw it here"
    )


def _table(head: tuple[str, ...], lines: Sequence[tuple[str, ...]]) -> str:
    rule = "|".join("---" for _ in head)
    return "\n".join([f"| {' | '.join(head)} |", f"|{rule}|", *(f"| {' | '.join(line)} |" for line in lines)])


def _camera(name: str, figures: dict[str, Any]) -> str:
    lines: list[tuple[str, ...]] = []
    for tau, row in figures["ours"]["lambert"].items():
        error = row["screen_error_px"]
        lines.append(
            (
                f"ours, lit, {tau.replace('tau', 'τ =')}",
                f"{row['still_gpu_process_ms']:.0f}",
                f"{row['triangles']:,}",
                f"{error['p95']:.2f}",
                f"{row['pixels_off_percent']:.2f} %",
            )
        )
    for tau, row in figures["ours"]["full"].items():
        label = f"ours with all of its light and materials, {tau.replace('tau', 'τ =')}"
        lines.append((label, f"{row['still_gpu_process_ms']:.0f}", f"{row['triangles']:,}", "", ""))
    for peer, row in figures.get("beside_cesium", {}).items():
        for shading in ("flat", "lambert"):
            label = f"ours, {'one colour' if shading == 'flat' else 'lit'}, for {_peer_name(peer)}, τ = {row['tau']:g}"
            cost, error = f"{row[shading]['still_gpu_process_ms']:.0f}", f"{row['screen_error_px']['p95']:.2f}"
            lines.append((label, cost, f"{row[shading]['triangles']:,}", error, ""))
    for peer, row in figures.get("peers", {}).items():
        if isinstance(row, dict):
            error = row.get("screen_error_px", {})
            shown = _peer_name(peer)
            cost = f"{row['still_gpu_process_ms']:.0f}" if "still_gpu_process_ms" in row else "could not draw it here"
            triangles = f"{row['triangles']:,}" if "triangles" in row else ""
            lines.append((shown, cost, triangles, f"{error['p95']:.2f}" if "p95" in error else "", ""))
    table = _table(("", "ms", "triangles", "error, 95th percentile, px", "pixels off by 8/255"), lines)
    said = ", ".join(_share(key, value) for key, value in figures.get("verdict", {}).items() if key != "for_three")
    return f"View `{name}`:\n\n{table}\n\nOurs beside the others: {said or 'none of them drew'}."


def _peer_name(peer: str) -> str:
    return NAMES.get(peer, peer.replace("cesium sse", "CesiumJS, error bound"))


def _share(key: str, value: Any) -> str:
    name = _peer_name(key.removeprefix("share_of_"))
    if isinstance(value, dict):
        lit = f"({value['lambert']:.2f} when ours is lit)"
        return f"{value['flat']:.2f} of {name}, at equal error and in one colour as it draws {lit}"
    return f"{value:.2f} of {name} with less than 0.1 % of pixels off"


def _growth(growth: dict[str, Any]) -> str:
    lines = [
        (
            side.replace("x", " × "),
            f"{row['still_gpu_process_ms']:.0f}",
            f"{row['patches']:,}",
            f"{row['select_ms']:.2f} ms",
        )
        for side, row in growth.items()
    ]
    return "The same view of ever larger terrains, τ = 1.5:\n\n" + _table(
        ("samples", "ms", "patches", "selection"), lines
    )


def _hidden(hidden: dict[str, Any]) -> str:
    lines = [
        (
            f"{row['patches']}",
            f"{row['drawn']}",
            f"{row['without_gpu_process_ms']:.0f}",
            f"{row['with_gpu_process_ms']:.0f}",
        )
        for row in hidden.values()
    ]
    return "Low views among ridges, with and without the search for hidden patches:\n\n" + _table(
        ("patches after the horizon", "drawn", "ms without", "ms with"), lines
    )


def _cracks(cracks: dict[str, Any]) -> str:
    kinds = [(name, cracks[kind]) for kind, name in CRACK_KINDS.items() if kind in cracks]
    lines = [
        (name, f"{k['views']:,}", f"{k['patches']:,}", f"{k['covered']:,}", f"{k['cracks']}", f"{k['nans']}")
        for name, k in kinds
    ]
    return "The crack test:\n\n" + _table(("views", "count", "patches", "ground pixels", "crack pixels", "NaN"), lines)


def _flight(flight: dict[str, Any]) -> str:
    device, heap = flight["device_mib"], flight["heap_mib"]
    return (
        f"A flight of {flight['seconds'] / 60:.0f} minutes, {flight['frames']} frames over {flight['metres']:,.0f} m "
        f"of ground: at most {device['largest']} MiB on the device and {heap['largest']} MiB of heap; in its "
        f"second half {device['second_half']:+} and {heap['second_half']:+} MiB. {flight['tiles_made_a_frame']} tiles "
        f"were made a frame. At rest {flight['at_rest']['differing']} pixels differed from frame to frame."
    )
