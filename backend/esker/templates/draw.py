"""Draws the five starting terrains: ``python -m esker.templates.draw`` rewrites the JSON files beside this one.

A test checks that drawing again changes nothing (SPEC H6). Heights and distances are metres, x east, y north.
"""

from __future__ import annotations

import json
import math

from esker.contract import TerrainSettings
from esker.templates import FOLDER
from esker.templates.pen import Pen


def figure_six() -> dict[str, object]:
    """Paper 0, figure 6: mountains and crevices all around, plateaux in the midst."""
    pen = Pen("figure-six", 6)
    pen.chain(
        [(330, 2750, 60), (760, 3120, 520), (1180, 3330, 390), (1650, 3580, 610), (2150, 3640, 90)],
        (37, 1200),
        (34, 1200),
    )
    pen.chain(
        [(2500, 3560, 60), (2900, 3420, 450), (3330, 3060, 640), (3640, 2560, 380), (3720, 2140, 50)],
        (35, 1200),
        (38, 1200),
    )
    pen.chain([(420, 2240, 40), (560, 1700, 360), (470, 1180, 470), (700, 680, 60)], (40, 900), (33, 900))
    pen.chain([(1180, 560, 40), (1720, 380, 330), (2240, 470, 440), (2760, 360, 60)], (36, 900), (36, 900))
    pen.chain([(3180, 520, 50), (3560, 880, 420), (3660, 1420, 300), (3560, 1800, 40)], (36, 900), (40, 900))
    pen.chain(
        [(1100, 2420, -10), (1420, 2690, -130), (1880, 2830, -150), (2380, 2860, -20)],
        (48, 420),
        (48, 420),
        wobble=0.03,
    )
    pen.chain(
        [(2900, 2560, -10), (3060, 2160, -150), (2960, 1740, -120), (3020, 1300, -15)],
        (46, 420),
        (52, 420),
        wobble=0.03,
    )
    pen.plateau([(1240, 1980), (1560, 2250), (2020, 2220), (2180, 1900), (1960, 1640), (1480, 1640)], 210, (48, 600))
    pen.plateau([(2360, 1560), (2640, 1700), (2760, 1420), (2600, 1130), (2280, 1160)], 130, (44, 500))
    pen.plateau([(1180, 1180), (1500, 1330), (1760, 1130), (1560, 860), (1220, 880)], 80, (40, 400))
    settings = TerrainSettings(title="Figure six", sun_azimuth_deg=118.0, sun_elevation_deg=27.0, reach_m=180.0)
    return template(
        pen, "Figure six", "The paper's own landscape: mountains and crevices, with plateaux in the midst.", settings
    )


def alpine_ridge() -> dict[str, object]:
    """A main divide with horns and spurs on both sides, above a trough valley with a river."""
    pen = Pen("alpine-ridge", 41)
    crest = [
        (140, 2480, 420), (620, 2660, 860), (980, 2560, 720), (1420, 2790, 1180), (1800, 2700, 900),
        (2230, 2930, 1360), (2620, 2760, 960), (3060, 2890, 1120), (3480, 2680, 760), (3960, 2760, 380),
    ]  # fmt: skip
    pen.chain(crest, (43, 2200), (40, 2200), wobble=0.06, label="Main divide")
    for x, y, z, dx, dy, drop in (
        (620, 2660, 780, -180, -760, 140), (1420, 2790, 1080, 60, -900, 190), (1420, 2790, 1080, -260, 760, 260),
        (2230, 2930, 1250, 210, -980, 170), (2230, 2930, 1250, -40, 820, 300), (3060, 2890, 1020, 190, -860, 150),
        (3060, 2890, 1020, 240, 700, 240),
    ):  # fmt: skip
        bend = pen.rng.uniform(-0.16, 0.16)
        mid = (x + 0.5 * dx - bend * dy, y + 0.5 * dy + bend * dx, drop + 0.42 * (z - drop))
        pen.chain([(x, y, z), mid, (x + dx, y + dy, drop)], (41, 1500), (41, 1500), wobble=0.07, label="Spur")
    south = [
        (60, 560, 260),
        (700, 430, 520),
        (1320, 560, 430),
        (2000, 380, 640),
        (2700, 540, 470),
        (3350, 360, 590),
        (4030, 500, 240),
    ]
    pen.chain(south, (33, 1300), (35, 1300), wobble=0.07, label="South chain")
    river = [
        (40, 1500, 60),
        (620, 1420, 46),
        (1240, 1560, 34),
        (1900, 1400, 22),
        (2560, 1520, 12),
        (3240, 1380, 2),
        (4050, 1470, -14),
    ]
    pen.chain(river, (7, 260), (7, 260), wobble=0.0, label="River")
    settings = TerrainSettings(
        title="Alpine ridge", look="natural", sun_azimuth_deg=128.0, sun_elevation_deg=22.0, reach_m=300.0
    )
    return template(pen, "Alpine ridge", "A divide with horns and spurs above a broad valley with its river.", settings)


def canyon() -> dict[str, object]:
    """Two tablelands cut by a meandering river, with terraces, side canyons and buttes left standing."""
    pen = Pen("canyon", 17, shape="straight")
    mid = [
        (0, 2500),
        (420, 2380),
        (820, 1900),
        (1250, 1640),
        (1720, 1860),
        (2050, 2330),
        (2500, 2520),
        (2960, 2240),
        (3240, 1720),
        (3640, 1500),
        (4096, 1620),
    ]
    for height, gap, slope in ((330.0, 330.0, 70.0), (170.0, 190.0, 62.0)):
        north = [(x, y + gap * (1 + 0.25 * math.sin(x / 190 + height))) for x, y in mid]
        south = [(x, y - gap * (1 + 0.25 * math.sin(x / 170 + height + 2))) for x, y in mid]
        inset = 40 if height > 300 else 0
        far = 360 if height > 300 else 250
        if height > 300:
            pen.plateau([*north, (4060, 4040), (inset, 4040)], height, (slope, 300), label="North rim", smooth=6)
            pen.plateau([*south, (4060, 50), (inset, 50)], height - 20, (slope, 300), label="South rim", smooth=6)
        else:
            pen.plateau(north[1:-1], height, (slope, far), radius=50, closed=False, label="North terrace")
            pen.plateau(south[1:-1], height - 14, (slope, far), radius=50, closed=False, label="South terrace")
    river = [(x, y, -12 - x / 200) for x, y in mid]
    pen.chain(river, (12, 120), (12, 120), wobble=0.0, label="River")
    for x, y, r, z in ((2040, 1850, 90, 285), (2720, 1960, 70, 255), (900, 2360, 80, 270), (1400, 2120, 60, 240)):
        pen.ring(x, y, r, z, (72, 200))
    settings = TerrainSettings(
        title="Canyon", look="desert", sun_azimuth_deg=236.0, sun_elevation_deg=28.0, reach_m=110.0
    )
    return template(
        pen, "Canyon", "A river between two tablelands: terraces, side walls and buttes left standing.", settings
    )


def volcanic_island() -> dict[str, object]:
    """A stratovolcano with a breached crater, ridges to the coast, a side cone and a quiet bay."""
    pen = Pen("volcanic-island", 73)
    cx, cy = 2080.0, 2120.0
    pen.ring(cx, cy, 1180, 78, (16, 500), uneven=0.16, n=13)
    rim = [(cx + 250 * math.cos(a), cy + 235 * math.sin(a)) for a in [math.radians(d) for d in range(-20, 281, 25)]]
    pen.plateau(rim, 640, (33, 1500), radius=14, closed=False, label="Crater rim")
    pen.ring(cx - 10, cy - 10, 105, 470, (20, 80), uneven=0.08)
    for d, length, z in (
        (12, 1250, 60),
        (62, 1150, 64),
        (108, 1300, 58),
        (158, 1220, 62),
        (205, 1330, 60),
        (252, 1120, 66),
    ):
        a = math.radians(d)
        b = math.radians(d + float(pen.rng.uniform(-9, 9)))
        start = (cx + 330 * math.cos(a), cy + 320 * math.sin(a), 560.0)
        half = (cx + (0.55 * length) * math.cos(b), cy + (0.55 * length) * math.sin(b), 285.0)
        end = (cx + length * math.cos(a), cy + length * math.sin(a), float(z))
        pen.chain([start, half, end], (34, 500), (34, 500), wobble=0.06, label="Ridge")
    pen.ring(3010, 1330, 70, 190, (30, 500))
    pen.ring(1090, 3050, 60, 150, (30, 400))
    pen.chain([(3480, 2900, 36), (3650, 3080, 96), (3790, 3180, 34)], (30, 300), (30, 300), label="Islet")
    pen.chain([(560, 900, 36), (700, 760, 110), (900, 700, 40)], (32, 300), (32, 300), label="Islet")
    settings = TerrainSettings(
        title="Volcanic island", sea_level_m=42.0, sun_azimuth_deg=104.0, sun_elevation_deg=19.0, reach_m=240.0
    )
    return template(
        pen, "Volcanic island", "A breached crater, ridges running to the coast, and a side cone in the bay.", settings
    )


def archipelago() -> dict[str, object]:
    """An arc of drowned ridges: a main island, skerries, sandbars and a sheltered lagoon."""
    pen = Pen("archipelago", 29)
    arc = [
        (math.radians(d), s)
        for d, s in zip(range(200, 20, -19), (0.5, 0.8, 1.1, 0.7, 1.35, 1.0, 0.6, 0.9, 0.45, 0.35), strict=True)
    ]
    for a, s in arc:
        x, y = 2050 + 1420 * math.cos(a), 1480 + 1480 * math.sin(a)
        t = a + math.pi / 2 + float(pen.rng.uniform(-0.5, 0.5))
        half = 330 * s + 120
        tip = [
            (x - half * math.cos(t), y - half * math.sin(t), 44.0),
            (x - 0.2 * half * math.cos(t + 0.4), y - 0.2 * half * math.sin(t + 0.4), 90 + 230 * s),
            (x + half * math.cos(t - 0.2), y + half * math.sin(t - 0.2), 46.0),
        ]
        pen.chain(tip, (33, 900), (29, 900), wobble=0.09, label="Island")
        if s > 0.75:
            n = (x + 0.1 * half, y, 150 * s + 60)
            out = (x + 430 * s * math.cos(a), y + 430 * s * math.sin(a), 46.0)
            pen.chain(
                [n, ((n[0] + out[0]) / 2 + 40, (n[1] + out[1]) / 2 - 30, 0.5 * (n[2] + 60)), out],
                (34, 600),
                (34, 600),
                wobble=0.08,
                label="Spur",
            )
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
    return template(
        pen, "Archipelago", "An arc of drowned ridges around a lagoon, with skerries and sandbars.", settings
    )


def template(pen: Pen, title: str, description: str, settings: TerrainSettings) -> dict[str, object]:
    """The JSON value of one file."""
    document = pen.document(settings).model_dump(mode="json")
    return {"id": pen.name, "title": title, "description": description, "document": document}


def files() -> dict[str, str]:
    """File name -> text, for all five."""
    drawn = (figure_six(), alpine_ridge(), canyon(), volcanic_island(), archipelago())
    return {f"{t['id']}.json": json.dumps(t, separators=(",", ":")) + "\n" for t in drawn}


if __name__ == "__main__":
    for name, text in files().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
