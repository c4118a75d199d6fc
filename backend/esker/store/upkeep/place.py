"""A store by its name, a data folder or a shared database, that nobody else uses meanwhile."""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

from esker.store.engine.lock import DataLock
from esker.store.engine.ports import BadDatabase, Engine
from esker.store.journal import Journal
from esker.store.upkeep.inspection import DATABASE_NAME

NO_DRIVER: Final = (
    "A PostgreSQL database needs psycopg, which a plain installation does not bring: pip install 'esker[cluster]'."
)


class Place:
    """An open store. ``with Place(...) as place``: until the block ends."""

    def __init__(self, named: str, *, is_there: bool) -> None:
        """``is_there``: whether it must have been used before. Raises BadDatabase, engine.ports.Unreachable,
        engine.lock.InUse, upkeep.inspection.CorruptDatabase, OSError."""
        self._lock: DataLock | None = None
        self._cache: tempfile.TemporaryDirectory[str] | None = None
        self.folder: Path | None = None
        """The data folder, where it is one."""
        engine: Engine | None = None
        if "://" in named:
            engine, self.name = shared(named, f"move:{platform.node()}:{os.getpid()}"), _named(named)
            self._cache = tempfile.TemporaryDirectory(prefix="esker-move-")
            directory = Path(self._cache.name)
        else:
            self.folder = directory = Path(named)
            self.name = str(directory.resolve())
            if is_there and not (directory / DATABASE_NAME).is_file():
                raise BadDatabase(f"There is no {DATABASE_NAME} in {directory}: no server has kept anything there.")
            self._lock = DataLock(directory)
        try:
            self.journal = Journal(directory, engine=engine)
        except BaseException:
            if self._lock is not None:
                self._lock.release()
            raise

    def __enter__(self) -> Place:
        return self

    def __exit__(self, *_: object) -> None:
        self.journal.close()
        if self._lock is not None:
            self._lock.release()
        if self._cache is not None:
            self._cache.cleanup()


def shared(url: str, name: str, lost: Callable[[], object] = lambda: None) -> Engine:
    """The engine of a shared database for a process that is alone on it. ``lost``: called when it no longer is.

    Raises BadDatabase, engine.ports.Unreachable, engine.lock.InUse.
    """
    try:
        from esker.store.engine.postgres.alone import LoneEngine
    except ImportError:
        raise BadDatabase(NO_DRIVER) from None
    return LoneEngine(url, name, lost)


def _named(url: str) -> str:
    from esker.store.engine.postgres.connections import place_of

    return f"postgresql://{place_of(url)}"
