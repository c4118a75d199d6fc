"""``esker move``: takes all terrains of a server from one database to another, both ways (``store/upkeep/move.py``)."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from esker.patchwork.raster.rasters import RasterError
from esker.store.engine.lock import InUse
from esker.store.engine.objects import NoObjects, Objects
from esker.store.engine.ports import BadDatabase, Unwritable
from esker.store.grids import GridStore
from esker.store.upkeep.inspection import CorruptDatabase
from esker.store.upkeep.move import CannotMove, finish, move
from esker.store.upkeep.place import Place


def main(argv: list[str]) -> int:
    """Runs the command; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="esker move",
        description="Copies all terrains, links and classes from one place to another, and their elevation grids where "
        "the places have them apart. Both servers must be stopped. The source stays as it is; what was copied is "
        "compared with it. Cut off, it goes on where it was when it is run again.",
        epilog="A place is a data folder or postgresql://user:password@host/name.",
    )
    parser.add_argument("--from", dest="source", required=True, metavar="PLACE", help="where the terrains are")
    parser.add_argument("--to", dest="target", required=True, metavar="PLACE", help="an empty one")
    parser.add_argument(
        "--grids",
        default=os.environ.get("ESKER_BLOBS", ""),
        metavar="PLACE",
        help="where the grids of a PostgreSQL database are: s3://bucket/prefix, or the data folder of its server "
        "(default ESKER_BLOBS)",
    )
    parsed = parser.parse_args(argv)
    try:
        return _move(parsed.source, parsed.target, parsed.grids)
    except (CannotMove, BadDatabase, CorruptDatabase, InUse, Unwritable, RasterError, OSError) as error:
        text = str(error)
        sys.stderr.write(f"\nesker: {text}{'' if text.endswith('.') else '.'}\n")
        return 1


def _move(named: str, target_named: str, grids: str) -> int:
    with ExitStack() as stack:
        source = stack.enter_context(Place(named, is_there=True))
        target = stack.enter_context(Place(target_named, is_there=False))
        done = move(source.journal, target.journal, source.name, _tell)
        named_grids = sorted(target.journal.grids())
        ends = _grids_of(source, grids, stack), _grids_of(target, grids, stack)
        missing: list[str] = []
        moved_grids = 0
        if ends[0] is not None and ends[1] is not None and ends[0].folder != ends[1].folder:
            moved_grids, missing = _copy_grids(ends[0], ends[1], named_grids)
        finish(source.journal, target.journal)
    where = f"{target.name}, as they are in {source.name}"
    sys.stdout.write(f"{done.terrains} terrains are in {where}: compared by digest.\n")
    if done.before:
        sys.stdout.write(f"{done.before} of them were there before.\n")
    if moved_grids:
        sys.stdout.write(f"{moved_grids} elevation grids were copied and verified.\n")
    elif named_grids and None in ends:
        sys.stdout.write(f"{len(named_grids)} elevation grids stay where they are: serve with that data folder.\n")
    if missing:
        sys.stdout.write(f"{len(missing)} elevation grids are nowhere: {', '.join(missing)}.\n")
    return 0


def _grids_of(place: Place, named: str, stack: ExitStack) -> GridStore | None:
    """The grids of a place; None where nobody said where they are. ``stack``: ends what was made for it."""
    if place.folder is not None:
        return GridStore(place.folder)
    if named.startswith("s3://"):
        cache = stack.enter_context(tempfile.TemporaryDirectory(prefix="esker-grids-"))
        return GridStore(Path(cache), objects=Objects(named))
    if "://" in named:
        raise NoObjects("--grids must be s3://bucket/prefix or a data folder.")
    return GridStore(Path(named)) if named else None


def _copy_grids(source: GridStore, target: GridStore, digests: list[str]) -> tuple[int, list[str]]:
    """Puts grids that are not there yet into the target; returns how many, and those that the source has not."""
    count, missing = 0, []
    for done, digest in enumerate(digests):
        _tell(done, len(digests), "grids")
        if target.has(digest):
            continue
        if not source.has(digest):
            missing.append(digest)
            continue
        target.put(source.verified(digest))
        count += 1
    _tell(len(digests), len(digests), "grids")
    return count, missing


def _tell(done: int, of: int, what: str = "terrains") -> None:
    end = "\n" if done == of else ""
    sys.stderr.write(f"\r{done} of {of} {what}{end}")
    sys.stderr.flush()
