"""Files that one server made and any may be asked for: exports and preview pictures, in the store of objects.

Each of them can be made once more, so a store that does not answer costs work and refuses nothing: what goes wrong is
logged, and for half a minute nobody asks again. A server without a store keeps what it made to itself.
"""

from __future__ import annotations

import logging
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from esker.store.engine.objects import NoSuchObject, Objects

log = logging.getLogger("esker.made")

EXPORTS: Final = "exports/"
PREVIEWS: Final = "previews/"
KEPT_SECONDS: Final = {EXPORTS: 86_400.0, PREVIEWS: 14 * 86_400.0}
"""After so long a file is removed by whichever server looks. Clocks of store and server may differ by hours."""
AWAY_SECONDS: Final = 30.0
"""A store that did not answer is not asked again for so long."""
PATIENCE_SECONDS: Final = 2.0
"""How long an address of the store is tried for such a file: somebody waits for it."""


class Made:
    """Files under names, where several servers have them together. Blocking; safe from any thread."""

    def __init__(self, objects: Objects | None = None, now: Callable[[], float] = time.monotonic) -> None:
        """``objects``: None for a server that keeps what it made to itself."""
        self._objects, self._now = objects, now
        self._away_until = 0.0

    @property
    def is_shared(self) -> bool:
        """Whether others can have what is made here."""
        return self._objects is not None

    def give(self, name: str, path: Path) -> bool:
        """Stores a file. Returns whether it is there now."""
        return self._tried("stored", name, lambda objects: objects.put(name, path))

    def say(self, name: str, text: str) -> bool:
        """Stores a short text. Returns whether it is there now."""
        with tempfile.TemporaryDirectory(prefix="esker-made-") as folder:
            path = Path(folder) / "text"
            path.write_text(text, encoding="utf-8")
            return self.give(name, path)

    def fetch(self, name: str, path: Path) -> bool:
        """Brings a file to ``path``, whole. Returns whether there was one."""
        part = path.with_name(f"{path.name}.part")
        try:
            found = self._tried("fetched", name, lambda objects: objects.get(name, part))
            if found:
                part.replace(path)
            return found
        finally:
            part.unlink(missing_ok=True)

    def said(self, name: str) -> str | None:
        """A short text, or None."""
        with tempfile.TemporaryDirectory(prefix="esker-made-") as folder:
            path = Path(folder) / "text"
            return path.read_text(encoding="utf-8") if self.fetch(name, path) else None

    def remove(self, *names: str) -> None:
        """Removes files."""
        for name in names:
            self._tried("removed", name, partial(Objects.delete, name=name))

    def remove_all(self, folder: str) -> None:
        """Removes everything below a name that ends with a slash."""

        def work(objects: Objects) -> None:
            for name in [name for name, _ in objects.ages(folder)]:
                objects.delete(name)

        self._tried("removed", folder, work)

    def throw_old(self) -> None:
        """Removes what is too old to be asked for. Raises NoObjects."""
        if self._objects is None:
            return
        for folder, seconds in KEPT_SECONDS.items():
            for name in [name for name, age in self._objects.ages(folder) if age > seconds]:
                self._objects.delete(name)

    def _tried(self, done: str, name: str, work: Callable[[Objects], object]) -> bool:
        if self._objects is None or self._now() < self._away_until:
            return False
        try:
            work(self._objects)
        except NoSuchObject:
            return False
        except OSError as error:
            self._away_until = self._now() + AWAY_SECONDS
            log.warning("%s could not be %s: %s", name, done, error)
            return False
        return True
