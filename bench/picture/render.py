"""The renderer beside three.js and CesiumJS: the same 1025² map, camera and viewport, one run, one Chromium.

What is measured is the processor time of the browser's GPU process in a frame, the least of some runs: on a machine
without a GPU all drawing happens there. Each peer is compared in its own shading: ``lambert``, one sun and one ambient
term by pixel, is that of three.js; ``flat``, one colour, that of CesiumJS, whose terrain has no normals here; ``full``
is the picture that people see, which no peer draws. The plain ones end with the map, as the peers do: ground finer than
it is made in the full one alone.

Pixels off by more than 8/255 are counted against a dense reference: every triangle of the grid with the same plain
shading and gradients. Beside CesiumJS our error bound is the one whose 95th percentile of screen errors, at the same
samples inside of the picture, is as small as what was measured of CesiumJS. `npm ci` in bench/peers installs the peers.
"""

from __future__ import annotations

import argparse
import base64
import io
import json
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Page

from bench.picture import _browser, _render_ground
from bench.room import _serving
from esker.version import VERSION

PEERS: Final = _browser.ROOT / "bench" / "peers"
WIDTH, HEIGHT = 1024, 768
SUN: Final = (-0.5, -0.2, 0.6)
# Inside of the map: from outside our block would show its walls, which no peer has.
CAMERAS: Final = {
    "air": {"eye": (200.0, 200.0, 1250.0), "target": (1800.0, 1800.0, 240.0)},
    "ground": {"eye": (1500.0, 1500.0, 130.0), "target": (2600.0, 2100.0, 300.0)},
}
LENS: Final = {"fovDeg": 50, "near": 4, "far": 20000, "stepM": 3}
TAUS: Final = (0.5, 0.7, 1.0, 1.5, 3.0, 6.0, 12.0)
THREE: Final = ("three-webgl", "three-webgl-displacement", "three-webgpu")
SCREEN_SPACE_ERRORS: Final = (1.0, 2.0, 4.0)
GROWTH: Final = (4, 6, 8, 10)
RIDGES: Final = (5, 6, 8, 9)
"""Seeds of the low views in which hidden patches are looked for."""
OFF: Final = 8


class Meter:
    """Processor time of the GPU process for frames that a page draws."""

    def __init__(self, page: Page, name: str, frames: int, runs: int) -> None:
        self.page, self.name, self.frames, self.runs = page, name, frames, runs
        self.process = _browser.gpu_process()

    def measure(self, moving: bool) -> tuple[float, Any]:
        """Least milliseconds a frame over the runs, and what the page said of the last. A moving camera, with which
        nobody is compared, has two runs less."""
        best, said = float("inf"), None
        for _ in range(max(1, self.runs - 2 * moving)):
            before = _browser.cpu_ms(self.process)
            said = self.page.evaluate(f"([n, m]) => {self.name}.frames(n, m)", [self.frames, moving])
            best = min(best, (_browser.cpu_ms(self.process) - before) / self.frames)
        return round(best, 1), said


def picture(url: str) -> NDArray[np.int16]:
    """(height, width, 3) of a PNG data URL."""
    data = base64.b64decode(url.split(",", 1)[1])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=np.int16)


def off(a: NDArray[np.int16], b: NDArray[np.int16]) -> float:
    """Share of pixels of which a channel differs by more than ``OFF``, per cent."""
    return round(100 * float((np.abs(a - b).max(axis=2) > OFF).mean()), 4)


def _tell(*words: object) -> None:
    """Says on standard error how far a long run is."""
    sys.stderr.write(" ".join(str(word) for word in words) + "\n")
    sys.stderr.flush()


def _rounded(error: dict[str, Any]) -> dict[str, Any]:
    return {k: v if k == "places" else round(float(v), 3) for k, v in error.items()}


def ours(browser: Browser, base: str, ground: dict[str, Any], args: argparse.Namespace) -> dict[str, Any]:
    """Plain at several error bounds, each with its errors against the dense reference, and the full picture."""
    out: dict[str, Any] = {}
    with _browser.page(browser, f"{base}/dev/bench.html", "globalThis.bench !== undefined") as page:
        page.evaluate("g => bench.load(g)", ground)
        reference = picture(page.evaluate("() => bench.reference()"))
        for shading in ("lambert", "full"):
            out["adapter"] = page.evaluate("s => bench.open(s)", shading)["description"]
            for tau in args.tau if shading == "lambert" else (1.5,):
                row = _still_and_moving(page, tau, args)
                row["screen_error_px"] = _rounded(_screen_error(page, tau, ground))
                if shading == "lambert":
                    page.evaluate("t => bench.settle(t, 'fine')", tau)
                    row["pixels_off_percent"] = off(picture(page.evaluate("() => bench.picture()")), reference)
                out.setdefault(shading, {})[f"tau {tau:g}"] = row
                _tell(shading, f"tau {tau:g}", row)
    return out


def _still_and_moving(page: Page, tau: float, args: argparse.Namespace) -> dict[str, Any]:
    stats = page.evaluate("t => bench.settle(t, 'fine')", tau)
    meter = Meter(page, "bench", args.frames, args.runs)
    still, _ = meter.measure(False)
    moving, said = meter.measure(True)
    return {
        "still_gpu_process_ms": still,
        "moving_gpu_process_ms": moving,
        "host_ms": round(said["host"], 2),
        "select_ms": round(said["select"], 2),
        "patches": stats["patches"],
        "triangles": stats["triangles"],
    }


def _screen_error(page: Page, tau: float, ground: dict[str, Any]) -> dict[str, Any]:
    error: dict[str, Any] = page.evaluate("([t, places]) => bench.screenError(t, places)", [tau, ground["places"]])
    return error


def _bound_for(page: Page, error: float, ground: dict[str, Any]) -> float:
    """The coarsest error bound (to 4 %) whose 95th percentile of screen errors is at most ``error`` pixels."""
    low, high = 0.25, 64.0
    while high > 1.04 * low:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if _screen_error(page, middle, ground)["p95"] <= error else (low, middle)
    return round(low, 2)


def beside_cesium(
    browser: Browser, base: str, ground: dict[str, Any], peers_: dict[str, Any], args: argparse.Namespace
) -> dict[str, Any]:
    """Ours at the error of each row of CesiumJS: ``flat`` as it draws, and ``lambert``."""
    rows = {k: v for k, v in peers_.items() if k.startswith("cesium") and "still_gpu_process_ms" in v}
    out: dict[str, Any] = {}
    with _browser.page(browser, f"{base}/dev/bench.html", "globalThis.bench !== undefined") as page:
        page.evaluate("g => bench.load(g)", ground)
        for shading in ("flat", "lambert") if rows else ():
            page.evaluate("s => bench.open(s)", shading)
            for name, figures in rows.items():
                beside = out.setdefault(name, {})
                if "tau" not in beside:
                    beside["tau"] = _bound_for(page, figures["screen_error_px"]["p95"], ground)
                    beside["screen_error_px"] = _rounded(_screen_error(page, beside["tau"], ground))
                beside[shading] = _still_and_moving(page, beside["tau"], args)
                _tell(name, shading, beside)
    return out


def growth(browser: Browser, base: str, ground: dict[str, Any], args: argparse.Namespace) -> dict[str, Any]:
    """Measures one view of terrains of ever more samples, plain shading, τ = 1.5."""
    out: dict[str, Any] = {}
    with _browser.page(browser, f"{base}/dev/bench.html", "globalThis.bench !== undefined") as page:
        page.evaluate("g => bench.load(g)", ground)
        page.evaluate("() => bench.open('lambert')")
        for level in GROWTH:
            page.evaluate("l => bench.grow(l)", level)
            stats = page.evaluate("() => bench.settle(1.5, 'fine')")
            still, said = Meter(page, "bench", args.frames, args.runs).measure(False)
            side = 64 * 2**level + 1
            _tell("growth", side, said)
            out[f"{side}x{side}"] = {
                "still_gpu_process_ms": still,
                "select_ms": round(said["select"], 2),
                "patches": stats["patches"],
                "triangles": stats["triangles"],
            }
    return out


def hidden(browser: Browser, base: str, args: argparse.Namespace) -> dict[str, Any]:
    """Low views among ridges, with and without the search for hidden patches on the device; plain shading, τ = 1.5."""
    out: dict[str, Any] = {}
    with _browser.page(browser, f"{base}/dev/bench.html", "globalThis.bench !== undefined") as page:
        size = {"width": WIDTH, "height": HEIGHT, "shading": "lambert"}
        page.evaluate("size => bench.ridges.open(size)", size)
        process = _browser.gpu_process()
        for seed in RIDGES:
            page.evaluate("seed => bench.ridges.low(seed)", seed)
            best = {"never": float("inf"), "always": float("inf")}
            said: dict[str, Any] = {}
            for _ in range(args.runs):
                for search in best:
                    # What the search remembers is of the same view: a picture before those that count.
                    said = page.evaluate("search => bench.ridges.frames(2, search)", search)
                    before = _browser.cpu_ms(process)
                    said = page.evaluate("([n, search]) => bench.ridges.frames(n, search)", [args.frames, search])
                    best[search] = min(best[search], (_browser.cpu_ms(process) - before) / args.frames)
            out[f"view {seed}"] = {
                "patches": said["patches"],
                "drawn": said["drawn"],
                "without_gpu_process_ms": round(best["never"], 1),
                "with_gpu_process_ms": round(best["always"], 1),
            }
            _tell("hidden", seed, out[f"view {seed}"])
    return out


def peer(browser: Browser, base: str, kind: str, ground: dict[str, Any], args: argparse.Namespace) -> dict[str, Any]:
    """One peer in a page of its own."""
    with _browser.page(browser, f"{base}/index.html", "globalThis.peer !== undefined") as page:
        facts: dict[str, Any] = page.evaluate("([k, g]) => peer.open(k, g)", [kind, ground])
        meter = Meter(page, "peer", args.frames, args.runs)
        page.evaluate("() => peer.frames(2, false)")
        facts["still_gpu_process_ms"], _ = meter.measure(False)
        facts["moving_gpu_process_ms"], _ = meter.measure(True)
    if "screen_error_px" in facts:
        facts["screen_error_px"] = _rounded(facts["screen_error_px"])
    return facts


def peers(browser: Browser, base: str, ground: dict[str, Any], args: argparse.Namespace) -> dict[str, Any]:
    """three.js, and CesiumJS at several of its error bounds; ``failed`` says why one has no figures."""
    if not (PEERS / "node_modules" / "three").exists():
        return {"failed": "not installed: run `npm ci` in bench/peers"}
    out: dict[str, Any] = {}
    kinds: list[tuple[str, str, dict[str, Any]]] = [(kind, kind, {}) for kind in THREE]
    kinds += [(f"cesium sse {sse:g}", "cesium", {"sse": sse}) for sse in SCREEN_SPACE_ERRORS]
    for name, kind, more in kinds:
        try:
            out[name] = peer(browser, base, kind, ground | more, args)
        except Exception as error:
            # Whatever a foreign renderer raises is a result: it could not draw this here.
            out[name] = {"failed": str(error).splitlines()[0][:300]}
        _tell(name, out[name])
    return out


def verdict(ours_: dict[str, Any], peers_: dict[str, Any], beside: dict[str, Any]) -> dict[str, Any]:
    """Our cheapest picture with less than 0.1 % of pixels off against three.js; against CesiumJS at equal error."""
    out: dict[str, Any] = {}
    good = {t: r for t, r in ours_["lambert"].items() if r["pixels_off_percent"] < 0.1}
    if good:
        tau, row = min(good.items(), key=lambda item: item[1]["still_gpu_process_ms"])
        out["for_three"] = tau
        for name in THREE:
            if "still_gpu_process_ms" in peers_.get(name, {}):
                out[f"share_of_{name}"] = round(row["still_gpu_process_ms"] / peers_[name]["still_gpu_process_ms"], 3)
    for name, row in beside.items():
        theirs = peers_[name]["still_gpu_process_ms"]
        shares = {s: round(row[s]["still_gpu_process_ms"] / theirs, 3) for s in ("flat", "lambert")}
        out[f"share_of_{name}"] = {"at": f"tau {row['tau']:g}"} | shares
    return out


@contextmanager
def stand() -> Iterator[tuple[Browser, str, str, str]]:
    """Browser, address of our sources, of the peers, and of the heights."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="esker-bench-")))
        (folder / "heights.f32").write_bytes(_render_ground.heights().astype("<f4").tobytes())
        data = stack.enter_context(_browser.files(folder))
        others = stack.enter_context(_browser.files(PEERS))
        sources = stack.enter_context(_browser.pages())
        yield stack.enter_context(_browser.chromium()), sources, others, f"{data}/heights.f32"


def main(argv: list[str]) -> int:
    """``esker bench render [--json] [--frames N] [--runs N] [--tau PX ...] [--camera NAME ...] [--no-peers] ...``."""
    parser = argparse.ArgumentParser(prog="esker bench render", description=__doc__)
    parser.add_argument("--frames", type=int, default=3, help="frames a run")
    parser.add_argument("--runs", type=int, default=3, help="runs, of which the least counts")
    parser.add_argument("--tau", type=float, action="append", help=f"error bounds, pixels (default {TAUS})")
    parser.add_argument("--camera", action="append", choices=list(CAMERAS), help="default: all")
    parser.add_argument("--no-peers", action="store_true")
    parser.add_argument("--no-growth", action="store_true")
    parser.add_argument("--no-hidden", action="store_true")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    args = parser.parse_args(argv)
    args.tau = args.tau or TAUS
    result: dict[str, Any] = {"bench": "render", "version": VERSION, "machine": _serving.machine(), "cameras": {}}
    result |= {"viewport": [WIDTH, HEIGHT], "map": f"{_render_ground.SIDE}x{_render_ground.SIDE}"}
    with stand() as (browser, sources, others, url):
        result["browser"] = browser.version
        common = {"url": url, "side": _render_ground.SIDE, "sizeM": _render_ground.SIZE_M, "sun": SUN}
        common |= {"width": WIDTH, "height": HEIGHT}
        for name in args.camera or CAMERAS:
            camera = CAMERAS[name] | LENS
            places = _render_ground.places(camera, WIDTH, HEIGHT, _render_ground.heights())
            ground = common | {"camera": camera, "places": places}
            row: dict[str, Any] = {"ours": ours(browser, sources, ground, args)}
            if not args.no_peers:
                row["peers"] = peers(browser, others, ground, args)
                row["beside_cesium"] = beside_cesium(browser, sources, ground, row["peers"], args)
                row["verdict"] = verdict(row["ours"], row["peers"], row["beside_cesium"])
            result["cameras"][name] = row
        if not args.no_growth:
            result["growth"] = growth(browser, sources, common | {"camera": CAMERAS["ground"] | LENS}, args)
        if not args.no_hidden:
            result["hidden"] = hidden(browser, sources, args)
    sys.stdout.write(json.dumps(result, indent=1) + "\n" if args.json else _lines(result))
    return 0


def _lines(value: Any, path: str = "") -> str:
    if isinstance(value, dict):
        return "".join(_lines(v, f"{path}.{k}" if path else str(k)) for k, v in value.items())
    return f"{path}: {value}\n"
