"""A lost graphics device is replaced without reloading the page (SPEC U21)."""

from __future__ import annotations

import io
import os
import signal
import time
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import psutil
import pytest
from PIL import Image
from playwright.sync_api import Browser

from tests.browser import FLAGS, chromium_path
from tests.e2e.conftest import AWAKE, Server, Visitor, Visitors
from tests.e2e.hands import COARSE, arch, draw, heights, on_screen, wait_settled, wait_still

# The page asks for its devices through this; the test takes the last one away.
KEEP_DEVICES = """
  window.devices = [];
  const request = GPUAdapter.prototype.requestDevice;
  GPUAdapter.prototype.requestDevice = async function (...rest) {
    if (window.refuseDevices) throw new Error("none for the test");
    const device = await request.apply(this, rest);
    window.devices.push(device);
    return device;
  };
"""


def contrast(visitor: Visitor) -> float:
    """Standard deviation of the middle of the window: what is black or one colour has none."""
    picture = Image.open(io.BytesIO(visitor.page.screenshot())).convert("L")
    width, height = picture.size
    return float(np.asarray(picture.crop((width // 4, height // 4, 3 * width // 4, 3 * height // 4))).std())


def open_page(visitors: Visitors, server: Server) -> Visitor:
    """A terrain with a mountain, drawn in 3D by a device that the test can take away."""
    terrain, secret = server.create(template="alpine-ridge", title="Lost")
    guest = visitors(480, 360, seen=True)
    guest.page.add_init_script(KEEP_DEVICES)
    guest.open(f"/t/{terrain}#{secret}")
    wait_settled(guest)
    assert guest.js("() => window.esker.renderer()") == "webgpu"
    return guest


def draw_here(guest: Visitor) -> None:
    """A stroke morphs the ground as before."""
    before, count = heights(guest, COARSE), len(guest.js("() => window.esker.strokes()"))
    left, right = on_screen(guest, 1100, 900), on_screen(guest, 2900, 1100)
    draw(guest, "b", arch(left, right, 100))
    wait_settled(guest)
    assert len(guest.js("() => window.esker.strokes()")) == count + 1
    assert np.abs(np.subtract(heights(guest, COARSE), before)).max() > 20


def drawn_again(guest: Visitor, frames: int) -> None:
    """Another device has drawn the ground."""
    guest.wait("n => window.esker.frames > n && window.esker.renderer() === 'webgpu'", frames)
    deadline = time.monotonic() + 40
    while contrast(guest) <= 8:
        assert time.monotonic() < deadline, "the ground is not drawn again"
        guest.page.wait_for_timeout(100)


def test_another_device_goes_on_and_the_map_stands_in_where_there_is_none(visitors: Visitors, server: Server) -> None:
    guest = open_page(visitors, server)
    guest.page.keyboard.press("ArrowLeft")
    wait_still(guest)
    frames, camera, strokes = (guest.js(f"() => window.esker.{what}") for what in ("frames", "camera()", "strokes()"))
    guest.js("() => window.devices.at(-1).destroy()")
    guest.page.get_by_text("The graphics device was lost; the 3D view is open again.").wait_for()
    drawn_again(guest, frames)
    assert guest.js("() => window.devices.length") == 2
    assert guest.js("() => window.esker.camera()") == camera
    assert guest.js("() => window.esker.strokes()") == strokes
    assert guest.js("() => window.esker.connection()") == "online"
    draw_here(guest)

    guest.js("() => { window.refuseDevices = true; window.devices.at(-1).destroy(); }")
    again = guest.page.get_by_role("button", name="Try the 3D view again")
    again.wait_for()
    assert guest.js("() => [window.esker.renderer(), window.esker.camera().mode]") == ["map", "map"]
    guest.js("() => { window.refuseDevices = false; }")
    again.click()
    drawn_again(guest, guest.js("() => window.esker.frames"))
    assert guest.js("() => window.esker.camera().mode") == "orbit"
    assert guest.errors == []


@pytest.fixture
def own_browser(browser: Browser) -> Iterator[Browser]:
    """A browser that may be harmed: others go on with theirs."""
    made = browser.browser_type.launch(executable_path=chromium_path(), args=FLAGS + AWAKE)
    yield made
    made.close()


def _gpu_processes() -> set[int]:
    found = set()
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):  # it has ended meanwhile
            if "--type=gpu-process" in process.cmdline():
                found.add(process.pid)
    return found


def test_a_crash_of_the_graphics_process_is_survived(
    browser: Browser, server: Server, request: pytest.FixtureRequest
) -> None:
    known = _gpu_processes()
    visitors = Visitors(request.getfixturevalue("own_browser"), server)
    guest = open_page(visitors, server)
    frames = guest.js("() => window.esker.frames")
    [process] = _gpu_processes() - known
    os.kill(process, signal.SIGKILL)
    guest.wait("() => window.devices.length > 1")
    drawn_again(guest, frames)
    for visitor in visitors.made:
        visitor.context.close()
