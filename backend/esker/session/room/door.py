"""Who may come into which terrain: links, the secrets that open them, and how many may come from where (DESIGN 13)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from esker import contract as c
from esker.fairness.shares import Rate, Rates, Who
from esker.session.room.entry import Denied
from esker.store.access import Access, Link
from esker.store.journal import Journal
from esker.store.upkeep.deletion import GRACE_SECONDS, Deletion

WRONG_SECRETS_PER_MINUTE: Final = 30
HISTORY_HELLOS: Final = Rate(1.0, 60.0)
"""Views of the history of one address, or by one link, that are opened: each reads the journal and is solved anew."""
HELLOS: Final = Rate(5.0, 300.0)
"""Pages that may come from one address, or by one link: a full room may come back at once."""


class Deleted(Denied):
    """The terrain was deleted and can still be brought back by its owners, until ``until`` (seconds since 1970)."""

    def __init__(self, link: Link, until: float) -> None:
        super().__init__("no_terrain", "This terrain was deleted.")
        self.link, self.until = link, until


class Door:
    """Checks links for all terrains of one server. Lives in one event loop."""

    def __init__(self, journal: Journal, access: Access, deletion: Deletion, now: Callable[[], float]) -> None:
        self._journal, self._access, self._deletion, self._now = journal, access, deletion, now
        self._wrong = Rates(Rate(WRONG_SECRETS_PER_MINUTE / 60, WRONG_SECRETS_PER_MINUTE))
        self._hellos = Rates(HELLOS, link=HELLOS)
        self._history_hellos = Rates(HISTORY_HELLOS, link=HISTORY_HELLOS)

    def authorise(self, terrain: str, secret: str, address: str) -> Link:
        """Returns the live link behind a secret. Raises Denied (no_terrain, bad_secret, revoked, rate_limited)."""
        found = self._access.opening(terrain, secret)
        if found is None:
            if not self._wrong.take(Who(address), self._now()):
                raise Denied("rate_limited", "Too many wrong links came from your address. Wait a minute.")
            if not self._journal.exists(terrain):
                raise Denied("no_terrain", "There is no such terrain on this server.")
            raise Denied("bad_secret", "This link does not open this terrain. Ask for a new one.")
        link, deleted = found
        if link.revoked is not None:
            raise Denied("revoked", "This link was revoked by the owner of the terrain.")
        if deleted is not None:
            raise Deleted(link, deleted + GRACE_SECONDS)
        return link

    def called(self, hello: c.Hello, address: str) -> Link:
        """Returns the link by which somebody comes, and counts who came. Raises Denied."""
        link = self.authorise(hello.terrain, hello.secret, address)
        self.count(Who(address, link.id), history=hello.at is not None)
        return link

    def demand(self, link: Link) -> None:
        """Asks again whether a link still opens its terrain: after everything that was waited for, and before anything
        is given out or laid. Raises Denied (revoked, bad_secret)."""
        if self._access.opens(link):
            return
        if (deleted := self._deletion.deleted(link.terrain)) is not None:
            raise Deleted(link, deleted + GRACE_SECONDS)
        if not self._access.alive(link):
            found = next((each for each in self._access.links(link.terrain) if each.id == link.id), None)
            if found is None or found.revoked is not None:
                raise Denied("revoked", "This link was revoked by the owner of the terrain.")
            raise Denied("bad_secret", "This link was renewed meanwhile. Ask for the new one.")

    def count(self, who: Who, *, history: bool) -> None:
        """Counts a page that comes, to the present or to the ``history``. Raises Denied (rate_limited)."""
        rates = self._history_hellos if history else self._hellos
        if not rates.take(who, self._now()):
            raise Denied("rate_limited", "Too many pages came at once. Yours comes back by itself.")
