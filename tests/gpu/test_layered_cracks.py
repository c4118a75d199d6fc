"""No crack on real ground with a stroke across it, at rest and while a turned grid arrives (SPEC G27, R8).

The frames are a server's: Mount St Helens with a dam, then a finer grid turned by 27 degrees over the crater. A page's
own decoder, store, selection and shaders draw them. What is counted: pixels of the clear colour, as in test_cracks.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page

from esker import Stroke, templates
from esker.api.layers import Patchwork
from esker.contract import Channel, Document, Layer
from esker.patchwork.raster import rasters
from esker.patchwork.raster.rasters import Raster
from esker.solve.detail import settle
from esker.solve.solver import Solver
from esker.tiles.delivery import ClientTiles, TileServer
from tests.gpu.page import open_harness

LEVEL = 3
DAM = ((900.0, 1500.0, 1700.0), (1500.0, 1750.0, 1900.0), (2100.0, 1600.0, 1750.0))
CRATER = (1480.0, 1050.0)


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with open_harness() as opened:
        yield opened


def dome() -> tuple[Layer, Raster]:
    """A grid of 4 m turned by 27 degrees, 60 m higher than the crater's floor."""
    y, x = np.mgrid[-1.0:1.0:97j, -1.0:1.0:97j]
    raster = rasters.build((2150 + 60 * np.exp(-3 * (x * x + y * y)) + 3 * np.sin(9 * x)).astype(np.float32))
    layer = Layer(
        id="dome", content=raster.digest, facts=raster.facts(), anchor=(CRATER[0] - 90.0, CRATER[1] - 260.0),
        rotation_deg=27.0, spacing_m=(4.0, 4.0), accuracy_m=0.2, priority=99,
    )  # fmt: skip
    return layer, raster


class Sender:
    """What one viewer of a terrain is sent, as the layers change."""

    def __init__(self, document: Document) -> None:
        self.document, self.solver, self.clock = document, Solver(max_level=LEVEL), 0
        self.server = TileServer(document.settings.size_m, LEVEL)
        self.client = ClientTiles(self.server)

    def frames(self, layers: tuple[Layer, ...], grids: dict[str, Raster]) -> list[str]:
        """The ground of these layers under the document's strokes, as far as it is news."""
        self.clock += 1
        settings = self.document.settings
        base = Patchwork(settings, layers, grids).base
        assert base is not None
        settled = settle(self.solver, self.document.strokes, settings, LEVEL, base=base)
        for level in range(LEVEL + 1):
            self.server.put_level(self.clock, level, base.level(level), True, Channel.BASE)
        for level in range(LEVEL + 1):
            step = 1 << (LEVEL - level)
            offsets = np.ascontiguousarray(settled.basis.heights[::step, ::step])
            self.server.put_level(self.clock, level, offsets, True)
        out = []
        while (plan := self.client.plan()) is not None:
            out.append(base64.b64encode(plan.encode()).decode())
            self.client.commit(plan)
        return out


@pytest.fixture(scope="module")
def sent() -> dict[str, Any]:
    template = templates.load("helens")
    dam = Stroke.profile(DAM, left=(35, 300), right=(40, 300))
    document = template.document.model_copy(update={"strokes": (*template.document.strokes, dam)})
    layer, raster = dome()
    grids = {**template.rasters(), layer.content: raster}
    sender = Sender(document)
    before = sender.frames(document.layers, grids)
    after = sender.frames((*document.layers, layer), grids)
    assert len(before) > 2 * LEVEL
    assert len(after) >= 2
    half = len(after) // 2
    return {
        "size_m": document.settings.size_m,
        "levels": LEVEL,
        "moments": [before, after[:half], after[half:]],
        "places": [list(CRATER), [1500.0, 1750.0], [1480.0 + 60.0, 1050.0 - 200.0], [1900.0, 1650.0]],
    }


def test_layered_ground_with_a_stroke_shows_no_crack(page: Page, sent: dict[str, Any]) -> None:
    """G27: at rest, with half of a new layer's tiles, and with all of them."""
    report = page.evaluate("sent => esker.layeredCrackTest(11, 8, sent)", sent)
    assert report["failures"] == []
    assert (report["cracks"], report["nans"]) == (0, 0)
    assert report["covered"] > 3 * 8 * 256 * 192 * 0.6
    assert report["mixed"] >= 8


def test_without_edge_bits_layered_ground_does_crack(page: Page, sent: dict[str, Any]) -> None:
    """The test can fail."""
    assert page.evaluate("sent => esker.layeredCrackTest(11, 2, sent, true)", sent)["cracks"] > 0
