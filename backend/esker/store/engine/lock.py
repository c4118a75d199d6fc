"""One server at a time on a data folder: two would give the same clock to different ops and sweep each other's work."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from esker.process import system

LOCK_FILE: Final = "esker.lock"


class InUse(Exception):
    """Another process serves this folder; the message says which and what to do."""


class DataLock:
    """Held from its making until ``release``; the system releases it when the process ends, however it ends."""

    def __init__(self, data: Path) -> None:
        """Takes the lock of folder ``data``, which is made if need be. Raises InUse, OSError."""
        data.mkdir(parents=True, exist_ok=True)
        self._file = (data / LOCK_FILE).open("a+")
        if not system.lock(self._file):
            self._file.seek(0)
            holder = self._file.read(20).strip()
            self._file.close()
            who = f"Another Esker (process {holder})" if holder.isdigit() else "Another Esker"
            raise InUse(f"{who} uses the data folder {data}. Stop it, or choose another folder with --data.")
        self._file.seek(0)
        self._file.truncate()
        self._file.write(f"{os.getpid()}\n")
        self._file.flush()

    def release(self) -> None:
        """Lets others serve the folder. Harmless when it was released before."""
        self._file.close()
