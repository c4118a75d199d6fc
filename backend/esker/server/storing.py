"""What a server keeps things in: its journal and its grids, over the database and the folder that the settings name."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable

from esker.server.settings import Settings
from esker.server.starting import CannotServe
from esker.store.engine.lock import DataLock, InUse
from esker.store.engine.made import PATIENCE_SECONDS, Made
from esker.store.engine.objects import NoObjects, Objects
from esker.store.engine.ports import BadDatabase, Engine, Unreachable
from esker.store.grids import GridStore
from esker.store.journal import Journal
from esker.store.space import Space
from esker.store.upkeep.care import sweep_parts
from esker.store.upkeep.move import CannotMove, refuse_half_moved
from esker.store.upkeep.place import shared


class Storing:
    """The store of one server, open until ``close``."""

    def __init__(
        self,
        settings: Settings,
        lost: Callable[[], object],
        share: Callable[[], tuple[Engine, Callable[[], float]]] | None = None,
    ) -> None:
        """``lost``: called in a thread when another server has taken the database. ``share``: returns the engine of a
        server among others, and the date that they have together. By default the server is alone on its database.

        Raises CannotServe, store.upkeep.inspection.CorruptDatabase, OSError.
        """
        self._lock: DataLock | None = None
        self._engine: Engine | None = None
        now: Callable[[], float] = time.time
        try:
            self._lock = DataLock(settings.data)
            sweep_parts(settings.data)
            self.space = Space(settings.data, settings.storage_mb << 20)
            if share is not None:
                self._engine, now = share()
            elif settings.database:
                # A server that was killed is known again by its folder, and has the database back at once.
                self._engine = shared(settings.database, f"{platform.node()}:{settings.data.resolve()}", lost)
            quota = settings.history_quota_mb << 20
            self.journal = Journal(settings.data, now, space=self.space, quota=quota, engine=self._engine)
            self._engine = self.journal.engine
            refuse_half_moved(self.journal)
            objects = Objects(settings.blobs) if settings.blobs else None
            self.grids = GridStore(settings.data, self.space, objects)
            self.made = Made(Objects(settings.blobs, PATIENCE_SECONDS) if settings.blobs else None)
            self.grids.sweep(self.journal.grids(), forgotten=self.journal.may_sweep())
        except (InUse, BadDatabase, Unreachable, CannotMove, NoObjects) as error:
            self.close()
            raise CannotServe(_sentence(error)) from None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Commits what is queued, and lets others have the database and the folder."""
        if self._engine is not None:
            self._engine.close()
        if self._lock is not None:
            self._lock.release()


def _sentence(error: Exception) -> str:
    text = str(error)
    return f"{text[0].upper()}{text[1:]}" + ("" if text.endswith(".") else ".")
