"""Heights kept between calls are those of a fresh solve of the same document, to the bit (SPEC S380, S381)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from esker import Stroke, Terrain, contract
from esker.api.heights import SHAPING
from esker.api.terrain import default_solver
from esker.solve.solver import Solver

SIZE = 1024.0
STEPS = ("add", "change", "delete", "hide", "label", "paint", "amplitude", "undo", "reach", "title", "field")


class Artist:
    """Draws, changes, hides, paints, renames, takes back, and sets the terrain, as chance has it."""

    def __init__(self, seed: int, terrain: Terrain) -> None:
        self.rng, self.terrain = np.random.default_rng(seed), terrain
        self.before: list[tuple[contract.TerrainSettings, tuple[contract.Stroke, ...]]] = []

    def stroke(self, key: str | None = None) -> contract.Stroke:
        rng = self.rng
        at, to = rng.uniform(0.0, SIZE, (2, 2))
        steps = np.linspace(0.0, 1.0, int(rng.integers(2, 12)))[:, None]
        heights = np.sin(np.pi * steps) * rng.uniform(-80.0, 200.0)
        flank = (float(rng.uniform(10.0, 70.0)), float(rng.uniform(20.0, 300.0)))
        more: dict[str, Any] = {} if key is None else {"id": key}
        kind = Stroke.level if rng.random() < 0.3 else Stroke.profile
        return kind(np.hstack([at + steps * (to - at), heights]), left=flank, right=flank, **more)

    def changed(self, old: contract.Stroke, which: str) -> contract.Stroke:
        """The stroke with one field that heights follow from changed a little."""
        rng = self.rng
        value: Any = {
            "curve": tuple((u, 0.9 * w) for u, w in old.curve),
            "left": contract.Flank(slope_deg=float(rng.uniform(5.0, 60.0)), extent_m=90.0, shape="convex"),
            "right": None if old.right is not None else contract.Flank(),
            "plateau_radius_m": float(rng.uniform(0.0, 40.0)),
            "yields": float(rng.uniform(0.0, 1.0)),
            "hidden": not old.hidden,
            "course": contract.Course(use="road", rises=(0.0, 50.0)),
        }.get(which)
        if which in ("first", "last"):
            x, y, z = getattr(old, which)
            value = x + 7.0, y - 3.0, z
        return old.model_copy(update={which: value})

    def any_id(self) -> str:
        return str(self.rng.choice([stroke.id for stroke in self.terrain.strokes]))

    def step(self) -> str:
        t, rng = self.terrain, self.rng
        name = str(
            rng.choice(["add", "change", "delete", "hide", "label", "paint", "amplitude", "undo", "reach", "title"])
        )
        if not t.strokes:
            name = "add"
        if name == "undo":
            if self.before:
                settings, strokes = self.before.pop()
                t.settings = settings
                for stroke in t.strokes:
                    t.remove(stroke.id)
                for stroke in strokes:
                    t.add(stroke)
            return name
        self.before.append((t.settings, t.strokes))
        if name == "add":
            t.add(self.stroke())
        elif name == "change":
            t.add(self.stroke(self.any_id()))
        elif name == "delete":
            t.remove(self.any_id())
        elif name == "paint":
            t.add(Stroke.paint([(10, 10), (500, 700)], "snow", 0.5, 60.0))
        elif name in ("reach", "title"):
            said: dict[str, Any] = {"title": f"{rng.random()}", "sea_level_m": 3.0}
            if name == "reach":
                said = {"reach_m": float(rng.choice([8.0, 32.0, 200.0])), "border": str(rng.choice(["free", "pinned"]))}
            t.settings = t.settings.model_copy(update=said)
        elif name == "field":
            old = t.strokes[int(rng.integers(len(t.strokes)))]
            which = str(rng.choice(["first", "last", "curve", "left", "right", "plateau_radius_m", "yields", "hidden"]))
            t.add(self.changed(old, which))
        else:
            old = t.strokes[int(rng.integers(len(t.strokes)))]
            fields: dict[str, dict[str, Any]] = {
                "hide": {"hidden": not old.hidden},
                "label": {"label": "x"},
                "amplitude": {"amplitude_m": 5.0},
            }
            t.add(old.model_copy(update=fields[name]))
        return name


@pytest.fixture(scope="module")
def fresh() -> Callable[[Terrain, int], np.ndarray]:
    """A solve from nothing: no workspace, no packed stroke, no preview of before."""
    solver = Solver()

    def solved(terrain: Terrain, level: int) -> np.ndarray:
        solver._pool.clear()
        return solver.solve(terrain.strokes, terrain.settings, level)[level]

    return solved


@pytest.mark.parametrize("seed", range(6))
def test_any_edits_leave_the_heights_of_a_fresh_solve(seed: int, fresh: Callable[[Terrain, int], np.ndarray]) -> None:
    """SPEC S380: after each of many random edits, on two levels, to the bit."""
    artist = Artist(seed, Terrain(SIZE))
    steps = set()
    for count in range(24):
        steps.add(artist.step())
        level = 2 if count % 3 else 1
        np.testing.assert_array_equal(artist.terrain.heights(level), fresh(artist.terrain, level))
    assert len(steps) >= 6


def test_a_level_that_rooms_preview_is_the_same_too(fresh: Callable[[Terrain, int], np.ndarray]) -> None:
    """SPEC S380: at level 4, where solves of rooms make previews by a workspace of their own."""
    artist = Artist(99, Terrain(SIZE))
    for _ in range(4):
        artist.step()
        np.testing.assert_array_equal(artist.terrain.heights(4), fresh(artist.terrain, 4))


class Counting(Solver):
    """Counts what it is asked to solve."""

    solved = 0

    def heights(self, *given: Any, **more: Any) -> np.ndarray:
        self.solved += 1
        return super().heights(*given, **more)


def test_what_heights_do_not_follow_from_is_not_solved_again() -> None:
    """SPEC S381: names, paint, the sea, the way back, another order; but ids, which decide where strokes meet, are."""
    solver = Counting("numpy")
    t = Terrain(SIZE, solver=solver)
    artist = Artist(5, t)
    a, b = artist.stroke("a"), artist.stroke("b")
    t.add(a)
    first = t.heights(0)
    t.add(b)
    second = t.heights(0)
    assert solver.solved == 2
    t.add(a.model_copy(update={"label": "Ridge", "amplitude_m": 9.0, "locked": True}))
    t.add(Stroke.paint([(0, 0), (9, 9)], "grass"))
    t.settings = t.settings.model_copy(update={"title": "Other", "sea_level_m": 4.0, "look": "alpine"})
    t.remove("b")
    assert t.heights(0) is first
    t.add(b)
    assert t.heights(0) is second
    assert not second.flags.writeable
    assert solver.solved == 2
    t.remove("b")
    t.add(b.model_copy(update={"id": "0"}))
    t.heights(0)
    assert solver.solved == 3
    t.settings = t.settings.model_copy(update={"border": "pinned"})
    t.heights(0)
    assert solver.solved == 4


def test_a_solve_for_detail_is_used_for_heights() -> None:
    """SPEC S381: it is the same solve."""
    solver = Counting("numpy")
    t = Terrain(SIZE, solver=solver)
    t.add(Artist(7, t).stroke())
    made = t.window(0, 0, 0, SIZE, SIZE, global_level=0)
    np.testing.assert_array_equal(t.heights(0), made.heights)
    assert solver.solved == 0


def test_nothing_is_shown_where_nobody_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S382: no preview is made or read, and no channel solved, for heights alone."""
    from esker.solve import passes, solver

    def shown(*_: object, **__: object) -> None:
        raise AssertionError("something to be shown was made")

    for name in ("coarsest_preview", "previews", "amended", "settled"):
        monkeypatch.setattr(passes, name, shown)
    monkeypatch.setattr(solver, "ChannelSolver", shown)
    t = Terrain(SIZE, solver=default_solver())
    artist = Artist(3, t)
    for _ in range(2):
        t.add(artist.stroke())
        assert np.ptp(t.heights(4)) > 0


@pytest.mark.parametrize("which", [name for name in SHAPING if name not in ("id", "kind")])
def test_each_field_that_heights_follow_from_counts(which: str) -> None:
    """SPEC S381: a stroke that differs in it alone is solved again."""
    solver = Counting("numpy")
    artist = Artist(11, Terrain(SIZE, solver=solver))
    line = [(100, 100, 0), (300, 500, 90), (700, 600, 10)]
    stroke = Stroke.course(line, "road") if which == "course" else Stroke.profile(line, left=(30, 200), right=(40, 100))
    artist.terrain.add(stroke)
    before = artist.terrain.heights(0)
    artist.terrain.add(artist.changed(stroke, which))
    assert not np.array_equal(artist.terrain.heights(0), before) or which == "yields"
    assert solver.solved == 2
