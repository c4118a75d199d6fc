"""Water in two real browsers: a valley is drawn, and both see its river (SPEC W54)."""

from __future__ import annotations

import json

from tests.e2e.conftest import Server, Visitors
from tests.e2e.hands import arch, draw, on_screen, wait, wait_settled

# A river that runs a long way down the middle of the valley.
RIVER = """([west, east, south]) => {
  const found = window.esker.rivers();
  if (!found?.settled || found.clock !== window.esker.clock()) return false;
  const inside = found.lines.flat().filter(([x, y]) => x > west && x < east && y > 300);
  return inside.length > 3 && Math.min(...inside.map(([, y]) => y)) < south;
}"""


def test_both_see_the_river_of_a_valley_that_one_draws(visitors: Visitors, server: Server) -> None:
    terrain, secret = server.create(title="Water")
    link = json.loads(server.request("POST", f"/api/terrains/{terrain}/links", {"role": "edit", "name": "Ben"}, secret))
    ada, ben = visitors(), visitors(640, 480)
    ada.open(f"/t/{terrain}#{secret}")
    ben.open(f"/t/{terrain}#{link['secret']}")

    # Ada draws a horseshoe of mountains that is open to the south: both see a river in it.
    draw(ada, "b", arch(on_screen(ada, 1000, 3300), on_screen(ada, 3000, 3300), 130))
    draw(ada, "b", arch(on_screen(ada, 700, 900), on_screen(ada, 1000, 3400), 120))
    draw(ada, "b", arch(on_screen(ada, 3300, 900), on_screen(ada, 3000, 3400), 120))
    wait_settled(ada, ben)
    for visitor in (ada, ben):
        wait(visitor, RIVER, [1100, 2900, 1400], timeout=90)
    assert ada.errors == ben.errors == []
