"""``esker restore``: goes on with a copy of the database after damage or loss (``store/upkeep/restore.py``)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from esker.server.settings import from_environment
from esker.store.engine.lock import InUse
from esker.store.upkeep.restore import CannotRestore, Restored, restore


def main(argv: list[str]) -> int:
    """Runs the command; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="esker restore",
        description="Puts a copy of the database in the place of a damaged or lost one. The server must be stopped. "
        "What was there before is kept in a folder beside it; nothing is deleted.",
    )
    parser.add_argument("copy", nargs="?", type=Path, help="which copy (default: the newest that can be read)")
    parser.add_argument("--data", type=Path, help="the server's folder (default ./data, or ESKER_DATA)")
    parsed = parser.parse_args(argv)
    data = from_environment(data=parsed.data).data
    try:
        done = restore(data, parsed.copy)
    except (CannotRestore, InUse, OSError) as error:
        sys.stderr.write(f"esker: {error}\n")
        return 1
    sys.stdout.write(_report(done))
    return 0


def _report(done: Restored) -> str:
    lines = [f"Restored from {done.copy}: {done.terrains} terrains, {done.ops} operations."]
    if done.aside is not None:
        lines.append(f"What was there before is in {done.aside}.")
    if done.missing_grids:
        lines.append(f"{len(done.missing_grids)} elevation grids are nowhere: {', '.join(done.missing_grids)}.")
    return "\n".join(lines) + "\n"
