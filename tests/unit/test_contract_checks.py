"""What a client may send, as a table for the page (SPEC H472)."""

from __future__ import annotations

import re
from typing import Any

import pytest

from esker import contract as c
from esker import resources
from esker.contract import checks

ROOT = resources.sources()


def test_the_table_has_every_model_that_a_client_sends() -> None:
    table = checks.models()
    unions = checks.unions()
    assert unions["ClientMessage"] == [m.__name__ for m in c.ClientMessage.__origin__.__args__]  # type: ignore[attr-defined]
    assert unions["Op"] == [m.__name__ for m in c.Op.__origin__.__args__]  # type: ignore[attr-defined]
    for name in (*unions["ClientMessage"], *unions["Op"], "Stroke", "StrokeFields", "Layer", "LayerFields"):
        model = getattr(c, name)
        assert set(table[name]["must"]) | set(table[name]["may"]) == set(model.model_fields), name


def test_bounds_are_those_of_the_models() -> None:
    table = checks.models()
    assert table["Flank"]["may"]["slope_deg"] == {"nullable": {"number": [0, c.MAX_SLOPE_DEG]}}
    assert table["View"]["may"]["fov_deg"] == {"between": [1, 170]}
    assert table["AppendPoints"]["must"]["points"]["length"] == [0, c.MAX_POINTS_PER_APPEND]
    assert table["TerrainFields"]["may"]["seed"] == {"nullable": {"integer": [0, 2**32 - 1]}}
    assert table["Ping"]["must"] == {"type": {"oneOf": ["ping"]}, "t": {"number": [-checks.LARGEST, checks.LARGEST]}}


@pytest.mark.parametrize(
    "node",
    [
        {"type": "string", "format": "date"},
        {"type": "integer", "multipleOf": 2},
        {"type": "number", "exclusiveMinimum": 0},
        {"type": "object", "additionalProperties": {"type": "number"}},
        {"anyOf": [{"type": "number"}, {"type": "string"}]},
    ],
)
def test_what_no_check_knows_is_not_left_out(node: dict[str, Any]) -> None:
    """Generating stops, so that the page never lets through what the server refuses."""
    with pytest.raises(ValueError, match=r"no check|only one end"):
        checks.check(node)


def test_the_page_writes_no_field_and_no_bound_of_its_own() -> None:
    """The file that checks names no field of a message but ``type``, and imports the table alone."""
    text = (ROOT / "frontend" / "src" / "core" / "wire.ts").read_text()
    code = re.sub(r"/\*[\s\S]*?\*/|//.*", "", text)
    fields = {f for m in checks.models().values() for part in m.values() for f in part} - {"type"}
    words = fields & set(re.findall(r"(?<=[\s\"'.{])([a-z_]+)(?=\"?:)", code))
    assert words == set()
    assert re.findall(r'from "([^"]+)"', code) == ["../generated/wire.ts"]
