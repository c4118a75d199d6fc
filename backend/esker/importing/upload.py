"""Bringing a file into a terrain on a server, over HTTP: upload, status, answers, cancel (docs/importing.md)."""

from __future__ import annotations

import http.client
import json
import ssl
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self
from urllib.parse import quote, urlsplit

from esker import contract as c
from esker.link import Link, Refused

POLL_SECONDS: Final = 0.3
TIMEOUT_SECONDS: Final = 60.0
OVER: Final = frozenset({"done", "refused", "cancelled"})

Told = Callable[[c.ImportStatus], None]


class Uploads:
    """A connection to the server of one terrain. Use as a context manager."""

    def __init__(self, link: str, ca_file: Path | None = None) -> None:
        """Raises ValueError for what is no link, OSError for an authority that cannot be read."""
        self._link = Link(link)
        parts = urlsplit(link)
        if self._link.secure:
            tls = ssl.create_default_context(cafile=ca_file)
            self._http: http.client.HTTPConnection = http.client.HTTPSConnection(
                parts.netloc, timeout=TIMEOUT_SECONDS, context=tls
            )
        else:
            self._http = http.client.HTTPConnection(parts.netloc, timeout=TIMEOUT_SECONDS)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._http.close()

    def send(self, path: Path, on_progress: Callable[[float], None], query: str = "") -> c.ImportStatus:
        """Uploads a file; ``on_progress``: share of its bytes; ``query``: more of the address (docs/protocol.md).

        Raises Refused, OSError, http.client.HTTPException.
        """
        size = path.stat().st_size
        with path.open("rb") as file:
            body = _Told(file, size, lambda done: on_progress(done / size if size else 1.0))
            return self._call("POST", f"?name={quote(path.name, safe='')}{query}", body, size)

    def follow(self, status: c.ImportStatus, told: Told) -> c.ImportStatus:
        """Asks until the import is over or asks something itself; every status is ``told``. Raises as ``send``."""
        while True:
            told(status)
            if status.stage in OVER or status.stage == "question":
                return status
            time.sleep(POLL_SECONDS)
            status = self._call("GET", f"/{status.id}")

    def answer(self, status: c.ImportStatus, answers: c.ImportAnswers) -> c.ImportStatus:
        """Answers what an import asks. Raises as ``send``."""
        body = answers.model_dump_json(exclude_none=True).encode()
        return self._call("POST", f"/{status.id}/answers", body, len(body), "application/json")

    def cancel(self, status: c.ImportStatus) -> None:
        """Stops an import; nothing of it stays. Raises as ``send``."""
        self._request("DELETE", f"/{status.id}")

    def _call(
        self,
        method: str,
        tail: str,
        body: bytes | _Told | None = None,
        length: int = 0,
        kind: str = "application/octet-stream",
    ) -> c.ImportStatus:
        return c.ImportStatus.model_validate_json(self._request(method, tail, body, length, kind))

    def _request(
        self, method: str, tail: str, body: bytes | _Told | None = None, length: int = 0, kind: str = ""
    ) -> bytes:
        headers = {"Authorization": f"Bearer {self._link.secret}"}
        if body is not None:
            headers |= {"Content-Length": str(length), "Content-Type": kind}
        self._http.request(method, f"/api/terrains/{self._link.terrain}/imports{tail}", body, headers)
        response = self._http.getresponse()
        text = response.read()
        if response.status >= 400:
            raise _refusal(response.status, text)
        return text


class _Told:
    """The first ``size`` bytes of a file, that tells how much of it was read. Raises OSError if it has become shorter:
    the server would wait for the rest."""

    def __init__(self, file: BinaryIO, size: int, told: Callable[[int], None]) -> None:
        self._file, self._size, self._told, self._done = file, size, told, 0

    def read(self, count: int = -1) -> bytes:
        left = self._size - self._done
        part = self._file.read(left if count < 0 else min(count, left))
        if not part and left:
            raise OSError("the file became shorter while it was sent")
        self._done += len(part)
        self._told(self._done)
        return part


def _refusal(status: int, text: bytes) -> Refused:
    """What the server said, or what its status means when it is not the server that answered."""
    try:
        body = json.loads(text)
        return Refused(str(body["code"]), str(body["message"]))
    except (ValueError, KeyError, TypeError):
        return Refused("http", f"The server answered with status {status}.")
