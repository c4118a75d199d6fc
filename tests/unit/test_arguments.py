"""Every argument of the Python face, as somebody who does not read the manual gives it (SPEC D380 to D382).

What is wrong is refused at the door: in a sentence of one line that names it, and by Esker, not by NumPy or pydantic.
Nothing is solved for it.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterator
from decimal import Decimal
from functools import partial
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import esker
from esker import Stroke, Terrain, contract
from esker.api.live.client import LiveTerrain
from esker.api.live.ground import StreamedGround
from esker.api.live.layers import bring_in
from esker.document import archive
from esker.document.ops import Limits, Refusal, StrokeSet

NAN, INF = float("nan"), float("inf")
HILLS = np.random.default_rng(2).uniform(0.0, 90.0, (20, 30))
LINE = [(100.0, 100.0, 0.0), (200.0, 300.0, 90.0), (300.0, 100.0, 0.0)]
PACKAGE = Path(esker.__file__).parent

NO_NUMBER: tuple[Any, ...] = (
    "4",
    "much",
    b"4",
    None,
    [],
    {},
    (1, 2),
    1 + 2j,
    object(),
    True,
    np.zeros(3),
    np.datetime64("2020-01-01"),
)
SOME_NUMBER: tuple[Any, ...] = tuple(one for one in NO_NUMBER if one is not None)
"""Where None is an answer."""
NOT_FINITE: tuple[Any, ...] = (NAN, INF, -INF, np.float32("nan"), Decimal("inf"), 10**400)
NO_LEVEL: tuple[Any, ...] = (*NO_NUMBER, *NOT_FINITE, 1.5, 2.0, -1, 99, 2**70, np.float64(2))
NO_POINTS: tuple[Any, ...] = (
    None, 7, "line", [], {}, [()], [1, 2], [(1, 2), (3,)], [("a", "b", "c")], [(None, 1, 2)], [(NAN, 0, 0)] * 2,
    [(INF, 0, 0)] * 2, [(1e300, 0, 0)] * 2, [(1j, 0, 0)] * 2, np.zeros((2, 4)), np.zeros((2, 2, 3)), object(),
    np.ma.masked_less(np.array(LINE), 1.0), [("1", "2", "3")] * 2, np.zeros((contract.MAX_POINTS_PER_STROKE + 1, 3)),
)  # fmt: skip
NO_FLAG: tuple[Any, ...] = ("yes", 1, 0, None, NAN, [], np.zeros(2))


def fresh() -> Terrain:
    made = Terrain(size_m=1024.0)
    made.add(Stroke.profile(LINE, id="a"))
    made.add_grid(HILLS, spacing=10.0, name="hills")
    return made


TERRAIN = fresh()
LAYER = TERRAIN.layers[0].id
Call = partial[Any]
call: Any = partial
"""Of arguments whose types are wrong on purpose."""


def terrains() -> Iterator[Call]:
    bad: Any
    t = TERRAIN
    for bad in (*NO_NUMBER, *NOT_FINITE, 0, -5, 63.9, 65536.5, 1e300):
        yield call(Terrain, size_m=bad)
    for bad in ("much", b"4", [], NAN, -INF, -1.0, 0, 1e300, 10**400, 1e-300, np.zeros(3), True):
        yield call(Terrain, reach_m=bad)
    for bad in ("round", None, 1, NAN, []):
        yield call(Terrain, border=bad)
    for bad in ("numpy", 1, object(), Terrain):
        yield call(Terrain, solver=bad)
    for bad in (None, 1, "a", LINE, Stroke, {}, HILLS):
        yield call(t.add, bad)
    for bad in (None, 1, "b", [], NAN, {}):
        yield call(t.remove, bad)
        yield call(t.remove_grid, bad)
        yield call(t.set_grid, bad, name="x")
    for bad in NO_LEVEL:
        yield call(t.heights, bad)
        yield call(t.heights, 1, global_level=bad)
        yield call(t.heights, 1, detail=True, refined_level=bad)
        yield call(t.attributes, bad)
        yield call(t.attributes, 1, refined_level=bad)
        yield call(t.window, bad, 0, 0, 9, 9)
        yield call(t.window, 1, 0, 0, 999, 999, global_level=bad)
        yield call(t.assemble, bad)
    yield call(t.assemble, 7)
    for bad in NO_FLAG:
        yield call(t.heights, 1, detail=bad)
        yield call(t.window, 1, 0, 0, 999, 999, detail=bad)
        yield call(t.sample, [(1, 1)], derivatives=bad)
    for bad, k in product((*NO_NUMBER, *NOT_FINITE), range(4)):
        yield call(t.window, 1, *[*(0, 0, 999, 999)[:k], bad, *(0, 0, 999, 999)[k + 1 :]])
    for corners in ((9, 9, 0, 0), (1e300, 0, 1e308, 9), (-1e308, -1e308, -1e300, -1), (2000, 0, 3000, 9)):
        yield call(t.window, 1, *corners)
    yield call(t.window, 10, 0, 0, 1024, 1024)
    for bad in ("f", 1, [], {}):
        yield call(t.heights, 1, progress=bad)
        yield call(t.window, 1, 0, 0, 9, 9, progress=bad)
    for points in NO_POINTS[:3] + NO_POINTS[4:-1]:
        yield call(t.sample, points)
    for bad in (*NO_NUMBER, *NOT_FINITE, -1.0):
        yield call(t.sample, [(1, 1)], tolerance=bad)
    for bad in (None, {}, "a", TERRAIN, b""):
        yield call(Terrain.from_document, bad)
    for bad in (None, 1, NAN, [], "a\0b"):
        yield call(t.save, bad)
        yield call(Terrain.load, bad)
        yield call(t.export, bad)
    for bad in (None, {}, contract.TerrainSettings(size_m=64.0), t.settings.model_copy(update={"reach_m": NAN})):
        yield call(setattr, t, "settings", bad)
    yield call(setattr, t, "settings", t.settings.model_copy(update={"title": "x" * 81}))


def exports() -> Iterator[Call]:
    bad: Any

    def export(**more: Any) -> Call:
        return Call(TERRAIN.export, "/nowhere/at/all.npy", **({"level": 1} | more))

    for bad in (*(one for one in NO_LEVEL if one is not None), 7):
        yield export(level=bad)
        yield export(global_level=bad)
    for bad in (*NO_NUMBER[:3], *NOT_FINITE, 1000, -1, 1.5):
        yield export(level=None, samples=bad)
    for bad in (1, "1234", (1, 2, 3), (1, 2, 3, NAN), (0, 0, INF, 1), (0, 0, "9", 9), {}, [None] * 4):
        yield export(window=bad)
    for bad in NO_FLAG:
        yield export(detail=bad)
        yield export(weights=bad)
    yield export(progress="p")


def grids() -> Iterator[Call]:
    bad: Any
    fields: Any

    def lay(grid: Any = HILLS, **more: Any) -> Call:
        return Call(TERRAIN.add_grid, grid, **({"spacing": 5.0} | more))

    for bad in (1e300, NAN, None, 7, [], {}, [[1, 2], [3]], HILLS[0], HILLS[None], HILLS + 1j, HILLS.astype(str),
                HILLS.astype(object), HILLS > 3, HILLS[:3], np.full((9, 9), NAN), np.full((9, 9), INF),
                np.where(HILLS > 50, 1e300, 0.0), np.where(HILLS > 50, -1e30, 0.0), HILLS * 1e6,
                HILLS.astype("datetime64[s]"), np.ma.masked_less(HILLS, 1e3), np.full((9, 9), 2**63, np.uint64),
                object()):  # fmt: skip
        yield lay(bad)
    for name, bads in {
        "anchor": (1, "ab", (1,), (1, 2, 3), (NAN, 0), (1e9, 0), (None, 0), ("1", "2"), {}),
        "rotation": (*SOME_NUMBER, *NOT_FINITE, 361, -1e300),
        "spacing": ("5", None, NAN, INF, 0, -1, 1e300, (1, 2, 3), (1, -1), ("1", "2"), {}, [[5, 5]], (5, None), True),
        "accuracy": (*SOME_NUMBER, *NOT_FINITE, -1, 1e300),
        "priority": (
            *(one for one in NO_LEVEL if one is not None and one is not NO_LEVEL[-3] and str(one) not in ("-1", "99")),
            10**6 + 1,
        ),
        "scale": (*NO_NUMBER, *NOT_FINITE, 1e4, -1e300),
        "lift": (*NO_NUMBER, *NOT_FINITE, 1e300, 1e5),
        "name": (None, 1, "x" * 81, [], NAN),
        "source": (None, 1, "x" * 241, []),
        "licence": (None, 1, "x" * 241, []),
        "answers": (5, "a", ["a"], {"a": 5}, {5: "a"}, object()),
    }.items():
        for bad in bads:
            yield lay(**{name: bad})
    for fields in ({"scale": NAN}, {"lift_m": 1e5}, {"nothing": 1}, {"name": None}, {"anchor": (NAN, 0.0)},
                   {"priority": 1.5}, {"accuracy_m": -1.0}, {"hidden": "no"}, {"spacing_m": 5.0}):  # fmt: skip
        yield call(TERRAIN.set_grid, LAYER, **fields)


def strokes() -> Iterator[Call]:
    bad: Any
    fields: Any
    for kind, points in product((Stroke.profile, Stroke.level), NO_POINTS):
        yield call(kind, points)
    for points in NO_POINTS:
        yield call(Stroke.paint, points, "snow")
    for bad in ("steep", 1, (1,), (1, 2, 3), ("a", "b"), (NAN, 5), (35, NAN), (35, -1), (86, 9), (35, 1e300), {}, "ab"):
        yield call(Stroke.profile, LINE, left=bad)
        yield call(Stroke.level, LINE, right=bad)
    for name in ("plateau_radius_m", "amplitude_m", "roughness", "yields"):
        for bad in (*NO_NUMBER, *NOT_FINITE, -1.0, 1e300):
            yield call(Stroke.profile, LINE, **{name: bad})
    for fields in ({"id": ""}, {"id": "a b"}, {"id": None}, {"id": 5}, {"label": "x" * 81}, {"label": None},
                   {"hidden": 1}, {"kind": "level"}, {"first": (0, 0, 0)}, {"curve": ()}, {"nothing": 1},
                   {"locked": "no"}):  # fmt: skip
        yield call(Stroke.profile, LINE, **fields)
    for bad in ("height", None, 1, ["snow"]):
        yield call(Stroke.paint, LINE, bad)
    for name in ("value", "radius_m"):
        for bad in (*NO_NUMBER, *NOT_FINITE, -2.0, 1e300):
            yield call(Stroke.paint, LINE, "snow", **{name: bad})


def unlinked() -> LiveTerrain:
    """A live terrain that never connected: whatever gets past its door fails for want of what is behind."""
    return LiveTerrain.__new__(LiveTerrain)


def live() -> Iterator[Call]:
    bad: Any
    fields: Any
    link = "http://127.0.0.1:9/t/abc#secret"
    for bad in (None, 7, b"x", "", "http://h", "ftp://h/t/a#s", "http://[/t/a#s", [], NAN):
        yield call(esker.connect, bad)
    for bad in (None, 7, "x" * 81, []):
        yield call(esker.connect, link, bad)
    for bad in (*NO_NUMBER, *NOT_FINITE, -1.0, 1e300):
        yield call(esker.connect, link, timeout=bad)
    for bad in NO_FLAG:
        yield call(esker.connect, link, ground=bad)
    for bad in (1, [], NAN):
        yield call(esker.connect, link, ca_file=bad)
        yield call(esker.connect, link, solver=bad)
    t = unlinked()
    for bad in NO_LEVEL:
        yield call(t.heights, bad)
        yield call(t.assemble, bad)
    for bad in (None, 1, "", "a b", [], {}):
        for method in (t.remove, t.restore, t.set, t.remove_grid, t.restore_grid, t.set_grid):
            yield call(method, bad)
        yield call(t.add, bad)
        yield call(t.apply, bad)
    for fields in ({"roughness": NAN}, {"nothing": 1}, {"label": 5}, {"left": (1, 2)}):
        yield call(t.set, "a", **fields)
    for fields in ({"reach_m": NAN}, {"size_m": 64.0}, {"title": "x" * 81}, {"border": "round"}):
        yield call(t.set_terrain, **fields)
    for fields in ({"scale": NAN}, {"nothing": 1}, {"name": 5}):
        yield call(t.set_grid, "a", **fields)
    for bad in (*NO_NUMBER, *NOT_FINITE, -1.0):
        yield call(t.wait, bad)
        yield call(t.wait_clock, 3, bad)
    for bad in (*NO_NUMBER, *NOT_FINITE, -1, 1.5, 2**60):
        yield call(t.wait_clock, bad)
        yield call(t.at, bad)
        if bad is not None:
            yield call(t.history, bad)
            yield call(t.fork, bad)
    for bad in (5, "x" * 81, []):
        yield call(t.fork, 3, bad)
    for bad in (None, 1, [], NAN, "a\0b"):
        yield call(t.save, bad)
    for name, bads in {
        "anchor": (1, (1,), (NAN, 0), (1e9, 0.0)), "rotation": ("a", NAN, 400.0), "spacing": ("5", NAN, -1.0),
        "accuracy": (NAN, -1.0), "priority": (1.5, NAN, 10**9), "scale": (NAN, 1e9), "lift": (NAN, 1e300),
        "name": (5, "x" * 81), "source": (5, "x" * 241), "on_status": (5,), "answers": (5, {"a": 5}),
    }.items():  # fmt: skip
        for bad in bads:
            yield call(t.add_grid, HILLS, **({"spacing": 5.0} | {name: bad}))
    for grid in (1e300, None, [[1, 2], [3]], HILLS[0], HILLS + 1j, HILLS.astype(str), HILLS * 1e300):
        yield call(bring_in, cast(Any, None), grid, {"spacing_m": (5.0, 5.0)}, {}, print, "me")


def streamed() -> Iterator[Call]:
    bad: Any
    sync = SimpleNamespace(confirmed=SimpleNamespace(settings=SimpleNamespace(size_m=512.0), clock=1))
    g = StreamedGround(cast(Any, sync), threading.Condition(), lambda: None, lambda: None)
    for bad in (None, 1, "abc", (1, 2), (1, 2, NAN), (1, 2, "3"), (INF, 0, 0), {}):
        yield call(g.look, bad, (0, 0, 0))
        yield call(g.look, (0, 0, 9), bad)
    yield call(g.look, (0, 0, 9), (0, 0, 0), nothing=1)
    for bad in (*NO_NUMBER, *NOT_FINITE, -1.0):
        yield call(g.wait, bad)
        yield call(g.wait, 1.0, bad)
    for bad in NO_LEVEL:
        yield call(g.heights, bad)
        yield call(g.amplitude, bad)
        yield call(g.tile, bad, 0, 0)
        yield call(g.tile, 2, bad, 0)
        yield call(g.tile, 2, 0, bad)
    for bad in (None, 1, "HEIGHT", "height", []):
        yield call(g.tiles, bad)
        yield call(g.channel, bad, 1)


def complaint(one: Call) -> str | None:
    """What is wrong with how a wrong argument was refused; None when nothing is."""
    said = f"{one!r:.200}"
    try:
        with np.errstate(all="raise"):
            one()
    except (ValueError, TypeError, KeyError) as error:
        words, last = str(error), Path(traceback.extract_tb(error.__traceback__)[-1].filename)
        if PACKAGE not in last.parents:
            return f"{said}: by {last.name}: {words}"
        if len(words) < 12 or "\n" in words or "pydantic" in words:
            return f"{said}: no sentence: {words!r}"
        return None
    except BaseException as error:
        return f"{said}: {type(error).__name__}: {error}"
    return f"{said}: taken"


@pytest.mark.parametrize("calls", [terrains, exports, grids, strokes, live, streamed])
def test_no_wrong_argument_gets_past_the_door(
    calls: Callable[[], Iterator[Call]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC D380: each public method of ``Terrain``, ``Stroke``, ``connect`` and what it gives, each argument."""

    def solves(*_: object, **__: object) -> None:
        raise AssertionError("it was solved")

    monkeypatch.setattr("esker.api.terrain.default_solver", solves)
    before = TERRAIN.strokes, TERRAIN.layers, TERRAIN.settings
    found = [complaint(one) for one in calls()]
    assert len(found) > 30
    assert [one for one in found if one is not None] == []
    assert (TERRAIN.strokes, TERRAIN.layers, TERRAIN.settings) == before, "nothing of it was done"


# --- the limits are a server's ------------------------------------------------------------------------------------


def server_says(document: contract.Document, op: contract.Op) -> str:
    """The sentence with which a server refuses an op."""
    with pytest.raises(Refusal) as caught:
        StrokeSet.from_document(document).apply(op)
    return caught.value.message


def test_an_offline_terrain_refuses_what_a_server_refuses() -> None:
    """SPEC D381: in the same words: points too far outside, too many strokes and points, kinds that do not fit."""
    t = Terrain(size_m=64.0)
    born = t.document
    far = Stroke.profile([(0, 0, 0), (700, 0, 9)], id="far")
    sly = Stroke.level([(0, 0, 1), (9, 0, 1)], id="sly").model_copy(update={"curve": ((0.0, 0.0), (100.0, 90.0))})
    kind = Stroke.profile(LINE, id="kind").model_copy(
        update={"paint": contract.Paint(channel="snow", value=1, radius_m=2)}
    )
    for wrong in (far, sly, kind):
        with pytest.raises(ValueError, match="t") as caught:
            t.add(wrong)
        assert str(caught.value) == server_says(born, contract.BeginStroke(stroke=wrong))
    for fields in ({"roughness": 7.0}, {"label": "x" * 81}, {"first": (NAN, 0.0, 0.0)}, {"curve": ((0.0, 1e9),)}):
        with pytest.raises(ValueError, match=next(iter(fields))):
            t.add(Stroke.profile([(0, 0, 0), (9, 0, 9)]).model_copy(update=fields))
    assert t.strokes == ()


def test_numbers_of_strokes_and_points_are_a_servers(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC D381: also of a file, or of any document from elsewhere."""
    small = partial(Limits, strokes=2, all_points=7)
    monkeypatch.setattr("esker.document.ops.Limits", small)
    t = Terrain(size_m=1024.0)
    t.add(Stroke.profile(LINE, id="a"))
    t.add(Stroke.profile(LINE, id="b"))
    third, long = Stroke.profile(LINE, id="c"), Stroke.profile([(x, x, 9.0) for x in range(5)], id="b")
    longer = contract.SetStroke(stroke="b", fields=contract.StrokeFields(curve=long.curve))
    for wrong, op in ((third, contract.BeginStroke(stroke=third)), (long, longer)):
        with pytest.raises(ValueError, match="at most") as caught:
            t.add(wrong)
        assert str(caught.value) == server_says(t.document, op)
    more = t.document.model_copy(update={"strokes": (*t.strokes, third)})
    with pytest.raises(ValueError, match="at most 2 strokes"):
        Terrain.from_document(more)
    assert len(Terrain.from_document(more, trusted=True).strokes) == 3, "what a server has was good when it was made"


def test_a_file_beyond_the_limits_is_refused(tmp_path: Path) -> None:
    """SPEC D381: what an upload to a server refuses, in the same words."""
    t = Terrain(size_m=64.0)
    far = Stroke.profile([(0, 0, 0), (700, 0, 9)], id="far")
    (tmp_path / "a.esker").write_bytes(archive.dumps(t.document.model_copy(update={"strokes": (far,)})))
    with pytest.raises(ValueError, match="ten times the terrain"):
        Terrain.load(tmp_path / "a.esker")


def test_a_layer_is_as_high_as_a_server_lets_it_be() -> None:
    """SPEC D381: laid, and changed afterwards."""
    t = Terrain(size_m=64.0)
    with pytest.raises(ValueError, match="would reach 900 metres"):
        t.add_grid(np.full((9, 9), 900.0), spacing=5.0)
    layer = t.add_grid(np.full((9, 9), 300.0), spacing=5.0)
    with pytest.raises(ValueError, match="would reach 600 metres"):
        t.set_grid(layer, scale=2.0)
    assert t.layers[0].scale == 1.0


def test_a_masked_grid_keeps_its_mask() -> None:
    """SPEC D382: what is masked is no data, whatever stands under the mask, of any type of numbers."""
    for dtype in (np.int16, np.uint8, np.float32, np.float64):
        plain = np.arange(400).reshape(20, 20) % 200
        masked = np.ma.masked_array(plain.astype(dtype), mask=(plain // 20 == 3))
        masked.data[masked.mask] = 255 if dtype is np.uint8 else -9999
        t = Terrain(size_m=256.0)
        t.add_grid(masked, spacing=5.0)
        (raster,) = t.grids.values()
        np.testing.assert_array_equal(np.isnan(raster.heights), masked.mask)
        np.testing.assert_array_equal(raster.heights[~masked.mask], plain[~masked.mask])
        assert t.layers[0].facts.low_m >= 0
    nothing = np.ma.masked_array(np.ones((5, 5)), mask=False)
    t = Terrain(size_m=256.0)
    t.add_grid(nothing, spacing=5.0)
    assert next(iter(t.grids.values())).valid == 1.0


def test_a_masked_grid_is_sent_with_its_mask() -> None:
    """SPEC D382: what goes to a server is the array with NaN where it is masked."""
    sent: list[np.ndarray] = []

    class Uploads:
        follow = None

        def send(self, path: Path, *_: object) -> None:
            sent.append(np.load(path))
            raise ConnectionError("far enough")

    masked = np.ma.masked_less(HILLS, 30.0)
    with pytest.raises(ConnectionError):
        bring_in(cast(Any, Uploads()), masked, {"spacing_m": (5.0, 5.0)}, {}, print, "me")
    np.testing.assert_array_equal(np.isnan(sent[0]), HILLS < 30.0)


def test_what_is_right_is_taken_in_any_type_of_numbers(tmp_path: Path) -> None:
    """SPEC D380: NumPy's numbers and arrays are numbers, and what is infinite may be where that means something."""
    size: Any = np.float32(1024)
    t: Any = Terrain(size_m=size, reach_m=np.inf)
    assert t.settings.reach_m is None
    flank: Any = np.array([30, 90])
    t.add(Stroke.profile(np.array(LINE, np.float32), left=flank, roughness=np.float32(0.5)))
    t.add_grid(HILLS.astype(np.float16), anchor=np.array([1, 2]), spacing=np.array([5, 6]), priority=np.int8(3))
    assert t.heights(np.int64(0)).shape == (65, 65)
    assert t.sample(np.zeros((0, 2), int)).shape == (0,)
    corners = np.array([0, 0, 1024, 1024])
    assert t.window(np.uint8(0), *corners).heights.shape == (65, 65)
    t.export(tmp_path / "a.npy", level=0, window=corners, detail=np.bool_(False))
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), t.window(0, *corners).heights)
