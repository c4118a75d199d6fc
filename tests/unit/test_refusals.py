"""Whatever the server refuses to a page has a sentence of the page (SPEC U651)."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, get_args

from esker import contract as c
from esker.errors import AnswerCode

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "backend" / "esker"
WORDS = (ROOT / "frontend" / "src" / "app" / "words" / "refusals.ts").read_text(encoding="utf-8")
CODES: Final = frozenset((*get_args(AnswerCode), *get_args(c.CloseCode), *get_args(c.RejectCode)))

WHERE: Final = {
    "Cannot": 1,
    "answer": 1,
    "_answer": 3,
    "refuse": 2,
    "Denied": 0,
    "Refusal": 0,
    "WallRefused": 0,
    "EskerError": 0,
    "close": 0,
    "_close": 0,
}
"""What refuses, and which of its arguments is the code."""
NOT_TO_PAGES: Final = {
    "not_signed": "between the nodes of a server",
    "bad_target": "becomes a sentence of the score",
}
"""Codes that no page is answered, and who hears them."""
CLIENTS: Final = frozenset({"api", "cli", "doctor"})
"""Rooms that ask a server; what they refuse themselves no page hears."""
LISTS: Final = (PACKAGE / "errors.py", PACKAGE / "contract" / "operations.py")
"""Files that list the codes."""


def refusals(source: str) -> Iterator[tuple[int, str]]:
    """Lines and codes of what a source refuses: calls that take a code, bases that are given one, and JSON with one."""
    for node in ast.walk(ast.parse(source)):
        code = None
        if isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            at = 0 if ast.unparse(node.func) == "super().__init__" else WHERE.get(name, len(node.args))
            code = node.args[at] if at < len(node.args) else None
        elif isinstance(node, ast.Dict):
            keys = [key.value if isinstance(key, ast.Constant) else None for key in node.keys]
            code = node.values[keys.index("code")] if {"code", "message"} <= set(keys) else None
        if isinstance(code, ast.Constant) and isinstance(code.value, str) and re.fullmatch(r"[a-z_]+", code.value):
            yield code.lineno, code.value


def test_the_page_has_a_sentence_for_every_code() -> None:
    """SPEC U651."""
    worded = set(re.findall(r"^  (\w+): msg\(", WORDS, re.MULTILINE))
    ours = re.search(r"^type SaidByServer = (.+);$", WORDS, re.MULTILINE)
    assert ours is not None
    by_server = set(re.findall(r'"(\w+)"', ours[1]))
    assert worded | by_server == CODES
    assert not worded & by_server
    assert len(by_server) <= 1, "a sentence of the page says it in every language: think twice"


def test_the_codes_are_all_that_the_server_refuses_with() -> None:
    """SPEC U651: types hold calls to the codes; whatever escapes them is found in the sources."""
    found = {
        (path.relative_to(PACKAGE).as_posix(), line, code)
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.relative_to(PACKAGE).parts[0] not in CLIENTS
        for line, code in refusals(path.read_text(encoding="utf-8"))
    }
    assert len(found) > 100
    strange = {each for each in found if each[2] not in CODES | NOT_TO_PAGES.keys()}
    assert not strange
    assert {code for _, _, code in found} >= NOT_TO_PAGES.keys(), "nobody is answered these any more"
    rest = "".join(path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py") if path not in LISTS)
    assert not {code for code in CODES if f'"{code}"' not in rest}, "nothing is refused with these any more"


def test_a_new_code_would_be_noticed() -> None:
    source = 'raise Cannot(400, "new", "No.")\nanswer(1, "newer", s)\nx = {"code": "newest", "message": m}'
    assert {code for _, code in refusals(source)} == {"new", "newer", "newest"}
    assert list(refusals("raise Cannot(status, code, sentence)\nfile.close()")) == []
