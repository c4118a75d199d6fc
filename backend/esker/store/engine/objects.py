"""An S3-compatible store of whole files under names: written once, found by every server.

Where it is (``AWS_ENDPOINT_URL``) and by which keys it is opened (``AWS_ACCESS_KEY_ID``, ``AWS_SECRET_ACCESS_KEY``,
``AWS_REGION``) stands in the environment, as other programs read it there. No key is logged or told.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any, Final

NO_DRIVER: Final = "ESKER_BLOBS needs obstore, which a plain installation does not bring: pip install 'esker[cluster]'."
AT_ONCE_BYTES: Final = 32 << 20
"""A larger file is sent in parts."""
PATIENCE_SECONDS: Final = 20.0
REFRESH_SECONDS: Final = 86_400.0
"""A file that is stored again after so long counts as new: whoever sweeps looks at its age."""


class NoObjects(OSError):
    """The store of objects does not answer, or refuses; the message says why, without a key."""


class NoSuchObject(NoObjects):
    """There is nothing under this name."""


class Objects:
    """Files under ``s3://bucket/prefix``. Blocking; safe from any thread."""

    def __init__(self, url: str, patience: float = PATIENCE_SECONDS) -> None:
        """Asks nothing yet. ``patience``: seconds for which something is tried again.

        Raises NoObjects for what is no such address, or without its driver.
        """
        try:
            import obstore
            from obstore.exceptions import BaseError
            from obstore.store import S3Store
        except ImportError:
            raise NoObjects(NO_DRIVER) from None
        if not url.startswith("s3://") or not url[5:].split("/")[0]:
            raise NoObjects("ESKER_BLOBS must name a bucket: s3://bucket or s3://bucket/prefix.")
        self.name = url
        self._obs, self._failure = obstore, BaseError
        try:
            self._store = S3Store.from_url(
                url,
                client_options={"allow_http": True, "connect_timeout": "3s", "timeout": "120s"},
                retry_config={"max_retries": 3, "retry_timeout": timedelta(seconds=patience)},
            )
        except BaseError as error:
            raise NoObjects(f"{url} cannot be used as a store of grids ({_plain(error)}).") from None

    def put(self, name: str, path: Path) -> None:
        """Stores a file, whole, unless there is one of this name. Raises NoObjects, OSError."""
        age = self._age(name)
        if age is not None and age < REFRESH_SECONDS:
            return
        if age is None and path.stat().st_size <= AT_ONCE_BYTES:
            try:
                self._run(self._obs.put, self._store, name, path, mode="create", use_multipart=False)
            except FileExistsError:
                return
        else:
            self._run(self._obs.put, self._store, name, path)

    def get(self, name: str, path: Path) -> None:
        """Fetches a file. Raises NoSuchObject, NoObjects, OSError."""

        def fetch() -> None:
            with path.open("wb") as file:
                for chunk in self._obs.get(self._store, name).stream(min_chunk_size=4 << 20):
                    file.write(chunk)

        self._run(fetch)

    def has(self, name: str) -> bool:
        """Whether there is a file of this name. Raises NoObjects."""
        return self._age(name) is not None

    def size(self, name: str) -> int:
        """Its bytes; 0 where there is none. Raises NoObjects."""
        try:
            return int(self._run(self._obs.head, self._store, name)["size"])
        except NoSuchObject:
            return 0

    def ages(self, prefix: str) -> Iterator[tuple[str, float]]:
        """All names below a prefix with how long ago each was stored, seconds. Raises NoObjects."""
        now = time.time()
        batches = iter(self._run(self._obs.list, self._store, prefix=prefix))
        while (batch := self._run(next, batches, None)) is not None:
            for found in batch:
                yield str(found["path"]), now - found["last_modified"].timestamp()

    def delete(self, name: str) -> None:
        """Removes a file. Raises NoObjects."""
        self._run(self._obs.delete, self._store, name)

    def _age(self, name: str) -> float | None:
        try:
            found = self._run(self._obs.head, self._store, name)
        except NoSuchObject:
            return None
        return float(time.time() - found["last_modified"].timestamp())

    def _run(self, work: Any, *arguments: Any, **named: Any) -> Any:
        try:
            return work(*arguments, **named)
        except FileNotFoundError:
            raise NoSuchObject("There is no such object.") from None
        except self._failure as error:
            if type(error).__name__ == "NotFoundError":
                raise NoSuchObject("There is no such object.") from None
            if type(error).__name__ == "AlreadyExistsError":
                raise FileExistsError from None
            raise NoObjects(f"the store of grids does not answer ({_plain(error)})") from None


def _plain(error: Exception) -> str:
    """What went wrong in few words: the first line, and nothing that could be a key or a signed address."""
    first = (str(error).strip() or type(error).__name__).splitlines()[0]
    return first.split("http", 1)[0].strip(" :,") or type(error).__name__
