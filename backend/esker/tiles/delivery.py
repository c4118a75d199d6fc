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

from esker import grid
from esker.contract import DEFAULT_LEVEL, Channel, View
from esker.grid import TileKey
from esker.tiles.channels import ChannelPyramid, channel_levels
from esker.tiles.codec.frame import GROUND
from esker.tiles.ledger import Ledger
from esker.tiles.plans import EncodedTiles, FramePlan
from esker.tiles.pyramid import Mask, Pyramid
from esker.tiles.quadtree import ALWAYS, default_selection, restrict, select_shown
from esker.tiles.refined import RefinedTiles, Under
from esker.tiles.refined_ledger import RefinedLedger
from esker.tiles.sparse import Selection, restrict_below, select_refined
from esker.tiles.surface import BasePyramid, Surface, total

MOST_REQUESTS: Final = 128
"""Most tiles that the refiner is asked for at once."""
TAU_STEP: Final = 1.3
"""Where a view wants more refined tiles than a client may hold, its tau grows by this factor until they fit."""

CHANNELS: Final[tuple[Channel, ...]] = tuple(channel for channel in Channel if channel not in GROUND)


class RefinedTile(Protocol):
    """A tile as the refiner makes it (``solve/refine/``): heights (65, 65) float32, metres, offsets from the base;
    base: the same of the elevation layers, None where there are none; content: digest of all that it depends on."""

    @property
    def key(self) -> TileKey: ...

    @property
    def heights(self) -> NDArray[np.float32]: ...

    @property
    def base(self) -> NDArray[np.float32] | None: ...

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
        self.base = BasePyramid(size_m, levels)
        self.surface = Surface(self.pyramid, self.base)
        self.channels = {channel: ChannelPyramid(channel, levels) for channel in CHANNELS}
        self.refined = RefinedTiles(size_m, levels, levels if finest is None else finest, room_tiles)
        self.refined_base = RefinedTiles(size_m, levels, self.refined.finest, room_tiles)
        self.cache = EncodedTiles()
        self._based = -1
        """The heights' stamp when the base last came: levels put before then belong to another base."""
        self._base_whole = True
        """Whether all levels of the base have come since it last changed."""

    @property
    def levels(self) -> int:
        """The finest level that can be put."""
        return self.pyramid.levels

    @property
    def stamp(self) -> int:
        """Rises with every change of anything that a client could be sent."""
        refined = self.refined.stamp + self.refined_base.stamp
        return self.surface.stamp + sum(c.stamp for c in self.channels.values()) + refined

    def put_level(
        self,
        clock: int,
        level: int,
        heights: NDArray[np.float32],
        settled: bool,
        channel: Channel = Channel.HEIGHT,
    ) -> int:
        """Takes a level of a solve: (N_l, N_l) float32, row 0 south. Returns the number of changed tiles.

        Heights (offsets from the base), base and amplitude in metres, roughness 0..1, biases -1..1, survey in levels.
        A tile changes when a sample moved by at least one quantum; a settled level is exact, and so is the base. The
        base comes before the heights that were solved over it. Raises ValueError for a wrong level, shape, NaN or
        infinity, and changes nothing then.
        """
        if channel == Channel.BASE:
            return self._put_base(clock, level, heights)
        if channel == Channel.SURVEY:
            # Data finer than any tile of the base are not shown: detail goes on where the tiles end.
            heights = np.minimum(heights, np.float32(self.refined.finest))
        if channel != Channel.HEIGHT:
            pyramid = self.channels[channel]
            return (pyramid.settle if settled else pyramid.preview)(clock, level, heights)
        before = self.pyramid.stamp
        changed = (self.pyramid.settle if settled else self.pyramid.preview)(clock, level, heights)
        if self.pyramid.stamp != before:
            self.refined.suspend()
            if self.pyramid.top == self.levels and self.settled():
                self.refined.begin(clock)
        return changed

    def note(self, clock: int, level: int, heights: NDArray[np.float32]) -> None:
        """Takes note of a coarse preview whose finest one is expected soon. Raises like ``put_level``."""
        self.pyramid.note(clock, level, heights)

    def _put_base(self, clock: int, level: int, heights: NDArray[np.float32]) -> int:
        before = self.base.stamp
        changed = self.base.put_base(clock, level, heights)
        if self.base.stamp != before:
            self._based, self._base_whole = self.pyramid.stamp, level == self.base.top
            self.refined.suspend()
            self.refined_base.suspend()
            if self._base_whole and level == self.levels:
                self.refined_base.begin(clock)
        return changed

    def put_tile(self, clock: int, tile: RefinedTile) -> bool:
        """Takes a refined tile of the settled solve at ``clock``; False when it has been overtaken.

        Raises ValueError for a level that is not refined here, a wrong shape, NaN or infinity.
        """
        if not self.refined.takes(clock, tile.key, tile.heights, self.pyramid):
            return False
        self.surface.changes()
        base = above = None
        if self.base.held or (tile.base is not None and tile.base.any()):
            if not self._put_base_tile(tile):
                return False
            found = self.refined_base.verified(tile.key)
            base = None if found is None else found.state.samples
            above = self.refined_base.parent(tile.key, self.base)
        under = Under(self.surface.stamp, base, above)
        return self.refined.put(clock, tile.key, tile.heights, tile.content, self.pyramid, under)

    def _put_base_tile(self, tile: RefinedTile) -> bool:
        """Puts the base of a refined tile: a stream of its own, which outlives the solve."""
        if not self.base.held:  # no level that is solved as a whole sees layers so small
            self.base.begin(self.refined.clock, self.levels + 1)
            self.refined_base.begin(self.refined.clock)
        heights = np.zeros_like(tile.heights) if tile.base is None else tile.base
        return self.refined_base.put(self.refined_base.clock, tile.key, heights, tile.content, self.base)

    def limit(self, top: int) -> None:
        """Says that levels above ``top`` are not solved from now on: clients are made to forget them."""
        if top != self.pyramid.top:
            self.refined.suspend()
            self.refined_base.suspend()
            self.pyramid.limit(top)
            self._base_whole = not self.base.held or self.base.level(top) is not None
            self.base.limit(top)
            for channel in self.channels.values():
                channel.limit(channel_levels(top))

    def settled(self) -> bool:
        """Whether every level that is solved is final for one and the same clock, over the base as it is."""
        levels = [self.pyramid.level(level) for level in range(self.pyramid.top + 1)]
        final = all(level is not None and level.settled and level.stamp > self._based for level in levels)
        return final and self._base_whole and len({v.clock for v in levels if v}) == 1

    def heights(self, level: int) -> NDArray[np.float32] | None:
        """The ground of a level as it is drawn, metres, row 0 south; None where it was not solved yet."""
        offset, base = self.pyramid.level(level), self.base.level(level)
        if offset is None:
            return None
        quanta = offset.samples if base is None else total(offset.samples, base.samples)
        return np.asarray(quanta * np.float32(grid.quantum(level, self.pyramid.size_m)), dtype=np.float32)

    def forget_earlier(self, clients: Sequence[ClientTiles]) -> int:
        """Forgets the states of levels from which no client's tiles can be told as a change; returns how many. A state
        of the finest level is 4 MiB, and most clients have the newest a moment after it came. What is left is stored in
        half of the memory until the next put."""
        count = 0
        for channel, pyramid in ((Channel.HEIGHT, self.pyramid), (Channel.BASE, self.base), *self.channels.items()):
            ledgers = [client.ledger(channel) for client in clients]
            count += pyramid.forget_earlier(
                lambda level, versions, newer, ledgers=ledgers: any(  # type: ignore[misc]
                    ledger.holds(level, versions, newer) for ledger in ledgers
                )
            )
            pyramid.narrow()
        return count

    def requests(self, clients: Sequence[ClientTiles]) -> tuple[tuple[TileKey, ...], int]:
        """The tiles to refine next for all clients together, coarse before fine, then by screen error.

        At most MOST_REQUESTS, with the number of all that are wanted; none while the ground moves.
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
            self.refined_base.keep(self.refined)
            fresh = (key for key in order if self.refined.get(key) is None)
            beyond = set(itertools.islice(fresh, room, None))
            order = [key for key in order if key not in beyond]
        return tuple(order[:MOST_REQUESTS]), len(order)


class ClientTiles:
    """What one client holds and wants. Mutable; used from the room's thread; one plan is outstanding at a time.

    ``rest_level``: once the ground is settled and the view is served, the client gets every other tile up to this
    level too, so that a turning camera finds full detail and all pages answer ``heightAt`` alike everywhere; -1 never.
    """

    def __init__(self, tiles: TileServer, rest_level: int = DEFAULT_LEVEL) -> None:
        self._server = tiles
        self._rest_level = min(rest_level, tiles.levels)
        self._heights = Ledger(tiles.pyramid, tiles.cache, ALWAYS, self._rest_level)
        self._base = Ledger(tiles.base, tiles.cache, ALWAYS, self._rest_level, Channel.BASE)
        self._channels = {
            channel: Ledger(pyramid, tiles.cache, pyramid.levels, pyramid.levels, channel)
            for channel, pyramid in tiles.channels.items()
        }
        self._refined = RefinedLedger(tiles.refined, self._heights, tiles.cache)
        self._refined_base = RefinedLedger(tiles.refined_base, self._base, tiles.cache, Channel.BASE)
        self._view: View | None = None
        self._wanted = self._shown = default_selection(tiles.levels)
        self._errors: list[NDArray[np.float32]] | None = None
        self._selection = Selection.nothing(tiles.levels, tiles.refined.finest)
        self._selected = (-1, -1)
        self._view_changed = False
        self._idle_stamp = -1

    def set_view(self, view: View) -> None:
        """Takes the client's camera. The selection follows it at the next ``plan``."""
        if view != self._view:
            self._view = view
            self._view_changed = True

    def ledger(self, channel: Channel) -> Ledger:
        """Returns what the client holds of the levels of a channel that are solved as a whole."""
        if channel == Channel.HEIGHT:
            return self._heights
        return self._base if channel == Channel.BASE else self._channels[channel]

    def held(self, channel: Channel = Channel.HEIGHT) -> dict[TileKey, int]:
        """Returns the versions that the client holds once it has applied every committed frame."""
        if channel == Channel.BASE:
            return self._base.held() | self._refined_base.held()
        if channel != Channel.HEIGHT:
            return self._channels[channel].held()
        return self._heights.held() | self._refined.held()

    def wanted(self) -> list[Mask]:
        """Returns the present selection of the levels that are solved as a whole, one (2^l, 2^l) mask per level."""
        self.refresh()
        return self._wanted

    def shown(self) -> list[Mask]:
        """Returns the selected tiles that the view shows as it is.

        The other selected tiles are for an eye a step nearer.
        """
        self.refresh()
        return self._shown

    def wanted_refined(self) -> set[TileKey]:
        """Returns the present selection above the levels that are solved as a whole."""
        self.refresh()
        return set(self._selection.tiles)

    def held_refined(self) -> set[TileKey]:
        """Returns the tiles that the client holds above the levels that are solved as a whole."""
        return self._refined.keys()

    def missing(self) -> list[tuple[TileKey, float]]:
        """Returns the wanted tiles to which the settled ground has not been refined yet, with their projected errors in
        pixels."""
        return [(k, e) for k, e in self._selection.tiles.items() if self._server.refined.verified(k) is None]

    def plan(self, hurry: bool = False) -> FramePlan | None:
        """The most useful next frame, or None when there is nothing to send now. Cheap; changes nothing held.

        ``hurry``: only levels that move, over the selection of before; all else can wait.

        Levels coarse to fine: a LEVEL frame where a newer put waits; then FILL frames for tiles that the view shows,
        coarse to fine and by projected error; then the other channels; then tiles that a step nearer will show; then
        refined tiles; then, when the ground is settled, everything up to ``rest_level``. The base of a tile always
        goes before the tile.
        """
        stamp = self._server.stamp
        if self._idle_stamp == stamp and not self._view_changed:
            return None
        # Levels that move go first, over the selection of before: selecting anew takes longer than sending them.
        plan = None if self._view_changed else self._plan_levels()
        if plan is None and not hurry:
            self.refresh()
            plan = self._plan_levels() or self._plan_fills(self._shown)
            plan = plan or self._plan_channels() or self._plan_fills(self._wanted)
        if plan is not None or hurry:
            return plan
        if self._server.refined.active:
            plan = self._plan_refined()
        if plan is None and self._server.settled():
            plan = self._plan_rest()
        if plan is None:
            self._idle_stamp = stamp
        return plan

    def _plan_levels(self) -> FramePlan | None:
        plan = self._base.plan_limit() or self._heights.plan_limit()
        if plan is not None:
            return plan
        for level, wanted in enumerate(self._wanted):
            plan = self._base.plan_level(level, wanted) or self._heights.plan_level(level, wanted)
            if plan is not None:
                return plan
        return None

    def _plan_fills(self, masks: list[Mask]) -> FramePlan | None:
        for level, wanted in enumerate(masks):
            plan = self._plan_fill(level, wanted, None if self._errors is None else self._errors[level])
            if plan is not None:
                return plan
        return None

    def _plan_fill(
        self, level: int, wanted: Mask | np.bool_, errors: NDArray[np.float32] | None = None
    ) -> FramePlan | None:
        """Plans tiles on a base that is held; then base, and the tiles that lie on it next; then tiles that wait for
        their base."""
        if not self._server.base.held:
            return self._heights.plan_fill(level, wanted, errors)
        based = self._base.versions[level] > 0
        return (
            self._heights.plan_fill(level, wanted & based, errors)
            or self._base.plan_fill(level, wanted, errors)
            or self._heights.plan_fill(level, wanted, errors)
        )

    def _plan_refined(self) -> FramePlan | None:
        """Plans a frame above the levels that are solved as a whole."""
        selection = self._selection
        plan, finest = self._refined.plan_levels(selection)
        if not self._server.refined_base.active:
            return plan or self._fill_refined(finest, None)
        under, finest_base = self._refined_base.plan_levels(selection)
        return under or plan or self._fill_refined(finest, finest_base)

    def _fill_refined(self, finest: int, finest_base: int | None) -> FramePlan | None:
        """Fills tiles in up to level ``finest``, and their base up to ``finest_base``."""
        selection = self._selection
        based = None if finest_base is None else self._refined_base.keys()
        for level in range(self._server.levels + 1, finest + 1):
            plan = self._refined.plan_fill(level, selection, based)
            if plan is None and finest_base is not None and level <= finest_base:
                plan = self._refined_base.plan_fill(level, selection)
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
            plan = self._plan_fill(level, np.True_)
            if plan is not None:
                return plan
        return None

    def commit(self, plan: FramePlan) -> None:
        """Says that the frame was handed to the socket: from now on the client counts as holding it."""
        self._idle_stamp = -1
        if plan.channel not in GROUND:
            self._channels[plan.channel].commit(plan)
            return
        whole, refined = self._heights, self._refined
        if plan.channel == Channel.BASE:
            whole, refined = self._base, self._refined_base
        if plan.level <= self._server.levels:
            whole.commit(plan)
        refined.commit(plan)

    def refresh(self) -> None:
        """Selects again when the view moved or the ground changed since the last selection."""
        server = self._server
        now = (server.surface.generation, server.refined.generation)
        if self._view is None or not (self._view_changed or self._selected != now):
            return
        self._select(self._view)
        self._selected = now
        self._view_changed = False
        self._idle_stamp = -1

    def _select(self, view: View) -> None:
        server = self._server
        self._wanted, self._shown, self._errors = select_shown(server.surface.bounds(), view)
        if server.refined.finest == server.levels or server.pyramid.level(server.levels) is None:
            self._selection = Selection.nothing(server.levels, server.refined.finest)
            return
        while True:
            found = select_refined(server.surface, server.refined, self._wanted[-1], view)
            if found.count <= server.refined.client_tiles:
                break
            view = view.model_copy(update={"tau_px": view.tau_px * TAU_STEP})
        self._selection = found
        if restrict_below(found, self._wanted):
            restrict(self._wanted)
