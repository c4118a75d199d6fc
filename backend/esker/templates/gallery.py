"""The gallery: scenes that the solver is measured and tested on. ``python -m esker.templates.gallery`` writes them.

Documents under bench/scenes/, one stroke a line; ``esker solve`` reads them like any terrain. Drawing them again
changes nothing (a test does). Metres, x east, y north, on the default domain of 4096 m.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from esker import resources, templates
from esker.api.strokes import Stroke as Make
from esker.contract import DEFAULT_SIZE_M, Document, Flank, FlankShape, Stroke, TerrainSettings
from esker.document import archive

FOLDER = resources.SCENES
SIZE = DEFAULT_SIZE_M
POINTS = 24
"""Points of a random stroke."""
SHAPES: tuple[FlankShape, ...] = ("straight", "concave", "convex")
DECIMALS = {"z": 2, "u": 5}
"""A centimetre, and hundred-thousandths of a stroke's length: the files stay small and the same everywhere."""

Points = NDArray[np.float64]


def _side(slope: float, extent: float, shape: FlankShape = "concave") -> Flank:
    return Flank(slope_deg=round(slope, 1), extent_m=round(extent, 1), shape=shape)


def _rounded(value: float, kind: str) -> float:
    """A rounded coordinate. Zero has no sign: which one a sine ends with depends on the processor."""
    return round(value, DECIMALS[kind]) + 0.0


def _tidy(stroke: Stroke) -> Stroke:
    """The stroke with rounded coordinates."""
    anchors = {name: tuple(_rounded(v, "z") for v in getattr(stroke, name)) for name in ("first", "last")}
    second = "z" if stroke.kind == "profile" else "u"
    curve = tuple((_rounded(u, "u"), _rounded(v, second)) for u, v in stroke.curve)
    return stroke.model_copy(update={**anchors, "curve": curve})


def _line(a: tuple[float, float], b: tuple[float, float], heights: Points) -> Points:
    u = np.linspace(0, 1, len(heights))
    return np.column_stack([a[0] + u * (b[0] - a[0]), a[1] + u * (b[1] - a[1]), heights])


def _arch(height: float, count: int = 40) -> Points:
    """A silhouette that rises from the ground and returns to it."""
    return np.asarray(height * np.sin(np.linspace(0, math.pi, count)))


def _ring(x: float, y: float, radius: float, height: float, lobes: float = 0.0, turn: float = 0.98) -> Points:
    """A loop, counter-clockwise, open by 1 - ``turn`` of its length; ``lobes`` dents it, as a share of the radius."""
    a = np.linspace(0, 2 * math.pi * turn, 72)
    r = radius * (1 + lobes * np.sin(3 * a + 0.5))
    return np.column_stack([x + r * np.cos(a), y + r * np.sin(a), np.full(len(a), height)])


def random_strokes(count: int, seed: int, length: tuple[float, float], height: tuple[float, float]) -> list[Stroke]:
    """Smooth ridges, crevices, level ridges bent in plan and closed plateaux, of all sizes and directions."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(count):
        name = f"s{k:03d}"
        start = rng.uniform(0.04, 0.96, 2) * SIZE
        angle, along = rng.uniform(0, 2 * math.pi), rng.uniform(*length)
        top = float(rng.uniform(*height)) * (-0.6 if k % 5 == 4 else 1)
        slopes, extents = rng.uniform(20, 52, 2), rng.uniform(0.5, 1.3, 2) * along / 2
        phases = rng.uniform(0, 2 * math.pi, 3)
        # Every seventh stroke only says where its crest is.
        sides = [_side(float(s), float(e), SHAPES[k % 3]) for s, e in zip(slopes, extents, strict=True)]
        left, right = (None, None) if k % 7 == 6 else sides
        direction = np.array([math.cos(angle), math.sin(angle)])
        u = np.linspace(0, 1, POINTS)
        if k % 6 == 5:
            points = _ring(float(start[0]), float(start[1]), float(along / 4), abs(top) * 0.7, 0.15)[::3]
            out.append(Make.level(points, left=left, right=right, id=name))
            continue
        if k % 6 == 2:
            bend = 0.2 * along * np.sin(math.pi * u + 0.3 * phases[0])
            side = np.array([-direction[1], direction[0]])
            plan = start + u[:, None] * along * direction + (bend - bend[0])[:, None] * side
            out.append(Make.level(np.column_stack([plan, np.full(POINTS, top)]), left=left, right=right, id=name))
            continue
        wave = sum(0.12 / (j + 1) * np.sin((j + 2) * math.pi * u + phase) for j, phase in enumerate(phases))
        silhouette = top * np.sin(math.pi * u) ** 0.8 * (1 + wave)
        end = start + along * direction
        out.append(Make.profile(_line(tuple(start), tuple(end), silhouette), left=left, right=right, id=name))
    return out


def _loops() -> list[Stroke]:
    """A plateau, a basin, a loop inside a loop, and an eight."""
    t = np.linspace(0, 2 * math.pi, 90)
    eight = np.column_stack([2900 + 520 * np.sin(t), 3150 + 360 * np.sin(2 * t), np.full(len(t), 160.0)])
    return [
        Make.level(_ring(1000, 1100, 520, 220, 0.12), left=_side(35, 512), right=_side(30, 600), id="plateau"),
        Make.level(_ring(1000, 1100, 210, 330), left=None, right=_side(45, 300, "straight"), id="upper"),
        Make.level(_ring(2900, 1100, 620, -140), left=_side(40, 500), right=_side(35, 500, "convex"), id="basin"),
        Make.level(eight, left=_side(35, 300), right=_side(35, 300), id="eight"),
        Make.level(_ring(1050, 3000, 480, 180, turn=1.0), left=None, right=None, id="bare"),
    ]


def _crossing() -> list[Stroke]:
    """Two crests that cross at heights of 500 and 280 m, and a crevice that cuts both."""
    gentle, steep = _side(30, 800), _side(40, 512, "straight")
    return [
        Make.profile(_line((600, 1300), (3500, 2700), _arch(500)), left=gentle, right=gentle, id="high"),
        Make.profile(_line((800, 3200), (3300, 800), _arch(280)), left=steep, right=steep, id="low"),
        Make.profile(_line((2100, 300), (2500, 3800), _arch(-180)), left=steep, right=_side(25, 600), id="crevice"),
    ]


def _tiny() -> list[Stroke]:
    """One stroke that is shorter than a cell of level 4."""
    return [Make.profile(_line((1680, 1510), (1682.5, 1511.5), np.full(6, 40.0)), left=None, right=None, id="tiny")]


def _border() -> list[Stroke]:
    """Along a border, across one, into a corner, and beyond the domain."""
    side = _side(35, 512)
    return [
        Make.profile(_line((400, 0), (2600, 0), _arch(300)), left=side, right=side, id="south"),
        Make.profile(_line((3500, 2000), (4700, 2300), _arch(350)), left=side, right=_side(45, 300), id="across"),
        Make.profile(_line((3300, 700), (4096, 0), np.linspace(0, 420, 40)), left=side, right=side, id="corner"),
        Make.level(_ring(0, 2900, 500, 180), left=None, right=_side(40, 400), id="half"),
        Make.profile(_line((-300, 4300), (3000, 4200), _arch(400)), left=side, right=side, id="beyond"),
        Make.profile(_line((4096, 2700), (4096, 4096), np.full(20, -90.0)), left=side, right=None, id="east"),
    ]


def _twins() -> list[Stroke]:
    """Strokes that lie exactly on one another: alike, backwards, at another height, with other flanks."""
    line = _line((700, 2500), (3300, 3300), _arch(320))
    level = _ring(2300, 1300, 560, 150, 0.1)
    side, steep = _side(35, 600), _side(50, 300, "straight")
    return [
        Make.profile(line, left=side, right=side, id="a"),
        Make.profile(line, left=side, right=side, id="a-again"),
        Make.profile(line[::-1], left=side, right=side, id="a-backwards"),
        Make.profile(line * (1, 1, 0.6), left=steep, right=None, id="a-lower"),
        Make.level(level, left=side, right=side, id="b"),
        Make.level(level * (1, 1, -0.5), left=steep, right=steep, id="b-sunken"),
    ]


RECIPES: dict[str, Callable[[], Sequence[Stroke]]] = {
    "five": lambda: random_strokes(5, 5, (700, 1900), (120, 480)),
    "fifty": lambda: random_strokes(50, 50, (250, 1300), (60, 420)),
    "five-hundred": lambda: random_strokes(500, 500, (120, 600), (20, 220)),
    "loops": _loops,
    "crossing": _crossing,
    "tiny": _tiny,
    "border": _border,
    "twins": _twins,
}
NAMES = (*RECIPES, *templates.ORDER)
KEPT = "alpine-ridge"
"""The scene that stays as it was before its starting terrain was drawn anew: most benchmarks have figures of it."""


def draw() -> dict[str, Document]:
    """The gallery, drawn afresh: the recipes above and the five starting terrains, of which ``KEPT`` is read."""
    out = {
        name: Document(id=name, settings=TerrainSettings(title=name.capitalize()), strokes=tuple(map(_tidy, recipe())))
        for name, recipe in RECIPES.items()
    }
    return out | {name: load(name) if name == KEPT else templates.load(name).document for name in templates.ORDER}


def to_json(document: Document) -> str:
    """One stroke a line, defaults left out."""

    def line(value: object) -> str:
        return json.dumps(value, separators=(",", ":"))

    fields = document.model_dump(mode="json", exclude_defaults=True)
    strokes = fields.pop("strokes", [])
    head = "".join(f"{line(name)}:{line(value)},\n" for name, value in fields.items())
    body = ",\n".join(line(stroke) for stroke in strokes)
    return f'{{{head}"strokes":[\n{body}\n]}}\n'


@cache
def load(name: str) -> Document:
    """A committed scene. Raises KeyError for a name that is not in the gallery, OSError when its file is missing."""
    if name not in NAMES:
        raise KeyError(name)
    return archive.document_from_json((FOLDER / f"{name}.json").read_bytes())


def main(_argv: list[str]) -> int:
    """Write the scenes."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, document in draw().items():
        (FOLDER / f"{name}.json").write_text(to_json(document), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
