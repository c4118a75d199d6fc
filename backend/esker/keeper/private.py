"""What only the machine's owner may read: the server's key, and the links of the lesson that its start prints.

One file in the data folder, readable by the user who runs the server and by nobody else. The database holds hashes of
secrets only, so without this file a start could not print a link a second time.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError

FILE_NAME: Final = "private.json"
KEY_CHARACTERS: Final = 32
"""Characters of the server's key: 192 random bits as URL-safe text."""


class Lesson(BaseModel):
    """The terrain that a start prints, and the secrets of two of its links."""

    model_config = ConfigDict(frozen=True)

    terrain: str
    owner: str
    edit: str


class Content(BaseModel):
    """The content of the private file."""

    model_config = ConfigDict(frozen=True)

    key: str = Field(min_length=KEY_CHARACTERS)
    base: str = ""
    """Address at which people reached the server when it started last: ``https://192.168.1.20:8000``."""
    lesson: Lesson | None = None


class Private:
    """The private file of one data folder. The server is the only one that writes it."""

    def __init__(self, data: Path) -> None:
        self.path = data / FILE_NAME

    def read(self) -> Content | None:
        """Returns the content of the file; None where there is no file, or one that cannot be understood."""
        try:
            return Content.model_validate_json(self.path.read_bytes())
        except (FileNotFoundError, ValidationError):
            return None

    def open(self) -> Content:
        """Returns the content of the file, which is made anew with another key where it is missing or damaged. Raises
        OSError."""
        found = self.read()
        if found is None:
            found = Content(key=secrets.token_urlsafe(24))
            self.write(found)
        return found

    def write(self, content: Content) -> None:
        """Replaces the file whole. Nobody else can read it at any moment. Raises OSError."""
        made = self.path.with_suffix(".new")
        with suppress(FileNotFoundError):
            made.unlink()  # a file that exists would keep its rights, which may be too wide
        descriptor = os.open(made, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as file:
            file.write(content.model_dump_json(indent=1).encode())
            file.flush()
            os.fsync(file.fileno())
        made.replace(self.path)


class Key:
    """Compares what somebody shows with the server's key. It holds the key's hash only."""

    def __init__(self, key: str) -> None:
        self._hash = hashlib.sha256(key.encode()).digest()

    def fits(self, shown: str) -> bool:
        """Returns whether this is the key; the comparison takes the same time wherever they differ."""
        return hmac.compare_digest(self._hash, hashlib.sha256(shown.encode()).digest())
