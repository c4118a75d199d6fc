"""Loops of elevation layers are compiled by a child before the first base (SPEC H564, H565, H572)."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from esker import contract as c
from esker.patchwork import warming
from esker.patchwork.raster import rasters
from esker.server import first_build
from esker.server.elevation import Elevation
from esker.solve.opencl import prepare
from esker.solve.opencl.pocl import home
from esker.store.grids import GridStore

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def laid(tmp_path: Path) -> tuple[GridStore, c.Layer]:
    """A store, and a layer whose grid is in it."""
    store, raster = GridStore(tmp_path), rasters.build(np.add.outer(np.arange(40.0), np.arange(50.0)))
    store.put(raster)
    place: dict[str, Any] = {"anchor": (900.0, 900.0), "spacing_m": (10.0, 10.0), "accuracy_m": 1.0}
    return store, c.Layer(id="a", content=raster.digest, facts=raster.facts(), **place)


def test_they_are_compiled_once_on_a_machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[list[str]] = []

    def bounded(arguments: list[str], stopped: Any, times: float) -> dict[str, Any]:
        del stopped, times
        asked.append(arguments)
        return {"loops": arguments[-1]}

    monkeypatch.setattr(prepare, "bounded", bounded)
    monkeypatch.setattr(home, "root", lambda: tmp_path)
    for _ in range(2):
        first_build.have_layer_loops(threading.Event())
    assert asked == [["loops", "layers"]]


def test_they_have_more_time_than_kernels(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """SPEC H565: a child that was ended while it compiled left the rest to the server, once for each start."""
    monkeypatch.setattr(home, "root", lambda: tmp_path)
    monkeypatch.setattr(prepare, "MODULE", "tests.solver.breaking_build")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("BREAK", "turns")
    monkeypatch.setattr(prepare, "SECONDS", 0.06)
    first_build.have_layer_loops(threading.Event())
    assert "loops of layers: not compiled within 1 s" in caplog.text
    assert list(tmp_path.iterdir()) == [], "the next server tries it again"


def test_what_the_child_runs_is_ground() -> None:
    """Two layers at an angle, one with a hole: were they refused, nothing would be compiled."""
    warming.warm()


LAYS = """
import gc
import sys
from pathlib import Path

import numpy as np
from numba.core.dispatcher import Dispatcher

from esker import contract as c
from esker.patchwork import warming
from esker.patchwork.base import Base
from esker.patchwork.lod import space
from esker.patchwork.raster import rasters

SIZE_M = 4096.0


def forms():
    return {
        (each.py_func.__module__, each.py_func.__name__, form)
        for each in gc.get_objects() if isinstance(each, Dispatcher) and each.py_func.__module__.startswith("esker")
        for form in each.signatures
    }


def laid(name, warp, **place):
    heights = np.add.outer(np.arange(90.0), np.sin(np.arange(110.0))).astype(np.float32)
    heights[40:45, 50:70] = np.nan
    raster = rasters.build(heights, warp)
    rasters.write(Path(sys.argv[1], name), raster)
    raster = rasters.read(Path(sys.argv[1], name))
    return space.Placed(c.Layer(id=name, content=raster.digest, facts=raster.facts(), **place), raster)


warming.warm()
before = forms()
base = None
layers = []
for name, warp, place in (
    ("plain", None, {"anchor": (900.0, 900.0), "spacing_m": (14.0, 14.0), "accuracy_m": 2.0}),
    ("turned", None, {"anchor": (1500.0, 1200.0), "spacing_m": (6.0, 7.0), "rotation_deg": 33.0, "accuracy_m": 0.0}),
    ("bent", np.full((3, 4, 2), 0.3), {"anchor": (700.0, 1400.0), "spacing_m": (9.0, 9.0), "accuracy_m": 0.0}),
):
    layers.append(laid(name, warp, **place))
    base = Base(space.build(layers, base and base.model), SIZE_M, base, c.CURRENT_EDITION)
    for level in range(4):
        base.level(level)
        base.survey(level)
    base.window(5, slice(100, 200), slice(300, 400))
for module, name, form in sorted(forms() - before, key=str):
    print(module, name, [each for each in map(str, form)])
"""


def test_a_server_s_first_layers_need_no_other(tmp_path: Path) -> None:
    """SPEC H572: what the child compiles is what rooms run, for arrays that are kept too, which may not be written."""
    ran = subprocess.run([sys.executable, "-c", LAYS, str(tmp_path)], capture_output=True, text=True, check=True)
    assert ran.stdout == ""


def test_the_first_base_waits_for_them_and_later_ones_do_not(laid: tuple[GridStore, c.Layer]) -> None:
    store, layer = laid
    asked: list[threading.Event] = []
    elevation = Elevation(store, asked.append)
    assert elevation.base((), 4096.0) is None
    assert asked == [], "nobody has laid anything"
    for _ in range(2):
        assert elevation.base((layer,), 4096.0) is not None
    assert len(asked) == 1


def test_a_close_ends_them_and_the_base_that_waits(laid: tuple[GridStore, c.Layer]) -> None:
    store, layer = laid
    begun = threading.Event()

    def compile_them(closed: threading.Event) -> None:
        begun.set()
        assert closed.wait(60)

    elevation = Elevation(store, compile_them)
    raised: list[str] = []

    def make() -> None:
        with pytest.raises(RuntimeError) as error:
            elevation.base((layer,), 4096.0)
        raised.append(str(error.value))

    thread = threading.Thread(target=make)
    thread.start()
    assert begun.wait(60)
    elevation.close()
    thread.join(60)
    assert raised == ["the server is stopping"]
