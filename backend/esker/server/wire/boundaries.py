"""Finds where the frames of a websocket's stream end, from their headers alone (RFC 6455, section 5.2).

The short way in (``websocket.py``) may take a text only where nothing is left over from what came before. The library
that parses all else does not say where it stands, so the bytes that it is given are counted here too.
"""

from __future__ import annotations

from typing import Final

END_OF_REQUEST: Final = b"\r\n\r\n"
MASK_BYTES: Final = 4
MOST_HEADER_BYTES: Final = 14
"""A header's two bytes, a length of eight and a mask."""
_FINAL, _CONTROL, _MASKED = 0x80, 0x08, 0x80
_TWO_BYTES, _EIGHT_BYTES = 126, 127
"""Codes that stand for a length which follows in two or in eight bytes."""


def measured(header: bytes) -> tuple[int, int] | None:
    """Returns the bytes of a frame's header and of its payload; None while the header is not whole.

    ``header``: the frame's first bytes, any number of them.

    >>> measured(bytes((0x81, 0x82, 0, 0, 0, 0)))
    (6, 2)
    >>> measured(bytes((0x81, 0xFE, 1))) is None
    True
    """
    if len(header) < 2:
        return None
    size, after = header[1] & ~_MASKED, 2
    if size >= _TWO_BYTES:
        after += 2 if size == _TWO_BYTES else 8
        size = int.from_bytes(header[2:after])
    if header[1] & _MASKED:
        after += MASK_BYTES
    return None if len(header) < after else (after, size)


class FrameBoundaries:
    """Follows one peer's bytes: first the request that opens the websocket, then frames.

    What is wrong with a frame is for the library to find. It ends the connection then, and nothing is asked here.
    """

    def __init__(self) -> None:
        self._request = b""
        """The last bytes of a request that has not ended: its end may lie across two pieces."""
        self._is_open = False
        self._header = b""
        self._payload_left = 0
        self._in_message = False

    @property
    def is_between(self) -> bool:
        """Whether the next byte begins a frame, and that frame a message."""
        return self._is_open and not self._payload_left and not self._header and not self._in_message

    def feed(self, data: bytes) -> None:
        """Takes the peer's next bytes."""
        at = 0 if self._is_open else self._after_request(data)
        while at < len(data):
            if self._payload_left:
                passed = min(self._payload_left, len(data) - at)
                self._payload_left -= passed
                at += passed
            else:
                at = self._after_header(data, at)

    def _after_request(self, data: bytes) -> int:
        """Returns where frames begin in ``data``; its length where they do not begin yet."""
        seen = self._request + data
        end = seen.find(END_OF_REQUEST)
        if end < 0:
            self._request = seen[-(len(END_OF_REQUEST) - 1) :]
            return len(data)
        begin = end + len(END_OF_REQUEST) - len(self._request)
        self._is_open, self._request = True, b""
        return begin

    def _after_header(self, data: bytes, at: int) -> int:
        """Returns where the header ends that begins or goes on at ``at``; the length of ``data`` where it does not."""
        known = len(self._header)
        header = self._header + data[at : at + MOST_HEADER_BYTES - known]
        found = measured(header)
        if found is None:
            self._header = header
            return len(data)
        size, self._payload_left = found
        self._header = b""
        if not header[0] & _CONTROL:
            self._in_message = not header[0] & _FINAL
        return at + size - known
