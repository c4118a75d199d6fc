"""Links, roles and join codes (DESIGN 13). A secret is shown once; the store keeps its SHA-256.

Secrets are 192 random bits, so a plain hash is enough: there is nothing to guess. Every comparison is constant-time.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import sqlite3
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Final

from esker.contract import Role
from esker.store.journal import Journal

CODE_SECONDS: Final = 15 * 60
CODE_LENGTH: Final = 6
CODE_ALPHABET: Final = "ABCDEFGHJKMNPQRSTUVWXYZ23456789"
"""No 0/O, 1/I/L: codes are read from a wall and typed by hand."""
MAX_LINKS: Final = 2_000
"""Live links per terrain. Links made by join codes count too."""
MAX_CODES: Final = 16
"""Live join codes that one link may have made; with one more its oldest ends."""


@dataclass(frozen=True)
class Link:
    """One link of a terrain, without its secret. Times are seconds since 1970; ``revoked`` None means alive."""

    id: str
    terrain: str
    role: Role
    name: str
    created: float
    revoked: float | None


@dataclass(frozen=True)
class _Code:
    terrain: str
    role: Role
    link: str
    expires: float


class TooManyLinks(Exception):
    """The terrain has as many live links as it may have."""


def hashed(secret: str) -> bytes:
    """SHA-256 of a secret, 32 bytes."""
    return hashlib.sha256(secret.encode()).digest()


class Access:
    """Links in the journal's database, join codes in memory (they live for fifteen minutes)."""

    def __init__(
        self,
        journal: Journal,
        now: Callable[[], float] = time.time,
        ticks: Callable[[], float] = time.monotonic,
    ) -> None:
        """``now``: the date, which may be set; ``ticks``: seconds that only ever go on, by which codes end."""
        self._journal, self._now, self._ticks = journal, now, ticks
        self._codes: dict[bytes, _Code] = {}

    def check(self, terrain: str, secret: str) -> Link | None:
        """The link of this terrain that has this secret (see ``revoked``), or None."""
        digest = hashed(secret)
        rows = self._journal.reader().execute(
            "SELECT id,terrain,role,name,created,revoked,hash FROM links WHERE hash=?", (digest,)
        )
        for row in rows:
            same = hmac.compare_digest(bytes(row[6]), digest)
            link = Link(*row[:6])
            if same and link.terrain == terrain:  # an id is no secret, and may be any text here
                return link
        return None

    def links(self, terrain: str) -> list[Link]:
        """All links of a terrain, oldest first, revoked ones too."""
        rows = self._journal.reader().execute(
            "SELECT id,terrain,role,name,created,revoked FROM links WHERE terrain=? ORDER BY created, id", (terrain,)
        )
        return [Link(*row) for row in rows]

    def add(self, terrain: str, role: Role, name: str) -> Future[tuple[Link, str]]:
        """A new link and its secret. Fails with TooManyLinks, Unwritable."""
        link, secret, insert = self.make(terrain, role, name)

        def write(db: sqlite3.Connection) -> tuple[Link, str]:
            live = db.execute("SELECT count(*) FROM links WHERE terrain=? AND revoked IS NULL", (terrain,)).fetchone()
            if live[0] >= MAX_LINKS:
                raise TooManyLinks
            insert(db)
            return link, secret

        return self._journal.submit(write)

    def make(self, terrain: str, role: Role, name: str) -> tuple[Link, str, Callable[[sqlite3.Connection], object]]:
        """A link that is not written yet, its secret, and what writes it; a terrain's first comes with its birth."""
        secret = secrets.token_urlsafe(24)
        link = Link(secrets.token_urlsafe(9), terrain, role, name, self._now(), None)
        row = (link.id, terrain, role, name, hashed(secret), link.created)
        return link, secret, lambda db: db.execute("INSERT INTO links VALUES (?,?,?,?,?,?,NULL)", row)

    def rotate(self, terrain: str, link_id: str) -> Future[str | None]:
        """A new secret for a live link; the old one stops working. None when there is no such link."""
        secret = secrets.token_urlsafe(24)

        def write(db: sqlite3.Connection) -> str | None:
            changed = db.execute(
                "UPDATE links SET hash=? WHERE id=? AND terrain=? AND revoked IS NULL",
                (hashed(secret), link_id, terrain),
            )
            return secret if changed.rowcount else None

        return self._journal.submit(write)

    def revoke(self, terrain: str, link_id: str) -> Future[bool]:
        """Ends a link. False when there is no such live link."""

        def write(db: sqlite3.Connection) -> bool:
            changed = db.execute(
                "UPDATE links SET revoked=? WHERE id=? AND terrain=? AND revoked IS NULL",
                (self._now(), link_id, terrain),
            )
            return changed.rowcount > 0

        return self._journal.submit(write)

    def make_code(self, terrain: str, role: Role, link: str) -> str:
        """A join code that opens the terrain in this role for fifteen minutes, as often as it is typed.

        ``link``: the id of the link by which it is made; when that ends, so do its codes.
        """
        self._forget_old()
        own = [digest for digest, code in self._codes.items() if code.link == link]
        for digest in own[: max(0, len(own) + 1 - MAX_CODES)]:
            del self._codes[digest]
        while True:
            code = "".join(secrets.choice(CODE_ALPHABET) for _ in range(CODE_LENGTH))
            if hashed(code) not in self._codes:
                self._codes[hashed(code)] = _Code(terrain, role, link, self._ticks() + CODE_SECONDS)
                return code

    def open_code(self, code: str) -> tuple[str, Role] | None:
        """Terrain and role behind a code, or None when it is wrong or too old. Case and spaces do not matter."""
        self._forget_old()
        found = self._codes.get(hashed(code.strip().upper().replace(" ", "").replace("-", "")))
        return None if found is None else (found.terrain, found.role)

    def drop_codes(self, link: str) -> None:
        """Ends every join code that was made by this link."""
        self._codes = {k: v for k, v in self._codes.items() if v.link != link}

    def _forget_old(self) -> None:
        now = self._ticks()
        self._codes = {k: v for k, v in self._codes.items() if v.expires > now}
