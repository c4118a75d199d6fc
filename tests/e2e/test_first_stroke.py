"""A newcomer's first stroke, with real pointer events (SPEC I310, I312, U310, U314, U315)."""

from __future__ import annotations

from tests.e2e.conftest import Visitors
from tests.e2e.hands import arch, press_and_move, wait, wait_settled, wait_still

CORNERS = "() => [[0,0],[4096,0],[4096,4096],[0,4096]].map(([x, y]) => window.esker.project(x, y, 0))"
CREST = """() => {
  const s = window.esker.strokes()[0], out = [];
  for (const [u, w] of s.curve) {
    const x = s.first[0] + u * (s.last[0] - s.first[0]), y = s.first[1] + u * (s.last[1] - s.first[1]);
    out.push([x, y, s.first[2] + u * (s.last[2] - s.first[2]) + w]);
  }
  return out;
}"""
HIGHEST = "() => Math.max(...window.esker.strokes()[0].curve.map(([u, w]) => w))"
TABS = """() => {
  const tabs = document.querySelector("esk-terrain").shadowRoot.querySelector("aside esk-segmented");
  const box = tabs.getBoundingClientRect(), last = [...tabs.shadowRoot.querySelectorAll("button")].at(-1);
  return [last.getBoundingClientRect().right, box.right, last.scrollWidth, last.clientWidth];
}"""
UNDER = """() => {
  const toasts = document.querySelector("esk-terrain").shadowRoot.querySelector("esk-toasts");
  const toast = toasts.shadowRoot.querySelector(".toast");
  const box = toast.getBoundingClientRect();
  return [box.left + 20, box.top + box.height / 2];
}"""


def test_the_mountain_stands_still_while_the_pen_comes_down(visitors: Visitors) -> None:
    server = visitors.server
    terrain, secret = server.create()
    ana = visitors(900, 600)
    ana.open(f"/t/{terrain}#{secret}")
    for corner in ana.js(CORNERS):
        assert 60 < corner["x"] < 900
        assert 60 < corner["y"] < 545

    # The arch of the first view: from half-way on the line is what it is after release, and so is the ground under it.
    path = arch((300, 380), (620, 380), 190, steps=40)
    press_and_move(ana.page, path[:22])
    wait(ana, "() => window.esker.pending() === 0 && window.esker.strokes()[0].curve.length > 3")
    top = [ana.js(HIGHEST)]
    summit = max(ana.js(CREST), key=lambda p: p[2])
    for x, y in path[22:]:
        ana.page.mouse.move(x, y)
        top.append(ana.js(HIGHEST))
    wait(ana, "([x, y]) => window.esker.heightAt(x, y) > 100", list(summit[:2]))
    before = ana.js("([x, y]) => window.esker.heightAt(x, y)", list(summit[:2]))
    ana.page.mouse.up()
    wait_settled(ana)
    after = ana.js(HIGHEST)
    assert all(abs(height - after) < 0.05 * after for height in top), (top, after)
    assert abs(before - ana.js("([x, y]) => window.esker.heightAt(x, y)", list(summit[:2]))) < 0.05 * after

    # Beside the land the line is refused and the view stays; a line may begin under the sentence that says so.
    view = ana.js("() => window.esker.camera()")
    press_and_move(ana.page, [(850, 500), (800, 470), (700, 420)])
    ana.page.mouse.up()
    assert ana.js("() => window.esker.camera()") == view
    assert len(ana.js("() => window.esker.strokes()")) == 1
    under = ana.js(UNDER)
    found = "([x, y]) => document.elementFromPoint(x, y).shadowRoot.elementFromPoint(x, y).tagName"
    assert ana.js(found, under) == "CANVAS"

    # A selected stroke's handles come out from under the inspector, and the view goes back when the selection goes.
    drawn = ana.js("() => window.esker.camera().width")
    ana.page.set_viewport_size({"width": 1040, "height": 600})
    wait(ana, "width => window.esker.camera().width > width", drawn)
    ana.page.keyboard.press("v")
    ana.page.keyboard.press("Escape")
    wait(ana, "() => window.esker.selection() === null")
    wait_still(ana)
    at = "() => { const { eye, target } = window.esker.camera(); return [...eye, ...target]; }"
    home = ana.js(at)
    crest = ana.js("([x, y, z]) => window.esker.project(x, y, z)", summit)
    ana.page.mouse.click(crest["x"], crest["y"])
    wait(ana, "() => window.esker.selection() !== null")
    tab, edge, wanted, has = ana.js(TABS)
    assert tab <= edge
    assert wanted <= has
    ana.page.keyboard.press("Escape")
    same = "[...eye, ...target].every((v, i) => Math.abs(v - was[i]) < 1)"
    close = f"was => {{ const {{ eye, target }} = window.esker.camera(); return {same}; }}"
    wait(ana, close, home)
    assert ana.errors == []
