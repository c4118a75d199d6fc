"""What conductors are told of what they asked for, sentence by sentence (docs/protocol.md)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from esker import contract as c

KEPT: Final = "What others have changed since was kept."
SENTENCES: Final[dict[c.NoticeCode, str]] = {
    "not_leading": "Only whoever leads the lesson may do this.",
    "owners_only": "Only an owner of the terrain may say who else leads.",
    "not_owners": "An owner of the terrain cannot be sent out. Their link can be revoked.",
    "not_leaders": "Only an owner may send out somebody who leads too.",
    "not_yourself": "You cannot send yourself out.",
    "nobody": "Nobody like that is here, or was here a while ago.",
    "unsaved": "The server could not save this (is its disk full?). It holds until the server stops.",
    "undo_busy": "What somebody did is being taken back already. Try again in a moment.",
    "unreadable": "The history could not be read, so nothing was taken back.",
    "too_many_groups": f"A lesson has at most {c.MAX_GROUPS} groups. Forget one first.",
    "too_many_grouped": f"The groups of a lesson hold at most {c.MAX_GROUPED} people. Take somebody out first.",
    "taken_back": "Everything that {who} did was taken back.",
    "taken_back_but": "Everything that {who} did was taken back. " + KEPT,
    "nothing_stands": "Nothing that {who} did still stands.",
    "nothing_taken_back": KEPT + " Nothing was taken back.",
    "refused": "Not everything that {who} did could be taken back.",
}
"""The English sentence of each code. ``{who}``: names of people."""


def notice(code: c.NoticeCode, names: Iterable[str] = ()) -> c.Notice:
    """The message with this code; ``names``: of whom it tells, the first of them by alphabet.

    >>> notice("taken_back", ["Ben", "Ada"]).text
    'Everything that Ada and Ben did was taken back.'
    """
    named = tuple(sorted(filter(None, set(names))))[: c.MAX_NAMED]
    return c.Notice(code=code, names=named, text=SENTENCES[code].format(who=" and ".join(named) or "they"))
