"""What somebody is sent who only watches a terrain: all of its coarse levels, and nothing finer (the wall)."""

from __future__ import annotations

import numpy as np

from esker.tiles.delivery import ClientTiles, TileServer
from esker.tiles.plans import FramePlan


class Watcher(ClientTiles):
    """Heights and their base up to level ``top``. No view, no channels, no refined tiles."""

    def __init__(self, tiles: TileServer, top: int) -> None:
        super().__init__(tiles, rest_level=min(top, tiles.levels))
        self._top = min(top, tiles.levels)

    def plan(self, hurry: bool = False) -> FramePlan | None:  # noqa: ARG002  (all that it sends is coarse)
        """The next frame: newer puts of a level before what is missing of it, coarse before fine."""
        stamp = self._server.stamp
        if self._idle_stamp == stamp:
            return None
        found = self._base.plan_limit() or self._heights.plan_limit()
        for level in range(self._top + 1):
            found = found or self._base.plan_level(level, np.True_) or self._heights.plan_level(level, np.True_)
        for level in range(self._top + 1):
            found = found or self._plan_fill(level, np.True_)
        if found is None:
            self._idle_stamp = stamp
        return found
