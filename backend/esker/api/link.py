"""Share links as programs see them, and refusals (DESIGN 13)."""

from __future__ import annotations

import re
from typing import Final
from urllib.parse import urlsplit

from esker.errors import EskerError

WANTED: Final = "a link looks like https://host/t/terrain#secret"


class Refused(EskerError):
    """The server refused something; ``code`` is for machines, the message for people."""


class Link:
    """A share link taken apart: where to connect, which terrain, with which secret."""

    def __init__(self, link: str) -> None:
        """Raises ValueError when it is not a link to a terrain."""
        try:
            parts = urlsplit(link)
        except (TypeError, ValueError, AttributeError):
            raise ValueError(WANTED) from None
        if not isinstance(link, str):
            raise ValueError(WANTED)
        match = re.fullmatch(r"/t/([A-Za-z0-9_-]{1,40})", parts.path)
        if parts.scheme not in ("http", "https") or not parts.netloc or match is None or not parts.fragment:
            raise ValueError(WANTED)
        self.terrain, self.secret = match.group(1), parts.fragment
        self.secure = parts.scheme == "https"
        self.url = f"{'wss' if self.secure else 'ws'}://{parts.netloc}/ws"
