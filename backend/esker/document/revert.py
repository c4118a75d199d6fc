"""Taking one change of a stroke or a layer back in the present document: the inner half of ``undo.py``. Pure.

Twin of ``frontend/src/doc/revert.ts``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator

from esker import contract as c
from esker.contract import Op, Stroke
from esker.document.changes import WORDS, ItemChange, Kind, state_of
from esker.document.ops import StrokeSet

LARGE_CURVE_POINTS = 1_024
"""A longer curve is restored by appends, since one message of 64 KiB does not hold it."""


class Reverter(ABC):
    """Takes one change back, for strokes and layers: appends to ``ops`` what takes the change back, and to
    ``skipped`` what was left alone, a sentence each."""

    kind: Kind

    def __init__(
        self, item_id: str, change: ItemChange, present: StrokeSet, ops: list[c.SimpleOp], skipped: list[str]
    ) -> None:
        self.id, self.change, self.ops, self.skipped = item_id, change, ops, skipped
        self.state, self.item = state_of(self.kind, present, item_id)

    def run(self) -> None:
        """Appends to ``ops`` and ``skipped``."""
        match self.change.before, self.change.after:
            case ("absent", "live") | ("deleted", "live"):
                self._take_away()
            case "live", "deleted":
                self._bring_back()
            case "live", "live":
                if self.item is None or self.state != "live":
                    self._skip(f"Somebody else has deleted this {self.kind} since; your change of it was not undone.")
                else:
                    self._fields()
            case _:
                pass  # made and taken away within one step: nothing is left of it

    def _skip(self, sentence: str) -> None:
        self.skipped.append(sentence)

    def _take_away(self) -> None:
        if self.item is None or self.state != "live":
            self._skip(f"This {self.kind} is deleted already.")
            return
        if any(getattr(self.item, name) != getattr(self.change.content, name) for name in WORDS[self.kind]):
            self._skip(f"Somebody else has changed this {self.kind} since; it was kept.")
            return
        self._delete(self.change.before == "deleted" and bool(self.change.fields))

    def _bring_back(self) -> None:
        if self.item is None:
            self._skip(f"This {self.kind} can no longer be restored.")
            return
        if self.state == "live":
            self._skip(f"This {self.kind} is back already.")
            return
        self._restore()
        self._fields()

    def _restorable(self) -> dict[str, object]:
        """The fields that are still as I left them, with the values they had before."""
        update: dict[str, object] = {}
        for name, word in WORDS[self.kind].items():
            if name not in self.change.fields:
                continue
            old, new = self.change.fields[name]
            if getattr(self.item, name) == new:
                update[name] = old
            else:
                self._skip(f"Somebody else has changed the {word} of this {self.kind} since; that was kept.")
        return update

    @abstractmethod
    def _delete(self, changed: bool) -> None:
        """``changed``: put the fields back first, as they were in the tombstone."""

    @abstractmethod
    def _restore(self) -> None: ...

    @abstractmethod
    def _fields(self) -> None:
        """Puts the fields back that are still as I left them."""


class LayerReverter(Reverter):
    """Takes one layer's change back."""

    kind: Kind = "layer"

    def _delete(self, changed: bool) -> None:
        if changed:
            self._fields()
        self.ops.append(c.DeleteLayer(layer=self.id))

    def _restore(self) -> None:
        self.ops.append(c.RestoreLayer(layer=self.id))

    def _fields(self) -> None:
        update = self._restorable()
        if update:
            self.ops.append(c.SetLayer(layer=self.id, fields=c.LayerFields.model_validate(update)))


class StrokeReverter(Reverter):
    """Takes one stroke's change back, minding its lock and curves that no message holds."""

    kind: Kind = "stroke"

    def _delete(self, changed: bool) -> None:
        stroke = self._stroke()
        locked = self._put_back() if changed else stroke.locked
        if locked:
            self.ops.append(c.SetStroke(stroke=self.id, fields=c.StrokeFields(locked=False)))
        self.ops.append(c.DeleteStroke(stroke=self.id))

    def _restore(self) -> None:
        self.ops.append(c.RestoreStroke(stroke=self.id))

    def _fields(self) -> None:
        self._put_back()

    def _stroke(self) -> Stroke:
        assert isinstance(self.item, Stroke)
        return self.item

    def _put_back(self) -> bool:
        """Puts the fields back that are still as I left them; returns whether the stroke is locked afterwards."""
        stroke, update = self._stroke(), self._restorable()
        if stroke.locked and update:
            if "locked" not in update:
                self._skip("Somebody else has locked this stroke since; it was kept.")
                return True
            self._set({"locked": update.pop("locked")})
        relock = update.pop("locked", None)
        curve = update.get("curve")
        if isinstance(curve, tuple) and len(curve) > LARGE_CURVE_POINTS:
            del update["curve"]
            self._append(curve, update.pop("last", stroke.last))
        if update:
            self._set(update)
        if relock is not None:
            self._set({"locked": relock})
        return bool(relock)

    def _set(self, update: dict[str, object]) -> None:
        self.ops.append(c.SetStroke(stroke=self.id, fields=c.StrokeFields.model_validate(update)))

    def _append(self, curve: tuple[c.CurvePoint, ...], last: object) -> None:
        step = c.MAX_POINTS_PER_APPEND
        for start in range(0, len(curve), step):
            points = curve[start : start + step]
            op = {"stroke": self.id, "start": start, "points": points, "last": last}
            self.ops.append(c.AppendPoints.model_validate(op))


def _points(op: c.SimpleOp) -> int:
    if isinstance(op, c.AppendPoints):
        return len(op.points)
    return len(op.fields.curve or ()) if isinstance(op, c.SetStroke) else 0


def grouped(ops: Iterable[c.SimpleOp]) -> Iterator[Op]:
    """One op if it fits in one message, a group if there are several, more groups only beyond the limits."""
    batch: list[c.SimpleOp] = []
    points = 0
    for op in ops:
        if batch and (len(batch) == c.MAX_OPS_PER_GROUP or points + _points(op) > LARGE_CURVE_POINTS):
            yield batch[0] if len(batch) == 1 else c.Group(ops=tuple(batch))
            batch, points = [], 0
        batch.append(op)
        points += _points(op)
    if batch:
        yield batch[0] if len(batch) == 1 else c.Group(ops=tuple(batch))
