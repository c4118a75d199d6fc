"""The house itself: one-way imports, generated files, lock files (SPEC H1, H3, H4, H5)."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from esker import contract_emit
from esker.bench import report

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "backend" / "esker"

# A room may import the rooms to its left and itself (DESIGN 2).
LAYERS: tuple[frozenset[str], ...] = (
    frozenset({"child_process", "contract", "fractal", "http_protocol", "link", "version", "websocket_protocol"}),
    frozenset({"contract_emit", "grid", "lakes"}),
    frozenset({"document"}),
    frozenset({"patchwork"}),
    frozenset({"importing"}),
    frozenset({"templates"}),
    frozenset({"solve", "tiles", "store", "settings", "synthesis"}),
    frozenset({"terrain_layers"}),
    frozenset({"session", "terrain", "exports"}),
    frozenset({"ground"}),
    frozenset(
        {"client", "client_history", "client_layers", "elevation", "imports", "tls", "headers", "upload", "render"}
    ),
    frozenset({"server"}),
    frozenset({"run"}),
    frozenset({"bench", "history_command", "export_command"}),
    frozenset({"cli"}),
    frozenset({"__main__"}),
)
RANK = {room: rank for rank, rooms in enumerate(LAYERS) for room in rooms}
# Rooms of one rank that may not see each other, and rooms that a lower-ranked one may never see.
FORBIDDEN = {("session", "solve"), ("tiles", "solve"), ("solve", "tiles"), ("store", "solve"), ("store", "tiles")}
FORBIDDEN |= {(room, "synthesis") for room in ("session", "tiles", "store")}
FORBIDDEN |= {("synthesis", room) for room in ("solve", "tiles", "store", "patchwork")}
FORBIDDEN |= {(room, other) for room in ("session", "tiles", "solve") for other in ("patchwork", "importing")}
ONLY = {
    "pyopencl": {"solve", "synthesis", "patchwork"},
    "numba": {"patchwork", "tiles"},
    "rasterio": {"importing", "exports"},
    "pyproj": {"importing"},
    "fastapi": {"server"},
    "starlette": {"server"},
    "moderngl": {"render"},
    "uvicorn": {"run", "http_protocol", "websocket_protocol"},
    "sqlite3": {"store"},
}


def modules() -> Iterator[tuple[str, Path]]:
    """Every module of the package with the room it belongs to."""
    for path in sorted(PACKAGE.rglob("*.py")):
        relative = path.relative_to(PACKAGE)
        room = relative.parts[0].removesuffix(".py")
        if room != "__init__":
            yield room, path


def imports(path: Path) -> Iterator[str]:
    """Dotted names of all modules that a file imports, at any depth of the code."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: relative import"
            if node.module == "esker":
                yield from (f"esker.{alias.name}" for alias in node.names)
            else:
                yield node.module


def violations(room: str, names: Iterator[str]) -> Iterator[str]:
    """What a file of ``room`` may not import."""
    for name in names:
        top, _, rest = name.partition(".")
        if top in ONLY and room not in ONLY[top] and room != "bench":
            yield f"{room} imports {top}"
        if top == "esker" and rest:
            target = rest.split(".")[0]
            if target not in RANK:
                continue
            if RANK[target] > RANK[room] or (room, target) in FORBIDDEN:
                yield f"{room} imports esker.{target}"


def test_every_room_has_a_rank() -> None:
    assert {room for room, _ in modules()} <= RANK.keys()


def test_imports_point_one_way() -> None:
    """SPEC H1."""
    found = [f"{path.relative_to(ROOT)}: {v}" for room, path in modules() for v in violations(room, imports(path))]
    assert found == []


@pytest.mark.parametrize(
    ("room", "name"),
    [("session", "esker.solve.solver"), ("document", "fastapi"), ("contract", "esker.grid"), ("tiles", "pyopencl")],
)
def test_the_import_rule_can_fail(room: str, name: str) -> None:
    assert list(violations(room, iter([name])))


def test_generated_files_are_fresh() -> None:
    """SPEC H3."""
    for path, text in contract_emit.outputs().items():
        assert path.read_text() == text, f"{path.relative_to(ROOT)} is stale: run `make generate`"


def test_import_touches_no_device() -> None:
    """SPEC H4: importing every module neither loads OpenCL nor starts a thread."""
    names = [
        ".".join(("esker", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")
        for room, path in modules()
        if room not in {"__main__", "bench"}
    ]
    code = (
        "import importlib, threading\n"
        f"for name in {names!r}: importlib.import_module(name)\n"
        "assert threading.active_count() == 1, threading.enumerate()\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


def test_lock_files_pin_every_requirement() -> None:
    """SPEC H5."""
    project = (ROOT / "pyproject.toml").read_text()
    block = project.split("dependencies = [", 1)[1].split("[project.scripts]")[0]
    wanted = {re.split(r"[;>=<\[ ]", name)[0].lower() for name in re.findall(r'^\s+"([^"]+)"', block, re.M)}
    locked = set(re.findall(r"^([a-z0-9-]+)==", (ROOT / "requirements-dev.lock").read_text(), re.M))
    assert wanted <= locked
    assert "http" not in (ROOT / "frontend" / "package-lock.json").read_text().split('"packages"')[0]


def test_figures_in_the_readme_come_from_committed_results() -> None:
    """CONTRIBUTING: figures in docs come from committed benchmark output."""
    text = report.README.read_text(encoding="utf-8")
    assert report.readme(text) == text, "run python -m esker.bench.report"


def test_file_sizes() -> None:
    """CONTRIBUTING: files stay near 400 lines, so that a newcomer finds the room of any line quickly."""
    suffixes = {".py", ".ts", ".cl", ".wgsl"}
    roots = ("backend", "frontend/src", "shaders", "tests")
    long = {
        str(path.relative_to(ROOT)): count
        for root in roots
        for path in (ROOT / root).rglob("*")
        if path.suffix in suffixes and "generated" not in path.parts
        for count in [len(path.read_text().splitlines())]
        if count > 520
    }
    assert long == {}
