"""Applying operations to the elevation layers of a document (DESIGN 4, 11). Pure; the layers' half of ``ops.py``.

``frontend/src/doc/layers.ts`` is the twin; ``tests/vectors/ops.json`` holds the cases that both read.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from esker import contract as c
from esker.contract import Layer
from esker.document.refusal import Limits, Refusal, changed, trim

CREDIT_FIELDS: Final = frozenset({"name", "outline", "source", "licence"})
"""Fields of a layer that are for people only; the ground follows from all the others."""
LayerOp = c.AddLayer | c.SetLayer | c.DeleteLayer | c.RestoreLayer


def span_m(layers: Iterable[Layer]) -> tuple[float, float] | None:
    """Lowest and highest sample of the layers that are shown, metres, as they are laid; None without any."""
    ends = [
        layer.scale * z + layer.lift_m
        for layer in layers
        if not layer.hidden
        for z in (layer.facts.low_m, layer.facts.high_m)
    ]
    return (min(ends), max(ends)) if ends else None


def size_for(farthest_m: float) -> float:
    """Side in whole metres of the smallest domain that holds ground so far from zero."""
    return float(math.ceil(farthest_m / c.LAYER_HEIGHT_MARGIN))


def check_layer(layer: Layer, size_m: float) -> None:
    """Raises Refusal for a layer whose heights the quanta of the finest tiles of such a domain could not hold."""
    facts = layer.facts
    farthest = max(abs(layer.scale * z + layer.lift_m) for z in (facts.low_m, facts.high_m))
    bound = c.LAYER_HEIGHT_MARGIN * size_m
    if farthest > bound:
        raise Refusal(
            "out_of_domain",
            f"Heights of this layer would reach {farthest:.0f} metres from zero; a terrain "
            f"{size_m:.0f} metres wide holds {bound:.0f}. Lower it, or make a terrain of at least "
            f"{size_for(farthest):.0f} metres.",
        )


class LayerEditor:
    """The layers of one application in progress. Copies the dictionaries on first write only."""

    def __init__(self, layers: dict[str, Layer], deleted: dict[str, Layer], size_m: float, limits: Limits) -> None:
        self.layers, self.deleted = layers, deleted
        self.grounded = False
        """Whether the ground under the strokes may have changed."""
        self._size_m, self._limits = size_m, limits
        self._copied = False

    def run(self, op: LayerOp) -> None:
        """Applies one op. Raises Refusal."""
        match op:
            case c.AddLayer():
                self._add(op.layer)
            case c.SetLayer():
                self._set(op)
            case c.DeleteLayer():
                self._delete(op.layer)
            case c.RestoreLayer():
                self._restore(op.layer)

    def check(self, layer: Layer) -> None:
        """See ``check_layer``."""
        check_layer(layer, self._size_m)

    def _own(self) -> None:
        if not self._copied:
            self.layers, self.deleted, self._copied = dict(self.layers), dict(self.deleted), True

    def _live(self, layer_id: str) -> Layer:
        layer = self.layers.get(layer_id)
        if layer is None:
            if layer_id in self.deleted:
                raise Refusal("deleted_layer", "This layer was deleted. Restore it before you change it.")
            raise Refusal("unknown_layer", "There is no such elevation layer in this terrain.")
        return layer

    def _room_for_one(self) -> None:
        if len(self.layers) >= self._limits.layers:
            raise Refusal("too_many_layers", f"A terrain holds at most {self._limits.layers} elevation layers.")

    def _add(self, layer: Layer) -> None:
        if layer.id in self.layers or layer.id in self.deleted:
            raise Refusal("duplicate_layer", "A layer with this id exists already.")
        self._room_for_one()
        self.check(layer)
        self._own()
        self.layers[layer.id] = layer
        self.grounded |= not layer.hidden

    def _set(self, op: c.SetLayer) -> None:
        old = self._live(op.layer)
        update = changed(op.fields)
        new = old.model_copy(update=update)
        self.check(new)
        self._own()
        self.layers[new.id] = new
        differs = any(getattr(old, name) != value for name, value in update.items() if name not in CREDIT_FIELDS)
        self.grounded |= differs and not (old.hidden and new.hidden)

    def _delete(self, layer_id: str) -> None:
        old = self._live(layer_id)
        self._own()
        del self.layers[layer_id]
        self.deleted[layer_id] = old
        trim(self.deleted, c.MAX_LAYERS)
        self.grounded |= not old.hidden

    def _restore(self, layer_id: str) -> None:
        if layer_id in self.layers:
            raise Refusal("duplicate_layer", "This layer is not deleted.")
        layer = self.deleted.get(layer_id)
        if layer is None:
            raise Refusal("unknown_layer", "There is no such deleted layer to restore.")
        self._room_for_one()
        self.check(layer)
        self._own()
        del self.deleted[layer_id]
        self.layers[layer_id] = layer
        self.grounded |= not layer.hidden
