"""Owners of client ids (decision 33).

Client ids are chosen by clients and known to everybody in a room. Whoever claims one first is given a token for it, and
comes again only with that: the time of the claim and a hash over it that only this server can make, bound to terrain
and link. Nothing is stored for it, so a link to look writes nothing, and a token is good after a restart.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

FILE_NAME: Final = "clients.key"
KEY_BYTES: Final = 32


def key_in(folder: Path) -> bytes:
    """The key of a data folder, made on first use, readable by the server's user only. Raises OSError."""
    path = folder / FILE_NAME
    try:
        found = path.read_bytes()
        if len(found) == KEY_BYTES:
            return found
        path.unlink()
    except FileNotFoundError:
        pass
    made = secrets.token_bytes(KEY_BYTES)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(made)
    return made


class Claims:
    """Makes and reads the tokens of one server."""

    def __init__(self, key: bytes | None = None, now: Callable[[], float] = time.time) -> None:
        """``key``: None for one that ends with this process."""
        self._key, self._now = key or secrets.token_bytes(KEY_BYTES), now

    def now(self) -> int:
        """The time of a claim that is made now, milliseconds since 1970."""
        return int(self._now() * 1000)

    def token(self, terrain: str, client: str, link: str, since: int) -> str:
        """The token of an id that was claimed at ``since`` by somebody who came in by ``link``."""
        text = f"{terrain}\0{client}\0{link}\0{since}"
        return f"{since:x}.{hmac.new(self._key, text.encode(), hashlib.sha256).hexdigest()}"

    def ticket(self, terrain: str) -> str:
        """A new ticket of a terrain: whoever shows it is one person, whatever their client id and link."""
        return self._ticket(terrain, f"{self.now():x}-{secrets.token_hex(8)}")

    def _ticket(self, terrain: str, who: str) -> str:
        text = f"ticket\0{terrain}\0{who}"
        return f"{who}.{hmac.new(self._key, text.encode(), hashlib.sha256).hexdigest()}"

    def holder(self, ticket: str | None, terrain: str) -> tuple[str, int] | None:
        """Returns the id of the person who has a ticket of this server's, and when it was given; else None."""
        who = (ticket or "").partition(".")[0]
        if ticket is None or not hmac.compare_digest(self._ticket(terrain, who), ticket):
            return None
        since, _, nonce = who.partition("-")
        return f"p{nonce}", int(since, 16)

    def since(self, token: str | None, terrain: str, client: str, link: str) -> int | None:
        """Returns when the id was claimed, if the token is one of this server's for it; else None."""
        try:
            since = int((token or "").partition(".")[0], 16)
        except ValueError:
            return None
        good = hmac.compare_digest(self.token(terrain, client, link, since), token or "")
        return since if good else None
