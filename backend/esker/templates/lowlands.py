"""Two starting terrains that water made: a delta and a badland. ``draw.py`` writes their files."""

from __future__ import annotations

import math

from esker.contract import TerrainSettings
from esker.templates.pen import Pen

APEX = (2080.0, 2700.0)
"""Where the river of the delta parts."""
BRANCHES = ((-62, 1500), (-34, 1960), (-9, 2240), (17, 2120), (43, 1760), (68, 1380))
"""Arms of the delta: degrees from south, east positive, and metres from the apex to the sea."""
SEA_M = -13.0
BED_M = -17.0
"""Height of the arms' beds: water of the sea stands in them."""


def delta() -> Pen:
    """A river from the hills parts into six arms on a plain and builds its lobes out into the sea."""
    pen = Pen("delta", 57)
    west = [(-300, 3500, 120), (420, 3760, 330), (980, 3620, 250), (1420, 3960, 360), (1560, 4500, 200)]
    east = [(2760, 4500, 220), (2900, 3880, 330), (3380, 3560, 270), (3840, 3760, 390), (4450, 3500, 180)]
    for chain in (west, east):
        pen.massif(chain, 27, spacing=430, reach=1.35, spurs=1, meander=0.16, label="Hills")
    valley = [(2240, 4400, 36), (2120, 4010, 24), (2230, 3620, 10), (2060, 3180, -4), (*APEX, BED_M)]
    pen.chain(valley, (8, 190), (8, 190), wobble=0.0, label="River")
    tips = [_arm(pen, degrees, length) for degrees, length in BRANCHES]
    # The sea: its shore runs out along each arm and back into the bays between them.
    shore: list[tuple[float, float]] = [(-320, 2060), (240, 1990)]
    for k, (x, y) in enumerate(tips):
        ahead = math.atan2(x - APEX[0], APEX[1] - y)
        side = (math.cos(ahead) * 120, math.sin(ahead) * 120)
        shore += [(x - side[0], y - side[1]), (x, y - 70), (x + side[0], y + side[1])]
        if k + 1 < len(tips):
            nx, ny = tips[k + 1]
            bay = 0.90 + 0.05 * float(pen.rng.uniform(-1, 1))
            mx, my = 0.5 * (x + nx), 0.5 * (y + ny)
            shore.append((APEX[0] + (mx - APEX[0]) * bay, APEX[1] + (my - APEX[1]) * bay))
    shore += [(3900, 2040), (4420, 2120), (4420, -320), (-320, -320)]
    pen.plateau(shore, -48, (5, 420), label="Sea", smooth=4)
    # Bars of sand before the mouths, and pools on the plain that an old arm left.
    for k in (1, 2, 3, 4):
        x, y = tips[k]
        bar = [(x - 190, y - 250), (x - 40, y - 320), (x + 150, y - 290)]
        pen.plateau(bar, SEA_M + 1.6, (4, 160), radius=22, closed=False, label="Bar")
    for x, y, r in ((1300, 2430, 26), (2620, 2300, 34), (1750, 2010, 22), (3060, 2560, 30), (860, 2500, 28)):
        pen.ring(x, y, r, SEA_M - 2.0, (12, 90), uneven=0.3)
    return pen


def _arm(pen: Pen, degrees: float, length: float) -> tuple[float, float]:
    """One arm, which wanders on its way; where it ends."""
    angle = math.radians(degrees)
    phase, sway = float(pen.rng.uniform(0, 1)), float(pen.rng.choice([-1.0, 1.0])) * 0.14
    path = [APEX]
    for k in range(1, 10):
        t = k / 9
        turn = angle * (0.45 + 0.55 * t) + sway * math.sin(2 * math.pi * (1.6 * t + phase)) * (1 - 0.6 * t)
        r = length * t
        path.append((APEX[0] + r * math.sin(turn), APEX[1] - r * math.cos(turn)))
    pen.plateau(path, BED_M, (15, 90), radius=11, closed=False, label="Arm", smooth=4)
    return path[-1]


def badland() -> Pen:
    """Clay hills that rain has cut to ribs and gullies, under a tableland that still stands."""
    pen = Pen("badland", 83)
    ribs = (
        [(-200, 700, 0), (500, 860, 96), (1080, 700, 142), (1700, 900, 118), (2300, 760, 64), (2700, 820, 0)],
        [(1500, 60, 0), (2150, 280, 104), (2800, 180, 150), (3420, 420, 96), (4300, 300, 0)],
        [(2500, 1380, 0), (2980, 1180, 128), (3440, 1320, 172), (3900, 1160, 120), (4400, 1240, 40)],
        [(-300, 1560, 40), (380, 1480, 132), (960, 1640, 168), (1520, 1500, 122), (2050, 1640, 0)],
    )
    for rib in ribs:
        pen.massif(rib, 34, spacing=250, reach=1.4, spurs=1, meander=0.2, label="Rib")
    rim = [
        (-320, 2330), (220, 2250), (420, 2520), (700, 2300), (1010, 2240), (1180, 2600), (1420, 2700), (1560, 2360),
        (1900, 2200), (2140, 2380), (2260, 2760), (2520, 2800), (2680, 2420), (3020, 2300), (3260, 2520), (3420, 2860),
        (3640, 2560), (3980, 2420), (4420, 2520),
    ]  # fmt: skip
    pen.plateau([*rim, (4420, 4420), (-320, 4420)], 260, (58, 420), label="Tableland", smooth=3)
    foot = [(x, y - 170.0) for x, y in rim[1:-1]]
    pen.plateau(foot, 128, (40, 300), radius=24, closed=False, label="Bench", smooth=3)
    for x, y, r, z in ((640, 2060, 34, 150), (1760, 1960, 40, 178), (2860, 2020, 30, 162), (3640, 2140, 36, 158)):
        pen.ring(x, y, r, z, (52, 260), uneven=0.25)
    wash = [
        (-100, 1130, 14), (700, 1190, 9), (1420, 1160, 4), (2120, 1080, -2), (2640, 700, -8), (3100, 760, -13),
        (4200, 700, -22),
    ]  # fmt: skip
    pen.chain(wash, (6, 150), (6, 150), wobble=0.0, label="Wash")
    return pen


def delta_settings() -> TerrainSettings:
    """A low morning sun over the sea."""
    return TerrainSettings(
        title="Delta", sea_level_m=SEA_M, sun_azimuth_deg=112.0, sun_elevation_deg=21.0, reach_m=150.0
    )


def badland_settings() -> TerrainSettings:
    """Late light, and rain's own lines: narrow gullies that let crests move."""
    return TerrainSettings(title="Badland", look="desert", sun_azimuth_deg=242.0, sun_elevation_deg=24.0, reach_m=90.0)
