"""Join codes in the database of several servers: a code that was made on one opens on another."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future

from esker.contract import Role
from esker.store.access import (
    CODE_LIFE_SECONDS,
    CODE_SECONDS,
    MAX_CODES,
    JoinCode,
    code_length,
    drawn,
    hashed,
)
from esker.store.engine.ports import Connection, Database

log = logging.getLogger("esker.cluster")


class StoredCodes:
    """Codes in the database of several servers: their hashes, and until when by the date that all have together."""

    is_slow = True

    def __init__(self, journal: Database, now: Callable[[], float]) -> None:
        """``now``: the date of the database."""
        self._journal, self._now = journal, now

    def make(self, terrain: str, role: Role, link: str, seconds: float = CODE_SECONDS) -> str:
        def write(db: Connection) -> str:
            now = self._now()
            db.execute("DELETE FROM codes WHERE expires<=?", (now,))
            live = int(db.execute("SELECT count(*) FROM codes", ()).fetchone()[0])
            own = db.execute("SELECT hash FROM codes WHERE link=? ORDER BY until, hash", (link,)).fetchall()
            for row in own[: max(0, len(own) + 1 - MAX_CODES)]:
                db.execute("DELETE FROM codes WHERE hash=?", (row[0],))
            code = drawn(code_length(live + 1))
            values = (hashed(code), terrain, role, link, now + seconds, now + CODE_LIFE_SECONDS)
            db.execute("INSERT INTO codes VALUES (?,?,?,?,?,?)", values)
            return code

        return self._journal.submit(write, terrain).result()

    def prolong(self, terrain: str, code: str, link: str) -> float | None:
        def write(db: Connection) -> float | None:
            now, digest = self._now(), hashed(code)
            row = db.execute(
                "SELECT until, expires FROM codes WHERE hash=? AND terrain=? AND link=? AND expires>?",
                (digest, terrain, link, now),
            ).fetchone()
            if row is None:
                return None
            expires = max(float(row[1]), min(now + CODE_SECONDS, float(row[0])))
            db.execute("UPDATE codes SET expires=? WHERE hash=?", (expires, digest))
            return expires - now

        return self._journal.submit(write, terrain).result()

    def open(self, code: str) -> JoinCode | None:
        now = self._now()
        row = (
            self._journal.reader()
            .execute(
                "SELECT codes.terrain, codes.role, codes.link, codes.expires FROM codes"
                " JOIN links ON links.id = codes.link"
                " WHERE codes.hash=? AND codes.expires>? AND links.revoked IS NULL",
                (hashed(code), now),
            )
            .fetchone()
        )
        if row is None:
            return None
        terrain, role, link, expires = row
        return JoinCode(terrain, role, link, float(expires) - now)

    def drop(self, link: str) -> None:
        def write(db: Connection) -> None:
            db.execute("DELETE FROM codes WHERE link=?", (link,))

        self._journal.submit(write).add_done_callback(_note)


def _note(done: Future[None]) -> None:
    """A code whose link has ended opens nothing; one whose link was renewed ends by itself soon."""
    error = done.exception()
    if error is not None:
        log.warning("codes of a link could not be ended: %s", error)
