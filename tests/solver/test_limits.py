"""Whatever the contract allows has ground that is finite, on every device (SPEC S220, S221, D220, J220)."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from bench.solver import limits
from bench.solver._limit_documents import document
from esker import contract as c
from esker.document.archive import document_from_json
from esker.document.former import read_document, read_op
from esker.document.ops import StrokeSet, check_document
from esker.events import Settled
from esker.solve.constraints.computable import CLOSEST_M, LEAST_REACH_FRACTION, computable
from esker.solve.constraints.crest import crest_of
from esker.solve.multigrid import DivergedError
from esker.solve.solver import Solver
from esker.store.journal import Journal, Row
from tests.solver.scenes import SCENES, SETTINGS

COUNT = 60
STALE = '{"type":"terrain.set","fields":{"reach_m":1e-300}}'


def test_documents_at_the_limits_of_every_field_have_finite_ground_on_every_device() -> None:
    found = limits.search([Solver("numpy", 0), Solver(None, 0)], range(COUNT))
    assert found["documents"] == COUNT
    assert found["findings"] == []


def test_the_generator_reaches_both_ends_of_the_numbers() -> None:
    reaches = {document(seed).settings.reach_m for seed in range(200)}
    assert {None, c.MIN_REACH_M, c.ABSOLUTE_BOUND_M} <= reaches
    extents = {f.extent_m for seed in range(200) for s in document(seed).strokes for f in (s.left, s.right) if f}
    assert {0.0, c.ABSOLUTE_BOUND_M} <= extents
    assert any(0 < extent < 1e-290 for extent in extents)
    for seed in range(20):
        check_document(document(seed))
        assert document(seed) == document(seed)


def test_the_search_tells_what_it_finds() -> None:
    """It can fail: a solver that gives out NaN, one that raises, and one that diverges."""

    class Wrong(Solver):
        error: Exception | None = None

        def steps(self, *_: object, **__: object) -> object:  # type: ignore[override]
            if self.error is not None:
                raise self.error
            yield limits_level(np.nan)

    solver = Wrong("numpy", 0)
    assert "not finite" in limits.search([solver], [3])["findings"][0]
    solver.error = OverflowError("x")
    assert "seed 3: OverflowError: x" in limits.search([solver], [3])["findings"][0]
    solver.error = DivergedError()
    assert limits.search([solver], [3]) == {
        "documents": 1,
        "findings": [],
        "diverged": [f"{solver.device_name}, seed 3"],
    }


def limits_level(value: float) -> object:
    return Settled(0, np.full((65, 65), value, dtype=np.float32))


@pytest.mark.parametrize("device", ["numpy", None])
@pytest.mark.parametrize("size", [c.MIN_SIZE_M, c.MAX_SIZE_M])
def test_a_reach_that_no_float32_can_square_takes_nobody_s_device(device: str | None, size: float) -> None:
    """It was an OverflowError in the tables, taken for a fault of the device: every room went on with NumPy."""
    for reach in (1e-300, 1e-45, c.MIN_REACH_M):
        settings = SETTINGS.model_copy(update={"reach_m": reach, "size_m": size})
        heights = Solver(device, 1).solve(SCENES["one"], settings)[1]
        assert np.isfinite(heights).all()


def test_ordinary_settings_are_computed_as_they_are() -> None:
    assert computable(SETTINGS) is SETTINGS
    endless = SETTINGS.model_copy(update={"reach_m": None})
    assert computable(endless) is endless
    short = SETTINGS.model_copy(update={"reach_m": c.MIN_REACH_M})
    assert computable(short).reach_m == SETTINGS.size_m * LEAST_REACH_FRACTION


def test_points_that_are_nearly_one_are_one() -> None:
    stroke = SCENES["one"][0]
    near = stroke.model_copy(update={"last": (stroke.first[0] + 5e-324, stroke.first[1], 0.0)})
    crest = crest_of(near)
    assert crest is not None
    assert len(crest.points) == 1
    assert crest.points[0, 2] == pytest.approx(max(w for _, w in stroke.curve)), "its summit"
    level = c.Stroke(
        id="l", kind="level", first=(0, 0, 10), last=(100, 0, 10), curve=((0, 0), (CLOSEST_M / 1e3, 0), (1, 0))
    )
    crest = crest_of(level)
    assert crest is not None
    assert len(crest.points) == 2


# --- what an earlier version wrote ----------------------------------------------------------------------------------


def test_what_the_wire_refuses_a_journal_may_hold(caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(ValidationError):
        c.OP.validate_json(STALE)
    with caplog.at_level(logging.WARNING, logger="esker.former"):
        op = read_op(STALE)
    assert isinstance(op, c.SetTerrain)
    assert op.fields.reach_m == c.MIN_REACH_M
    assert op.fields.model_fields_set == {"reach_m"}
    assert "reach_m was 1e-300" in caplog.text
    group = read_op(f'{{"type":"group","ops":[{STALE}]}}')
    assert isinstance(group, c.Group)
    text = c.Document(id="t").model_dump_json().replace('"reach_m":128.0', '"reach_m":1e-300')
    assert "1e-300" in text
    assert read_document(text).settings.reach_m == c.MIN_REACH_M
    assert document_from_json(text.encode()).settings.reach_m == c.MIN_REACH_M


@pytest.mark.parametrize("text", ["{", "{}", '{"type":"terrain.set","fields":{"reach_m":"far"}}', STALE[:-3]])
def test_what_was_never_valid_still_is_not(text: str) -> None:
    with pytest.raises(ValidationError):
        read_op(text)


def test_an_old_journal_with_a_reach_of_nothing_opens(tmp_path: Path) -> None:
    """SPEC J220: with the number that the server computes, for those who resume too."""
    journal = Journal(tmp_path)
    journal.create(c.Document(id="t")).result()
    journal.append("t", [Row(1, "c1", 0, "c1", STALE)]).result()
    loaded = journal.load("t")
    assert loaded is not None
    assert loaded.document.settings.reach_m == c.MIN_REACH_M
    assert json.loads(loaded.recent[0].op)["fields"] == {"reach_m": c.MIN_REACH_M}
    assert StrokeSet.from_document(loaded.document.to_document()).settings.reach_m == c.MIN_REACH_M
    assert journal.rows("t", 0)[0].op == STALE, "what was written stays as it was"
    journal.close()
