"""Preview tokens: who may see the picture of a terrain without its secret (docs/decisions/0018-preview-tokens.md).

Programs that unfold links never see the fragment with the secret. A link that is meant to be shared carries a token
beside it, ``/t/{id}?p={token}#{secret}``, which opens the picture and the title, and nothing else.
"""

from __future__ import annotations

import secrets
from concurrent.futures import Future
from typing import Final, NamedTuple

from esker.store.engine.ports import Connection
from esker.store.journal import Journal

_MAKE: Final = "INSERT INTO previews VALUES (?,?,1) ON CONFLICT DO NOTHING"


class Preview(NamedTuple):
    """A terrain's token; ``shown`` False: its owner does not want a picture to be seen."""

    token: str
    shown: bool


class PreviewTokens:
    """Tokens in the journal's database. They are kept as they are: a link must be shown again with its token, and all
    that a token opens is a picture."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal

    def terrain(self, token: str) -> str | None:
        """The terrain whose picture this token opens now, if there is one."""
        row = (
            self._journal.reader()
            .execute("SELECT terrain FROM previews WHERE token=? AND shown=1", (token,))
            .fetchone()
        )
        return None if row is None else str(row[0])

    def of(self, terrain: str) -> Future[Preview]:
        """The token of a terrain, made when it has none."""

        def write(db: Connection) -> Preview:
            db.execute(
                "INSERT INTO previews VALUES (?,?,1) ON CONFLICT DO NOTHING", (terrain, secrets.token_urlsafe(12))
            )
            return _read(db, terrain)

        return self._journal.submit(write, terrain)

    def change(self, terrain: str, *, shown: bool | None = None, renew: bool = False) -> Future[Preview]:
        """Shows or hides the picture; ``renew``: links with the old token no longer show it."""
        fresh = secrets.token_urlsafe(12)

        def write(db: Connection) -> Preview:
            db.execute(_MAKE, (terrain, fresh))
            if renew:
                db.execute("UPDATE previews SET token=? WHERE terrain=?", (fresh, terrain))
            if shown is not None:
                db.execute("UPDATE previews SET shown=? WHERE terrain=?", (int(shown), terrain))
            return _read(db, terrain)

        return self._journal.submit(write, terrain)


def _read(db: Connection, terrain: str) -> Preview:
    token, shown = db.execute("SELECT token, shown FROM previews WHERE terrain=?", (terrain,)).fetchone()
    return Preview(str(token), bool(shown))
