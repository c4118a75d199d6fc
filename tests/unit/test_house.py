"""The house itself: one-way imports, generated files, lock files (SPEC H1, H3, H4, H5)."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Set
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from bench import report
from esker.contract import emit
from tests.unit.sources import statements

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "backend" / "esker"

# A room may import the rooms to its left and itself (DESIGN 2).
LAYERS: tuple[frozenset[str], ...] = (
    frozenset({"compiled", "errors", "fairness", "process", "resources", "version", "wgsl"}),
    frozenset({"contract"}),
    frozenset({"events", "grid"}),
    frozenset({"flow"}),
    frozenset({"document", "patchwork", "synthesis", "tasks", "tiles"}),
    frozenset({"importing", "solve", "store"}),
    frozenset({"exporting", "session"}),
    frozenset({"api", "cluster", "jobs", "keeper", "lesson"}),
    frozenset({"render", "templates"}),
    frozenset({"server"}),
    frozenset({"cli", "doctor", "__main__"}),
)
RANK = {room: rank for rank, rooms in enumerate(LAYERS) for room in rooms}
# Rooms of one rank that may not see each other, and rooms that a lower-ranked one may never see.
FORBIDDEN = {("session", "solve"), ("tiles", "solve"), ("solve", "tiles"), ("store", "solve"), ("store", "tiles")}
FORBIDDEN |= {(room, "synthesis") for room in ("session", "tiles", "store")}
FORBIDDEN |= {("synthesis", room) for room in ("solve", "tiles", "store", "patchwork")}
FORBIDDEN |= {(room, other) for room in ("session", "tiles", "solve") for other in ("patchwork", "importing")}
ONLY = {
    "pyopencl": {"solve", "synthesis", "patchwork"},
    "numba": {"compiled", "patchwork"},
    "rasterio": {"importing", "exporting"},
    "pyproj": {"importing"},
    "fastapi": {"server"},
    "starlette": {"server"},
    "moderngl": {"render"},
    "uvicorn": {"server"},
    "sqlite3": {"store"},
}


def modules() -> Iterator[tuple[str, Path]]:
    """Every module of the package with the room it belongs to."""
    for path in sorted(PACKAGE.rglob("*.py")):
        relative = path.relative_to(PACKAGE)
        room = relative.parts[0].removesuffix(".py")
        if room != "__init__":
            yield room, path


@cache
def importing(path: Path) -> list[ast.Import | ast.ImportFrom]:
    """The statements with which a file imports, at any depth of the code. Several tests ask for them."""
    found = statements(ast.parse(path.read_text(encoding="utf-8")))
    return [node for node in found if isinstance(node, ast.Import | ast.ImportFrom)]


def imports(path: Path) -> Iterator[str]:
    """Dotted names of all modules that a file imports."""
    for node in importing(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif node.module:
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


def ranks(text: str) -> tuple[frozenset[str], ...]:
    """The ranks that a text gives: names in backquotes, with an arrow between two ranks."""
    chain = re.search(r"`\w+`(?:[\s,←]+`\w+`)+", text)
    assert chain is not None
    return tuple(frozenset(re.findall(r"`(\w+)`", rank)) for rank in chain[0].split("←"))


def test_documents_give_the_ranks_that_are_kept() -> None:
    """SPEC H514."""
    kept = tuple(rooms - {"__main__"} for rooms in LAYERS)
    for path, start in (("tests/SPEC.md", "- **H1** "), ("docs/design.md", "- **Imports point one way.** ")):
        text = (ROOT / path).read_text(encoding="utf-8").split(start, 1)[1]
        assert ranks(text[text.index("`compiled`") :]) == kept, path
    assert ranks("`a`, `b` ←\n`c`") == (frozenset({"a", "b"}), frozenset({"c"}))


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


def knows_people(room: str, names: Iterator[str]) -> list[str]:
    """What a file of ``session/ground`` may not import."""
    return [name for name in names if room == "ground" and f"{name}.".startswith("esker.session.room.")]


def test_the_ground_of_a_room_knows_no_people() -> None:
    """SPEC H460."""
    paths = sorted((PACKAGE / "session").rglob("*.py"))
    assert [found for path in paths for found in knows_people(path.parent.name, imports(path))] == []
    assert any(path.parent.name == "ground" for path in paths)
    assert knows_people("ground", iter(["esker.session.room.core", "esker.session.ground.jobs"])) == [
        "esker.session.room.core"
    ]


def test_what_has_a_code_for_programs_has_one_base() -> None:
    """SPEC H427: exceptions with a ``code`` are ``EskerError``s; none is made from ``Exception`` by itself."""
    apart = []
    for room, path in modules():
        source = path.read_text(encoding="utf-8")
        # Few files have it: a class is made to text again only in these.
        for node in statements(ast.parse(source)) if "self.code" in source else ():
            if room != "errors" and isinstance(node, ast.ClassDef) and "self.code" in ast.unparse(node):
                bases = {ast.unparse(base) for base in node.bases}
                apart += [f"{path.name}: {node.name}"] if bases & {"Exception", "RuntimeError", "ValueError"} else []
    assert apart == []


MOST_NAMES = 16
"""Names that a folder shows: what one looks through in half a minute."""
WIDE = {"backend/esker": "the list of all rooms"}


def crowded(folders: dict[str, int]) -> dict[str, int]:
    """Folders with more names than one looks through."""
    return {folder: count for folder, count in folders.items() if count > MOST_NAMES and folder not in WIDE}


def test_folders_are_looked_through_in_half_a_minute() -> None:
    """SPEC H490: rooms within rooms. Tests are looked for by the name of what they test, not looked through."""
    counts: dict[str, int] = {}
    for root in ("backend/esker", "bench", "shaders"):
        for folder in [ROOT / root, *(path for path in (ROOT / root).rglob("*") if path.is_dir())]:
            if (
                "__pycache__" not in folder.parts
                and "results" not in folder.parts
                and "node_modules" not in folder.parts
            ):
                names = [path.name for path in folder.iterdir() if path.name not in ("__pycache__", "__init__.py")]
                counts[folder.relative_to(ROOT).as_posix()] = len(names)
    assert crowded(counts) == {}
    assert crowded({"backend/esker/solve": MOST_NAMES + 1}) != {}


def files_and_imports() -> dict[str, set[str]]:
    """Modules of the package and of the benchmarks by name, with those of them that each imports."""
    folders = ((PACKAGE, ROOT / "backend"), (ROOT / "bench", ROOT))
    paths = {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): path
        for folder, root in folders
        for path in folder.rglob("*.py")
    }
    return {name: set(imported(path, paths.keys())) - {name} for name, path in paths.items()}


def imported(path: Path, known: Set[str]) -> Iterator[str]:
    """Those of the known modules that a file imports, for types too."""
    for node in importing(path):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                yield from {name if name in known else node.module} & known
        elif isinstance(node, ast.Import):
            yield from {alias.name for alias in node.names} & known


def circle(graph: dict[str, set[str]]) -> list[str]:
    """One circle of a graph, or nothing."""
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        return list(error.args[1])
    return []


def test_files_import_each_other_in_no_circle() -> None:
    """SPEC H491: for types neither; whoever reads a file has read, or can read first, all that it stands on."""
    assert circle(files_and_imports()) == []
    assert circle({"a": {"b"}, "b": {"a"}}) != []


def unnamed(files: dict[str, str]) -> list[str]:
    """Functions, classes and constants of modules by text that stand nowhere but where they are defined."""
    words = Counter(word for text in files.values() for word in re.findall(r"\w+", text))
    found = []
    for path, text in files.items():
        for node in ast.parse(text).body if path.endswith(".py") else ():
            names: list[str] = []
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                names = [node.name]
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                names = [each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)]
            found += [f"{path}: {name}" for name in names if words[name] == 1]
    return found


def test_nothing_stands_unnamed() -> None:
    """SPEC H574: what nobody calls or reads goes. The contract is written out for other languages, all of it."""
    folders = PACKAGE, ROOT / "bench", ROOT / "tests"
    paths = [path for folder in folders for path in folder.rglob("*.py")]
    texts = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}
    ours = ("backend/esker/contract/", "tests/")
    assert [each for each in unnamed(texts) if not each.startswith(ours)] == []
    assert unnamed({"a.py": "A = 1\ndef b(): return c\n", "c.py": "from a import b\nclass c: pass\n"}) == ["a.py: A"]


def test_generated_files_are_fresh() -> None:
    """SPEC H3."""
    for path, text in emit.outputs().items():
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
    assert report.readme(text) == text, "run python -m bench.report"


FOLDERS = {".ci", "backend", "bench", "docs", "frontend", "shaders", "tests"}
FILES = re.compile(r"""[A-Z]+(\.md|\.in)?|Caddyfile(\.cluster)?|Dockerfile|Makefile|build\.in
    |docker-compose(\.cluster)?\.yml|node\.lock|pyproject\.toml|requirements(-dev|-cluster)?\.lock|setup\.py
    |\.dockerignore|\.gitignore""", re.VERBOSE)  # fmt: skip
MOST_BYTES = 2 * 1024 * 1024


def strangers(files: dict[str, int]) -> set[str]:
    """Committed files that have no place here: of no known name at the top, or too big for a source."""
    return {
        path
        for path, size in files.items()
        for top, within, _ in [path.partition("/")]
        if size > MOST_BYTES or not (top in FOLDERS if within else FILES.fullmatch(top))
    }


def test_what_is_committed_has_a_place() -> None:
    """SPEC H506: sixteen downloaded packages lay at the top level for a day, 21 MB of them."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    paths = [path for path in listed.stdout.decode().split("\0") if path and (ROOT / path).is_file()]
    assert strangers({path: (ROOT / path).stat().st_size for path in paths}) == set()
    assert strangers({"numpy-2.4.6.whl": 1, "docs/film.mp4": MOST_BYTES + 1}) == {"numpy-2.4.6.whl", "docs/film.mp4"}


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
