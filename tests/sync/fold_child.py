"""Folding beside a writer in processes that are killed: a process that forks one for each line it reads.

``python -m tests.sync.fold_child``: for each line ``DATA FIRST`` a fork folds terrain "t" in short stretches and
appends ops u:FIRST, u:FIRST+1 … to terrain "u"; it writes ``fold`` for each stretch that is done and the counter of
each op that is acknowledged. ``gone`` follows when it has ended.
"""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

from esker.document.history.folding import SILENT
from esker.store.journal import Journal, Row
from esker.store.upkeep import compaction
from esker.store.upkeep.compaction import Compaction

PIECE = 20


def life(data: Path, first: int) -> None:
    """Runs until it is killed."""
    compaction.PIECE = PIECE  # type: ignore[misc]
    journal = Journal(data)
    clock = journal.newest("u")

    def append() -> None:
        counter, at = first, clock
        while True:
            at += 1
            journal.append("u", [Row(at, "u", counter, "u", SILENT)]).result()
            os.write(1, f"{counter}\n".encode())
            counter += 1

    threading.Thread(target=append, daemon=True).start()
    folding = Compaction(journal, lambda: 2e9, pause=lambda _: None)
    for _ in folding._fold("t"):
        os.write(1, b"fold\n")
    threading.Event().wait()


def main() -> None:
    """One fork for each line."""
    for line in sys.stdin:
        folder, first = line.rsplit(" ", 1)
        child = os.fork()
        if child == 0:
            life(Path(folder), int(first))
        os.write(2, f"{child}\n".encode())
        os.waitpid(child, 0)
        os.write(1, b"gone\n")


if __name__ == "__main__":
    main()
