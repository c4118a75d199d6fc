"""Makes the README's picture and animation; `make pictures` copies them to docs/pictures.

They are tests too: a picture without contrast, or an animation in which nothing rises, fails.
"""

from __future__ import annotations

import io
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image, ImageChops, ImageStat

from tests.e2e.conftest import ROOT, Server, Visitor, Visitors
from tests.e2e.hands import COARSE, heights, polyline, wait_settled

PICTURES = ROOT / "tests" / "artifacts" / "pictures"


def picture(visitor: Visitor) -> Image.Image:
    """The window as it is now."""
    return Image.open(io.BytesIO(visitor.page.screenshot())).convert("RGB")


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


def test_hero(visitors: Visitors, server: Server) -> None:
    """The landscape of the paper's figure 6 as a visitor sees it."""
    terrain, secret = server.create(template="figure-six", title="Figure six")
    guest = visitors(1280, 800, device_scale_factor=1, slow_screen=False)
    guest.open(f"/t/{terrain}#{secret}")
    wait_settled(guest)
    rest(guest)
    hero = picture(guest)
    assert min(ImageStat.Stat(hero).stddev) > 25, "a landscape has light and shade"
    PICTURES.mkdir(parents=True, exist_ok=True)
    hero.save(PICTURES / "hero.png", optimize=True)


def test_morph(visitors: Visitors, server: Server) -> None:
    """A mountain rises under the pen, frame by frame."""
    terrain, secret = server.create(title="Morph")
    guest = visitors(720, 450, device_scale_factor=1, slow_screen=False)
    guest.open(f"/t/{terrain}#{secret}")
    wait_settled(guest)
    rest(guest)
    guest.page.keyboard.press("b")
    legs = [(190, 262), (245, 205), (270, 212), (330, 128), (365, 160), (400, 138), (455, 205), (480, 196), (545, 258)]
    path = polyline([(float(x), float(y)) for x, y in legs], 5)
    frames = [picture(guest)]
    guest.page.mouse.move(*path[0])
    guest.page.mouse.down()
    for i, point in enumerate(path[1:]):
        guest.page.mouse.move(*point)
        guest.page.wait_for_timeout(60)
        if i % 2 == 1:
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
