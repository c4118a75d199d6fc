"""The page in German, in windows of three widths: no text is cut, no bar lies on another (SPEC E67, U649)."""

from __future__ import annotations

from playwright.sync_api import Locator

from tests.e2e.conftest import Server, Visitor, Visitors
from tests.e2e.hands import wait
from tests.e2e.test_phone import apart, bars_apart, box

BARS = ("esk-top-bar .left", "esk-top-bar .right", "esk-tools", "esk-status-line", "esk-view-bar")
SIZES = ((1366, 768), (720, 900), (390, 844))

CUT = """() => {
  const WORDS = "button, a, label, legend, h1, h2, h3, h4, dt, dd, summary, [role], .lead, .quiet, .name";
  const cut = [], styleOf = (e) => getComputedStyle(e);
  const look = (e) => {
    const box = e.getBoundingClientRect(), style = styleOf(e), text = (e.innerText ?? "").trim();
    if (!e.matches(WORDS) || text === "" || box.width <= 1 || box.height <= 1 || style.visibility === "hidden") return;
    if ([e, ...e.querySelectorAll("*")].some((each) => styleOf(each).textOverflow === "ellipsis")) return;
    const scrolls = ["auto", "scroll"].includes(style.overflowX) || style.display === "inline";
    const out = !scrolls && e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1;
    if (out || box.right > innerWidth + 1 || box.left < -1)
      cut.push([e.tagName, e.className, text.slice(0, 60), e.scrollWidth, e.clientWidth, box.left, box.right]);
  };
  const walk = (root) => {
    for (const e of root.querySelectorAll("*")) {
      if (e.shadowRoot) walk(e.shadowRoot);
      look(e);
    }
  };
  walk(document);
  return cut;
}"""


def whole(visitor: Visitor, name: str) -> None:
    """No text is cut or lies outside the window."""
    cut = visitor.js(CUT)
    if cut:
        visitor.shot(f"german-{name}")
    assert cut == [], name


def test_german_fits_in_windows_of_three_widths(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(title="Wanderwege", template="alpine-ridge")
    visitor = visitors(1366, 768, locale="de-DE", reduced_motion="reduce")
    page = visitor.page

    def button(name: str) -> Locator:
        return page.get_by_role("button", name=name, exact=True)

    page.goto(visitor.origin + "/")
    button("Neues Gelände").wait_for()
    assert visitor.js("() => document.documentElement.lang") == "de"
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        whole(visitor, f"start-{width}")

    visitor.open(f"/t/{terrain}#{secret}")
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        bars_apart(visitor, *BARS)
        whole(visitor, f"terrain-{width}")
        button("Eigenschaften").click()
        for tab in ("Linie", "Boden", "Gelände", "Verlauf", "Aufgabe", "Stunde"):
            page.get_by_role("radio", name=tab, exact=True).click()
            whole(visitor, f"{tab}-{width}")
        button("Eigenschaften schließen").click()
        for name, end in (("Messen", "Messung beenden"), ("Wasser", "Das Wasser weglegen")):
            button(name).click()
            whole(visitor, f"{name}-{width}")
            button(end).click()
        button("Ansicht auf diesem Gerät").click()
        whole(visitor, f"Ansicht-{width}")
        page.keyboard.press("Escape")
        button("Teilen").click()
        page.get_by_role("button", name="Code zeigen").wait_for()
        whole(visitor, f"share-{width}")
        page.keyboard.press("Escape")

    # Whoever chooses English has it from then on.
    page.goto(visitor.origin + "/")
    page.get_by_role("combobox", name="Sprache der Seite").select_option("en")
    button("New terrain").wait_for()
    assert visitor.js("() => document.documentElement.lang") == "en"


def test_a_hint_lies_on_no_bar_and_bars_not_on_each_other(visitors: Visitors, server: Server) -> None:
    """SPEC U690: with the widest inspector, that of whoever leads in German."""
    terrain, secret = server.create(title="Leer")
    visitor = visitors(1100, 700, locale="de-DE", reduced_motion="reduce", on_map=True)
    visitor.open(f"/t/{terrain}#{secret}")
    keys = visitor.page.keyboard
    keys.press("b")
    shown = "shown => document.querySelector('esk-terrain').renderRoot.querySelector('esk-legend').hidden !== shown"
    for legend in (False, True):
        if legend:
            keys.press("x")
        wait(visitor, shown, legend)
        for closed in (False, True):
            keys.press("i")
            visitor.page.locator("aside.side").wait_for(state="hidden" if closed else "visible")
            bars = ["esk-tools", *(["esk-legend"] if legend else []), *([] if closed else ["aside.side"])]
            for width in (721, 900, 960, 1041, 1280):
                for height in (480, 540, 640, 760):
                    visitor.page.set_viewport_size({"width": width, "height": height})
                    hint = box(visitor, "esk-terrain .hint")
                    on = [bar for bar in bars if not apart(hint, box(visitor, bar))]
                    assert on == [], (width, height, legend, closed, hint)
                    status, view = box(visitor, "esk-status-line"), box(visitor, "esk-view-bar")
                    assert apart(status, view), (width, height, status, view)
    assert visitor.errors == []
