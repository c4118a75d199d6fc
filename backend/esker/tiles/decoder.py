"""Python twin of the page's ``net/decode.ts``: keeps the exact samples that a client holds (DESIGN 6, 8).

Each channel is a stream of its own: tiles of one never predict tiles of another, and a drop names tiles of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from esker.contract import Channel, Filter, FrameKind, Predictor
from esker.grid import TileKey
from esker.tiles.codec.filters import undo
from esker.tiles.codec.frame import FrameError, FrameHead, TileRecord, ratio, read_frame
from esker.tiles.codec.payload import CodecError, Ints, Wide, child_window, follow, predict, reconstruct, unpack
from esker.tiles.codec.rivers import is_rivers, read_rivers


@dataclass(frozen=True)
class HeldTile:
    """A tile as the server last sent it: 65x65 int32 quanta of its level, read-only.

    ``parent_then``: the parent's samples when the tile was last sent or confirmed by a LEVEL frame; None at level 0.
    """

    version: int
    samples: Ints
    parent_then: Ints | None


@dataclass(frozen=True)
class DecodedFrame:
    """One frame, decoded. ``drops`` are the tiles named by the frame, without their descendants."""

    kind: FrameKind
    level: int
    clock: int
    settled: bool
    drops: tuple[TileKey, ...]
    tiles: dict[TileKey, HeldTile]
    bytes: int
    channel: Channel = Channel.HEIGHT


class FrameDecoder:
    """Applies frames in order. ``channels`` is what the client holds after the last accepted frame."""

    def __init__(self) -> None:
        self.channels: dict[Channel, dict[TileKey, HeldTile]] = {channel: {} for channel in Channel}

    @property
    def held(self) -> dict[TileKey, HeldTile]:
        """The tiles of the heights."""
        return self.channels[Channel.HEIGHT]

    def reset(self) -> None:
        """Forgets everything, as after a reconnect."""
        for held in self.channels.values():
            held.clear()

    def decode(self, data: bytes | memoryview) -> DecodedFrame:
        """Decodes and applies one frame. Raises FrameError, and then changes nothing that is held."""
        if is_rivers(data):  # they are no tiles; ``codec.rivers`` reads them
            found = read_rivers(data)
            return DecodedFrame(FrameKind.RIVERS, found.level, found.clock, found.settled, (), {}, len(data))
        head, gone, records = read_frame(data)
        drops = tuple(TileKey(head.level, x, y) for x, y in gone)
        dropped = set(drops)
        held = self.channels[head.channel]
        tiles: dict[TileKey, HeldTile] = {}
        for record in records:
            key = TileKey(head.level, record.x, record.y)
            if key in dropped:
                raise FrameError(f"tile {tuple(key)} is both sent and dropped")
            try:
                tiles[key] = HeldTile(record.version, _samples(held, head, key, record), _parent(held, key))
            except CodecError as e:
                raise FrameError(f"tile {tuple(key)}: {e}") from e
        if dropped:
            held = self.channels[head.channel] = {k: v for k, v in held.items() if not _under(k, dropped, head.level)}
        held.update(tiles)
        if head.kind == FrameKind.LEVEL:
            for key, tile in held.items():
                if key.level == head.level:
                    held[key] = replace(tile, parent_then=_parent(held, key))
        return DecodedFrame(head.kind, head.level, head.clock, head.settled, drops, tiles, len(data), head.channel)


Held = dict[TileKey, HeldTile]


def _parent(held: Held, key: TileKey) -> Ints | None:
    found = held.get(key.parent()) if key.level else None
    return None if found is None else found.samples


def _samples(held: Held, head: FrameHead, key: TileKey, record: TileRecord) -> Ints:
    residual = undo(record.filter, unpack(record.shift, record.payload, record.filter == Filter.LATTICE))
    if record.predictor == Predictor.ZERO:
        samples = reconstruct(None, residual)
    elif record.predictor in (Predictor.PREVIOUS, Predictor.HELD):
        samples = reconstruct(_previous(held, head, key, record), residual)
    else:
        parent = held.get(key.parent()) if head.level > 0 else None
        if parent is None:
            raise FrameError(f"tile {tuple(key)} is predicted from a parent that is not held")
        if parent.version != record.base_version:
            raise FrameError(
                f"tile {tuple(key)} is predicted from version {record.base_version} of its parent, "
                f"not from version {parent.version}"
            )
        samples = reconstruct(child_window(predict(parent.samples, ratio(head.channel)), key.x, key.y), residual)
    samples.flags.writeable = False
    return samples


def _previous(held: Held, head: FrameHead, key: TileKey, record: TileRecord) -> Wide:
    own = held.get(key)
    if own is None:
        raise FrameError(f"tile {tuple(key)} is predicted from itself but not held")
    if own.version != record.base_version:
        raise FrameError(
            f"tile {tuple(key)} is predicted from its version {record.base_version}, not from {own.version}"
        )
    if record.predictor == Predictor.HELD:
        return own.samples
    return follow(own.samples, own.parent_then, _parent(held, key), key.x, key.y, ratio(head.channel))


def _under(key: TileKey, dropped: set[TileKey], level: int) -> bool:
    """Returns True for a dropped tile and for its descendants."""
    shift = key.level - level
    return shift >= 0 and TileKey(level, key.x >> shift, key.y >> shift) in dropped
