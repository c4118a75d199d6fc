"""``esker list`` and ``esker link``: what a server on this computer keeps, and the way in, for its owner."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from esker.contract import Role
from esker.keeper.private import Private
from esker.server.settings import BadSetting, from_environment
from esker.store.access import Access, TooManyLinks
from esker.store.engine.ports import BadDatabase, Unreachable
from esker.store.kept import Visit, all_kept, count_kept, kept_one

LINK_NAME: Final = "Made at the server's computer"
PAGE: Final = 100


def main(argv: list[str]) -> int:
    """``argv``: from the command's name on. Returns the exit status."""
    command, arguments = argv[0], argv[1:]
    parser = argparse.ArgumentParser(prog=f"esker {command}", description=_WORDS[command])
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder of the database (default ./data)")
    if command == "link":
        parser.add_argument("terrain", nargs="?", metavar="TERRAIN", help="its id, as `esker list` prints it "
                            "(default: the terrain that the server's start printed)")  # fmt: skip
        parser.add_argument(
            "--role", choices=("owner", "edit", "view"), help="what the new link allows (default owner)"
        )
    parsed = parser.parse_args(arguments)
    try:
        settings = from_environment(data=parsed.data)
        # A folder that is named says which server is meant, as one whose database is a file.
        database = "" if parsed.data is not None else settings.database
        with Visit(settings.data, database) as visit:
            parsed.public_url = settings.public_url or ""
            return _RUN[command](visit, Private(settings.data), parsed)
    except (FileNotFoundError, BadSetting, KeyError, ValueError, BadDatabase, Unreachable) as error:
        message = str(error.args[0])
    except TooManyLinks:
        message = "This terrain has too many links. Revoke some on its page."
    except OSError as error:
        message = str(error)
    sys.stderr.write(f"esker: {message}\n")
    return 1


def _list(visit: Visit, private: Private, parsed: argparse.Namespace) -> int:  # noqa: ARG001
    content = private.read()
    shown = content.lesson.terrain if content is not None and content.lesson is not None else ""
    total = count_kept(visit)
    for skip in range(0, total, PAGE):
        for kept in all_kept(visit, skip, PAGE):
            when = time.strftime("%Y-%m-%d %H:%M", time.localtime(kept.changed))
            changes = f"{kept.clock} change{'' if kept.clock == 1 else 's'}"
            last = "  (printed at the start)" if kept.id == shown else ""
            sys.stdout.write(f"{kept.id:<14} {when}  {changes:>14}  {kept.title or 'untitled'}{last}\n")
    if total == 0:
        sys.stdout.write("This server keeps no terrain yet.\n")
    return 0


def _link(visit: Visit, private: Private, parsed: argparse.Namespace) -> int:
    content = private.read()
    base = content.base if content is not None else parsed.public_url.rstrip("/")
    if parsed.terrain is None and parsed.role is None:
        if content is None or content.lesson is None:
            raise KeyError("No server has started on this data folder yet. `esker list` names its terrains.")
        lesson = content.lesson
        sys.stdout.write(f"PRIVATE, you own it:       {base}/t/{lesson.terrain}#{lesson.owner}\n")
        sys.stdout.write(f"PRIVATE, all terrains:     {base}/server#{content.key}\n")
        sys.stdout.write(f"For everybody (can draw):  {base}/t/{lesson.terrain}#{lesson.edit}\n")
        return 0
    terrain = parsed.terrain or (content.lesson.terrain if content is not None and content.lesson is not None else "")
    if kept_one(visit, terrain) is None:
        raise KeyError(f"There is no terrain {terrain!r} here. `esker list` names those that there are.")
    role: Role = parsed.role or "owner"
    _, secret = Access(visit).add(terrain, role, LINK_NAME).result()
    sys.stdout.write(f"{base}/t/{terrain}#{secret}\n")
    return 0


_WORDS: Final = {
    "list": "Lists the terrains that the server of a data folder keeps, the last changed first: id, when it was "
    "changed, number of changes, title. The server may be running. Where ESKER_DATABASE names a shared database and "
    "--data nothing, those of all its servers.",
    "link": "Prints the private links of the terrain that the server's start printed; with TERRAIN or --role it makes "
    "a new link to a terrain. Whoever may read the data folder may open everything in it.",
}
_RUN: Final[dict[str, Callable[[Visit, Private, argparse.Namespace], int]]] = {"list": _list, "link": _link}
