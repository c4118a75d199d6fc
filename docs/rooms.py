"""Writes the tables of rooms in CONTRIBUTING.md from the first sentence of each room: ``python docs/rooms.py``.

A package of the backend says what it owns in the docstring of its ``__init__.py``, a module beside the packages in its
own, a folder of the page or of shaders in its README. ``make generate`` runs this, and a test compares.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "CONTRIBUTING.md"
BEGIN, END = "<!-- rooms: written by `python docs/rooms.py` -->\n", "<!-- end of rooms -->\n"
FOLDERS = ("frontend/src", "shaders")
GENERATED = "generated"
ABOUT_GENERATED = "What `esker.contract.emit` writes from `contract/`: nobody edits it."


def about(path: Path) -> str:
    """What a room says of itself: the docstring of a module, the text of a README below its heading."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return text.partition("\n\n")[2]
    return ast.get_docstring(ast.parse(text)) or ""


def first_sentence(text: str) -> str:
    """As Markdown on one line, without what it cites in brackets."""
    flat = re.sub(r"\s+", " ", text.strip().split("\n\n")[0]).replace("``", "`").replace("|", "\\|")
    flat = re.sub(r" \((?:DESIGN|decision|docs/|paper|twin|``|`store/|CONTRIBUTING)[^)]*\)", "", flat)
    return re.split(r"(?<=[\w`)\"])\. (?=[A-Z`])", flat)[0].strip().rstrip(".") + "."


def python_rooms() -> Iterator[tuple[str, str]]:
    """Packages first, each before the packages in it, then the modules beside them, each with its first sentence."""
    package = ROOT / "backend" / "esker"
    for path in sorted(package.rglob("*/__init__.py")):
        yield f"`backend/esker/{path.parent.relative_to(package).as_posix()}/`", first_sentence(about(path))
    for path in sorted(package.glob("*.py")):
        if path.name != "__init__.py":
            yield f"`backend/esker/{path.name}`", first_sentence(about(path))
    for path in sorted((ROOT / "bench").glob("*/__init__.py")):
        yield f"`bench/{path.parent.name}/`", first_sentence(about(path))


def folder_rooms(base: str) -> Iterator[tuple[str, str]]:
    """Folders of the page or of shaders."""
    for folder in sorted(path for path in (ROOT / base).iterdir() if path.is_dir()):
        said = ABOUT_GENERATED if folder.name == GENERATED else first_sentence(about(folder / "README.md"))
        yield f"`{base}/{folder.name}/`", said


def tables() -> str:
    """All of them, as Markdown."""
    rooms = [*python_rooms(), *(room for base in FOLDERS for room in folder_rooms(base))]
    return "\n| room | what it owns |\n|---|---|\n" + "".join(f"| {name} | {said} |\n" for name, said in rooms) + "\n"


def contributing(text: str) -> str:
    """The page with its tables as they are to be."""
    before, _, rest = text.partition(BEGIN)
    return before + BEGIN + tables() + END + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(contributing(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
