"""Memory of refinement: fields of tiles by their content."""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from esker.contract import TILE_SAMPLES
from esker.solve.refine.engine import CHANNELS, Fields

CACHE_BYTES: Final = 64 << 20
TILE_BYTES: Final = 4 * CHANNELS * TILE_SAMPLES**2


class FieldCache:
    """Fields of refined tiles by content, least recently used dropped first; shared by the refiners of a solver."""

    def __init__(self, bytes_: int = CACHE_BYTES) -> None:
        self.most = max(1, bytes_ // TILE_BYTES)
        self._held: OrderedDict[bytes, Fields] = OrderedDict()

    def __len__(self) -> int:
        return len(self._held)

    def __contains__(self, content: bytes) -> bool:
        return content in self._held

    def get(self, content: bytes) -> Fields | None:
        """The fields (3, 65, 65) of this content, if they are held."""
        found = self._held.get(content)
        if found is not None:
            self._held.move_to_end(content)
        return found

    def put(self, content: bytes, fields: Fields) -> None:
        """Hold fields."""
        self._held[content] = fields
        self._held.move_to_end(content)
        while len(self._held) > self.most:
            self._held.popitem(last=False)

    def drop(self, content: bytes) -> None:
        """Forget one tile."""
        self._held.pop(content, None)

    def clear(self) -> None:
        """Drop everything."""
        self._held.clear()
