"""``esker history LINK`` and ``esker fork LINK``: what people did on a terrain, and copies of it as it was."""

from __future__ import annotations

import argparse
import itertools
import ssl
import sys
import time
from collections.abc import Callable
from pathlib import Path

from esker.api.link import Refused
from esker.api.live.history import HistoryReader


def main(argv: list[str]) -> int:
    """``argv``: from the command's name on. Returns the exit status."""
    command, arguments = argv[0], argv[1:]
    parser = argparse.ArgumentParser(prog=f"esker {command}", description=_WORDS[command])
    parser.add_argument("link", metavar="LINK", help="link to the terrain, http://host/t/terrain#secret")
    parser.add_argument("--ca-file", type=Path, help="esker-ca.pem of a server in the local network")
    _OPTIONS[command](parser)
    parsed = parser.parse_args(arguments)
    try:
        tls = None if parsed.ca_file is None else ssl.create_default_context(cafile=parsed.ca_file)
        return _RUN[command](HistoryReader(parsed.link, tls), parsed)
    except Refused as error:
        message = str(error)
    except ValueError as error:
        message = f"{parsed.link}: {error}"
    except OSError as error:
        message = f"The server cannot be reached: {error}"
    sys.stderr.write(f"esker: {message}\n")
    return 1


def _history_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--before", type=int, metavar="CLOCK", help="only what had ended before this clock")
    parser.add_argument("--most", type=int, default=50, metavar="N", help="so many entries at most (default 50)")


def _fork_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--at", type=int, metavar="CLOCK", help="as the terrain was at this clock (default: now)")
    parser.add_argument("--title", help="title of the new terrain (default: Copy of ...)")


def _history(reader: HistoryReader, parsed: argparse.Namespace) -> int:
    for event in itertools.islice(reader.events(parsed.before), max(0, parsed.most)):
        when = "" if event.at is None else time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(event.at))
        sys.stdout.write(f"{event.last:>8}  {when:19}  {event}\n")
    return 0


def _fork(reader: HistoryReader, parsed: argparse.Namespace) -> int:
    sys.stdout.write(f"{reader.fork(parsed.at, parsed.title)}\n")
    return 0


_WORDS = {
    "history": "Lists what people did on a terrain, newest first: the clock, when, who and what.",
    "fork": "Makes a new terrain as this one was, and prints its owner link.",
}
_OPTIONS: dict[str, Callable[[argparse.ArgumentParser], None]] = {"history": _history_options, "fork": _fork_options}
_RUN: dict[str, Callable[[HistoryReader, argparse.Namespace], int]] = {"history": _history, "fork": _fork}
