"""The shared vectors are what the Python implementation says today (SPEC D1, D12, P2)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.document.ops import Refusal, StrokeSet
from tests.vectors import make

VECTORS = Path(make.__file__).parent


def _cases(name: str) -> list[dict[str, Any]]:
    cases: list[dict[str, Any]] = json.loads((VECTORS / name).read_text(encoding="utf-8"))["cases"]
    return cases


def test_regenerating_changes_nothing() -> None:
    for name, content in make.build().items():
        assert (VECTORS / name).read_text(encoding="utf-8") == content, f"run python tests/vectors/make.py ({name})"


@pytest.mark.parametrize("case", _cases("ops.json"), ids=lambda case: case["name"])
def test_op(case: dict[str, Any]) -> None:
    before = StrokeSet.from_document(c.Document.model_validate_json(json.dumps(case["document"])))
    kept = before.to_document()
    op = c.OP.validate_json(json.dumps(case["op"]))
    if "refusal" in case:
        with pytest.raises(Refusal) as caught:
            before.apply(op)
        assert caught.value.code == case["refusal"]
        assert len(caught.value.message) > 10
    else:
        after, _ = before.apply(op)
        assert after.to_document().model_dump(mode="json") == case["result"]
        assert after.clock == before.clock + 1
    assert before.to_document() == kept, "apply must not change the set it was called on"


def test_every_op_type_and_document_refusal_has_a_vector() -> None:
    cases = _cases("ops.json")
    types = {case["op"]["type"] for case in cases if "result" in case}
    assert types == {
        "stroke.begin",
        "stroke.append",
        "stroke.finish",
        "stroke.set",
        "stroke.anchor",
        "stroke.delete",
        "stroke.restore",
        "terrain.set",
        "layer.add",
        "layer.set",
        "layer.delete",
        "layer.restore",
        "group",
    }
    codes = {case["refusal"] for case in cases if "refusal" in case}
    assert codes >= {"unknown_stroke", "duplicate_stroke", "deleted_stroke", "locked_stroke", "too_many_points"}
    assert codes >= {"out_of_domain", "bad_index", "bad_field"}
    assert codes >= {"unknown_layer", "duplicate_layer", "deleted_layer", "too_many_layers"}
