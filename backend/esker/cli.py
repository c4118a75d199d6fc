"""``esker serve | import | history | fork | solve | export | render | bench | --version``; also ``python -m esker``."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import logging
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from esker import contract as c
from esker.version import VERSION

if TYPE_CHECKING:
    from esker.patchwork.base import Base

NOT_MEASURED: Final = frozenset(
    {"gallery", "gpu_model", "plots", "report", "synthesis_plots", "synthesis_statistics"}
)  # fmt: skip
"""Modules beside the benchmarks that write scenes, sections and pictures: ``python -m esker.bench.NAME``."""


def main(argv: list[str] | None = None) -> int:
    """Runs a command; returns the exit status."""
    arguments = sys.argv[1:] if argv is None else argv
    # What follows such a name belongs to that command, options and --help included.
    if arguments[:1] == ["import"]:
        return _run("esker.importing.command", arguments[1:])
    if arguments[:1] in (["history"], ["fork"]):
        return _run("esker.history_command", arguments)
    if arguments[:1] == ["solve"]:
        return _run("esker.solve.command", arguments[1:], _base_of)
    if arguments[:1] == ["export"]:
        return _run("esker.export_command", arguments[1:])
    if arguments[:1] == ["render"]:
        return _run("esker.render.command", arguments[1:])
    if arguments[:1] == ["bench"] and len(arguments) > 1 and not arguments[1].startswith("-"):
        return _bench(arguments[1], arguments[2:])
    parsed = _parser().parse_args(arguments)
    if parsed.command == "serve":
        return _serve(parsed)
    if parsed.command == "bench":
        sys.stdout.write("".join(f"{name}\n" for name in _benches()))
        return 0
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
    serve.add_argument("--public-url", metavar="URL", help="where people reach this server, behind a proxy")
    serve.add_argument("--level", type=int, help=f"finest solved level, 0 to {c.MAX_LEVEL} (default {c.DEFAULT_LEVEL})")
    serve.add_argument("--refine", type=int, metavar="LEVEL", help="finest level made where somebody looks, "
                       f"0 to {c.MAX_REFINED_LEVEL} (default {c.DEFAULT_REFINED_LEVEL})")  # fmt: skip
    serve.add_argument("--device", help="part of the name of the OpenCL device, or numpy")
    serve.add_argument("--threads", type=int, help="threads of a CPU device (default: all cores)")
    serve.add_argument("--log-level", choices=("debug", "info", "warning", "error"))
    commands.add_parser("import", help="bring in elevation files (see esker import --help)", add_help=False)
    commands.add_parser("history", help="what people did on a terrain (see esker history --help)", add_help=False)
    commands.add_parser("fork", help="a new terrain as one was at a clock (see esker fork --help)", add_help=False)
    commands.add_parser("solve", help="solve a terrain file into heights (see esker solve --help)", add_help=False)
    commands.add_parser("export", help="a terrain for other programs (see esker export --help)", add_help=False)
    commands.add_parser("render", help="draw a terrain: pictures, turntables (see esker render --help)", add_help=False)
    commands.add_parser("bench", help="measure: esker bench NAME --json (without NAME: the list)",
                        usage="esker bench [NAME [OPTIONS]]", description="Without NAME: lists the benchmarks. "
                        "esker bench NAME --help says what one measures.")  # fmt: skip
    return parser


def _serve(parsed: argparse.Namespace) -> int:
    from esker.settings import BadSetting, from_environment

    try:
        settings = from_environment(**{k: v for k, v in vars(parsed).items() if k != "command"})
    except BadSetting as error:
        return _fail(str(error))
    logging.basicConfig(
        level=settings.log_level.upper(), format="%(asctime)s %(levelname).1s %(name)s: %(message)s", stream=sys.stderr
    )
    logging.getLogger("uvicorn").setLevel("WARNING")
    from esker.run import CannotServe, serve
    from esker.store.journal import CorruptDatabase

    try:
        serve(settings)
    except (CannotServe, CorruptDatabase) as error:
        return _fail(str(error))
    except OSError as error:
        return _fail(f"Cannot use the data folder {settings.data}: {error}")
    return 0


def _benches() -> list[str]:
    folder = Path(__file__).parent / "bench"
    return sorted({path.stem for path in folder.glob("*.py") if not path.stem.startswith("_")} - NOT_MEASURED)


def _bench(name: str, argv: list[str]) -> int:
    if name not in _benches():
        return _fail(f"There is no benchmark {name!r}. There are: {', '.join(_benches())}.")
    return _run(f"esker.bench.{name}", argv)


def _base_of(document: c.Document, data: bytes) -> Base | None:
    """The ground of the elevation layers of a terrain file. Raises ValueError."""
    from esker.terrain_layers import Patchwork, unpacked

    if not document.layers:
        return None
    grids = unpacked(data) if data[:2] == b"PK" else {}
    return Patchwork(document.settings.size_m, document.layers, grids).base


def _run(module: str, argv: list[str], *more: object) -> int:
    if importlib.util.find_spec(module) is None:
        return _fail(f"This installation lacks {module}.")
    result: int = importlib.import_module(module).main(argv, *more)
    return result


def _fail(message: str) -> int:
    sys.stderr.write(f"esker: {message}\n")
    return 1
