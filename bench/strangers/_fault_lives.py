"""Lives of servers that are killed: a process that forks one for each line it reads, so that each begins at once.

``python -m bench.strangers._fault_lives LOG``: a line is JSON, ``{"what": "serve", "data": DIR, "port": N}``, or
"restore" or "open" in the place of "serve". The fork is a whole server (on NumPy, small), ``esker restore`` or the
opening of a database. It writes ``begin NAME`` and ``end NAME`` around what it may be killed in, and ``ready``; ``pid
N`` comes before and ``gone`` after it. Its care comes every moment, folds what was done just now and has no days of
grace.
"""

from __future__ import annotations

import functools
import json
import logging
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from threading import Event
from typing import Any, Final

from esker.server import first_build, run
from esker.server.settings import Settings
from esker.session.room import core
from esker.store import journal
from esker.store.engine import sqlite
from esker.store.grids import GridStore
from esker.store.space import Space
from esker.store.upkeep import care, compaction, deletion, migrations
from esker.store.upkeep.backup import write_backup
from esker.store.upkeep.compaction import Compaction
from esker.store.upkeep.restore import restore

CARE_SECONDS: Final = 0.3
SNAPSHOT_EVERY: Final = 60
PIECE: Final = 30


def say(line: str) -> None:
    """One line, whole or not at all."""
    os.write(1, f"{line}\n".encode())


def marked(name: str, work: Callable[..., Any]) -> Callable[..., Any]:
    """Says when ``work`` begins and ends."""

    @functools.wraps(work)
    def run_marked(*arguments: Any, **named: Any) -> Any:
        say(f"begin {name}")
        try:
            return work(*arguments, **named)
        finally:
            say(f"end {name}")

    return run_marked


def hurry() -> None:
    """Makes rare things frequent, and says when they are done."""
    places: Any = {"run": run, "care": care, "compaction": compaction, "deletion": deletion, "core": core}
    places["run"].Care = functools.partial(care.Care, seconds=CARE_SECONDS, full_seconds=CARE_SECONDS)
    places["care"].Compaction = functools.partial(Compaction, fold_after=-1.0, crowded_after=-1.0)
    places["compaction"].PIECE = PIECE
    places["core"].SNAPSHOT_EVERY = SNAPSHOT_EVERY
    places["deletion"].GRACE_SECONDS = 0.0
    folds: Any = Compaction
    stretch, end = Compaction._stretch, Compaction._end

    def begun(self: Compaction, *arguments: Any) -> Any:
        say("begin compaction")
        return stretch(self, *arguments)

    def ended(self: Compaction, terrain: str) -> int | None:
        say("end compaction")  # it is asked for before each stretch
        return end(self, terrain)

    folds._stretch, folds._end = begun, ended
    engine: Any = sqlite
    engine.write_backup = marked("backup", write_backup)
    store: Any = GridStore
    store.keep = marked("import", GridStore.keep)
    removes: Any = deletion.Deletion
    removing = deletion.Deletion.remove_old

    def remove(self: deletion.Deletion) -> list[str]:
        one = self._journal.reader().execute("SELECT 1 FROM terrains WHERE deleted IS NOT NULL").fetchone()
        return removing(self) if one is None else marked("delete", removing)(self)

    removes.remove_old = remove
    steps: Any = migrations
    steps.migrate = marked("migration", migrations.migrate)


def serve(data: Path, port: int, floor: int | None = None) -> None:
    """Runs a server until it is killed or told to stop. ``floor``: bytes of the disk that it leaves free."""
    if floor is not None:
        places: Any = run
        places.Space = functools.partial(Space, floor=floor)
    settings = Settings(port=port, data=data, page=data / "none", level=1, refine=0, device="numpy", log_level="error")
    assembly = run.Assembly(settings)
    try:
        server: Any = assembly.server(announce=False)

        async def ready() -> None:
            say("ready")

        server._announce = ready
        assembly.run(server)
    finally:
        assembly.close()


def life(task: dict[str, Any], log: str) -> None:
    """One fork."""
    logging.basicConfig(filename=log, level=logging.WARNING, format="%(levelname)s %(name)s %(message)s", force=True)
    data = Path(task["data"])
    try:
        hurry()
        if task["what"] == "serve":
            serve(data, task["port"], task.get("floor"))
        elif task["what"] == "restore":
            marked("restore", restore)(data)
        else:
            journal.Journal(data).close()
        say("done")
    except Exception as error:
        logging.error("%s", "".join(traceback.format_exception(error)))
        say(f"failed {type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}")
    finally:
        os._exit(0)


def main(log: str) -> None:
    """One fork for each line. The compiled loops are loaded before: each server would load them for itself."""
    first_build.have_loops(Event(), Event())
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            life(json.loads(line), log)
        say(f"pid {child}")
        os.waitpid(child, 0)
        say("gone")


if __name__ == "__main__":
    main(sys.argv[1])
