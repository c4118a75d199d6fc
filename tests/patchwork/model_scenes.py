"""Scenes of the model's tests: small grids of one made-up land, turned, stretched, with errors and holes."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker import contract
from esker.patchwork.blend import lattice
from esker.patchwork.blend import points as blend_points
from esker.patchwork.lod import layer_patches
from esker.patchwork.lod.space import Model, Placed
from esker.patchwork.raster import rasters
from esker.patchwork.raster.patches import warped

Floats = NDArray[np.float64]


def land(x: Floats, y: Floats) -> Floats:
    """Heights of the made-up land, metres: hills of a kilometre, ridges of a hundred metres, some roughness."""
    hills = 120 * np.sin(x / 340) * np.cos(y / 290) + 40 * np.sin(x / 97 + y / 130)
    return np.asarray(hills + 6 * np.sin(x / 19) * np.sin(y / 23) + 0.05 * x)


def layer(name: str, rows: int, cols: int, **fields: Any) -> contract.Layer:
    """A layer of the document whose content is not known yet."""
    values: dict[str, Any] = {"anchor": (0.0, 0.0), "spacing_m": (10.0, 10.0), "accuracy_m": 1.0, **fields}
    facts = contract.GridFacts(rows=rows, cols=cols, low_m=0.0, high_m=1.0)
    return contract.Layer(id=name, content="0" * 64, facts=facts, **values)


def places(of: contract.Layer, warp: Floats | None = None) -> Floats:
    """World places (rows, cols, 2) of a layer's samples."""
    u, v = np.meshgrid(np.arange(of.facts.cols, dtype=float), np.arange(of.facts.rows, dtype=float))
    return layer_patches.mapped(
        layer_patches.affine(of), warped(warp, of.facts.rows, of.facts.cols, np.stack([u, v], -1))
    )


def surveyed(
    of: contract.Layer,
    height: Callable[[Floats, Floats], Floats] = land,
    warp: Floats | None = None,
    change: Callable[[Floats], Floats] | None = None,
) -> Placed:
    """A layer with samples of ``height`` at its places; ``change`` may add errors and holes to them."""
    at = places(of, warp)
    heights = height(at[..., 0], at[..., 1])
    raster = rasters.build(heights if change is None else change(heights), warp)
    return Placed(of.model_copy(update={"content": raster.digest}), raster)


def random_scene(seed: int) -> list[Placed]:
    """Two to five overlapping grids of 40 to 120 samples a side, at any angle; some newer, noisy, stale or holed."""
    rng = np.random.default_rng(seed)
    scene = []
    for k in range(rng.integers(2, 6)):
        spacing = float(rng.choice([4.0, 10.0, 10.0, 16.0, 31.0]))
        of = layer(
            f"layer{k}",
            int(rng.integers(40, 121)),
            int(rng.integers(40, 121)),
            anchor=(float(rng.uniform(-200, 600)), float(rng.uniform(-200, 600))),
            rotation_deg=float(rng.choice([0.0, 90.0, rng.uniform(-180, 180)])),
            spacing_m=(spacing, spacing * float(rng.choice([1.0, 1.0, 1.47]))),
            accuracy_m=float(rng.choice([0.0, 0.5, 2.0, spacing / 4])),
            priority=int(rng.choice([0, 0, 1, 2])),
            scale=float(rng.choice([1.0, 1.0, 0.5])),
            lift_m=float(rng.choice([0.0, 0.0, 30.0])),
        )
        warp = bend(of, float(rng.uniform(0.5, 6.0)), rng) if rng.random() < 0.3 else None
        scene.append(surveyed(of, warp=warp, change=functools.partial(_changed, of=of, rng=rng)))
    return scene


def bend(of: contract.Layer, sag: float, rng: np.random.Generator) -> Floats:
    """A control net (9, 9, 2) that bends, shears and narrows a lattice as a projection does, by ``sag`` samples."""
    b, a = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9), indexing="ij")
    shear, narrow, _ = rng.uniform(-1, 1, 3)
    return sag * np.stack([shear * b + narrow * a * b, a * a + 0.3 * a * b], -1) * min(1.0, of.facts.cols / 100)


def _changed(heights: Floats, of: contract.Layer, rng: np.random.Generator) -> Floats:
    heights = heights + rng.normal(0, of.accuracy_m / 3, heights.shape)
    rows, cols = heights.shape
    if rng.random() < 0.3:  # a landslide that the others have not seen
        r, c = np.indices(heights.shape)
        heights = heights - 60 * np.exp(-((r - rows / 3) ** 2 + (c - cols / 2) ** 2) / 60)
    heights = (heights - of.lift_m) / of.scale
    if rng.random() < 0.4:
        r, c = rng.integers(0, rows - 8), rng.integers(0, cols - 12)
        heights[r : r + rng.integers(1, 9), c : c + rng.integers(1, 13)] = np.nan
    return heights


def arrays(model: Model) -> dict[str, NDArray[Any]]:
    """All arrays of a model, by name."""
    return {name: value for name, value in vars(model).items() if isinstance(value, np.ndarray)}


def same(a: Model, b: Model) -> bool:
    """Whether two models are equal, bit for bit."""
    if [p.layer for p in a.placed] != [p.layer for p in b.placed]:
        return False
    one, other = arrays(a), arrays(b)
    return all(one[name].tobytes() == other[name].tobytes() for name in one)


def inside(quads: Floats, points: Floats, grow: float | Floats = 0.0) -> NDArray[np.bool_]:
    """(quads, points): which points lie in which quads, grown by ``grow`` metres."""
    out = np.ones((len(quads), len(points)), bool)
    grow = np.broadcast_to(grow, len(quads))[:, None]
    for k in range(4):
        a, b = quads[:, k], quads[:, (k + 1) % 4]
        d = b - a
        length = np.hypot(d[:, 0], d[:, 1])
        cross = d[:, 0, None] * (points[None, :, 1] - a[:, 1, None]) - d[:, 1, None] * (
            points[None, :, 0] - a[:, 0, None]
        )
        out &= cross >= -grow * length[:, None]
    return out


def chosen(model: Model, tolerance: float) -> NDArray[np.intp]:
    """The cut of a model at one tolerance."""
    return np.flatnonzero((model.low <= tolerance) & (tolerance < model.max_z))


def blended(model: Model, index: NDArray[np.intp], points: Floats, tolerance: float) -> Floats:
    """The bilinear blend of a cut at points, NaN where no patch lies."""
    found = blend_points.evaluate(lattice.pack(model, index.astype(np.int32), False, tolerance), points)
    return np.where(found.cover[:, 0] > 0, found.heights[:, 0], np.nan)
