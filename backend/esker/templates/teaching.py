"""Writes the six lessons: ``python -m esker.templates.teaching`` rewrites ``lessons/*.json`` and their pictures.

A lesson is a starting terrain with its task, and a plan for the teacher. Each has an answer, strokes that solve it:
targets are solved from it, and a test asks that it has nearly all points. Metres, x east, y north.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.api.terrain import Terrain
from esker.lesson import relief
from esker.tasks.ground import Ground
from esker.tasks.target import encode
from esker.templates import FOLDER, load
from esker.templates.pen import Pen
from esker.templates.plans import Plan, plans

PLACE: Final = FOLDER / "lessons"
PICTURE_LEVEL: Final = 2
PICTURE_SIDE: Final = 480
PROFILE_SAMPLES: Final = 129
RING: Final = (1400.0, 256.0)
"""Where the stream of the western valley leaves the hills."""


@dataclass(frozen=True)
class Lesson:
    """What a lesson begins as, without its task, and the strokes that solve it."""

    id: str
    settings: c.TerrainSettings
    start: tuple[c.Stroke, ...]
    answer: tuple[c.Stroke, ...]
    layers: tuple[c.Layer, ...] = ()
    grids: Mapping[str, str] = field(default_factory=dict)

    def document(self, *more: c.Stroke) -> c.Document:
        """The start with some strokes more."""
        return c.Document(id=self.id, settings=self.settings, strokes=(*self.start, *more), layers=self.layers)

    def heights(self, *more: c.Stroke, level: int = c.TASK_LEVEL) -> NDArray[np.float32]:
        """Settled ground."""
        rasters = load("helens").rasters() if self.layers else {}
        found: NDArray[np.float32] = Terrain.from_document(self.document(*more), rasters).heights(level=level)
        return found


def _settings(title: str, **more: Any) -> c.TerrainSettings:
    born = {"edition": c.CURRENT_EDITION, "reach_m": 128.0, "erosion": c.BORN_EROSION, "hold": c.BORN_HOLD}
    return c.TerrainSettings.model_validate({"title": title} | born | more)


def _yielding(pen: Pen) -> tuple[c.Stroke, ...]:
    """Strokes whose beds give way to those of pupils: a dam is not notched by the stream that it crosses."""
    beds = ("Valley", "Stream")
    return tuple(s.model_copy(update={"yields": 1.0}) if s.label in beds else s for s in pen.strokes)


def contours() -> Lesson:
    """A broad hill, a steep one, and the saddle between them."""
    pen = Pen("contours-answer", 1)
    pen.chain(
        [(500, 2450, 0), (1250, 2650, 360), (2100, 2350, 120)], (24, 900), (24, 900), wobble=0, label="Broad hill"
    )
    pen.chain(
        [(2100, 2350, 120), (2950, 1900, 280), (3500, 1650, 0)], (38, 600), (38, 600), wobble=0, label="Steep hill"
    )
    return Lesson("reading-contours", _settings("Reading contours", look="paper"), (), tuple(pen.strokes))


def profile() -> Lesson:
    """A coast, a cliff, a tableland, a valley and a peak, from west to east."""
    pen = Pen("profile-answer", 2)
    line = [
        (400, 2048, 0), (1000, 2048, 12), (1250, 2048, 30), (1450, 2048, 200), (2050, 2048, 215),
        (2400, 2048, 70), (2950, 2048, 420), (3650, 2048, 0),
    ]  # fmt: skip
    pen.chain(line, (30, 900), (30, 900), wobble=0, label="The profile")
    return Lesson("drawing-the-profile", _settings("Drawing the profile"), (), tuple(pen.strokes))


def rain() -> Lesson:
    """Two valleys side by side, and the ridge between them."""
    pen = Pen("rain", 3)
    for x, heights in ((-60, (200, 260, 330)), (2048, (70, 170, 260)), (4156, (200, 260, 330))):
        points = [(x, y, z) for y, z in zip((500, 2200, 4100), heights, strict=True)]
        pen.massif(points, 14, spurs=0, spacing=900, meander=0.06, label="Ridge")
    for x in (1020, 3070):
        bed = [(x, -60, 4), (x + 110, 900, 20), (x - 80, 1900, 46), (x + 40, 3000, 90), (x, 4150, 150)]
        pen.chain(bed, (5, 500), (5, 500), wobble=0, label="Valley")
    answer = Pen("rain-answer", 3)
    wall = [(4250, 330, 34), (2900, 250, 34), (1530, 200, 34)]
    answer.chain(wall, (30, 120), (30, 120), wobble=0, label="Wall that turns the eastern stream")
    settings = _settings("Where does the rain go?", rivers=1.0)
    return Lesson("where-does-the-rain-go", settings, _yielding(pen), tuple(answer.strokes))


def dam() -> Lesson:
    """A valley that opens to the south, narrow where a dam belongs."""
    pen = Pen("dam", 4)
    for side in (-1, 1):
        wall = [
            (2048 + side * x, y, z)
            for x, y, z in ((1150, 500, 90), (620, 1500, 330), (1050, 2700, 420), (700, 4100, 520))
        ]
        pen.massif(wall, 30, spacing=900, spurs=0, meander=0.05, label="Wall of the valley")
    pen.chain(
        [(2048, 4150, 260), (2048, 2600, 110), (2048, 1300, 60), (2048, -60, 8)],
        (6, 340),
        (6, 340),
        wobble=0,
        label="Stream",
    )
    answer = Pen("dam-answer", 4)
    answer.chain([(1400, 1450, 230), (2048, 1450, 200), (2700, 1450, 230)], (40, 300), (40, 300), wobble=0, label="Dam")
    settings = _settings("Dam a valley", rivers=1.0, lakes_m=4.0)
    return Lesson("dam-a-valley", settings, _yielding(pen), tuple(answer.strokes))


def sea() -> Lesson:
    """A low island with one hill, four metres above the sea."""
    pen = Pen("sea", 5)
    coast = [(800, 1500), (900, 2500), (1600, 3150), (2600, 3200), (3300, 2500), (3250, 1500), (2500, 900), (1500, 850)]
    pen.plateau(coast, 4.0, (5, 200), label="Lowland")
    pen.ring(1450, 2450, 300, 46, (9, 500))
    answer = Pen("sea-answer", 5)
    dyke = [(2048 + 0.93 * (x - 2048), 2000 + 0.93 * (y - 2000)) for x, y in coast]
    answer.plateau(dyke, 14.0, (40, 60), radius=20, closed=False, label="Dyke")
    answer.chain([(*dyke[-1], 14), (*dyke[0], 14)], (40, 60), (40, 60), wobble=0, label="Dyke")
    settings = _settings("A rising sea", sea_level_m=1.0, rivers=0.0)
    return Lesson("a-rising-sea", settings, tuple(pen.strokes), tuple(answer.strokes))


def helens() -> Lesson:
    """Real ground of 2000 and 2004, and a cone sketched to the summit's height of before."""
    real = load("helens")
    answer = Pen("helens-answer", 6)
    summit = (1472.0, 1130.0)
    crest = [(summit[0] - 900, summit[1], 2330), (*summit, 2950), (summit[0] + 900, summit[1], 2330)]
    answer.chain(crest, (33, 1300), (33, 1300), wobble=0, label="The old summit")
    meridian = [(summit[0], summit[1] - 850, 2350), (*summit, 2950), (summit[0], summit[1] + 1200, 2080)]
    answer.chain(meridian, (33, 1300), (33, 1300), wobble=0, label="The old summit")
    settings = real.document.settings.model_copy(
        update={"title": "Mount St Helens before 1980", "edition": c.CURRENT_EDITION}
    )
    layers = real.document.layers
    return Lesson("helens-before-1980", settings, (), tuple(answer.strokes), layers, real.grids)


def goal_of(lesson: Lesson) -> c.Goal:
    """What the lesson asks; a target is the answer's ground."""
    size = lesson.settings.size_m
    match lesson.id:
        case "reading-contours":
            return c.ContoursGoal(target=encode(lesson.heights(*lesson.answer), size), tolerance_m=20, interval_m=40)
        case "drawing-the-profile":
            first, last = (400.0, 2048.0), (3650.0, 2048.0)
            at = np.linspace(first, last, PROFILE_SAMPLES)
            wanted = Ground(lesson.heights(*lesson.answer), size).along(at)
            return c.ProfileGoal(first=first, last=last, heights=tuple(np.round(wanted, 1)), tolerance_m=15)
        case "where-does-the-rain-go":
            return c.WatershedGoal(point=RING, at_least_m2=11e6)
        case "dam-a-valley":
            return c.VolumeGoal(point=(2048, 1900), level_m=180, at_least_m3=60e6)
        case "a-rising-sea":
            return c.AreaGoal(level_m=8, at_least_m2=4e6, dry=True)
        case _:
            return c.ContoursGoal(target=encode(lesson.heights(*lesson.answer), size), tolerance_m=40, interval_m=100)


@cache
def lessons() -> tuple[Lesson, ...]:
    """All six, in the order of the gallery."""
    return contours(), profile(), rain(), dam(), sea(), helens()


def document_of(lesson: Lesson, plan: Plan) -> c.Document:
    """The start with its task."""
    task = c.Task(title=plan.title, text=plan.task, goal=goal_of(lesson))
    start = lesson.document()
    return start.model_copy(update={"settings": lesson.settings.model_copy(update={"task": task})})


def picture(lesson: Lesson, path: Path) -> None:
    """The picture of a lesson's card: what pupils are to make, as relief."""
    from PIL import Image

    shown = relief.picture(lesson.heights(*lesson.answer, level=PICTURE_LEVEL + 1), lesson.settings)
    Image.fromarray(shown).resize((PICTURE_SIDE, PICTURE_SIDE)).save(path, quality=82)


def main(pictures: Path | None) -> None:
    """Write all. ``pictures``: a folder for the pictures of the cards."""
    PLACE.mkdir(exist_ok=True)
    for lesson in lessons():
        plan = plans()[lesson.id]
        data = {"id": lesson.id, "title": plan.title, "description": plan.description, "grids": dict(lesson.grids)}
        text = json.dumps(data | {"document": document_of(lesson, plan).model_dump(mode="json")}, separators=(",", ":"))
        (PLACE / f"{lesson.id}.json").write_text(text + "\n", encoding="utf-8")
        if pictures is not None:
            picture(lesson, pictures / f"{lesson.id}.webp")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=Path, help="a folder for the pictures of the cards")
    main(parser.parse_args().pictures)
