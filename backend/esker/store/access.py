"""Links, roles and join codes (DESIGN 13). A secret is shown once; the store keeps its SHA-256.

A link knows its parent: the link through which it was made, also by a join code. When a link is revoked so is all that
was made through it, in the same commit, so whoever is sent away leaves no spare key behind.

Secrets are 192 random bits, so a plain hash is enough: there is nothing to guess. Every comparison is constant-time.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import Any, Final, Protocol

from esker.contract import Role
from esker.store.engine.ports import Connection, Database

CODE_SECONDS: Final = 15 * 60
CODE_LIFE_SECONDS: Final = 10 * 3600
"""A code can be prolonged for as long as a day at school takes; then another one must be made."""
JOINED_BY_CODE: Final = "Joined by code"
"""The name of a link that a join code made: it is one device's."""
CODE_LENGTH: Final = 6
CODES_TO_GUESS: Final = 10**8
"""There are so many codes for each that lives: codes are longer when many do."""
CODE_ALPHABET: Final = "ABCDEFGHJKMNPQRSTUVWXYZ23456789"
"""No 0/O, 1/I/L: codes are read from a wall and typed by hand."""
MAX_LINKS: Final = 2_000
"""Live links per terrain. Links made by join codes count too."""
KEPT_REVOKED: Final = 2_000
"""Revoked links per terrain that are remembered; of more the oldest are forgotten, and open nothing either."""
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
    parent: str | None = None
    digest: bytes = field(default=b"", repr=False)
    """Hash of the secret by which it was opened; another one after it was renewed."""


@dataclass(frozen=True)
class JoinCode:
    """What a join code opens. ``link``: the id of the link by which it was made."""

    terrain: str
    role: Role
    link: str
    seconds: float = field(default=0.0, compare=False)
    """For how long it still opens that."""


@dataclass(frozen=True)
class _Code:
    terrain: str
    role: Role
    link: str
    expires: float
    until: float
    """Time at which the code ends, however often it is prolonged."""


class SecretTaken(Exception):
    """Another link has this secret already."""


class Ended(Exception):
    """The link by which something was asked is revoked or renewed. Nothing was done."""


class OwnLink(Exception):
    """The link by which somebody asks would end with the one that they want to revoke."""


class TooManyLinks(Exception):
    """The terrain has as many live links as it may have."""


def hashed(secret: str) -> bytes:
    """SHA-256 of a secret, 32 bytes."""
    return hashlib.sha256(secret.encode()).digest()


class Codes(Protocol):
    """Where codes are kept. ``is_slow``: a call may wait for a database, so it is made in a thread."""

    is_slow: bool

    def make(self, terrain: str, role: Role, link: str, seconds: float = CODE_SECONDS) -> str:
        """Makes a code. ``seconds``: for how long it lives. Raises store.engine.ports.Unwritable, Moved."""

    def prolong(self, terrain: str, code: str, link: str) -> float | None:
        """Lets a code live longer; returns for how many seconds, None where there is none of this link."""

    def open(self, code: str) -> JoinCode | None:
        """Returns what a code opens."""

    def drop(self, link: str) -> None:
        """Ends the codes of a link."""


class OwnCodes:
    """Codes in the memory of this process."""

    is_slow = False

    def __init__(self, ticks: Callable[[], float] = time.monotonic) -> None:
        """``ticks``: seconds that only ever go on, by which codes end."""
        self._ticks = ticks
        self._codes: dict[bytes, _Code] = {}

    def make(self, terrain: str, role: Role, link: str, seconds: float = CODE_SECONDS) -> str:
        self._forget_old()
        length = code_length(len(self._codes) + 1)
        own = [digest for digest, code in self._codes.items() if code.link == link]
        for digest in own[: max(0, len(own) + 1 - MAX_CODES)]:
            del self._codes[digest]
        while True:
            code = drawn(length)
            if hashed(code) not in self._codes:
                now = self._ticks()
                self._codes[hashed(code)] = _Code(terrain, role, link, now + seconds, now + CODE_LIFE_SECONDS)
                return code

    def prolong(self, terrain: str, code: str, link: str) -> float | None:
        self._forget_old()
        digest = hashed(code)
        found = self._codes.get(digest)
        if found is None or (found.terrain, found.link) != (terrain, link):
            return None
        now = self._ticks()
        expires = max(found.expires, min(now + CODE_SECONDS, found.until))
        self._codes[digest] = longer = replace(found, expires=expires)
        return longer.expires - now

    def open(self, code: str) -> JoinCode | None:
        self._forget_old()
        found = self._codes.get(hashed(code))
        if found is None:
            return None
        return JoinCode(found.terrain, found.role, found.link, found.expires - self._ticks())

    def drop(self, link: str) -> None:
        self._codes = {k: v for k, v in self._codes.items() if v.link != link}

    def _forget_old(self) -> None:
        now = self._ticks()
        self._codes = {k: v for k, v in self._codes.items() if v.expires > now}


class Access:
    """Links in the journal's database, and join codes, which live for fifteen minutes."""

    def __init__(
        self,
        journal: Database,
        now: Callable[[], float] = time.time,
        ticks: Callable[[], float] = time.monotonic,
        codes: Codes | None = None,
    ) -> None:
        """``now``: the date, which may be set; ``ticks``: seconds that only ever go on, by which codes end; ``codes``:
        where codes are kept (default: in memory)."""
        self._journal, self._now = journal, now
        self.codes = OwnCodes(ticks) if codes is None else codes

    def check(self, terrain: str, secret: str) -> Link | None:
        """The link of this terrain that has this secret (see ``revoked``), or None."""
        found = self.opening(terrain, secret)
        return None if found is None else found[0]

    def opening(self, terrain: str, secret: str) -> tuple[Link, float | None] | None:
        """The link of this terrain that has this secret, and when the terrain was deleted (None: it was not), by one
        question: each gives the interpreter's lock away several times, and whoever asks waits for it in a busy server.
        """
        digest = hashed(secret)
        for row in self._journal.reader().execute(f"SELECT {_COLUMNS},{_DELETED} FROM links WHERE hash=?", (digest,)):
            link = _link(row)
            same = hmac.compare_digest(link.digest, digest)
            if same and link.terrain == terrain:  # an id is no secret, and may be any text here
                return link, None if row[8] is None else float(row[8])
        return None

    def alive(self, link: Link) -> bool:
        """Returns whether a link that was opened before is neither revoked nor renewed since."""
        return _alive(self._journal.reader(), link)

    def opens(self, link: Link) -> bool:
        """Returns whether a link that was opened before still opens its terrain: it lives, and the terrain was not
        deleted. One question, as in ``opening``."""
        row = (
            self._journal.reader()
            .execute(f"SELECT hash,{_DELETED} FROM links WHERE id=? AND revoked IS NULL", (link.id,))
            .fetchone()
        )
        return row is not None and row[1] is None and hmac.compare_digest(bytes(row[0]), link.digest)

    def links(self, terrain: str) -> list[Link]:
        """All links of a terrain, oldest first, revoked ones too."""
        rows = self._journal.reader().execute(
            f"SELECT {_COLUMNS} FROM links WHERE terrain=? ORDER BY created, id", (terrain,)
        )
        return [_link(row) for row in rows]

    def called(self, terrain: str, role: Role, name: str) -> list[Link]:
        """The living links of a terrain that have this role and name."""
        sql = f"SELECT {_COLUMNS} FROM links WHERE terrain=? AND role=? AND name=? AND revoked IS NULL"
        return [_link(row) for row in self._journal.reader().execute(sql, (terrain, role, name))]

    def elsewhere(self, terrain: str, links: Collection[str]) -> dict[str, str]:
        """Returns the terrains of those links, by id, that are not of ``terrain``."""
        db = self._journal.reader()
        found = ((each, db.execute("SELECT terrain FROM links WHERE id=?", (each,)).fetchone()) for each in links)
        return {each: str(row[0]) for each, row in found if row is not None and row[0] != terrain}

    def add(self, terrain: str, role: Role, name: str, by: Link | str | None = None) -> Future[tuple[Link, str]]:
        """A new link and its secret. ``by``: the link through which it is made, or its id where a join code stands for
        it. Fails with TooManyLinks, Ended, Unwritable."""
        link, secret, insert = self.make(terrain, role, name, by.id if isinstance(by, Link) else by)

        def write(db: Connection) -> tuple[Link, str]:
            _demand(db, by)
            live = db.execute("SELECT count(*) FROM links WHERE terrain=? AND revoked IS NULL", (terrain,)).fetchone()
            if live[0] >= MAX_LINKS:
                raise TooManyLinks
            insert(db)
            db.execute(_FORGET, (terrain, terrain, KEPT_REVOKED))
            return link, secret

        return self._journal.submit(write, terrain)

    def make(
        self, terrain: str, role: Role, name: str, parent: str | None = None, secret: str | None = None
    ) -> tuple[Link, str, Callable[[Connection], object]]:
        """A link that is not written yet, its secret (default: a new one), and what writes it; a terrain's first comes
        with its birth."""
        secret = secret or secrets.token_urlsafe(24)
        link = Link(secrets.token_urlsafe(9), terrain, role, name, self._now(), None, parent, hashed(secret))
        row = (link.id, terrain, role, name, link.digest, link.created, parent)
        insert = "INSERT INTO links (id,terrain,role,name,hash,created,parent) VALUES (?,?,?,?,?,?,?)"
        return link, secret, lambda db: db.execute(insert, row)

    def rotate(
        self, terrain: str, link_id: str, by: Link | None = None, secret: str | None = None
    ) -> Future[tuple[str, list[str]] | None]:
        """A new secret for a live link, and the ids of the links that ended; None when there is no such link.

        The old secret stops working. What was made through a link to draw ends too: whoever had the old secret may have
        made it. What was made through an owner's link stays: it stands in the owners' list.
        ``secret``: made by whoever asks, who then has it even if the answer is lost. Fails with Ended, SecretTaken.
        """
        secret = secret or secrets.token_urlsafe(24)

        def write(db: Connection) -> tuple[str, list[str]] | None:
            _demand(db, by)
            found = db.execute(
                "SELECT role FROM links WHERE id=? AND terrain=? AND revoked IS NULL", (link_id, terrain)
            ).fetchone()
            if found is None:
                return None
            try:
                # Some databases say only then that a key is used twice when they are asked what came of it.
                _ = db.execute("UPDATE links SET hash=? WHERE id=?", (hashed(secret), link_id)).rowcount
            except db.IntegrityError:
                raise SecretTaken from None
            return secret, [] if found[0] == "owner" else self._end(db, _tree(db, link_id)[1:])

        return self._journal.submit(write, terrain)

    def revoke(self, terrain: str, link_id: str, by: Link | None = None) -> Future[list[str]]:
        """Ends a link and all that was made through it; returns the ids of those that ended, none when there is no such
        live link. Fails with Ended, and with OwnLink where the link of who asks would be among them."""

        def write(db: Connection) -> list[str]:
            _demand(db, by)
            if db.execute("SELECT 1 FROM links WHERE id=? AND terrain=?", (link_id, terrain)).fetchone() is None:
                return []
            tree = _tree(db, link_id)
            if by is not None and by.id in tree:
                raise OwnLink
            return self._end(db, tree)

        return self._journal.submit(write, terrain)

    def _end(self, db: Connection, ids: list[str]) -> list[str]:
        """Revokes these; returns those that were alive."""
        now = self._now()
        return [
            each
            for each in ids
            if db.execute("UPDATE links SET revoked=? WHERE id=? AND revoked IS NULL", (now, each)).rowcount
        ]

    def make_code(self, terrain: str, role: Role, link: str, seconds: float = CODE_SECONDS) -> str:
        """A join code that opens the terrain in this role for fifteen minutes, as often as it is typed.

        ``link``: the id of the link by which it is made; when that ends, so do its codes. ``seconds``: for how long
        else it lives.
        """
        return self.codes.make(terrain, role, link, seconds)

    def prolong_code(self, terrain: str, code: str, link: str) -> float | None:
        """The code lives for another fifteen minutes from now; returns for how many seconds it does live.

        Only the link by which it was made can prolong it. None: there is no such code any more.
        """
        return self.codes.prolong(terrain, _typed(code), link)

    def open_code(self, code: str) -> JoinCode | None:
        """Returns what a code opens, or None when it is wrong or too old. Case and spaces do not matter."""
        return self.codes.open(_typed(code))

    def drop_codes(self, link: str) -> None:
        """Ends every join code that was made by this link."""
        self.codes.drop(link)


def drawn(length: int) -> str:
    """A code of so many characters."""
    return "".join(secrets.choice(CODE_ALPHABET) for _ in range(length))


def code_length(live: int) -> int:
    """Characters of a new code when so many live."""
    length = CODE_LENGTH
    while len(CODE_ALPHABET) ** length < live * CODES_TO_GUESS:
        length += 1
    return length


def _typed(code: str) -> str:
    """A code as it was made, from what somebody typed."""
    return code.strip().upper().replace(" ", "").replace("-", "")


_FORGET: Final = (
    "DELETE FROM links WHERE terrain=? AND id IN (SELECT id FROM links WHERE terrain=? AND revoked IS NOT NULL"
    " ORDER BY revoked DESC, created DESC LIMIT 9223372036854775807 OFFSET ?)"
)
"""A link that was revoked has no living children: they ended in the same commit."""
_COLUMNS: Final = "id,terrain,role,name,created,revoked,parent,hash"
_DELETED: Final = "(SELECT deleted FROM terrains WHERE terrains.id=links.terrain)"


def _link(row: Sequence[Any]) -> Link:
    return Link(*(*row[:7], bytes(row[7])))


def _alive(db: Connection, link: Link) -> bool:
    row = db.execute("SELECT hash FROM links WHERE id=? AND revoked IS NULL", (link.id,)).fetchone()
    return row is not None and hmac.compare_digest(bytes(row[0]), link.digest)


def _demand(db: Connection, by: Link | str | None) -> None:
    """Raises Ended unless the link by which something is asked lives, in the very commit that does it."""
    if isinstance(by, Link):
        if not _alive(db, by):
            raise Ended
    elif by is not None and not db.execute("SELECT 1 FROM links WHERE id=? AND revoked IS NULL", (by,)).fetchone():
        raise Ended


def _tree(db: Connection, link_id: str) -> list[str]:
    """A link and all that was made through it, the link itself first."""
    rows = db.execute(
        "WITH RECURSIVE tree(id) AS (VALUES(?) UNION SELECT links.id FROM links JOIN tree ON links.parent = tree.id)"
        " SELECT id FROM tree",
        (link_id,),
    )
    found = [str(row[0]) for row in rows]
    return [link_id, *(each for each in found if each != link_id)]
