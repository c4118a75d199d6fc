"""Draws the pictures of docs/teaching.md in Chromium: ``python docs/pictures/lesson.py [projector wall task profile]``.

It starts a server with ``--lan``, plays a class of nine with answers of their own, and writes
docs/pictures/lesson-<name>.webp. No GPU is needed; all four take some two minutes on two cores.
"""

from __future__ import annotations

import json
import secrets
import ssl
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from esker import Stroke, connect
from esker.templates import teaching

HERE: Final = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))

from tests.browser import FLAGS, chromium_path, free_port  # noqa: E402

PUPILS: Final = (
    ("Ada", 1.0), ("Ben", 0.72), ("Chloé", 0.9), ("Deniz", 0.35), ("Emil", 1.12), ("Fatou", 0.97), ("Gus", 0.55),
    ("Hana", 0.85), ("Ivo", 0.0),
)  # fmt: skip
"""Names, and how high they draw what is asked for."""
BEHIND: Final = 75.0
"""Metres by which the answers of the pupils lie beside what is asked for."""


class School:
    """A server with a teacher's terrain of a lesson, and its class."""

    def __init__(self, folder: Path) -> None:
        self.data, self.port = folder / "data", free_port()
        command = [sys.executable, "-m", "esker", "serve", "--lan", "--port", str(self.port), "--data", str(self.data)]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        self.base, self._tls = f"https://127.0.0.1:{self.port}", ssl._create_unverified_context()
        deadline = time.monotonic() + 300
        while True:
            try:
                self.ask("GET", "/healthz")
                return
            except OSError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.3)

    def ask(self, method: str, path: str, body: Any = None, secret: str = "") -> Any:
        """One request; the JSON of its answer."""
        headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {secret}"} if secret else {})
        data = None if body is None else json.dumps(body).encode()
        call = urllib.request.Request(self.base + path, data, headers, method=method)
        with urllib.request.urlopen(call, context=self._tls, timeout=120) as answer:
            return json.loads(answer.read() or b"null")

    def begin(self, lesson: str) -> tuple[str, str, dict[str, Any]]:
        """A terrain of a lesson and a class of it: the terrain, its owner's secret, and the class."""
        made = self.ask("POST", "/api/terrains", {"template": lesson})
        terrain, secret = made["id"], made["secret"]
        return terrain, secret, self.ask("POST", f"/api/terrains/{terrain}/classes", {}, secret)

    def pupil(self, made: dict[str, Any], name: str, strokes: Sequence[Stroke]) -> str:
        """The link of a pupil who has drawn these."""
        seat = secrets.token_urlsafe(24)
        body = {"code": made["code"], "seat": seat, "name": name}
        sat = self.ask("POST", f"/api/classes/{made['id']}/seats", body)
        link = f"{self.base}/t/{sat['id']}#{seat}"
        with connect(link, name, ca_file=str(self.data / "tls" / "esker-ca.pem"), ground=False) as terrain:
            for stroke in strokes:
                terrain.add(stroke)
            terrain.wait()
        return link


def attempt(answer: Sequence[Stroke], share: float) -> list[Stroke]:
    """An answer as somebody draws it who has understood so much of it: lower, and a little beside."""
    if share == 0:
        return []
    lines: list[Stroke] = []
    for number, stroke in enumerate(answer):
        if number % 2 and share < 0.6:
            continue
        aside = BEHIND * (1 - share)
        (x, y, z), (u, v, w) = stroke.first, stroke.last
        ends = {"first": (x + aside, y - aside, z * share), "last": (u + aside, v - aside, w * share)}
        curve = tuple((along, up * share) for along, up in stroke.curve)
        lines.append(stroke.model_copy(update={**ends, "curve": curve, "id": f"p{number}-{secrets.token_hex(4)}"}))
    return lines


def keep(page: Page, name: str) -> None:
    """Writes what a page shows."""
    out = HERE / f"lesson-{name}.webp"
    with tempfile.TemporaryDirectory() as folder:
        page.screenshot(path=f"{folder}/page.png")
        Image.open(f"{folder}/page.png").convert("RGB").save(out, quality=80, method=6)
    sys.stdout.write(f"{name}: {out.stat().st_size // 1024} KiB\n")


def opened(browser: Browser, url: str, size: tuple[int, int]) -> Page:
    """A window that trusts the server."""
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]}, ignore_https_errors=True, color_scheme="light"
    )
    context.set_default_timeout(240_000)
    page = context.new_page()
    page.goto(url)
    return page


def ready(page: Page) -> None:
    """Waits until a terrain has come and its ground is final."""
    deadline = time.monotonic() + 240
    while not page.evaluate("() => window.esker?.ready?.() && (window.esker.score()?.points ?? -1) >= 0"):
        assert time.monotonic() < deadline, "the terrain did not come"
        page.wait_for_timeout(250)
    page.wait_for_timeout(4000)


def main() -> None:
    """Draws the named pictures, or all."""
    wanted = set(sys.argv[1:] or ("projector", "wall", "task", "profile"))
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        school = School(Path(folder))
        browser = play.chromium.launch(executable_path=chromium_path(), args=FLAGS)
        try:
            terrain, secret, made = school.begin("reading-contours")
            links = {
                name: school.pupil(made, name, attempt(teaching.contours().answer, share)) for name, share in PUPILS
            }
            if "wall" in wanted:
                page = opened(browser, f"{school.base}/wall/{terrain}/{made['id']}#{secret}", (1366, 900))
                page.locator("esk-wall li .points").nth(len(PUPILS) - 1).wait_for()
                page.get_by_role("radio", name="By score").click()
                page.wait_for_timeout(3000)
                keep(page, "wall")
            if "task" in wanted:
                page = opened(browser, links["Hana"], (1366, 768))
                ready(page)
                page.locator("esk-task-chip").get_by_role("button").first.click()
                page.locator("esk-task-panel wa-switch", has_text="Red and blue").click(position={"x": 14, "y": 12})
                page.wait_for_timeout(5000)
                keep(page, "task")
            if "projector" in wanted:
                windows = [opened(browser, links[name], (400, 300)) for name in ("Ada", "Ben", "Chloé")]
                page = opened(browser, f"{school.base}/room#{made['code']}", (1280, 720))
                page.locator("esk-room strong", has_text="3").wait_for()
                keep(page, "projector")
                for window in windows:
                    window.context.close()
            if "profile" in wanted:
                _, _, made = school.begin("drawing-the-profile")
                link = school.pupil(made, "Ada", attempt(teaching.profile().answer, 0.8))
                page = opened(browser, link, (1366, 768))
                ready(page)
                page.locator("esk-task-chip").get_by_role("button").first.click()
                page.locator("esk-task-panel").get_by_role("button", name="Show the profile").click()
                page.locator("esk-measure svg.chart path.crest").wait_for()
                page.wait_for_timeout(5000)
                keep(page, "profile")
        finally:
            browser.close()
            school.process.terminate()
            school.process.wait(30)


if __name__ == "__main__":
    main()
