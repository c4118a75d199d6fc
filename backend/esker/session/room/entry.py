"""Who comes in: why somebody may not, and whose a client id and a ticket are (decisions 33 and 53). No I/O, no time."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from esker import contract as c
from esker.contract import CloseCode, Role
from esker.errors import EskerError
from esker.store.claims import Claims

MOST_OWNERS: Final = 4_096
"""Client ids of which a room remembers whose they are, besides those in the journal."""
STATUS: Final = {
    "bad_secret": 403,
    "revoked": 403,
    "removed": 403,
    "no_terrain": 404,
    "rate_limited": 429,
    "server_error": 500,
    "shutting_down": 503,
    "moved": 503,
}
"""What HTTP answers where a route is denied for a reason that also closes sockets."""


class Denied(EskerError):
    """A client that may not come in: the close code and a sentence. ``ticket``: by which it may be let in later."""

    def __init__(self, code: CloseCode, message: str, ticket: str = "") -> None:
        super().__init__(code, message, STATUS.get(code, 400))
        self.code: CloseCode = code
        self.ticket = ticket


@dataclass(frozen=True)
class Caller:
    """Somebody at the door. ``since``: when the ticket was given that they showed, None where they showed none."""

    role: Role
    person: str
    ticket: str
    since: int | None


def caller_of(claims: Claims, terrain: str, role: Role, ticket: str | None) -> Caller:
    """Returns who shows a ticket; whoever shows none of this server's gets a new one, and is somebody new."""
    held = claims.holder(ticket, terrain)
    if held is not None and ticket is not None:
        return Caller(role, held[0], ticket, held[1])
    new = claims.ticket(terrain)
    found = claims.holder(new, terrain)
    assert found is not None, "it was made here"
    return Caller(role, found[0], new, None)


@dataclass
class Owner:
    """The owner of a client id. ``since``: when the id was claimed, milliseconds since 1970; ``heard``: whether
    anything was said under the id, so that its token is known to have arrived."""

    since: int
    link: str
    heard: bool = False


class Owners:
    """The owners of the client ids that were seen in one room."""

    def __init__(self, terrain: str, claims: Claims, counters: Mapping[str, int]) -> None:
        """``counters``: the client ids of which the journal has an op."""
        self._terrain, self._claims, self._counters = terrain, claims, counters
        self._by_client: OrderedDict[str, Owner] = OrderedDict()
        """The id that was unseen for longest comes first."""

    def caller(self, hello: c.Hello, role: Role) -> Caller:
        """Returns who says hello; whoever shows no ticket of this server's gets a new one, and is somebody new."""
        return caller_of(self._claims, self._terrain, role, hello.ticket)

    def owner(self, hello: c.Hello, link: str) -> Owner:
        """Returns whose the client id is once this client is in. Raises Denied (bad_hello): somebody else's.

        Who has no token comes under an id that was not used; or under one whose welcome did not arrive, as nothing was
        heard since. Of two who have one for the same id, it is that of whoever claimed it first.
        """
        known = self._by_client.get(hello.client)
        since = self._claims.since(hello.token, self._terrain, hello.client, link)
        if since is not None:
            if known is None or since <= known.since:
                return Owner(since, link, heard=True)
        elif known is not None:
            if known.link == link and not known.heard:
                return Owner(known.since, link)
        elif hello.client not in self._counters:
            return Owner(self._claims.now(), link)
        raise Denied("bad_hello", "Another page has this client id. Reload this page.")

    def put(self, client: str, owner: Owner) -> None:
        """A client is in."""
        self._by_client[client] = owner
        self._by_client.move_to_end(client)
        while len(self._by_client) > MOST_OWNERS:
            self._by_client.popitem(last=False)

    def heard(self, client: str, link: str) -> None:
        """A member said something, so it has its welcome."""
        owner = self._by_client.get(client)
        if owner is not None and owner.link == link:
            owner.heard = True

    def belongs(self, client: str, link: str) -> bool:
        """Returns whether things may be done in the name of a client id by who came in by this link."""
        owner = self._by_client.get(client)
        return client not in self._counters if owner is None else owner.link == link

    def token(self, client: str, link: str) -> str:
        """The token of a client that is in."""
        return self._claims.token(self._terrain, client, link, self._by_client[client].since)
