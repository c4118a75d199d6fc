"""A phone, upright and on its side: nothing covers the land or another bar, fingers hit what they mean (SPEC U33)."""

from __future__ import annotations

from tests.e2e.conftest import Server, Visitor, Visitors
from tests.e2e.hands import wait

Box = dict[str, float]

SMALL = """() => {
  const small = [], walk = (root) => {
    for (const e of root.querySelectorAll("*")) {
      if (e.shadowRoot) walk(e.shadowRoot);
      const box = e.getBoundingClientRect();
      if (e.matches("button:not(.avatar), a") && box.height > 0 && (box.height < 40 || box.width < 40))
        small.push([e.getAttribute("aria-label") ?? e.textContent.trim(), box.width, box.height]);
    }
  };
  walk(document);
  return small;
}"""

CORNERS = "() => [[0,0],[4096,0],[4096,4096],[0,4096]].map(([x, y]) => window.esker.project(x, y, 0))"


def box(visitor: Visitor, selector: str) -> Box:
    """Where an element is, CSS pixels."""
    found = visitor.page.locator(selector).first.bounding_box()
    assert found is not None, selector
    x, y = found["x"], found["y"]
    return {"x": x, "y": y, "right": x + found["width"], "bottom": y + found["height"]}


def apart(a: Box, b: Box) -> bool:
    """Whether two boxes have no pixel in common."""
    return a["right"] <= b["x"] or b["right"] <= a["x"] or a["bottom"] <= b["y"] or b["bottom"] <= a["y"]


def bars_apart(visitor: Visitor, *names: str) -> None:
    """All of these lie inside the window and beside each other."""
    window = visitor.page.viewport_size
    assert window is not None
    boxes = {name: box(visitor, name) for name in names}
    for name, at in boxes.items():
        assert min(at["x"], at["y"], window["width"] - at["right"], window["height"] - at["bottom"]) >= 0, (name, at)
        assert all(apart(at, other) for key, other in boxes.items() if key != name), (name, boxes)


def test_a_phone_shows_the_land_beside_its_panel_and_follows_a_turn(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(title="Phone")
    phone = visitors(390, 844, has_touch=True, is_mobile=True, reduced_motion="reduce")
    phone.open(f"/t/{terrain}#{secret}")
    bars_apart(phone, "esk-top-bar .left", "esk-top-bar .right", "esk-tools", "esk-status-line", "esk-view-bar")
    assert phone.js(SMALL) == []
    upright = phone.js("() => window.esker.camera().eye")

    phone.page.get_by_role("button", name="Inspector").tap()
    wait(phone, "() => window.esker.camera().height < 844 * window.devicePixelRatio * 0.7")
    side, picture = box(phone, "aside.side"), box(phone, ".viewport canvas")
    assert side["y"] > picture["bottom"] - 20, "the drawer lies below the picture, not on it"
    bars_apart(phone, "esk-top-bar .right", "esk-tools", "aside.side")
    for tab in ("Ground", "Terrain", "History"):
        phone.page.get_by_role("radio", name=tab).tap()
        assert box(phone, "aside.side") == side, "tabs do not make the drawer jump"
    middle = phone.js("() => window.esker.project(2048, 2048, 0)")
    assert middle["visible"]
    assert middle["y"] < side["y"]
    hint = box(phone, "esk-terrain .hint")
    assert all(hint["bottom"] < corner["y"] for corner in phone.js(CORNERS)), "the hint lies on no land (SPEC U431)"
    assert apart(hint, box(phone, "esk-top-bar .left"))
    phone.shot("phone-drawer")
    phone.page.get_by_role("button", name="Close the inspector").tap()
    wait(phone, "e => JSON.stringify(window.esker.camera().eye) === JSON.stringify(e)", upright)

    phone.page.set_viewport_size({"width": 844, "height": 390})
    wait(phone, "e => JSON.stringify(window.esker.camera().eye) !== JSON.stringify(e)", upright)
    bars_apart(phone, "esk-top-bar .left", "esk-top-bar .right", "esk-tools", "esk-status-line", "esk-view-bar")
    phone.shot("phone-side")

    # A page at 200 % is as small: nothing is cut beside the drawer, and no row has to be scrolled.
    phone.page.set_viewport_size({"width": 640, "height": 400})
    phone.page.get_by_role("button", name="Inspector").tap()
    phone.page.locator("aside.side").wait_for()
    tools = phone.page.locator("esk-tools")
    assert tools.evaluate("e => e.scrollWidth <= e.clientWidth")
    names = ("Stroke", "Ground", "Terrain", "History", "Lesson")
    tops = {phone.page.get_by_role("radio", name=name).evaluate("e => e.offsetTop") for name in names}
    assert len(tops) == 1, "five tabs stand side by side"
    ends = phone.page.get_by_role("radio", name="Lesson").bounding_box()
    cross = phone.page.get_by_role("button", name="Close the inspector").bounding_box()
    assert ends is not None
    assert cross is not None
    assert ends["x"] + ends["width"] <= cross["x"], "and end before the cross"
    bars_apart(phone, "esk-top-bar .right", "esk-tools", "aside.side")
    phone.shot("phone-drawer-beside")

    # A window of 1100 x 700 at 200 % (SPEC U350): tabs and tools are whole, no sentence lies under the inspector.
    phone.page.set_viewport_size({"width": 550, "height": 350})
    wait(phone, "() => innerWidth === 550")
    side = box(phone, "aside.side")
    for name in names:
        placed = phone.page.get_by_role("radio", name=name).bounding_box()
        assert placed is not None
        assert side["x"] <= placed["x"] < placed["x"] + placed["width"] <= side["right"], name
    for button in phone.page.locator("esk-tools button").all():
        button.scroll_into_view_if_needed()
        at = button.bounding_box()
        assert at is not None
        assert at["x"] >= 0
        assert at["x"] + at["width"] <= side["x"]
    assert box(phone, "esk-terrain .hint")["right"] <= side["x"]
    phone.shot("phone-drawer-at-200")
    assert phone.errors == []
