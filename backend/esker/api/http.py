"""HTTP to the server of one terrain, with the secret of its link: what the Python API and the commands ask by.

It may be used from any thread: each request has a connection of its own, unless it is given one.
"""

from __future__ import annotations

import http.client
import json
import ssl
from typing import IO, Final, Protocol
from urllib.parse import urlsplit

from esker.api.link import Link, Refused

TIMEOUT_SECONDS: Final = 60.0


class Readable(Protocol):
    """A body that is read while it is sent."""

    def read(self, count: int = -1, /) -> bytes: ...


class Api:
    """The routes below ``/api/terrains/{terrain}`` of the terrain behind a link."""

    def __init__(self, link: str, tls: ssl.SSLContext | None = None, timeout: float = TIMEOUT_SECONDS) -> None:
        """``tls``: for links of ``https``, where the system's authorities will not do; ``timeout``: seconds for which
        the server may be silent. Raises ValueError for what is no link."""
        self.link = Link(link)
        parts = urlsplit(link)
        self.origin, self._host = f"{parts.scheme}://{parts.netloc}", parts.netloc
        self._tls, self._timeout = tls, timeout

    def connect(self) -> http.client.HTTPConnection:
        """A connection for several requests. Who asks for it closes it."""
        if self.link.secure:
            return http.client.HTTPSConnection(self._host, timeout=self._timeout, context=self._tls)
        return http.client.HTTPConnection(self._host, timeout=self._timeout)

    def request(
        self,
        method: str,
        path: str,
        body: bytes | Readable | None = None,
        *,
        kind: str = "application/json",
        length: int | None = None,
        over: http.client.HTTPConnection | None = None,
    ) -> bytes:
        """The body of the answer.

        ``path`` begins below the terrain; ``length``: bytes of a body that is read while it is sent; ``over``: an open
        connection. Raises Refused for every status from 400 on, OSError, http.client.HTTPException.
        """
        headers = {"Authorization": f"Bearer {self.link.secret}"}
        if body is not None:
            headers["Content-Type"] = kind
        if length is not None:
            headers["Content-Length"] = str(length)
        connection = over or self.connect()
        try:
            sent: bytes | IO[bytes] | None = body  # type: ignore[assignment]
            connection.request(method, f"/api/terrains/{self.link.terrain}/{path}", sent, headers)
            response = connection.getresponse()
            text = response.read()
        finally:
            if over is None:
                connection.close()
        if response.status >= 400:
            raise refusal(response.status, text)
        return text


def refusal(status: int, text: bytes) -> Refused:
    """Returns what the server said, or what its status means when it is not the server that answered."""
    try:
        body = json.loads(text)
        return Refused(str(body["code"]), str(body["message"]), status)
    except (ValueError, KeyError, TypeError):
        return Refused("http", f"The server answered with status {status}.", status)
