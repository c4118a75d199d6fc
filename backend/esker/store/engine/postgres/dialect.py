"""The store's SQL as PostgreSQL takes it.

What the two engines write differently is little: the marks of values, and the schema before the names of tables. The
schema is named in every statement, since a search path would be state of a session, and poolers share sessions out by
transactions.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final

SCHEMA: Final = "esker"
TABLES: Final = (
    "terrains", "ops", "snapshots", "links", "grids", "moments", "people", "previews", "server", "folds", "folded_ids",
    "classes", "copies", "pupils", "lessons", "makers", "codes",
)  # fmt: skip
"""Every table of the store, and that of join codes. ``leases`` and ``nodes`` are PostgreSQL's own."""
_PART: Final = re.compile(
    r"'(?:[^']|'')*'"  # texts stay as they are
    r"|\?(?P<number>\d*)"
    rf"|(?P<before>\b(?:FROM|JOIN|INTO|UPDATE)\s+)(?P<table>{'|'.join(TABLES)})\b"
)
_VALUES: Final = re.compile(r"(INSERT INTO \w+(?: \([\w,]+\))? VALUES )(\([?,]+\))((?: ON CONFLICT DO NOTHING)?)")


@lru_cache(maxsize=1024)
def translated(sql: str) -> str:
    """A statement with numbered values, and with the schema before tables.

    >>> translated("SELECT op FROM ops WHERE terrain=? AND clock>?")
    'SELECT op FROM esker.ops WHERE terrain=$1 AND clock>$2'
    >>> translated("UPDATE terrains SET deleted=?1 WHERE id IN (SELECT terrain FROM copies WHERE class=?2) OR id='a?'")
    "UPDATE esker.terrains SET deleted=$1 WHERE id IN (SELECT terrain FROM esker.copies WHERE class=$2) OR id='a?'"
    """
    count = 0

    def one(found: re.Match[str]) -> str:
        nonlocal count
        if found["number"] is not None:
            count += 1
            return f"${found['number'] or count}"
        return f"{found['before']}{SCHEMA}.{found['table']}" if found["table"] else found[0]

    return _PART.sub(one, sql)


@lru_cache(maxsize=256)
def of_many(sql: str, rows: int) -> str | None:
    """One statement that inserts so many rows; None for what is no plain INSERT of values.

    >>> of_many("INSERT INTO grids VALUES (?,?) ON CONFLICT DO NOTHING", 2)
    'INSERT INTO esker.grids VALUES ($1,$2),($3,$4) ON CONFLICT DO NOTHING'
    """
    found = _VALUES.fullmatch(sql)
    return None if found is None else translated(found[1] + ",".join([found[2]] * rows) + found[3])
