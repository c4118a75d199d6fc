"""A first landscape without a pointer, and a second line over the first (SPEC I65, I66, U34, U39)."""

from __future__ import annotations

from tests.e2e.conftest import Server, Visitor, Visitors
from tests.e2e.hands import Pixel, arch, draw, polyline, press_and_move, wait, wait_settled

FOCUS = """() => {
  let at = document.activeElement;
  while (at?.shadowRoot?.activeElement) at = at.shadowRoot.activeElement;
  return (at.getAttribute("aria-label") ?? at.textContent).trim();
}"""
CREST = """() => {
  const [s] = window.esker.strokes();
  return s.curve.map(([u, w]) => {
    const p = s.first.map((a, k) => a + u * (s.last[k] - a));
    const at = window.esker.project(p[0], p[1], p[2] + w);
    return [at.x, at.y];
  });
}"""


def keys(visitor: Visitor, *names: str) -> None:
    """Press keys one after the other; ``6 ArrowUp`` is six presses."""
    for name in names:
        times, _, key = name.rpartition(" ")
        for _ in range(int(times or 1)):
            visitor.page.keyboard.press(key)


def highest(visitor: Visitor) -> float:
    """Height of the crest over its anchors, metres."""
    return float(visitor.js("() => Math.max(...window.esker.strokes()[0].curve.map(([, w]) => w))"))


def test_from_the_landing_page_to_a_mountain_without_a_pointer(visitors: Visitors, server: Server) -> None:
    person = visitors(reduced_motion="reduce")
    person.page.goto(server.url)
    # Keys that come before the page shows its controls go nowhere: a machine that is busy shows them late.
    person.page.get_by_text("New terrain", exact=True).first.wait_for()
    for _ in range(9):
        keys(person, "Tab")
        if person.js(FOCUS) == "New terrain":
            break
    assert person.js(FOCUS) == "New terrain"
    keys(person, "Enter")
    wait(person, "() => window.esker !== undefined && window.esker.ready()", timeout=90)
    hint = person.page.locator("esk-terrain .hint")
    hint.get_by_text("Draw a line across the land").wait_for()

    keys(person, "Enter")
    hint.get_by_text("Enter begins the line").wait_for()
    keys(person, "6 ArrowLeft", "Enter", "6 ArrowRight", "6 ArrowUp", "Enter")
    wait(person, "() => window.esker.strokes().length === 1 && !window.esker.strokes()[0].finished")
    keys(person, "5 ArrowRight", "6 ArrowDown", "2 Enter")
    wait(person, "() => window.esker.strokes()[0].finished && window.esker.pending() === 0")
    assert highest(person) > 150
    hint.get_by_text("draw over the line").wait_for()
    person.shot("by-keys")

    keys(person, "i", "F6")
    assert person.js(FOCUS) == "Stroke", "the inspector has the keys"
    keys(person, "Escape", "Shift+S")
    person.page.get_by_role("button", name="Make a link").wait_for(timeout=20_000)
    keys(person, "Escape")
    wait(person, f"() => ({FOCUS})().startsWith('Terrain.')")
    keys(person, "Control+z")
    wait(person, "() => window.esker.strokes().length === 0 && window.esker.pending() === 0")
    assert person.errors == []


def test_a_line_over_the_first_raises_its_summit_for_everybody(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(title="Over")
    author, other = visitors(reduced_motion="reduce"), visitors(reduced_motion="reduce", on_map=True)
    for visitor in (author, other):
        visitor.open(f"/t/{terrain}#{secret}")
    draw(author, "b", arch((240, 320), (450, 315), 90))
    before = highest(author)
    crest: list[Pixel] = author.js(CREST)
    start, end = crest[len(crest) // 4], crest[3 * len(crest) // 4]
    peak = ((start[0] + end[0]) / 2, min(y for _, y in crest) - 40)
    press_and_move(author.page, polyline([start, peak, end]))
    author.page.mouse.up()
    wait(author, "h => Math.max(...window.esker.strokes()[0].curve.map(([, w]) => w)) > h + 60", before)
    wait_settled(author, other)
    assert other.js("() => window.esker.strokes()") == author.js("() => window.esker.strokes()")
    assert len(author.js("() => window.esker.strokes()")) == 1
    author.page.keyboard.press("Control+z")
    wait(other, "h => Math.abs(Math.max(...window.esker.strokes()[0].curve.map(([, w]) => w)) - h) < 1e-3", before)
    assert author.errors == other.errors == []
