"""A room with elevation layers: which base is laid when, and what is told meanwhile (SPEC P111 to P117)."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from esker import contract as c
from esker import grid
from esker.document.ops import StrokeSet
from esker.events import Preview, Settled, SolveEvent
from esker.patchwork.raster import rasters
from esker.server.elevation import Elevation
from esker.session.ground import base_builder
from esker.session.ground.base_builder import Layers
from esker.session.ground.jobs import Job
from esker.session.ground.worker import Worker
from esker.store.grids import GridStore, MissingGrid
from esker.store.journal import Journal
from tests.sync.harness import LiveServer, PlainSolver, stroke
from tests.sync.test_worker_thread import FLAT, SETTINGS, Bench, Turnstile

FACTS = c.GridFacts(rows=40, cols=50, low_m=0, high_m=100)


def _layer(layer_id: str = "v", **fields: Any) -> c.Layer:
    base: dict[str, Any] = {"content": "0" * 64, "facts": FACTS, "anchor": (0.0, 0.0), "spacing_m": (80.0, 80.0)}
    return c.Layer(id=layer_id, **(base | {"accuracy_m": 1.0} | fields))


class FlatBase:
    """A base of one height; it says which layers it was made of."""

    def __init__(self, layers: tuple[c.Layer, ...]) -> None:
        self.layers = layers
        self.digest = repr(layers).encode()

    def level(self, level: int) -> NDArray[np.float32]:
        n = grid.samples(level)
        return np.full((n, n), sum(x.lift_m for x in self.layers), dtype=np.float32)

    def survey(self, level: int) -> NDArray[np.float32]:
        return np.zeros_like(self.level(level))


class Mason:
    """An ``Elevation`` that takes as long as the test wants."""

    def __init__(self) -> None:
        self.gate = threading.Semaphore(0)
        self.made: list[float] = []
        self.fails = False

    def base(
        self,
        layers: tuple[c.Layer, ...],
        size_m: float,
        before: object,
        tell: Callable[[str], None] = print,
        edition: int = 1,
    ) -> FlatBase | None:
        assert size_m > 0
        assert edition >= 1
        assert self.gate.acquire(timeout=10)
        visible = tuple(x for x in layers if not x.hidden)
        self.made.append(sum(x.lift_m for x in visible))
        if self.fails:
            raise RuntimeError("no stone")
        if any("gone" in x.name for x in visible):
            tell("A stone is missing.")
        assert before is None or isinstance(before, FlatBase)
        return FlatBase(visible) if visible else None


class Site:
    """``Layers`` in a loop of its own."""

    def __init__(self) -> None:
        self.mason = Mason()
        self.laid = 0
        self.told: list[str] = []
        self.slow: list[bool] = []
        self.document = StrokeSet("t")

    def apply(self, op: c.Op) -> None:
        self.document, _ = self.document.apply(op)

    async def run(self, test: Callable[[Site, Layers], Any]) -> None:
        with ThreadPoolExecutor(1) as executor:
            loop = asyncio.get_running_loop()
            layers = Layers(self.mason, executor, loop, self._laid, self.told.append, self._slow_changed)
            self.layers = layers
            try:
                await test(self, layers)
            finally:
                layers.close()
                self.mason.gate.release(100)

    def _laid(self) -> None:
        self.laid += 1

    def _slow_changed(self) -> None:
        self.slow.append(self.layers.slow)

    async def until(self, ready: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 60
        while not ready():
            assert time.monotonic() < deadline
            await asyncio.sleep(0.001)


def _on_site(test: Callable[[Site, Layers], Any]) -> None:
    asyncio.run(Site().run(test))


def _lift(metres: float, **more: Any) -> c.SetLayer:
    return c.SetLayer(layer="v", fields=c.LayerFields(lift_m=metres, **more))


def test_without_layers_nothing_is_made() -> None:
    """SPEC P111."""

    async def run(site: Site, layers: Layers) -> None:
        assert layers.empty
        assert layers.want(site.document)
        site.apply(c.AddLayer(layer=_layer(hidden=True)))
        assert layers.want(site.document), "hidden layers are no ground"
        assert (layers.empty, layers.base, site.mason.made) == (False, None, [])

    _on_site(run)


def test_the_newest_layers_win_and_what_lies_between_is_skipped() -> None:
    """SPEC P112: somebody drags a layer."""

    async def run(site: Site, layers: Layers) -> None:
        site.apply(c.AddLayer(layer=_layer()))
        assert not layers.want(site.document)
        for metres in range(1, 50):
            site.apply(_lift(float(metres)))
            assert not layers.want(site.document)
        site.mason.gate.release(2)
        await site.until(lambda: site.laid == 2)
        assert site.mason.made == [0.0, 49.0]
        assert layers.want(site.document)
        assert isinstance(layers.base, FlatBase)
        assert layers.base.layers[0].lift_m == 49.0

    _on_site(run)


def test_what_is_only_told_of_a_layer_makes_no_base() -> None:
    """SPEC D30."""

    async def run(site: Site, layers: Layers) -> None:
        site.apply(c.AddLayer(layer=_layer()))
        layers.want(site.document)
        site.mason.gate.release()
        await site.until(lambda: site.laid == 1)
        fields = c.LayerFields(name="x", source="y", licence="z", outline=1.0)
        site.apply(c.SetLayer(layer="v", fields=fields))
        assert layers.want(site.document)
        site.apply(_lift(0.0))
        assert layers.want(site.document), "nor does a value that it has already"

    _on_site(run)


def test_a_base_that_fails_keeps_the_one_before_and_is_told() -> None:
    """SPEC P113."""

    async def run(site: Site, layers: Layers) -> None:
        site.apply(c.AddLayer(layer=_layer()))
        layers.want(site.document)
        site.mason.gate.release()
        await site.until(lambda: site.laid == 1)
        first = layers.base
        site.mason.fails = True
        site.apply(_lift(5.0))
        layers.want(site.document)
        site.mason.gate.release()
        await site.until(lambda: site.laid == 2)
        assert layers.base is first
        assert site.told == [base_builder.FAILED]
        site.mason.fails = False
        site.apply(_lift(6.0, name="gone"))
        layers.want(site.document)
        site.mason.gate.release()
        await site.until(lambda: site.laid == 3)
        assert layers.base is not first
        assert "A stone is missing." in site.told

    _on_site(run)


def test_what_takes_long_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P114."""
    monkeypatch.setattr(base_builder, "SLOW_SECONDS", 0.01)

    async def run(site: Site, layers: Layers) -> None:
        site.apply(c.AddLayer(layer=_layer()))
        layers.want(site.document)
        await site.until(lambda: bool(site.slow))
        site.apply(_lift(1.0))
        layers.want(site.document)
        site.mason.gate.release()
        await site.until(lambda: site.laid == 1)
        await asyncio.sleep(0.05)
        site.mason.gate.release()
        await site.until(lambda: site.laid == 2)
        await asyncio.sleep(0.05)
        assert site.slow == [True, False], "a drag of slow bases is one long time"
        assert site.told == [], "it is a state, not a sentence"
        site.apply(_lift(2.0))
        layers.want(site.document)
        site.mason.gate.release()
        await site.until(lambda: site.laid == 3)

    _on_site(run)


# --- the worker -------------------------------------------------------------------------------------------------


class Ledger(Turnstile):
    """Notes on which base each solve stands."""

    def __init__(self) -> None:
        super().__init__()
        self.bases: list[object] = []

    def steps(self, *arguments: Any, base: Any = None, **more: Any) -> Iterator[SolveEvent]:
        self.bases.append(base)
        return super().steps(*arguments, **more)


def _built(test: Callable[[Bench, Ledger], None]) -> None:
    bench = Bench()
    bench.worker.stop()
    solver = Ledger()
    bench.solver = solver
    bench.worker = Worker(lambda _: solver, now=lambda: bench.now)
    bench.worker.start()
    try:
        test(bench, solver)
    finally:
        bench.stop()


def test_the_base_comes_before_what_is_solved_on_it_and_only_once() -> None:
    """SPEC P115."""

    def run(bench: Bench, solver: Ledger) -> None:
        channels: list[tuple[c.Channel, int, float]] = []
        arrived = threading.Condition()

        def deliver(clock: int, result: Any) -> None:
            assert clock >= 1
            with arrived:
                channels.append((result.channel, result.level, float(result.heights.max())))
                arrived.notify()

        def let(count: int) -> list[tuple[c.Channel, int, float]]:
            goal = len(channels) + count
            solver.permits.release(count)
            with arrived:
                assert arrived.wait_for(lambda: len(channels) >= goal, 5), channels
            return channels[goal - count :]

        room = bench.worker.add(1, deliver, lambda _: None, note=deliver)
        base, other = FlatBase((_layer(lift_m=7.0),)), FlatBase((_layer(lift_m=9.0),))
        height, ground = c.Channel.HEIGHT, c.Channel.BASE
        bench.worker.request(room, Job(1, (), SETTINGS, layers_rev=1, base=base))
        assert let(6) == [(ground, 0, 7.0), (ground, 1, 7.0), *[(height, level, 0.0) for level in (0, 1, 0, 1)]]
        bench.idle()
        bench.worker.request(room, Job(2, (), SETTINGS, layers_rev=1, base=base))
        assert [channel for channel, _, _ in let(4)] == [height] * 4, "the base is there already"
        bench.idle()
        bench.worker.request(room, Job(3, (), SETTINGS, layers_rev=2, base=other))
        assert let(6)[:2] == [(ground, 0, 9.0), (ground, 1, 9.0)]
        bench.idle()
        bench.worker.request(room, Job(4, (), SETTINGS))
        solver.permits.release(4)
        with arrived:
            assert arrived.wait_for(lambda: len(channels) >= 16 + 7, 5)
        assert channels[16:19] == [(ground, 0, 0.0), (ground, 1, 0.0), (c.Channel.SURVEY, 0, c.BASE_SURVEY)]
        assert solver.bases == [base, base, other, None]
        assert FLAT.max() == 0

    _built(run)


# --- a server ---------------------------------------------------------------------------------------------------


class Ground(PlainSolver):
    """Notes the base of each solve."""

    def __init__(self) -> None:
        self.jobs: list[tuple[int, object]] = []

    def steps(self, *arguments: Any, base: Any = None, **more: Any) -> Iterator[Preview | Settled]:
        self.jobs.append((len(arguments[0]), base))
        return super().steps(*arguments, **more)


def test_strokes_go_on_over_the_ground_of_before(tmp_path: Path) -> None:
    """SPEC P116: while a base is made the room shows strokes on the old one, and is not settled for the new clock."""
    solver, mason = Ground(), Mason()
    with LiveServer(tmp_path, solver=solver) as server:
        server.assembly.hub._elevation = mason
        terrain, secret = server.create(layers=(_layer(),))
        peer = server.join(terrain, secret)
        time.sleep(0.05)
        assert solver.jobs == [], "nothing is shown before the first base"
        mason.gate.release()
        peer.settled(0)
        first = solver.jobs[0][1]
        assert isinstance(first, FlatBase)
        peer.ops(("c1:1", {"type": "layer.set", "layer": "v", "fields": {"lift_m": 12}}))
        peer.ops(("c1:2", stroke()))
        found = peer.wait("progress")
        while not (found["settled"] and len(solver.jobs) > 1):
            assert found["clock"] == 0
            found = peer.wait("progress")
        assert solver.jobs[-1] == (1, first), "the stroke is there, on the ground of before"
        assert found["clock"] == 0, "that is not yet the ground of the newest clock"
        mason.gate.release()
        peer.settled(2)
        last = solver.jobs[-1][1]
        assert isinstance(last, FlatBase)
        assert last.layers[0].lift_m == 12
        peer.close()


def test_a_layer_whose_grid_is_missing_is_left_out_and_told(tmp_path: Path) -> None:
    """SPEC P117."""
    store = GridStore(tmp_path)
    raster = rasters.build(np.add.outer(np.arange(40.0), np.arange(50.0)))
    store.put(raster)
    told: list[str] = []
    elevation = Elevation(store)
    there, gone = _layer("a", content=raster.digest), _layer("b", content="f" * 64, name="lost.tif")
    base = elevation.base((there, gone), 4096.0, None, told.append)
    assert base is not None
    assert len(base.model.placed) == 1
    assert told == ["The layer “lost.tif” is left out: its elevation grid is missing or damaged here."]
    assert elevation.base((gone,), 4096.0, base, told.append) is None
    same = elevation.base((there.model_copy(update={"name": "x"}),), 4096.0, base, told.append)
    assert same is base, "the same ground is the same object"
    (store.path(raster.digest) / rasters.HEAD).write_text("{")
    with pytest.raises(rasters.RasterError):
        GridStore(tmp_path).read(raster.digest)


def test_the_store_keeps_what_the_journal_names(tmp_path: Path) -> None:
    """SPEC J15: live, deleted and long forgotten layers; nothing else."""
    store, journal = GridStore(tmp_path), Journal(tmp_path)
    made = [rasters.build(np.full((8, 8), float(k))) for k in range(4)]
    for raster in made:
        store.put(raster)
    born, lay = made[0].digest, c.AddLayer(layer=_layer("b", content=made[1].digest))
    journal.create(c.Document(id="t", deleted_layers=(_layer("a", content=born),))).result()
    document = journal.load("t")
    assert document is not None
    from esker.document.wire import op_json
    from esker.store.journal import Row

    journal.append("t", [Row(1, "import-x", 0, "c", op_json(c.Group(ops=(lay, c.DeleteLayer(layer="b")))))]).result()
    assert journal.grids("t") == journal.grids() == {born, made[1].digest}
    work, packed = store.work(), store.temporary(".npz")
    store.sweep(journal.grids(), now=0.0)
    assert not packed.exists()
    assert [store.has(raster.digest) for raster in made] == [True, True, False, False]
    assert not work.exists()
    with pytest.raises(MissingGrid):
        store.read(made[2].digest)
    with pytest.raises(ValueError, match="digest"):
        store.path("../esker.db")
    journal.close()
