"""``esker serve`` and its sister commands: ``esker --help`` lists them."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import logging
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from esker import contract as c
from esker import resources
from esker.process import caches, garbage, system
from esker.version import VERSION

if TYPE_CHECKING:
    from esker.patchwork.base import Base

NOT_MEASURED: Final = frozenset({"gpu_model", "plots", "report", "synthesis_plots", "synthesis_statistics"})
"""Modules beside the benchmarks that write sections and pictures: ``python -m bench.ROOM.NAME``."""
NEEDS_CHECKOUT: Final = "Benchmarks need what only a checkout of Esker's sources has (git clone, make run)."
PRIVATE_UMASK: Final = 0o077
"""Mask of the files that the server writes: nobody else on this computer may read them."""


def main(argv: list[str] | None = None) -> int:
    """Runs a command; returns the exit status."""
    system.speak_utf8()
    arguments = sys.argv[1:] if argv is None else argv
    # Arguments after such a name belong to that command, options and --help included.
    if arguments[:1] == ["import"]:
        return _run("esker.cli.import_files", arguments[1:])
    if arguments[:1] == ["restore"]:
        return _run("esker.cli.restore", arguments[1:])
    if arguments[:1] == ["move"]:
        return _run("esker.cli.move", arguments[1:])
    if arguments[:1] in (["list"], ["link"]):
        return _run("esker.cli.keep", arguments)
    if arguments[:1] in (["history"], ["fork"]):
        return _run("esker.cli.history", arguments)
    if arguments[:1] == ["solve"]:
        return _run("esker.cli.solve", arguments[1:], _base_of)
    if arguments[:1] == ["export"]:
        return _run("esker.cli.export", arguments[1:])
    if arguments[:1] == ["flow"]:
        return _run("esker.cli.flow", arguments[1:])
    if arguments[:1] == ["render"]:
        return _run("esker.cli.render", arguments[1:])
    if arguments[:1] == ["doctor"]:
        return _run("esker.cli.doctor", arguments[1:])
    if arguments[:1] == ["bench"] and len(arguments) > 1 and not arguments[1].startswith("-"):
        return _bench(arguments[1], arguments[2:])
    parsed = _parser().parse_args(arguments)
    if parsed.command == "serve":
        return _serve(parsed)
    if parsed.command == "bench":
        return _list_benchmarks()
    _parser().print_help()
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="esker", description="Sketch one terrain together.")
    parser.add_argument("--version", action="version", version=f"esker {VERSION}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    serve = commands.add_parser("serve", help="run the server", description="Run the server. Every option has an "
                                "environment variable: --port is ESKER_PORT, and so on.")  # fmt: skip
    serve.add_argument("--host", help="address to listen on (default 127.0.0.1)")
    serve.add_argument("--port", type=int, help="port to listen on (default 8000; 0: any free one)")
    serve.add_argument("--data", type=Path, metavar="DIR", help="folder of the database (default ./data)")
    serve.add_argument("--lan", action="store_true", default=None, help="HTTPS for every device on this network")
    serve.add_argument("--new", dest="new_terrain", action="store_true", default=None,
                       help="begin a new terrain (default: print the one of the last start again)")  # fmt: skip
    serve.add_argument("--public-url", metavar="URL", help="where people reach this server, behind a proxy")
    serve.add_argument("--level", type=int, help=f"finest solved level, 0 to {c.MAX_LEVEL} (default {c.DEFAULT_LEVEL})")
    serve.add_argument("--refine", type=int, metavar="LEVEL", help="finest level made where somebody looks, "
                       f"0 to {c.MAX_REFINED_LEVEL} (default {c.DEFAULT_REFINED_LEVEL})")  # fmt: skip
    serve.add_argument("--device", help="part of the name of the OpenCL device, or numpy")
    serve.add_argument("--threads", type=int, help="threads of a CPU device (default: all cores)")
    serve.add_argument("--node", metavar="NAME", help="this server's name among several over one database "
                       "(ESKER_DATABASE, ESKER_CLUSTER_KEY; docs/operations.md)")  # fmt: skip
    serve.add_argument("--advertise", metavar="URL", help="where the other nodes reach this one")
    serve.add_argument("--log-level", choices=("debug", "info", "warning", "error"))
    commands.add_parser("restore", help="go on with a copy of the database (see esker restore --help)", add_help=False)
    commands.add_parser("move", help="take all terrains to another database (see esker move --help)", add_help=False)
    commands.add_parser("list", help="the terrains that a server keeps (see esker list --help)", add_help=False)
    commands.add_parser("link", help="links to a terrain of this computer (see esker link --help)", add_help=False)
    commands.add_parser("import", help="bring in elevation files (see esker import --help)", add_help=False)
    commands.add_parser("history", help="what people did on a terrain (see esker history --help)", add_help=False)
    commands.add_parser("fork", help="a new terrain as one was at a clock (see esker fork --help)", add_help=False)
    commands.add_parser("solve", help="solve a terrain file into heights (see esker solve --help)", add_help=False)
    commands.add_parser("export", help="a terrain for other programs (see esker export --help)", add_help=False)
    commands.add_parser("flow", help="the rivers of a terrain as lines (see esker flow --help)", add_help=False)
    commands.add_parser("render", help="draw a terrain: pictures, turntables (see esker render --help)", add_help=False)
    commands.add_parser("doctor", help="what this machine has and lacks (see esker doctor --help)", add_help=False)
    commands.add_parser("bench", help="measure: esker bench NAME --json (without NAME: the list)",
                        usage="esker bench [NAME [OPTIONS]]", description="Without NAME: lists the benchmarks. "
                        "esker bench NAME --help says what one measures.")  # fmt: skip
    return parser


def _serve(parsed: argparse.Namespace) -> int:
    from esker.server.settings import BadSetting, from_environment

    try:
        settings = from_environment(**{k: v for k, v in vars(parsed).items() if k != "command"})
    except BadSetting as error:
        return _fail(str(error))
    logging.basicConfig(
        level=settings.log_level.upper(), format="%(asctime)s %(levelname).1s %(name)s: %(message)s", stream=sys.stderr
    )
    logging.getLogger("uvicorn").setLevel("WARNING")
    from esker.server import starting
    from esker.store.upkeep.inspection import CorruptDatabase

    os.umask(PRIVATE_UMASK)
    caches.keep_in(settings.data)
    stopping = starting.Stopping()
    try:
        system.on_stop(stopping)
        door = starting.FrontDoor(settings)
        with starting.WaitingRoom(door.listener, door.context, sys.stdout) as room:
            with garbage.importing():
                from esker.server.run import serve  # this takes a second, in which the door already listens

            serve(settings, door, room, stopping)
    except BaseException as error:
        if stopping.asked:
            sys.stderr.write("esker: stopped before it was ready\n")
        elif isinstance(error, (starting.CannotServe, CorruptDatabase)):
            return _fail(str(error))
        elif isinstance(error, OSError):
            return _fail(f"Cannot use the data folder {settings.data}: {error}")
        else:
            raise
    return 0


def benchmarks() -> dict[str, str]:
    """Module of each benchmark by its name. They lie beside their results in a checkout, not in the package."""
    modules = sorted((resources.sources() / "bench").glob("*/*.py"))
    found = {path.stem: f"bench.{path.parent.name}.{path.stem}" for path in modules}
    return {name: module for name, module in found.items() if name[0] != "_" and name not in NOT_MEASURED}


def _list_benchmarks() -> int:
    if not resources.has_benchmarks():
        return _fail(NEEDS_CHECKOUT)
    sys.stdout.write("".join(f"{name}\n" for name in sorted(benchmarks())))
    return 0


def _bench(name: str, argv: list[str]) -> int:
    if not resources.has_benchmarks():
        return _fail(NEEDS_CHECKOUT)
    module = benchmarks().get(name)
    if module is None:
        return _fail(f"There is no benchmark {name!r}. There are: {', '.join(sorted(benchmarks()))}.")
    try:
        return _run(module, argv)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] in ("esker", "bench"):
            raise
        return _fail(f"The benchmark {name!r} needs a package that is not installed: {error.name}.")


def _base_of(document: c.Document, data: bytes) -> Base | None:
    """The ground of the elevation layers of a terrain file. Raises ValueError."""
    from esker.api.layers import Patchwork, unpacked

    if not document.layers:
        return None
    grids = unpacked(data) if data[:2] == b"PK" else {}
    return Patchwork(document.settings, document.layers, grids).base


def _run(module: str, argv: list[str], *more: object) -> int:
    if importlib.util.find_spec(module) is None:
        return _fail(f"This installation lacks {module}.")
    with garbage.importing():
        command = importlib.import_module(module)
    result: int = command.main(argv, *more)
    return result


def _fail(message: str) -> int:
    sys.stderr.write(f"esker: {message}\n")
    return 1
