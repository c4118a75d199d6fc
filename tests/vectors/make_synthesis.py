"""Writes ``synthesis.json``: what the rule of synthesis makes of given samples, for every language that has one.

Run ``python tests/vectors/make_synthesis.py`` after a change of the rule or its constants. Arrays are rows from the
south, flattened. ``hashes``: H(level, stream, i, j) of a seed. ``sites``: settings, channels, and the guide of levels
0..solved as integers in quanta (size / (64 * 2^level) / 256). ``steps``: one subdivision of a parent window (r0, r1,
c0, c1, half open, global indices), state given as four words a sample. ``places``: windows of any level, made from the
root. Expected: the guide and the base, metres (float32; base: of a terrain in which nothing is refined above the solved
levels), and the state's words; d is word 0 as float32. Compare d and heights within ``metres`` of the cell (or float32
rounding of the heights), and halves within ``unorm``.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.synthesis import hash as noise
from esker.synthesis.interpolate import Window
from esker.synthesis.site import Site, tile_window
from esker.synthesis.state import pack, unpack
from esker.synthesis.subdivide import Samples, chain, interpolated, root, subdivide

PATH = Path(__file__).with_name("synthesis.json")
METRES = 1e-3
UNORM = 2
SIZE_M = 4096.0


def quanta(level: int, size_m: float, periodic: bool) -> NDArray[np.int32]:
    """A hill, a valley and a shore; or, periodic, waves that fit the domain."""
    n = grid.samples(level)
    y, x = np.mgrid[0:n, 0:n] / (n - 1)
    if periodic:
        z = 160 * np.sin(2 * np.pi * (x + 0.2)) * np.cos(4 * np.pi * y) + 90 * np.sin(6 * np.pi * x)
        z[:, -1], z[-1, :] = z[:, 0], z[0, :]
    else:
        z = 700 * np.exp(-(((x - 0.45) / 0.2) ** 2) - ((y - 0.4) / 0.15) ** 2) - 60 * np.cos(7 * x + 3 * y) + 120 * y
    q = grid.quantum(level, size_m)
    out: NDArray[np.int32] = np.rint(z * (size_m / SIZE_M) / q).astype(np.int32)
    return out


def fields(name: str, **changes: Any) -> dict[str, Any]:
    """A site as JSON has it."""
    out: dict[str, Any] = {
        "name": name, "size_m": SIZE_M, "seed": 1, "detail": 1.0, "rule": "landscape", "look": "natural",
        "sea_level_m": None, "cyclic": False, "place": None, "ground": None, "solved": 0, "channels": {},
        "erosion": 0.0, "erosion_scale": 10.0, "hold": 1.0,
    }  # fmt: skip
    return out | changes


def strokes(seed: int) -> dict[str, list[list[float]]]:
    """Channels as paint would leave them, on grids of several sizes."""
    rng = np.random.default_rng(seed)
    out = {}
    for k, name in enumerate(("amplitude", "roughness", "snow", "grass", "forest", "wetness")):
        side = (2, 3, 5, 9, 17, 5)[k]
        low, high = {"amplitude": (-2.0, 8.0), "roughness": (0.0, 1.0)}.get(name, (-1.0, 1.0))
        out[name] = np.round(rng.uniform(low, high, (side, side)) * 1024).astype(int) / 1024
    return {name: values.tolist() for name, values in out.items()}


def survey(seed: int) -> dict[str, list[list[float]]]:
    """Elevation data of cells of 64 m to one of 0.25 m, and none in a corner."""
    levels = np.random.default_rng(seed).uniform(0.0, 8.0, (9, 9))
    levels[:4, :4] = -1.0
    return {"survey": (np.round(levels * 256).astype(int) / 256).tolist()}


def fixed(seed: int) -> dict[str, list[list[float]]]:
    """Paint of gullies, and distances from strokes that are drawn anywhere."""
    rng = np.random.default_rng(seed)
    far, erosion = rng.uniform(0.0, 1.0, (129, 129)), rng.uniform(-1.0, 1.0, (9, 9))
    return {
        "erosion": (np.round(erosion * 1024).astype(int) / 1024).tolist(),
        "far": (np.round(far * 1024).astype(int) / 1024).tolist(),
    }


SITES = (
    fields("hill", sea_level_m=5.0, solved=1),
    fields("painted", seed=4294967295, detail=2.5, look="alpine", channels=strokes(5)),
    fields("smooth", rule="smooth", sea_level_m=-20.0, channels=strokes(6)),
    fields("plain", rule="plain", look="desert", channels=strokes(7)),
    fields("cyclic", cyclic=True, seed=77, channels=strokes(8)),
    fields(
        "surveyed",
        seed=9,
        sea_level_m=8.0,
        place={"lat_deg": 46.85, "lon_deg": -121.76},
        channels=strokes(9) | survey(9),
    ),
    fields("laid", seed=11, rule="plain", ground=[200.0, 1400.0]),
    fields("gullies", seed=21, solved=1, erosion=1.0, erosion_scale=9.0, hold=0.75, channels=fixed(21)),
    fields("worn", seed=22, erosion=1.75, channels=strokes(22) | survey(22) | {"erosion": fixed(22)["erosion"]}),
    fields("rilled", cyclic=True, seed=23, detail=0.0, erosion=0.5, erosion_scale=12.0),
    fields("wide", size_m=65536.0, seed=123456789, look="paper"),
)


def site_of(data: dict[str, Any]) -> Site:
    """The site that an entry of ``sites`` describes."""
    size = data["size_m"]
    guides = tuple(
        (np.asarray(q, dtype=np.float64).reshape(grid.samples(level), -1) * grid.quantum(level, size)).astype(
            np.float32
        )
        for level, q in enumerate(data["quanta"])
    )
    channels = {name: np.asarray(values, dtype=np.float32) for name, values in data["channels"].items()}
    return Site(
        size, data["seed"], guides, channels, data["detail"], data["rule"], data["look"], data["sea_level_m"],
        data["cyclic"], None if data["place"] is None else data["place"]["lat_deg"],
        None if data["ground"] is None else tuple(data["ground"]),
        erosion=data["erosion"], erosion_scale=data["erosion_scale"], hold=data["hold"],
    )  # fmt: skip


def hashes() -> list[dict[str, int]]:
    """Seeds, levels and indices at their ends."""
    out = []
    for seed, level, stream, i, j in (
        (0, 0, 0, 0, 0), (1, 0, 0, 0, 0), (1, 0, 1, 0, 0), (1, 0, 0, 1, 0), (1, 0, 0, 0, 1), (1, 3, 2, -2, -1),
        (1, 17, 3, 8388610, 8388608), (4294967295, 17, 3, -2, 8388610), (2654435769, 12, 1, 262143, 131072),
    ):  # fmt: skip
        word = noise.hashed(seed, level, stream, np.array([j], dtype=np.int64), np.array([i], dtype=np.int64))
        out.append({"seed": seed, "level": level, "stream": stream, "i": i, "j": j, "hash": int(word[0, 0])})
    return out


def _numbers(z: NDArray[Any]) -> list[float]:
    return [float(f"{v:.9g}") for v in z.ravel()]


def _corners(window: Window) -> list[int]:
    return [window.r0, window.r1, window.c0, window.c1]


def _expected(samples: Samples) -> dict[str, Any]:
    return {"guide": _numbers(samples.guide), "state": pack(samples.state).ravel().tolist()}


def step(site: Site, name: str, window: Window, seed: int) -> dict[str, Any]:
    """One subdivision of arbitrary samples, with every channel away from its ends."""
    rng = np.random.default_rng(seed)
    at = window.parent()
    rows, cols = at.shape
    s = site.spacing(at.level)
    walk = np.cumsum(np.cumsum(rng.normal(size=(rows, cols)), axis=0), axis=1)
    guide = (100 + s * 0.15 * walk).astype(np.float32)
    words = rng.integers(0, 2**32, (rows, cols, 4), dtype=np.uint32)
    words[..., 0] = (s * rng.uniform(-0.2, 0.2, (rows, cols))).astype(np.float32).view(np.uint32)
    parent = Samples(at, guide.astype(np.float64), unpack(words))
    given = {"window": _corners(at), "guide": _numbers(guide), "state": words.ravel().tolist()}
    child = _expected(subdivide(parent, window, site))
    return {"site": name, "level": window.level, "parent": given, "window": _corners(window), **child}


def places(site: Site, name: str) -> list[dict[str, Any]]:
    """Windows on the edges, corners and middle of the domain on many levels, each made by itself."""
    out = []
    for level in (0, 1, 2, 3, 5, 8, 11, 13, 15, 17):
        n = grid.cells(level)
        for r, c in ((-2, -2), (n - 1, n // 3), (int(0.37 * n), int(0.52 * n))):
            window = Window(level, r, r + 4, c, c + 4)
            first, *rest = chain(window)
            samples = root(site, first)
            base = samples.guide
            for w in rest:
                made = subdivide(samples, w, site)
                solved = w.level <= site.solved
                base = made.guide if solved else interpolated(base, samples.window, w, site.rule)
                samples = made
            out.append({"site": name, "level": level, "window": _corners(window), **_expected(samples),
                        "base": _numbers(base)})  # fmt: skip
    return out


def document() -> dict[str, Any]:
    """All that the file holds."""
    described = [
        data
        | {"quanta": [quanta(k, data["size_m"], data["cyclic"]).ravel().tolist() for k in range(data["solved"] + 1)]}
        for data in SITES
    ]
    sites = {data["name"]: site_of(data) for data in described}
    steps = []
    for k, name in enumerate(("painted", "hill", "painted", "smooth", "plain", "cyclic", "wide", "painted",
                              "surveyed", "gullies", "worn", "rilled", "gullies")):  # fmt: skip
        site = sites[name]
        level = (2, 3, 6, 4, 5, 7, 12, 17, 6, 4, 3, 5, 16)[k]
        n = grid.cells(level)
        tile = tile_window(level, (0, 3, 63, 5, 9, 127, 4095, 70000, 40, 9, 2, 31, 40000)[k],
                           (1, 7, 20, 15, 0, 127, 17, 130000, 41, 3, 7, 31, 20000)[k])  # fmt: skip
        window = Window(level, max(tile.r0, -2), min(tile.r0 + 9, n + 3), tile.c1 - 8, tile.c1)
        steps.append(step(site, name, window, k))
    return {
        "about": str(__doc__).partition("\n\n")[2].replace("\n", " ").strip(),
        "metres": METRES, "unorm": UNORM, "hashes": hashes(), "sites": described, "steps": steps,
        "places": [case for name, site in sites.items() for case in places(site, name)],
    }  # fmt: skip


def text() -> str:
    """The file: a line for every case, so that a change reads as a change of lines."""
    data = document()
    dump = {key: value for key, value in data.items() if not isinstance(value, list)}
    lists = [
        f'"{key}":[\n' + ",\n".join(json.dumps(v, separators=(",", ":"), allow_nan=False) for v in value) + "\n]"
        for key, value in data.items()
        if isinstance(value, list)
    ]
    return json.dumps(dump, separators=(",", ":"))[:-1] + ",\n" + ",\n".join(lists) + "}\n"


if __name__ == "__main__":
    PATH.write_text(text(), encoding="utf-8")
