"""A real server process and a real Chromium for the end-to-end tests (SPEC E)."""

from __future__ import annotations

import json
import os
import re
import signal
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Error, Page, Playwright, sync_playwright

from tests import zygote
from tests.browser import FLAGS, chromium_path, draw_politely, free_port

ROOT = Path(__file__).resolve().parents[2]
ARTIFACTS = ROOT / "tests" / "artifacts" / "e2e"
# Two pages side by side: neither may be slowed down as if it were in the background. What is not drawn in 3D costs less
# without the software graphics.
AWAKE = ["--disable-backgrounding-occluded-windows", "--disable-renderer-backgrounding", "--disable-gpu-rasterization"]
# Pages draw their 3D view as ever, but it is not put on the screen: doing that takes the software graphics as long as
# drawing it, and it is done with each change of the page.
UNSEEN = ["--disable-gpu-compositing"]

LEVEL = 3
"""The finest level that servers of these tests solve as a whole; the product's own is one more, which is four times as
many tiles to solve, send, unpack and draw. Two people who sketch one terrain have that (``test_together.py``)."""

NO_PREVIEWS = {"ESKER_PREVIEWS": "false"}
"""Pictures for programs that unfold links took a twentieth of what these tests take; nobody here looks at them. They
are drawn in ``tests/render/test_previews.py`` and by the server of ``tests/elsewhere/test_wheel.py``."""

SCALE = 0.25
"""Drawn pixels per CSS pixel, along a side: hands, layout and errors are those of the whole window, but the software
adapter draws a sixteenth of its pixels. Where the picture itself is looked at, tests ask for 1. Windows of fewer pixels
are not seen unless they ask for that: in their screenshots the 3D view is missing."""

PATIENCE_MS = 90_000
"""How long hands and eyes wait: limits end what hangs, a busy machine takes its time."""

HERTZ = 2
"""Pictures a second that a window shows at most, as a slow screen would: else pages of the software adapter draw all
that the processors can, for frames that nobody looks at, while the server that they wait for gets what is left."""
SLOW_SCREEN = """
  const draws = new Map(), real = requestAnimationFrame.bind(window), period = 1000 / HERTZ;
  let last = -period, count = 0, asked = false;
  const show = (now) => {
    asked = false;
    last = now;
    const due = [...draws.values()];
    draws.clear();
    for (const draw of due) try { draw(now); } catch (error) { reportError(error); }
  };
  window.requestAnimationFrame = (draw) => {
    draws.set(++count, draw);
    if (!asked) setTimeout(() => real(show), Math.max(0, last + period - performance.now()));
    asked = true;
    return count;
  };
  window.cancelAnimationFrame = (id) => void draws.delete(id);
""".replace("HERTZ", str(HERTZ))

NO_WEBGPU = "Object.defineProperty(Navigator.prototype, 'gpu', { get: () => undefined });"
"""Such a browser shows the map. Opening the 3D view takes the software adapter two seconds of processor time, most of
them for its pipelines: who is there for panels, pens or ground that arrives comes with such a one, as many do."""

WATCH = """([argument, patienceMs]) => new Promise((resolve, reject) => {
  const holds = %s, end = performance.now() + patienceMs;
  const look = () => {
    try {
      if (holds(argument)) resolve(true);
      else if (performance.now() > end) resolve(false);
      else setTimeout(look, 50);
    } catch (error) {
      reject(error);
    }
  };
  look();
})"""
"""Comes true when a condition does, false when it has not in so many milliseconds."""


@dataclass
class Server:
    """A server process that can be killed and started again on the same port and data."""

    data: Path
    port: int = field(default_factory=free_port)
    options: tuple[str, ...] = ()
    environment: dict[str, str] = field(default_factory=dict)
    level: int = LEVEL
    process: zygote.Process | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Start and wait until /healthz answers. Raises RuntimeError with the log when it does not."""
        arguments = ["serve", "--port", str(self.port), "--data", str(self.data), *self.options]
        environment = {"ESKER_LEVEL": str(self.level)} | NO_PREVIEWS | self.environment
        self.process = zygote.start("esker", arguments, environment, self.data.parent / "server.log")
        deadline = time.monotonic() + 300  # the first start of a machine compiles, beside whatever else it does
        while time.monotonic() < deadline:
            if self.process.poll() is not None:
                break
            try:
                with urllib.request.urlopen(f"{self.url}/healthz", timeout=1) as answer:
                    if answer.status == 200:
                        return
            except (urllib.error.URLError, OSError):
                time.sleep(0.1)
        raise RuntimeError((self.data.parent / "server.log").read_text(errors="replace")[-4000:])

    def kill(self, number: int = signal.SIGKILL) -> None:
        """Send a signal and reap the process."""
        if self.process is not None and self.process.poll() is None:
            os.kill(self.process.pid, number)
            self.process.wait(30)

    def request(self, method: str, path: str, body: Any = None, secret: str | None = None) -> bytes:
        """One HTTP request; raises on an error status."""
        headers = {"Content-Type": "application/json"}
        if secret:
            headers["Authorization"] = f"Bearer {secret}"
        data = None if body is None else json.dumps(body).encode()
        call = urllib.request.Request(self.url + path, data=data, headers=headers, method=method)
        with urllib.request.urlopen(call, timeout=120) as answer:
            return bytes(answer.read())

    def create(self, **body: Any) -> tuple[str, str]:
        """A new terrain: id and owner secret."""
        made = json.loads(self.request("POST", "/api/terrains", body))
        return made["id"], made["secret"]


def serving(folder: Path, level: int = LEVEL) -> Iterator[Server]:
    """A fresh server on an empty data folder inside ``folder``, ended at the end: the body of a fixture."""
    if not (ROOT / "frontend" / "dist" / "index.html").exists():
        pytest.fail("The page is not built: run `make test`, which builds it first.")
    made = Server(folder / "data", level=level)
    made.start()
    yield made
    made.kill(signal.SIGTERM)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest of these take minutes, on a busy machine several times as many."""
    for item in items:
        if item.path.is_relative_to(Path(__file__).parent):
            item.add_marker(pytest.mark.timeout(1200))


@pytest.fixture(scope="package")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One server for all: every test makes terrains of its own. Who harms it starts one of their own (``serving``)."""
    yield from serving(tmp_path_factory.mktemp("server"))


@pytest.fixture(scope="package")
def playwright() -> Iterator[Playwright]:
    """What starts browsers; its event loop ends with this folder."""
    with sync_playwright() as made:
        yield made


def browsing(playwright: Playwright, *flags: str) -> Iterator[Browser]:
    """Headless Chromium with WebGPU on the software adapter, ended at the end: the body of a fixture."""
    made = playwright.chromium.launch(executable_path=chromium_path(), args=[*FLAGS, *AWAKE, *flags])
    draw_politely()
    yield made
    made.close()


@pytest.fixture(scope="package")
def browser(playwright: Playwright) -> Iterator[Browser]:
    """Shows pages without their 3D view."""
    yield from browsing(playwright, *UNSEEN)


@pytest.fixture(scope="package")
def seen_browser(playwright: Playwright) -> Iterator[Browser]:
    """Shows all."""
    yield from browsing(playwright)


@dataclass
class Visitor:
    """One person: a browser context with one page, whose requests and console are watched."""

    context: BrowserContext
    page: Page
    origin: str
    foreign: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def watch(self) -> None:
        def seen(url: str) -> None:
            host = re.match(r"^(?:https?|wss?)://([^/]+)", url)
            if host and host.group(1) != self.origin.split("//")[1]:
                self.foreign.append(url)

        self.page.on("request", lambda request: seen(request.url))
        self.page.on("websocket", lambda socket: seen(socket.url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda line: self.errors.append(line.text) if line.type == "error" else None)

    def open(self, path: str) -> None:
        """Open a path of the server and wait for the terrain to be there."""
        self.page.goto(self.origin + path)
        self.wait("() => window.esker !== undefined && window.esker.ready()", timeout=90)

    def js(self, expression: str, argument: Any = None) -> Any:
        """Evaluate in the page."""
        return self.page.evaluate(expression, argument)

    def wait(self, condition: str, argument: Any = None, timeout: float = 90) -> None:
        """Wait until a condition in the page holds. (Playwright's own wait needs `eval`, which our CSP forbids.)"""
        deadline = time.monotonic() + timeout
        while not self._holds(condition, argument, deadline - time.monotonic()):
            if time.monotonic() > deadline:
                self.shot("timeout")
                raise TimeoutError(f"not so after {timeout} s: {condition} {argument!r}")

    def _holds(self, condition: str, argument: Any, seconds: float) -> bool:
        """Whether the condition comes true within a time. The page asks itself: asked from here it keeps a core busy.

        False too when the page goes to another address meanwhile: there is nobody to ask then.
        """
        try:
            return bool(self.page.evaluate(WATCH % condition, [argument, max(0.0, 1000 * seconds)]))
        except Error as error:
            if "Execution context was destroyed" not in error.message:
                raise
            self.page.wait_for_timeout(50)
            return False

    def shot(self, name: str) -> Path:
        """Keep a screenshot as a test artefact."""
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        path = ARTIFACTS / f"{name}.png"
        self.page.screenshot(path=path)
        return path


class Visitors:
    """Makes visitors; closes them all at the end."""

    def __init__(self, browser: Browser, server: Server, seen: Callable[[], Browser] | None = None) -> None:
        """``seen`` gives the browser of windows that are looked at; by default it is the same."""
        self.browser, self.server = browser, server
        self.seen = seen or (lambda: browser)
        self.made: list[Visitor] = []

    def __call__(
        self,
        width: int = 720,
        height: int = 540,
        device_scale_factor: float = SCALE,
        slow_screen: bool = True,
        seen: bool | None = None,
        on_map: bool = False,
        **options: Any,
    ) -> Visitor:
        """A window of so many CSS pixels, of ``device_scale_factor`` pixels each along a side.

        ``seen``: its 3D view is in screenshots (default: where it has all its pixels). ``on_map``: it has no WebGPU.
        """
        shown = device_scale_factor > SCALE if seen is None else seen
        context = (self.seen() if shown else self.browser).new_context(
            viewport={"width": width, "height": height}, device_scale_factor=device_scale_factor, **options
        )
        context.set_default_timeout(PATIENCE_MS)
        if slow_screen:
            context.add_init_script(SLOW_SCREEN)
        if on_map:
            context.add_init_script(NO_WEBGPU)
        visitor = Visitor(context, context.new_page(), self.server.url)
        draw_politely()  # the graphics process of a browser that was just launched may be there only now
        visitor.watch()
        self.made.append(visitor)
        return visitor


@pytest.fixture
def visitors(browser: Browser, server: Server, request: pytest.FixtureRequest) -> Iterator[Visitors]:
    """``visitors()`` gives a new person on the server."""
    made = Visitors(browser, server, lambda: request.getfixturevalue("seen_browser"))
    yield made
    for visitor in made.made:
        visitor.context.close()
