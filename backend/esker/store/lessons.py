"""What a lesson leaves in the database: how it stands, and by whose hand each stroke and each layer came.

``lessons`` (terrain, state): the state as the room wrote it (``session/lesson/state.py``), JSON. ``makers`` (terrain,
thing, client): written in the commit of the op by which the thing came; what has no row was there from the start.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from esker.store.engine.ports import Connection

_BEGUN: Final = re.compile(r'"type":"(?:stroke\.begin","stroke|layer\.add","layer)":\{"id":"([A-Za-z0-9_-]{1,40})"')


def begun(op: str) -> list[str]:
    """Ids of the strokes and layers that an op, as JSON text of this server, brings.

    In JSON a quote within a text has a backslash before it, so no text of a person's looks like such a field.
    """
    return _BEGUN.findall(op)


def keep_makers(db: Connection, terrain: str, made: Iterable[tuple[str, str]]) -> None:
    """Writes down by which clients things (thing, client) came."""
    db.executemany(
        "INSERT INTO makers VALUES (?,?,?) ON CONFLICT (terrain, thing) DO UPDATE SET client=excluded.client",
        [(terrain, *each) for each in made],
    )


def keep_state(db: Connection, terrain: str, state: str) -> None:
    """Writes down how the lesson stands."""
    db.execute(
        "INSERT INTO lessons VALUES (?,?) ON CONFLICT (terrain) DO UPDATE SET state=excluded.state", (terrain, state)
    )


def read_state(db: Connection, terrain: str) -> str | None:
    """How the lesson stands; None where there never was one."""
    row = db.execute("SELECT state FROM lessons WHERE terrain=?", (terrain,)).fetchone()
    return None if row is None else str(row[0])


def read_makers(db: Connection, terrain: str) -> dict[str, str]:
    """The client by which each thing came of which that is known."""
    rows = db.execute("SELECT thing, client FROM makers WHERE terrain=?", (terrain,))
    return {str(thing): str(client) for thing, client in rows}
