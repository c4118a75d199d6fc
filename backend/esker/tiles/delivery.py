"""What to send to whom, next (DESIGN 6, 7, 8): one ``TileServer`` a room, one ``ClientTiles`` a client.

Nothing is queued. A client's next frame is planned from the newest levels when its byte window has room, so a newer
version of a tile replaces an older one by construction, and a slow client sees fewer steps but the same end.

``ledger.py`` has the rules for levels that are solved as a whole, ``refined_ledger.py`` those for the tiles above.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from esker.contract import DEFAULT_LEVEL, Channel, View
from esker.grid import TileKey
from esker.tiles.channels import ChannelPyramid, channel_levels
from esker.tiles.ledger import Ledger
from esker.tiles.plans import EncodedTiles, FramePlan
from esker.tiles.pyramid import Mask, Pyramid
from esker.tiles.quadtree import ALWAYS, default_selection, restrict, select
from esker.tiles.refined import RefinedTiles
from esker.tiles.refined_ledger import RefinedLedger
from esker.tiles.sparse import Selection, restrict_below, select_refined

WISHES: Final = 64
"""Most tiles that the refiner is asked for at once."""
TAU_STEP: Final = 1.3
"""Where a view wants more refined tiles than a client may hold, its tau grows by this factor until they fit."""

CHANNELS: Final[tuple[Channel, ...]] = tuple(channel for channel in Channel if channel != Channel.HEIGHT)


class RefinedTile(Protocol):
    """A tile as the refiner makes it (``solve/refine.py``): heights (65, 65) float32, metres;
    content: digest of all that it depends on."""

    @property
    def key(self) -> TileKey: ...

    @property
    def heights(self) -> NDArray[np.float32]: ...

    @property
    def content(self) -> bytes: ...


class TileServer:
    """The newest ground of one room, as tiles. Mutable; owned by the room, used from one thread."""

    def __init__(self, size_m: float, levels: int, finest: int | None = None, room_tiles: int | None = None) -> None:
        """``levels``: the finest level solved as a whole; ``finest``: the finest that is refined (default: none is).

        ``room_tiles``: most refined tiles kept (default ``refined.ROOM_TILES``). Raises ValueError for a ``finest``
        below ``levels`` or above MAX_REFINED_LEVEL.
        """
        self.pyramid = Pyramid(size_m, levels)
        self.channels = {channel: ChannelPyramid(channel, levels) for channel in CHANNELS}
        self.refined = RefinedTiles(size_m, levels, levels if finest is None else finest, room_tiles)
        self.cache = EncodedTiles()

    @property
    def levels(self) -> int:
        """The finest level that can be put."""
        return self.pyramid.levels

    @property
    def stamp(self) -> int:
        """Rises with every change of anything that a client could be sent."""
        return self.pyramid.stamp + sum(c.stamp for c in self.channels.values()) + self.refined.stamp

    def put_level(
        self,
        clock: int,
        level: int,
        heights: NDArray[np.float32],
        settled: bool,
        channel: Channel = Channel.HEIGHT,
        show: bool = True,
    ) -> int:
        """Takes a level of a solve: (N_l, N_l) float32, row 0 south. Returns the number of changed tiles.

        Heights and amplitude in metres, roughness 0..1, biases -1..1. A tile changes when a sample moved by at least
        one quantum; a settled level is exact. Raises ValueError for a wrong level, shape, NaN or infinity, and changes
        nothing then.
        """
        if channel != Channel.HEIGHT:
            return self.channels[channel].put(clock, level, heights, settled, show)
        before = self.pyramid.stamp
        changed = self.pyramid.put(clock, level, heights, settled, show)
        if self.pyramid.stamp != before:
            self.refined.suspend()
            if self.pyramid.top == self.levels and self.settled():
                self.refined.begin(clock)
        return changed

    def put_tile(self, clock: int, tile: RefinedTile) -> bool:
        """Takes a refined tile of the settled solve at ``clock``; False when it has been overtaken.

        Raises ValueError for a level that is not refined here, a wrong shape, NaN or infinity.
        """
        return self.refined.put(clock, tile.key, tile.heights, tile.content, self.pyramid)

    def limit(self, top: int) -> None:
        """From now on levels above ``top`` are not solved: clients are made to forget them."""
        if top != self.pyramid.top:
            self.refined.suspend()
            self.pyramid.limit(top)
            for channel in self.channels.values():
                channel.limit(channel_levels(top))

    def settled(self) -> bool:
        """True when every level that is solved is final for one and the same clock."""
        levels = [self.pyramid.level(level) for level in range(self.pyramid.top + 1)]
        return all(level is not None and level.settled for level in levels) and len({v.clock for v in levels if v}) == 1

    def wishes(self, clients: Sequence[ClientTiles]) -> tuple[tuple[TileKey, ...], int]:
        """The tiles to refine next for all clients together, coarse before fine, then by screen error.

        At most WISHES, with the number of all that are wanted; none while the ground moves.
        """
        if not self.refined.active:
            return (), 0
        errors: dict[TileKey, float] = {}
        for client in clients:
            client.refresh()
            for key, error in client.missing():
                errors[key] = max(error, errors.get(key, 0.0))
        order = sorted(errors, key=lambda k: (k.level, -errors[k], k))
        if len(self.refined) + len(order) > self.refined.room_tiles:
            wanted = {key for client in clients for key in client.wanted_refined()}
            room = self.refined.make_room(wanted, {key for client in clients for key in client.held_refined()})
            fresh = (key for key in order if self.refined.get(key) is None)
            beyond = set(itertools.islice(fresh, room, None))
            order = [key for key in order if key not in beyond]
        return tuple(order[:WISHES]), len(order)


class ClientTiles:
    """What one client holds and wants. Mutable; used from the room's thread; one plan is outstanding at a time.

    ``rest_level``: once the ground is settled and the view is served, the client gets every other tile up to this
    level too, so that a turning camera finds full detail and all pages answer ``heightAt`` alike everywhere; -1 never.
    """

    def __init__(self, tiles: TileServer, rest_level: int = DEFAULT_LEVEL) -> None:
        self._server = tiles
        self._rest_level = min(rest_level, tiles.levels)
        self._heights = Ledger(tiles.pyramid, tiles.cache, ALWAYS, self._rest_level)
        self._channels = {
            channel: Ledger(pyramid, tiles.cache, pyramid.levels, pyramid.levels, channel)
            for channel, pyramid in tiles.channels.items()
        }
        self._refined = RefinedLedger(tiles.refined, self._heights, tiles.cache)
        self._view: View | None = None
        self._wanted = default_selection(tiles.levels)
        self._errors: list[NDArray[np.float32]] | None = None
        self._selection = Selection.nothing(tiles.levels, tiles.refined.finest)
        self._selected = (-1, -1)
        self._view_changed = False
        self._idle_stamp = -1

    def set_view(self, view: View) -> None:
        """The client's camera. Selection follows at the next ``plan``."""
        if view != self._view:
            self._view = view
            self._view_changed = True

    def held(self, channel: Channel = Channel.HEIGHT) -> dict[TileKey, int]:
        """Versions that the client holds once it has applied every committed frame."""
        if channel != Channel.HEIGHT:
            return self._channels[channel].held()
        return self._heights.held() | self._refined.held()

    def wanted(self) -> list[Mask]:
        """The present selection of the levels that are solved as a whole, one (2^l, 2^l) mask per level."""
        self.refresh()
        return self._wanted

    def wanted_refined(self) -> set[TileKey]:
        """The present selection above these levels."""
        self.refresh()
        return set(self._selection.tiles)

    def held_refined(self) -> set[TileKey]:
        """What the client holds above these levels."""
        return self._refined.keys()

    def missing(self) -> list[tuple[TileKey, float]]:
        """Wanted tiles that the settled ground has not been refined to yet, with their projected errors in pixels."""
        return self._refined.missing(self._selection)

    def plan(self) -> FramePlan | None:
        """The most useful next frame, or None when there is nothing to send now. Cheap; changes nothing held.

        Levels coarse to fine: a LEVEL frame where a newer put waits; then FILL frames for tiles that came into view,
        coarse to fine and by projected error; then the other channels; then refined tiles; then, when the ground is
        settled, everything up to ``rest_level``.
        """
        stamp = self._server.stamp
        if self._idle_stamp == stamp and not self._view_changed:
            return None
        self.refresh()
        plan = self._plan_heights() or self._plan_channels()
        if plan is None and self._server.refined.active:
            plan = self._refined.plan(self._selection)
        if plan is None and self._server.settled():
            plan = self._plan_rest()
        if plan is None:
            self._idle_stamp = stamp
        return plan

    def _plan_heights(self) -> FramePlan | None:
        plan = self._heights.plan_limit()
        if plan is not None:
            return plan
        for level, wanted in enumerate(self._wanted):
            plan = self._heights.plan_level(level, wanted)
            if plan is not None:
                return plan
        for level, wanted in enumerate(self._wanted):
            errors = None if self._errors is None else self._errors[level]
            plan = self._heights.plan_fill(level, wanted, errors)
            if plan is not None:
                return plan
        return None

    def _plan_channels(self) -> FramePlan | None:
        for ledger in self._channels.values():
            plan = ledger.plan_limit()
            if plan is not None:
                return plan
            for level in range(ledger.levels + 1):
                plan = ledger.plan_level(level, np.True_)
                if plan is not None:
                    return plan
        return None

    def _plan_rest(self) -> FramePlan | None:
        for level in range(self._rest_level + 1):
            plan = self._heights.plan_fill(level, np.True_)
            if plan is not None:
                return plan
        return None

    def commit(self, plan: FramePlan) -> None:
        """The frame was handed to the socket: from now on the client counts as holding it."""
        self._idle_stamp = -1
        if plan.channel != Channel.HEIGHT:
            self._channels[plan.channel].commit(plan)
            return
        if plan.level <= self._server.levels:
            self._heights.commit(plan)
        self._refined.commit(plan)

    def refresh(self) -> None:
        """Selects again when the view moved or the ground changed since the last selection."""
        server = self._server
        now = (server.pyramid.generation, server.refined.generation)
        if self._view is None or not (self._view_changed or self._selected != now):
            return
        self._select(self._view)
        self._selected = now
        self._view_changed = False
        self._idle_stamp = -1

    def _select(self, view: View) -> None:
        server = self._server
        self._wanted, self._errors = select(server.pyramid.bounds(), view)
        if server.refined.finest == server.levels or server.pyramid.level(server.levels) is None:
            self._selection = Selection.nothing(server.levels, server.refined.finest)
            return
        while True:
            found = select_refined(server.pyramid, server.refined, self._wanted[-1], view)
            if found.count <= server.refined.client_tiles:
                break
            view = view.model_copy(update={"tau_px": view.tau_px * TAU_STEP})
        self._selection = found
        if restrict_below(found, self._wanted):
            restrict(self._wanted)
