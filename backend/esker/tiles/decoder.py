"""Python twin of the page's ``net/decode.ts``: keeps the exact samples that a client holds (DESIGN 6, 8)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from esker.contract import FrameKind, Predictor
from esker.grid import TileKey
from esker.tiles.codec import CodecError, Ints, Wide, child_window, follow, predict, reconstruct, unpack
from esker.tiles.frame import FrameError, FrameHead, TileRecord, read_frame


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


class FrameDecoder:
    """Applies frames in order. ``held`` is what the client holds after the last accepted frame."""

    def __init__(self) -> None:
        self.held: dict[TileKey, HeldTile] = {}

    def reset(self) -> None:
        """Forgets everything, as after a reconnect."""
        self.held.clear()

    def decode(self, data: bytes | memoryview) -> DecodedFrame:
        """Decodes and applies one frame. Raises FrameError, and then changes nothing that is held."""
        head, gone, records = read_frame(data)
        drops = tuple(TileKey(head.level, x, y) for x, y in gone)
        dropped = set(drops)
        tiles: dict[TileKey, HeldTile] = {}
        for record in records:
            key = TileKey(head.level, record.x, record.y)
            if key in dropped:
                raise FrameError(f"tile {tuple(key)} is both sent and dropped")
            try:
                tiles[key] = HeldTile(record.version, self._samples(head, key, record), self._parent(key))
            except CodecError as e:
                raise FrameError(f"tile {tuple(key)}: {e}") from e
        if dropped:
            self.held = {k: v for k, v in self.held.items() if not _under(k, dropped, head.level)}
        self.held.update(tiles)
        if head.kind == FrameKind.LEVEL:
            for key, tile in self.held.items():
                if key.level == head.level:
                    self.held[key] = replace(tile, parent_then=self._parent(key))
        return DecodedFrame(head.kind, head.level, head.clock, head.settled, drops, tiles, len(data))

    def _parent(self, key: TileKey) -> Ints | None:
        found = self.held.get(key.parent()) if key.level else None
        return None if found is None else found.samples

    def _samples(self, head: FrameHead, key: TileKey, record: TileRecord) -> Ints:
        residual = unpack(record.planes, record.payload)
        if record.predictor == Predictor.ZERO:
            samples = reconstruct(None, residual)
        elif record.predictor == Predictor.PREVIOUS:
            samples = reconstruct(self._previous(key, record), residual)
        else:
            parent = self.held.get(key.parent()) if head.level > 0 else None
            if parent is None:
                raise FrameError(f"tile {tuple(key)} is predicted from a parent that is not held")
            if parent.version != record.base_version:
                raise FrameError(
                    f"tile {tuple(key)} is predicted from version {record.base_version} of its parent, "
                    f"not from version {parent.version}"
                )
            samples = reconstruct(child_window(predict(parent.samples), key.x, key.y), residual)
        samples.flags.writeable = False
        return samples

    def _previous(self, key: TileKey, record: TileRecord) -> Wide:
        held = self.held.get(key)
        if held is None:
            raise FrameError(f"tile {tuple(key)} is predicted from itself but not held")
        if held.version != record.base_version:
            raise FrameError(
                f"tile {tuple(key)} is predicted from its version {record.base_version}, not from {held.version}"
            )
        return follow(held.samples, held.parent_then, self._parent(key), key.x, key.y)


def _under(key: TileKey, dropped: set[TileKey], level: int) -> bool:
    """True for a dropped tile and for its descendants."""
    shift = key.level - level
    return shift >= 0 and TileKey(level, key.x >> shift, key.y >> shift) in dropped
