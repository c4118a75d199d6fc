"""Plain ASGI middleware before the application: it says who really asks, and whether a browser may ask for it.

A reverse proxy tells the address of who asks in X-Forwarded-For, each proxy at its end: the last entry that is not of a
trusted proxy counts, as whatever stands before it was written by who asks. A request that changes something is refused
when its ``Host`` is none of this server's names (a page of another site that had its name resolve to this computer),
or when ``Origin`` or ``Sec-Fetch-Site`` say that a page of another site sends it.
"""

from __future__ import annotations

import json
import socket
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network
from typing import Any, Final
from urllib.parse import urlsplit

from esker.errors import AnswerCode

CHANGES_NOTHING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
OWN_SITE: Final = frozenset({"same-origin", "none"})
WRONG_HOST: Final = (
    "This server does not go by the name in this request. If it is to, start it with --public-url or ESKER_HOSTS."
)
WRONG_SITE: Final = "A page of another site may not ask for this."


class Proxies:
    """Proxies that are believed about who asks: addresses and networks, or "*": any that connects directly."""

    def __init__(self, trusted: str) -> None:
        """``trusted``: separated by commas. Raises ValueError for what is no address, network or "*"."""
        entries = [entry.strip() for entry in trusted.split(",") if entry.strip()]
        self._all = "*" in entries
        self._networks: list[IPv4Network | IPv6Network] = [ip_network(e, strict=False) for e in entries if e != "*"]

    def __contains__(self, address: object) -> bool:
        return self._all or self._named(str(address))

    def _named(self, address: str) -> bool:
        try:
            parsed = ip_address(address)
        except ValueError:
            return False
        return any(parsed.version == net.version and parsed in net for net in self._networks)

    def client(self, peer: str, forwarded: Sequence[str]) -> str:
        """Returns who asks, of a connection from ``peer`` with these X-Forwarded-For fields."""
        if peer not in self:
            return peer
        here = peer
        for entry in reversed([part for value in forwarded for part in value.split(",")]):
            address = _bare(entry.strip())
            if address is None:
                return here
            here = address
            if not self._named(here):
                return here
        return here


def _bare(entry: str) -> str | None:
    """Returns an address without its port; None when it is none."""
    if entry.startswith("["):
        entry = entry[1:].partition("]")[0]
    elif entry.count(":") == 1:
        entry = entry.partition(":")[0]
    try:
        return str(ip_address(entry))
    except ValueError:
        return None


def local_names() -> set[str]:
    """Returns what a computer calls itself."""
    host = socket.gethostname().lower().rstrip(".")
    return {"localhost", host, f"{host.partition('.')[0]}.local"}


@dataclass(frozen=True)
class Front:
    """The ways by which this server is reached."""

    proxies: Proxies = field(default_factory=lambda: Proxies("127.0.0.1"))
    hosts: frozenset[str] | None = None
    """Names in ``Host`` besides addresses and "localhost". None: any, since nobody named some."""
    origin: str | None = None
    """The address at which people reach the server, when a proxy may change ``Host``:
    ``https://terrain.example.org``."""
    strict: bool = False
    """Whether browsers are told to come by HTTPS only (Strict-Transport-Security)."""

    def against(self, scope: Any) -> tuple[int, AnswerCode, str] | None:
        """Returns status, code and sentence of what stands against a change that this request asks for; None:
        nothing."""
        found: dict[bytes, bytes] = dict(scope["headers"])
        host = found.get(b"host", b"").decode("latin1").lower()
        if not self._mine(_name(host)):
            return 421, "bad_host", WRONG_HOST
        site = found.get(b"sec-fetch-site")
        if site is not None and site.decode("latin1") not in OWN_SITE:
            return 403, "bad_origin", WRONG_SITE
        origin = found.get(b"origin")
        if origin is not None and not self._own(origin.decode("latin1").lower(), host):
            return 403, "bad_origin", WRONG_SITE
        return None

    def _mine(self, name: str) -> bool:
        if self.hosts is None or name in self.hosts or name == "localhost" or name.endswith(".localhost"):
            return True
        try:
            ip_address(name)
        except ValueError:
            return False
        return True

    def _own(self, origin: str, host: str) -> bool:
        try:
            return urlsplit(origin).netloc == host or origin == self.origin
        except ValueError:  # "http://[": no browser says that of a page
            return False


def hosts(names: Iterable[str], *urls: str | None) -> frozenset[str]:
    """Returns names, and the names in URLs, as they stand in ``Host`` without a port."""
    return frozenset({name.lower() for name in names} | {_name(urlsplit(url).netloc) for url in urls if url})


def _name(host: str) -> str:
    """Returns a host without its port and brackets."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0].rstrip(".").lower()


class Forwarded:
    """Middleware that tells the application who really asks, and whether by HTTPS, where a trusted proxy says so."""

    def __init__(self, app: Any, front: Front) -> None:
        self.app, self._proxies = app, front.proxies

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] in ("http", "websocket") and scope.get("client") and scope["client"][0] in self._proxies:
            peer, port = scope["client"]
            named = {name: [v.decode("latin1") for n, v in scope["headers"] if n == name] for name in _FORWARDED}
            client = self._proxies.client(peer, named[b"x-forwarded-for"])
            schemes = [part.strip() for value in named[b"x-forwarded-proto"] for part in value.split(",")]
            scope = {**scope, "client": (client, port if client == peer else 0)}
            if schemes and schemes[-1] in ("http", "https"):
                scope["scheme"] = schemes[-1].replace("http", "ws") if scope["type"] == "websocket" else schemes[-1]
        await self.app(scope, receive, send)


_FORWARDED: Final = (b"x-forwarded-for", b"x-forwarded-proto")


class Gate:
    """Refuses changes that pages of other sites ask for. Sockets are refused by their route, with a sentence."""

    def __init__(self, app: Any, front: Front) -> None:
        self.app, self._front = app, front

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        against = None
        if scope["type"] == "http" and scope["method"] not in CHANGES_NOTHING:
            against = self._front.against(scope)
        if against is None:
            await self.app(scope, receive, send)
            return
        status, code, message = against
        body = json.dumps({"code": code, "message": message}).encode()
        head = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
        await send({"type": "http.response.start", "status": status, "headers": head})
        await send({"type": "http.response.body", "body": body})
