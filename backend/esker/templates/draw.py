"""Draws seven of the starting terrains: ``python -m esker.templates.draw`` rewrites the JSON files in ``drawn/``.

A test checks that drawing again changes nothing (SPEC H6). Heights and distances are metres, x east, y north.
"""

from __future__ import annotations

import json
import math

import numpy as np

from esker.contract import BORN_EROSION, BORN_HOLD, DEFAULT_RIVERS, MIN_EROSION_SCALE, TerrainSettings
from esker.templates import DRAWN, lowlands
from esker.templates.pen import Pen, smooth_path


def figure_six() -> dict[str, object]:
    """Paper 0, figure 6: mountains and crevices all around, plateaux in the midst."""
    pen = Pen("figure-six", 6)
    ridges = (
        ([(250, 2700, 0), (760, 3120, 500), (1180, 3330, 390), (1650, 3560, 600), (2330, 3700, 0)], 37),
        ([(2330, 3700, 0), (2900, 3420, 470), (3330, 3060, 640), (3640, 2560, 400), (3760, 1980, 0)], 37),
        ([(300, 2360, 0), (520, 1700, 380), (470, 1180, 470), (760, 560, 0)], 36),
        ([(1040, 560, 0), (1720, 360, 340), (2240, 450, 450), (2860, 330, 0)], 35),
        ([(3040, 420, 0), (3560, 880, 430), (3680, 1420, 310), (3560, 1900, 0)], 37),
    )
    for path, slope in ridges:
        pen.massif(path, slope, spurs=1, spacing=460, reach=1.25, label="Mountain")
    crevices = (
        [(980, 2420, 0), (1420, 2690, -120), (1880, 2820, -150), (2460, 2840, 0)],
        [(2880, 2600, 0), (3060, 2160, -150), (2960, 1740, -130), (3040, 1240, 0)],
    )
    for path in crevices:
        pen.chain(path, (46, 420), (46, 420), wobble=0.02, label="Crevice")
    pen.plateau([(1240, 1980), (1560, 2250), (2020, 2220), (2180, 1900), (1960, 1640), (1480, 1640)], 210, (48, 600))
    pen.plateau([(2360, 1560), (2640, 1700), (2760, 1420), (2600, 1130), (2280, 1160)], 130, (44, 500))
    pen.plateau([(1180, 1180), (1500, 1330), (1760, 1130), (1560, 860), (1220, 880)], 80, (40, 400))
    settings = TerrainSettings(title="Figure six", sun_azimuth_deg=118.0, sun_elevation_deg=27.0, reach_m=180.0)
    words = "The paper's own landscape: mountains and crevices, with plateaux in the midst."
    return template(pen, "Figure six", words, settings)


def alpine_ridge() -> dict[str, object]:
    """A main divide with horns and spurs on both sides, above a trough valley with a river."""
    pen = Pen("alpine-ridge", 45)
    divide = [
        (-420, 2560, 380), (180, 2700, 720), (760, 2620, 640), (1330, 2840, 1060), (1820, 2700, 850),
        (2330, 2930, 1290), (2800, 2760, 900), (3280, 2900, 1080), (3800, 2700, 700), (4500, 2800, 360),
    ]  # fmt: skip
    pen.massif(divide, 40, spacing=560, reach=0.9, spurs=1, foot=0.3, meander=0.14, label="Main divide")
    south = [
        (-300, 260, 300),
        (480, 120, 520),
        (1200, 240, 430),
        (2000, 60, 640),
        (2800, 200, 470),
        (3500, 40, 590),
        (4400, 200, 260),
    ]
    pen.massif(south, 36, spacing=620, reach=0.7, spurs=1, foot=0.3, meander=0.14, label="South chain")
    bends = [(-100, 1230), (620, 1130), (1240, 1260), (1900, 1110), (2560, 1240), (3240, 1100), (4200, 1210)]
    river = [(float(x), float(y), -27.0 - 0.0115 * float(x)) for x, y in smooth_path(bends, closed=False, each=3)]
    pen.chain(river, (10, 500), (10, 500), wobble=0.0, label="River")
    settings = TerrainSettings(title="Alpine ridge", sun_azimuth_deg=128.0, sun_elevation_deg=22.0, reach_m=300.0)
    words = "A divide with horns and spurs above a broad valley with its river."
    return template(pen, "Alpine ridge", words, settings)


def canyon() -> dict[str, object]:
    """Two tablelands cut by a meandering river, with terraces, side canyons and buttes left standing."""
    pen = Pen("canyon", 17, shape="straight")
    mid = [
        (-260, 2450), (420, 2350), (880, 1960), (1280, 1720), (1720, 1880), (2080, 2260),
        (2500, 2420), (2930, 2210), (3240, 1790), (3640, 1600), (4360, 1700),
    ]  # fmt: skip
    path = smooth_path(mid, closed=False, each=9)
    tangent = np.gradient(path, axis=0)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) / np.hypot(*tangent.T)[:, None]
    for side, corners, name in (
        (1.0, [(4360, 4400), (-260, 4400)], "North"),
        (-1.0, [(4360, -300), (-260, -300)], "South"),
    ):
        bends = pen.rng.uniform(0.03, 0.97, 7)
        at = np.linspace(0, 1, len(path))
        inlets = sum(np.exp(-(((at - c) / 0.013) ** 2)) * pen.rng.uniform(0.35, 1.0) for c in bends)
        for height, gap, slope, inlet in (
            (330.0, 400.0, 68.0, 430.0),
            (205.0, 262.0, 60.0, 190.0),
            (90.0, 145.0, 52.0, 50.0),
        ):
            cut = inlets * inlet + pen.rng.uniform(-0.1, 0.1, len(path)) * gap
            edge = path + side * normal * (gap + cut)[:, None]
            outline = [(float(x), float(y)) for x, y in edge]
            level = height - (22 if side < 0 else 0)
            if height > 300:
                pen.plateau([*outline, *corners], level, (slope, 400), label=f"{name} rim", smooth=2)
            else:
                pen.plateau(outline, level, (slope, 400), radius=46, closed=False, label=f"{name} terrace", smooth=2)
    river = [(float(x), float(y), -14.0 - 0.003 * float(x)) for x, y in path[::4]]
    pen.chain(river, (10, 160), (10, 160), wobble=0.0, label="River")
    for x, y, r, z in ((1330, 2010, 46, 262), (2420, 2130, 52, 250), (3420, 1960, 40, 232), (760, 1830, 40, 225)):
        pen.ring(x, y, r, z, (66, 300))
    settings = TerrainSettings(
        title="Canyon", look="desert", sun_azimuth_deg=236.0, sun_elevation_deg=28.0, reach_m=110.0
    )
    words = "A river between two tablelands: terraces, side canyons and buttes left standing."
    return template(pen, "Canyon", words, settings)


def volcanic_island() -> dict[str, object]:
    """A stratovolcano with a breached crater, ridges to the coast, a side cone and a quiet bay."""
    pen = Pen("volcanic-island", 73)
    cx, cy = 2080.0, 2120.0
    rim = [(cx + 250 * math.cos(a), cy + 235 * math.sin(a)) for a in [math.radians(d) for d in range(-20, 281, 25)]]
    pen.plateau(rim, 640, (29, 4000), radius=10, closed=False, label="Crater rim")
    pen.ring(cx - 10, cy - 10, 90, 455, (34, 200), uneven=0.08)
    for d in range(6, 360, 29):
        if 285 < d < 335:
            continue
        a = math.radians(d + float(pen.rng.uniform(-6, 6)))
        root = (cx + 285 * math.cos(a), cy + 270 * math.sin(a), 622.0)
        length = float(pen.rng.uniform(1250, 1620))
        spur = [(x, y, z if i in (0, 6) else z + 26) for i, (x, y, z) in enumerate(pen.spur(root, a, length, legs=6))]
        pen.chain(spur, (31, 420), (31, 420), wobble=0.03, label="Ridge")
    pen.plateau([(2980, 1240), (3060, 1330), (3010, 1430), (2900, 1400)], 205, (30, 900), radius=6, closed=False)
    pen.ring(2985, 1345, 22, 150, (34, 60))
    pen.ring(1010, 3120, 40, 170, (30, 600))
    pen.massif(
        [(3330, 2960, 0), (3560, 3080, 150), (3720, 3250, 96), (3880, 3420, 0)], 30, spurs=1, spacing=260, label="Islet"
    )
    pen.massif(
        [(420, 1020, 0), (620, 820, 140), (900, 700, 100), (1080, 560, 0)], 30, spurs=1, spacing=260, label="Islet"
    )
    settings = TerrainSettings(
        title="Volcanic island",
        sea_level_m=42.0,
        lakes_m=4.0,
        sun_azimuth_deg=104.0,
        sun_elevation_deg=19.0,
        reach_m=240.0,
    )
    words = "A breached crater that holds a lake, ridges running to the coast, and a side cone by the bay."
    return template(pen, "Volcanic island", words, settings)


def archipelago() -> dict[str, object]:
    """An arc of drowned ridges: a main island, skerries, sandbars and a sheltered lagoon."""
    pen = Pen("archipelago", 29)
    sizes = (0.5, 0.8, 1.1, 0.7, 1.35, 1.0, 0.6, 0.9, 0.45, 0.35)
    for degrees, s in zip(range(200, 20, -19), sizes, strict=True):
        a = math.radians(degrees)
        x, y = 2050 + 1420 * math.cos(a), 1480 + 1480 * math.sin(a)
        t = a + math.pi / 2 + float(pen.rng.uniform(-0.5, 0.5))
        half = 360 * s + 160
        top = 90 + 250 * s
        crest = [
            (x - half * math.cos(t), y - half * math.sin(t), 0.0),
            (x - 0.3 * half * math.cos(t + 0.4), y - 0.3 * half * math.sin(t + 0.4), top),
            (x + 0.4 * half * math.cos(t - 0.3), y + 0.4 * half * math.sin(t - 0.3), 0.7 * top),
            (x + half * math.cos(t - 0.1), y + half * math.sin(t - 0.1), 0.0),
        ]
        pen.massif(crest, 31, spacing=300 + 120 * s, reach=1.3, spurs=1, label="Island")
    pen.plateau(
        [(1500, 1280), (1880, 1100), (2320, 1120), (2680, 1330)], 57, (7, 240), radius=34, closed=False, label="Sandbar"
    )
    pen.plateau([(1260, 720), (1500, 600), (1800, 640)], 55, (7, 200), radius=28, closed=False, label="Sandbar")
    for _ in range(9):
        x, y = (float(v) for v in pen.rng.uniform((700, 320), (3500, 1500)))
        pen.ring(x, y, float(pen.rng.uniform(18, 46)), float(pen.rng.uniform(58, 92)), (34, 300), n=6)
    settings = TerrainSettings(
        title="Archipelago", sea_level_m=50.0, sun_azimuth_deg=250.0, sun_elevation_deg=17.0, reach_m=190.0
    )
    words = "An arc of drowned ridges around a lagoon, with skerries and sandbars."
    return template(pen, "Archipelago", words, settings)


def delta() -> dict[str, object]:
    """A delta (``lowlands.delta``)."""
    words = "A river parts on a plain and builds its arms out into the sea."
    return template(lowlands.delta(), "Delta", words, lowlands.delta_settings())


def badland() -> dict[str, object]:
    """A badland (``lowlands.badland``), with narrower and deeper gullies than other new terrains have."""
    words = "Clay hills cut to ribs and gullies by rain, under a tableland that still stands."
    made = template(lowlands.badland(), "Badland", words, lowlands.badland_settings())
    settings = made["document"]["settings"]  # type: ignore[index]
    settings.update(erosion=1.7, erosion_scale=MIN_EROSION_SCALE, hold=0.5)
    return made


def template(pen: Pen, title: str, description: str, settings: TerrainSettings) -> dict[str, object]:
    """The JSON value of one file: like all new terrains, with gullies and rivers."""
    settings = settings.model_copy(update={"erosion": BORN_EROSION, "hold": BORN_HOLD, "rivers": DEFAULT_RIVERS})
    document = pen.document(settings).model_dump(mode="json")
    return {"id": pen.name, "title": title, "description": description, "document": document}


def files() -> dict[str, str]:
    """File name -> text, for all seven."""
    drawn = (figure_six(), alpine_ridge(), canyon(), volcanic_island(), archipelago(), delta(), badland())
    return {f"{t['id']}.json": json.dumps(t, separators=(",", ":")) + "\n" for t in drawn}


if __name__ == "__main__":
    for name, text in files().items():
        (DRAWN / name).write_text(text, encoding="utf-8")
