"""Makes the README's picture and animation; `make pictures` copies them to docs/pictures.

They are tests too: a picture without contrast, or an animation in which nothing rises, fails. The large picture takes a
software adapter a minute or two and shows nothing that other tests do not ask for, so only `make pictures` draws it.
There alone the animation is large.
"""

from __future__ import annotations

import io
import json
import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageChops, ImageStat

from tests.e2e.conftest import PATIENCE_MS, ROOT, Server, Visitor, Visitors
from tests.e2e.hands import COARSE, heights, on_screen, polyline, press_and_move, wait_settled

PICTURES = ROOT / "tests" / "artifacts" / "pictures"
FOR_README = "ESKER_PICTURES" in os.environ
HERO_VIEW = {"eye": [260.0, 240.0, 640.0], "target": [2000.0, 2350.0, 330.0]}
HERO_STROKE = [(470.0, 690.0), (560.0, 590.0), (600.0, 600.0), (690.0, 500.0), (740.0, 530.0), (850.0, 690.0)]
"""Window pixels of a silhouette, foot to foot."""
HERO_OTHER = (330, 215)
MORPH_STROKE = [(0, 0), (0.16, 50), (0.23, 44), (0.4, 118), (0.5, 88), (0.6, 106), (0.75, 46), (0.82, 54), (1, 0)]
"""A silhouette from foot to foot: how far along, and window pixels above the line between the feet."""


def picture(visitor: Visitor) -> Image.Image:
    """The window as it is now."""
    return Image.open(io.BytesIO(visitor.page.screenshot(timeout=PATIENCE_MS))).convert("RGB")


def rest(visitor: Visitor) -> None:
    """Until nothing was drawn for two seconds: tiles are uploaded, light is baked, quality is full."""
    drawn, same = -1, 0
    for _ in range(600):
        visitor.page.wait_for_timeout(200)
        now = visitor.js("() => window.esker.frames")
        drawn, same = now, same + 1 if now == drawn else 0
        if same == 10:
            return
    raise TimeoutError("the picture does not come to rest")


def open_at(visitor: Visitor, terrain: str, secret: str, view: dict[str, list[float]]) -> None:
    """Opens a terrain where ``view`` looks: the page finds it among its remembered ones, and the key takes it there."""
    remembered: dict[str, object] = {"mode": "orbit", **view}
    kept = json.dumps(json.dumps({"1": remembered}))
    visitor.context.add_init_script(f"localStorage.setItem('esker.views.{terrain}', {kept})")
    visitor.open(f"/t/{terrain}#{secret}")
    wait_settled(visitor)
    visitor.page.keyboard.press("Alt+1")
    near = "([x, y]) => Math.hypot(window.esker.camera().eye[0] - x, window.esker.camera().eye[1] - y) < 1"
    visitor.wait(near, view["eye"][:2])


@pytest.mark.skipif(not FOR_README, reason="a picture for the README: make pictures")
def test_hero(visitors: Visitors, server: Server) -> None:
    """A ridge in the morning, a summit just drawn before it, and somebody else who points at what comes next."""
    terrain, secret = server.create(template="alpine-ridge", title="Morning ridge")
    guest, other = visitors(1440, 900, device_scale_factor=1, slow_screen=False), visitors(480, 360)
    guest.context.add_init_script("localStorage.setItem('esker.name', 'Ada')")
    other.context.add_init_script("localStorage.setItem('esker.name', 'Ben')")
    open_at(guest, terrain, secret, HERO_VIEW)
    open_at(other, terrain, secret, HERO_VIEW)
    rest(guest)
    land = picture(guest)
    guest.page.keyboard.press("b")
    press_and_move(guest.page, polyline(HERO_STROKE, 3))
    guest.page.mouse.up()  # while a stroke is drawn the picture is coarser
    other.page.mouse.move(*HERO_OTHER)
    wait_settled(guest)
    rest(guest)
    hero = picture(guest)
    assert min(ImageStat.Stat(hero).stddev) > 25, "a landscape has light and shade"
    grown = np.asarray(ImageChops.difference(hero, land)).max(axis=2) > 12
    assert grown.mean() > 0.02, "the summit stands in the picture"
    PICTURES.mkdir(parents=True, exist_ok=True)
    hero.save(PICTURES / "hero.png", optimize=True)


def test_morph(visitors: Visitors, server: Server) -> None:
    """A mountain rises under the pen, frame by frame."""
    terrain, secret = server.create(title="Morph")
    width, height = (800, 500) if FOR_README else (480, 300)
    large: dict[str, Any] = {"device_scale_factor": 1, "slow_screen": False} if FOR_README else {"seen": True}
    guest = visitors(width, height, **large)
    guest.open(f"/t/{terrain}#{secret}")
    wait_settled(guest)
    rest(guest)
    guest.page.keyboard.press("b")
    (left, foot), (right, end) = on_screen(guest, 900, 2300), on_screen(guest, 3000, 2500)
    rises = height / 500
    legs = [(left + part * (right - left), foot + part * (end - foot) - rises * rise) for part, rise in MORPH_STROKE]
    path = polyline(legs, 5 if FOR_README else 2)
    frames = [picture(guest)]
    guest.page.mouse.move(*path[0])
    guest.page.mouse.down()
    for i, point in enumerate(path[1:]):
        shown = guest.js("() => window.esker.frames")
        guest.page.mouse.move(*point)
        guest.wait("n => window.esker.frames > n", shown)
        if i % 2 == 1 or not FOR_README:
            frames.append(picture(guest))
    guest.page.mouse.up()
    wait_settled(guest)
    rest(guest)
    frames.append(picture(guest))
    assert max(heights(guest, COARSE)) > 100
    moved = [max(ImageStat.Stat(ImageChops.difference(a, b)).mean) for a, b in pairwise(frames)]
    assert np.count_nonzero(np.array(moved) > 0.2) > len(moved) // 2, "the ground moves while the pen moves"
    save_animation(frames, PICTURES / "morph.gif")


def save_animation(frames: list[Image.Image], path: Path) -> None:
    """A looping GIF with one palette for all frames, so that still parts stay still."""
    path.parent.mkdir(parents=True, exist_ok=True)
    palette = frames[-1].quantize(160, method=Image.Quantize.MEDIANCUT)
    small = [f.quantize(palette=palette, dither=Image.Dither.NONE) for f in frames]
    small[0].save(
        path,
        save_all=True,
        append_images=small[1:],
        duration=[600, *[110] * (len(small) - 2), 2200],
        loop=0,
        optimize=True,
    )
