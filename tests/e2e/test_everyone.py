"""Small screens, touch, no WebGPU, viewers, wrong links: nobody is left outside (SPEC E4, E5, E6)."""

from __future__ import annotations

import json

import pytest

from tests.e2e.conftest import Server, Visitor, Visitors
from tests.e2e.hands import COARSE, arch, draw, ellipse, heights, on_screen, wait, wait_settled


class Fingers:
    """Touches through the browser's own input pipeline."""

    def __init__(self, visitor: Visitor) -> None:
        self.session = visitor.context.new_cdp_session(visitor.page)

    def __call__(self, kind: str, *fingers: tuple[float, float]) -> None:
        """One touch event (touchStart, touchMove, touchEnd) with the given fingers down."""
        points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(fingers)]
        self.session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


def narrow(visitor: Visitor) -> bool:
    """Nothing sticks out sideways."""
    return bool(visitor.js("() => document.scrollingElement.scrollWidth <= window.innerWidth"))


def test_a_phone_draws_with_one_finger_and_moves_with_two(visitors: Visitors, server: Server) -> None:
    """SPEC E5, E6: 360 pixels wide, touch only."""
    terrain, secret = server.create(title="Phone")
    phone = visitors(360, 740, has_touch=True, is_mobile=True)
    phone.open(f"/t/{terrain}#{secret}")
    assert narrow(phone)
    phone.shot("phone-blank")
    touch = Fingers(phone)
    path = arch(on_screen(phone, 1200, 1500), on_screen(phone, 2800, 1900), 60)
    phone.page.keyboard.press("b")
    touch("touchStart", path[0])
    for point in path[1:]:
        touch("touchMove", point)
    touch("touchEnd")
    wait(phone, "() => window.esker.strokes().length === 1 && window.esker.pending() === 0")
    wait_settled(phone)
    assert max(heights(phone, COARSE)) > 20
    phone.shot("phone-drawn")

    before = phone.js("() => window.esker.camera().eye")
    touch("touchStart", (120, 400), (240, 400))
    for i in range(1, 9):
        touch("touchMove", (120 - 6 * i, 400), (240 + 6 * i, 400))
    touch("touchEnd")
    wait(phone, "eye => window.esker.camera().eye.some((v, i) => Math.abs(v - eye[i]) > 20)", before)
    assert phone.js("() => window.esker.strokes().length") == 1, "a pinch draws nothing"
    assert phone.errors == []


def test_without_webgpu_there_is_a_map_to_sketch_on(visitors: Visitors, server: Server) -> None:
    """SPEC E5: the 2D map shows the same ground, and a ridge drawn there rises for all."""
    terrain, secret = server.create(title="Map", template="archipelago")
    mapper = visitors(on_map=True)
    mapper.open(f"/t/{terrain}#{secret}")
    assert mapper.js("() => window.esker.renderer()") == "map"
    wait_settled(mapper)
    start = heights(mapper, COARSE)
    drawn = draw(
        mapper, "b", [on_screen(mapper, 600, 3300), on_screen(mapper, 900, 3500), on_screen(mapper, 1500, 3600)]
    )
    wait_settled(mapper)
    after = heights(mapper, COARSE)
    assert max(a - b for a, b in zip(after, start, strict=True)) > 20
    assert {s["id"]: s for s in mapper.js("() => window.esker.strokes()")}[drawn]["kind"] == "profile"
    mapper.shot("map-drawn")
    assert mapper.errors == []


def test_a_viewer_watches_and_cannot_draw(visitors: Visitors, server: Server) -> None:
    """A view link shows everything and changes nothing; a revoked one is told so."""
    terrain, secret = server.create(title="Look")
    link = json.loads(
        server.request("POST", f"/api/terrains/{terrain}/links", {"role": "view", "name": "Class"}, secret)
    )
    owner, viewer = visitors(), visitors(on_map=True)
    owner.open(f"/t/{terrain}#{secret}")
    viewer.open(f"/t/{terrain}#{link['secret']}")
    assert viewer.js("() => window.esker.role()") == "view"
    viewer.page.keyboard.press("b")
    at = on_screen(viewer, 1500, 1500)
    viewer.page.mouse.move(*at)
    viewer.page.mouse.down()
    viewer.page.mouse.move(at[0] + 80, at[1] - 60, steps=6)
    viewer.page.mouse.up()
    draw(owner, "b", arch(on_screen(owner, 1200, 1800), on_screen(owner, 2800, 2000), 90))
    wait_settled(owner, viewer)
    assert len(viewer.js("() => window.esker.strokes()")) == 1
    # They look from different places: equal where they hold the same level, else within a quantum of the coarser one.
    # Height and level are asked in one breath: tiles go on filling in at rest.
    ask = "ps => ps.map(([x, y]) => [window.esker.heightAt(x, y), window.esker.levelAt(x, y)])"
    seen = [who.js(ask, [list(p) for p in COARSE]) for who in (owner, viewer)]
    for (here, fine), (there, coarse) in zip(*seen, strict=True):
        assert abs(here - there) <= (0 if fine == coarse else 0.25 / 2 ** min(fine, coarse))
    viewer.shot("viewer")
    server.request("DELETE", f"/api/terrains/{terrain}/links/{link['id']}", secret=secret)
    wait(viewer, "() => window.esker.connection() === 'closed'")
    viewer.shot("viewer-revoked")
    assert owner.js("() => window.esker.connection()") == "online"


@pytest.mark.parametrize("path", ["/t/nosuchterrain#abcdefghijkl", "/t/nosuchterrain"])
def test_a_wrong_link_says_so(visitors: Visitors, server: Server, path: str) -> None:
    lost = visitors(480, 600)
    lost.page.goto(server.url + path)
    lost.page.get_by_text("Go to the start page").first.wait_for()
    lost.shot(f"wrong-link-{path.count('#')}")
    assert lost.foreign == []


def test_the_landing_page_starts_a_terrain(visitors: Visitors, server: Server) -> None:
    """From the front door to a starting terrain with the mouse, then back: it is under recent."""
    guest = visitors(1024, 700)
    guest.page.goto(server.url)
    guest.page.get_by_text("Volcanic island").first.wait_for()
    guest.shot("landing")
    assert narrow(guest)
    guest.page.get_by_text("Volcanic island").first.click()
    guest.wait("() => window.esker !== undefined && window.esker.ready()", timeout=90)
    wait_settled(guest)
    assert max(heights(guest, COARSE)) > 300
    guest.shot("landing-to-island")
    assert "#" in guest.page.url, "the secret is in the fragment"
    guest.page.goto(server.url)
    guest.page.get_by_text("Recent").first.wait_for()
    guest.shot("landing-recent")
    assert guest.foreign == []
    assert guest.errors == []


def test_a_plateau_keeps_the_height_where_it_began(visitors: Visitors, server: Server) -> None:
    """Paper 0, III-B: a plateau lies in the horizontal plane of its first point on the ground."""
    terrain, secret = server.create(title="Plateau")
    ada = visitors()
    ada.open(f"/t/{terrain}#{secret}")
    draw(ada, "b", arch(on_screen(ada, 900, 2400), on_screen(ada, 3100, 2600), 60))
    wait_settled(ada)
    x, y = on_screen(ada, 2000, 1900)
    made = draw(ada, "p", [(x, y), *ellipse((x - 60, y), 60, 10)[1:]])
    wait_settled(ada)
    stroke = {s["id"]: s for s in ada.js("() => window.esker.strokes()")}[made]
    z = stroke["first"][2]
    assert z > 15
    centre = [(a + b) / 2 for a, b in zip(stroke["first"][:2], stroke["last"][:2], strict=True)]
    assert abs(heights(ada, [(centre[0], centre[1])])[0] - z) < 1.0
    ada.shot("plateau-on-a-slope")
