"""Why an op cannot apply, and the limits that it is measured against (DESIGN 4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from esker import contract as c
from esker.contract import RejectCode
from esker.errors import EskerError

NOT_NULLABLE: Final[frozenset[str]] = frozenset()


class Refusal(EskerError):
    """An op that cannot apply: ``code`` for machines, the message for a person. The document is unchanged."""

    def __init__(self, code: RejectCode, message: str) -> None:
        super().__init__(code, message)
        self.code: RejectCode = code


@dataclass(frozen=True)
class Limits:
    """The document limits of DESIGN 4; settings may lower them."""

    strokes: int = c.MAX_STROKES
    points: int = c.MAX_POINTS_PER_STROKE
    layers: int = c.MAX_LAYERS
    all_points: int = c.MAX_POINTS_PER_TERRAIN


def changed(
    fields: c.StrokeFields | c.TerrainFields | c.LayerFields, nullable: frozenset[str] = NOT_NULLABLE
) -> dict[str, object]:
    """The fields that a partial update really sets. Raises Refusal when a field that has no null is null."""
    update: dict[str, object] = {name: getattr(fields, name) for name in fields.model_fields_set}
    for name, value in update.items():
        if value is None and name not in nullable:
            raise Refusal("bad_field", f"'{name}' needs a value.")
    return update


def trim(tombstones: dict[str, c.Stroke] | dict[str, c.Layer], most: int) -> None:
    """Forgets the oldest tombstones above ``most``. Never a setting: a replay must forget what was forgotten then."""
    items: Mapping[str, object] = tombstones
    while len(tombstones) > most:
        del tombstones[next(iter(items))]


def trim_points(tombstones: dict[str, c.Stroke], most: int) -> None:
    """Forgets the oldest tombstones above ``most`` points of all of them together."""
    held = sum(len(stroke.curve) for stroke in tombstones.values())
    while held > most:
        held -= len(tombstones.pop(next(iter(tombstones))).curve)
