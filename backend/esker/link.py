"""Share links as programs see them, and refusals (DESIGN 13)."""

from __future__ import annotations

import re
from urllib.parse import urlsplit


class Refused(Exception):
    """The server refused something; ``code`` is for machines, the message for people."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


class Link:
    """A share link taken apart: where to connect, which terrain, with which secret."""

    def __init__(self, link: str) -> None:
        """Raises ValueError when it is not a link to a terrain."""
        parts = urlsplit(link)
        match = re.fullmatch(r"/t/([A-Za-z0-9_-]{1,40})", parts.path)
        if parts.scheme not in ("http", "https") or not parts.netloc or match is None or not parts.fragment:
            raise ValueError("a link looks like https://host/t/terrain#secret")
        self.terrain, self.secret = match.group(1), parts.fragment
        self.secure = parts.scheme == "https"
        self.url = f"{'wss' if self.secure else 'ws'}://{parts.netloc}/ws"
