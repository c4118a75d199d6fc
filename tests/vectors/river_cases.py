"""Cases of rivers.json: frames of rivers, what is in them, and frames that are none."""

from __future__ import annotations

import base64
from typing import Any

from esker.contract import FRAME_HEADER
from esker.tiles.codec.frame import write_number
from esker.tiles.codec.rivers import RiverLine, write_rivers

SET = (
    RiverLine(((0, 5), (3, 9), (100, 200)), (130, 141), 1),
    RiverLine(((100, 200), (1024, 1024)), (-3, 150), None),
    RiverLine(((1024, 0), (900, 0), (901, 1), (700, 1000)), (131, 131), None),
)


def river_vectors() -> list[dict[str, Any]]:
    """Frames that are read, and then frames that are refused (``refused``: a part of the sentence)."""
    good = {
        "three rivers": (7, 2, True, SET),
        "none": (0, 4, False, ()),
        "a late clock": (2**32 - 1, 0, False, (RiverLine(((0, 0), (256, 256)), (0, 0), None),)),
    }
    read = []
    for name, (clock, level, settled, rivers) in good.items():
        lines = [{"points": [list(p) for p in r.points], "areas": list(r.areas), "into": r.into} for r in rivers]
        facts = {"clock": clock, "level": level, "settled": settled, "rivers": lines}
        read.append({"name": name, "frame": _text(write_rivers(clock, level, settled, rivers)), **facts})
    return read + [{"name": name, "frame": _text(frame), "refused": why} for name, frame, why in _bad()]


def _bad() -> list[tuple[str, bytes, str]]:
    whole = write_rivers(7, 2, True, SET)
    fields = FRAME_HEADER.fields
    assert fields is not None

    def other(field: str, value: int) -> bytes:
        out = bytearray(whole)
        out[fields[field][1]] = value
        return bytes(out)

    outside = write_rivers(1, 0, False, (RiverLine(((0, 0), (257, 0)), (0, 0), None),))
    before = write_rivers(1, 0, False, (RiverLine(((0, 0), (-1, 0)), (0, 0), None),))
    beyond = write_rivers(1, 0, False, (RiverLine(((0, 0), (1, 0)), (0, 0), 1),))
    point = write_rivers(1, 0, False, (RiverLine(((5, 5),), (0, 0), None),))
    long = bytearray(write_rivers(1, 0, False, ()))
    long[fields["tiles"][1]] = 1
    write_number(long, 1 << 34)
    return [
        ("shorter than its header", whole[:9], "bytes, not 9"),
        ("longer than any", whole + bytes(32 << 10), "bytes, not"),
        ("another protocol", other("protocol", 1), "protocol"),
        ("no magic", other("magic", 0), "no frame of rivers"),
        ("a level that is not solved as a whole", other("level", 7), "has a level"),
        ("a channel", other("channel", 1), "no channel"),
        ("dropped tiles", other("drops", 1), "no dropped tiles"),
        ("more rivers than there are", other("tiles", 4), "ends inside"),
        ("fewer rivers than there are", other("tiles", 1), "runs into river 1 of 1"),
        ("bytes behind the last", whole + b"\x00", "1 bytes follow"),
        ("cut off", whole[:-3], "ends inside"),
        ("a point beyond the border", outside, "leaves the terrain"),
        ("a point before the border", before, "leaves the terrain"),
        ("a river that runs into none", beyond, "runs into river 1 of 1"),
        ("a river that is a point", point, "at least two points"),
        ("a count of points that no frame holds", bytes(long), "ends inside"),
    ]


def _text(frame: bytes) -> str:
    return base64.b64encode(frame).decode()
