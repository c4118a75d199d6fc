"""Draws the pictures of the starting terrains (frontend/public/templates/*.webp) from the real page.

Run a server with the built page, then: ``python frontend/dev/previews.py http://127.0.0.1:8000 [id ...]``.
Needs Chromium with WebGPU; without a GPU the software adapter takes about ten seconds a picture.
"""

from __future__ import annotations

import io
import json
import sys
import urllib.request
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

OUT = Path(__file__).resolve().parents[1] / "public" / "templates"
SIZE = (640, 400)
FLAGS = [
    "--no-sandbox",
    "--enable-unsafe-webgpu",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-angle=swiftshader",
    "--disable-background-networking",
    "--no-first-run",
]
# Drag with the right button (turn, tilt) and wheel, in pixels, from the view of the whole terrain.
VIEWS = {
    "figure-six": (40, -40, -300),
    "alpine-ridge": (70, -60, -330),
    "canyon": (90, -10, -330),
    "volcanic-island": (40, -55, -420),
    "archipelago": (30, -25, -330),
}
CHROME = "esk-top-bar, esk-tools, .foot, .hint, esk-overlay, esk-toasts"


def wait(page: Page, condition: str, seconds: float) -> None:
    """Poll: the page's content security policy forbids Playwright's own wait_for_function."""
    for _ in range(int(seconds * 5)):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(200)
    raise TimeoutError(condition)


def picture(page: Page, base: str, template: str) -> None:
    """One picture: opens a copy of the terrain, turns to its view, waits until all is still."""
    body = json.dumps({"template": template}).encode()
    call = urllib.request.Request(f"{base}/api/terrains", body, {"Content-Type": "application/json"})
    with urllib.request.urlopen(call) as answer:
        made = json.load(answer)
    page.goto(f"{base}/t/{made['id']}#{made['secret']}")
    wait(page, "!!(window.esker && window.esker.ready() && window.esker.settled())", 90)
    page.keyboard.press("s")
    dx, dy, wheel = VIEWS.get(template, (0, -60, -400))
    x, y = page.viewport_size["width"] / 2, page.viewport_size["height"] / 2  # type: ignore[index]
    page.mouse.move(x, y)
    page.mouse.down(button="right")
    page.mouse.move(x + dx, y + dy, steps=8)
    page.mouse.up(button="right")
    page.mouse.wheel(0, wheel)
    parts = f"document.querySelector('esk-terrain').shadowRoot.querySelectorAll('{CHROME}')"
    page.evaluate(f"{parts}.forEach((part) => (part.style.display = 'none'))")
    page.wait_for_timeout(3000)
    wait(page, "!window.esker.stats().busy", 30)
    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    shot.resize(SIZE, Image.Resampling.LANCZOS).save(OUT / f"{template}.webp", quality=84, method=6)
    sys.stdout.write(f"{template}: {(OUT / f'{template}.webp').stat().st_size // 1024} KiB\n")


def main() -> None:
    """Draws the named pictures, or all."""
    base, *names = sys.argv[1:]
    OUT.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        page = browser.new_page(viewport={"width": 960, "height": 600})
        for name in names or list(VIEWS):
            picture(page, base, name)
        browser.close()


if __name__ == "__main__":
    main()
