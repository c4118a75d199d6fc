"""The ground of a live terrain as the server streams it, for Python (DESIGN 5.4, 5.6, 6): ``LiveTerrain.ground``."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker import grid
from esker.api import arguments
from esker.contract import Channel, Vec3
from esker.document.sync import SyncDoc
from esker.grid import TileKey
from esker.tiles.channels import values
from esker.tiles.codec.frame import GROUND
from esker.tiles.codec.payload import SAMPLE_LIMIT, Wide, child_window, predict
from esker.tiles.decoder import FrameDecoder

Heights = NDArray[np.float32]


class StreamedGround:
    """The tiles that the server has sent and not taken back. All public methods may be called from any thread.

    Heights, their base and amplitude in metres, roughness 0..1, survey in levels, paint of the other channels -1..1;
    float32, [row, col], row 0 south. Heights are those of the ground as it is drawn: offsets by strokes plus the base.
    All are those of the newest frames, a preview while somebody draws; ``wait`` returns when they are final.
    """

    def __init__(
        self, sync: SyncDoc, changed: threading.Condition, wake: Callable[[], None], check: Callable[[], None]
    ) -> None:
        """``changed`` guards ``sync``; ``wake`` has ``unsent`` asked for; ``check`` raises when the link has failed."""
        self._sync, self._changed, self._wake, self._check = sync, changed, wake, check
        self._decoder = FrameDecoder()
        self._view: c.View | None = None
        self._view_sent = True
        self._progress: c.Progress | None = None

    def look(self, eye: Vec3, target: Vec3, **view: Any) -> None:
        """Says where the server is to send detail: a camera. Other fields as in ``contract.View``.

        Raises ValueError.
        """
        place = {name: arguments.numbers(name, at, 3) for name, at in (("eye", eye), ("target", target))}
        wanted = arguments.model(c.View, {**place, **view})
        with self._changed:
            self._view, self._view_sent = wanted, False
        self._wake()

    def wait(self, timeout: float = 30.0, quiet: float = 0.5) -> int:
        """Returns the clock once the ground is final for the confirmed document and nothing came for ``quiet`` seconds.

        Raises TimeoutError, and client.Refused when the server does not let us in any more.
        """
        timeout, quiet = arguments.wait("timeout", timeout), arguments.wait("quiet", quiet)
        end = time.monotonic() + timeout
        with self._changed:
            while True:
                self._check()
                if not self._changed.wait(quiet) and self._at_rest():
                    return self._sync.confirmed.clock
                if time.monotonic() > end:
                    raise TimeoutError("the ground has not come to rest")

    def tiles(self, channel: Channel = Channel.HEIGHT) -> frozenset[TileKey]:
        """The tiles that are here. Those of ``Channel.BASE``: none while there is no elevation layer.

        Raises ValueError for what is no channel.
        """
        channel = _channel(channel)
        with self._changed:
            return frozenset(self._decoder.channels[channel])

    def tile(self, level: int, x: int, y: int, channel: Channel = Channel.HEIGHT) -> Heights:
        """One tile, (65, 65); of ``Channel.BASE`` the ground of the elevation layers alone.

        Raises KeyError when it is not here, ValueError for what is no tile.
        """
        channel, level = _channel(channel), _level(level)
        last = (1 << level) - 1
        key = TileKey(level, arguments.whole("x", x, 0, last), arguments.whole("y", y, 0, last))
        with self._changed:
            return self._tile(key, channel)

    def heights(self, level: int) -> Heights:
        """A whole level, (N_l, N_l). Raises KeyError naming a tile that is not here."""
        return self._whole(_level(level), Channel.HEIGHT)

    def amplitude(self, level: int) -> Heights:
        """Noise amplitude, metres. See ``channel``."""
        return self.channel("amplitude", level)

    def roughness(self, level: int) -> Heights:
        """Roughness, 0..1. See ``channel``."""
        return self.channel("roughness", level)

    def channel(self, name: c.PaintChannel, level: int) -> Heights:
        """A channel that strokes and paint speak of, a whole level, (N_l, N_l): up to two below the finest solved.

        Its base everywhere while nobody has asked anything of it. Raises KeyError naming a tile that is not here.
        """
        if name not in get_args(c.PaintChannel):
            raise ValueError(f"name must be one of {', '.join(get_args(c.PaintChannel))}, not {arguments.shown(name)}")
        channel, level = Channel[name.upper()], _level(level)
        with self._changed:
            if not self._decoder.channels[channel]:
                n = grid.samples(level)
                return values(np.zeros((n, n), dtype=np.int32), channel)
        return self._whole(level, channel)

    def _at_rest(self) -> bool:
        found = self._progress
        if found is None or not self._view_sent:
            return False
        return found.settled and found.refining == 0 and found.clock >= self._sync.confirmed.clock

    def _tile(self, key: TileKey, channel: Channel) -> Heights:
        held = self._decoder.channels[channel].get(key)
        if held is None:
            raise KeyError(f"tile {tuple(key)} is not here")
        if channel not in GROUND:
            return values(held.samples, channel)
        samples = held.samples
        if channel == Channel.HEIGHT and self._decoder.channels[Channel.BASE]:
            samples = samples + self._base(key)
        q = np.float64(grid.quantum(key.level, self._sync.confirmed.settings.size_m))
        return np.asarray(samples * q, dtype=np.float32)

    def _base(self, key: TileKey) -> Wide:
        """Base of a tile, quanta; while it has not come, as the tiles above predict it."""
        held = self._decoder.channels[Channel.BASE].get(key)
        if held is not None:
            return held.samples
        if key.level == 0:
            return np.zeros((c.TILE_SAMPLES, c.TILE_SAMPLES), dtype=np.int32)
        above = np.clip(self._base(key.parent()), -SAMPLE_LIMIT, SAMPLE_LIMIT).astype(np.int32)
        return child_window(predict(above), key.x, key.y)

    def _whole(self, level: int, channel: Channel) -> Heights:
        n = grid.samples(level)
        out = np.empty((n, n), dtype=np.float32)
        with self._changed:
            for key in grid.tiles(level):
                r, col = c.TILE_CELLS * key.y, c.TILE_CELLS * key.x
                out[r : r + c.TILE_SAMPLES, col : col + c.TILE_SAMPLES] = self._tile(key, channel)
        return out

    # --- for the connection, which holds ``changed`` ---------------------------------------------------------------

    def connected(self) -> None:
        """A connection begins anew: the server counts nothing as held and knows no view."""
        self._decoder.reset()
        self._progress, self._view_sent = None, self._view is None

    def applied(self, frame: bytes) -> c.Credit:
        """Applies a binary frame; what to answer. Raises tiles.frame.FrameError."""
        self._decoder.decode(frame)
        self._changed.notify_all()
        return c.Credit(bytes=len(frame))

    def progressed(self, progress: c.Progress) -> None:
        """Takes note of where the solver stands."""
        self._progress = progress

    def unsent(self) -> c.View | None:
        """The view, if the server has not been told of it; from now on it counts as told."""
        if self._view_sent:
            return None
        self._view_sent = True
        self._changed.notify_all()
        return self._view


def _level(level: int) -> int:
    return arguments.whole("level", level, 0, c.MAX_REFINED_LEVEL)


def _channel(channel: Channel) -> Channel:
    if not isinstance(channel, Channel):
        raise ValueError(f"channel must be one of esker.contract.Channel, not {arguments.shown(channel)}")
    return channel
