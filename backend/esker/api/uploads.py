"""Bringing a file into a terrain on a server, over HTTP: upload, status, answers, cancel (docs/importing.md)."""

from __future__ import annotations

import ssl
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self
from urllib.parse import quote

from esker import contract as c
from esker.api.http import Api
from esker.api.link import Link

POLL_SECONDS: Final = 0.3

OnStatus = Callable[[c.ImportStatus], None]


class Uploads:
    """A connection to the server of one terrain. Use as a context manager."""

    def __init__(self, link: str, ca_file: Path | None = None) -> None:
        """Raises ValueError for what is no link, OSError for an authority that cannot be read."""
        tls = ssl.create_default_context(cafile=ca_file) if Link(link).secure else None
        self._api = Api(link, tls)
        self._connection = self._api.connect()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._connection.close()

    def send(self, path: Path, on_progress: Callable[[float], None], query: str = "") -> c.ImportStatus:
        """Uploads a file; ``on_progress``: share of its bytes; ``query``: more of the address (docs/protocol.md).

        Raises Refused, OSError, http.client.HTTPException.
        """
        size = path.stat().st_size
        with path.open("rb") as file:
            body = _CountedBody(file, size, lambda done: on_progress(done / size if size else 1.0))
            return self._call("POST", f"?name={quote(path.name, safe='')}{query}", body, size)

    def follow(self, status: c.ImportStatus, on_status: OnStatus) -> c.ImportStatus:
        """Asks until the import is over or has a question. ``on_status`` hears every status. Raises as ``send``."""
        while True:
            on_status(status)
            if status.stage in c.ENDED_IMPORT or status.stage == "question":
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
        body: bytes | _CountedBody | None = None,
        length: int | None = None,
        kind: str = "application/octet-stream",
    ) -> c.ImportStatus:
        return c.ImportStatus.model_validate_json(self._request(method, tail, body, length, kind))

    def _request(
        self,
        method: str,
        tail: str,
        body: bytes | _CountedBody | None = None,
        length: int | None = None,
        kind: str = "",
    ) -> bytes:
        path = f"imports{tail}"
        return self._api.request(method, path, body, kind=kind, length=length, over=self._connection)


class _CountedBody:
    """The first ``size`` bytes of a file, that tells how much of it was read. Raises OSError if it has become shorter:
    the server would wait for the rest."""

    def __init__(self, file: BinaryIO, size: int, on_read: Callable[[int], None]) -> None:
        self._file, self._size, self._on_read, self._done = file, size, on_read, 0

    def read(self, count: int = -1) -> bytes:
        left = self._size - self._done
        part = self._file.read(left if count < 0 else min(count, left))
        if not part and left:
            raise OSError("the file became shorter while it was sent")
        self._done += len(part)
        self._on_read(self._done)
        return part
