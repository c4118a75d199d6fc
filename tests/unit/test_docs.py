"""What documents and comments name is there (SPEC H7)."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = (".py", ".ts", ".js", ".mjs", ".wgsl", ".cl", ".glsl", ".toml", ".yml", ".css", ".html")
FILE = re.compile(r"[\w./-]+\.(?:py|ts|js|mjs|wgsl|cl|md|json|css|html|svg|webp|png|toml|yml)")
NAME = re.compile(r"[A-Za-z]\w*(?:\.[A-Za-z_]\w*)*(?:\(\))?")
ELSEWHERE = {".venv/"}
"""Made on the reader's machine."""
RULE = re.compile(r"\b(?:PW|HI|[A-Z])\d+\b")


@cache
def files() -> tuple[str, ...]:
    """Paths of all files of the project, relative to its root."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return tuple(path for path in listed.stdout.splitlines() if (ROOT / path).is_file())


@cache
def folders() -> frozenset[str]:
    return frozenset(str(folder) for path in files() for folder in Path(path).parents)


@cache
def text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8", errors="replace")


@cache
def words() -> frozenset[str]:
    """Every name that occurs in the code, and the settings, whose names in the environment are put together."""
    found = {word for path in files() if path.endswith(SOURCES) for word in re.findall(r"\w+", text(path))}
    settings = re.findall(r"^    (\w+): ", text("backend/esker/settings.py"), re.M)
    return frozenset(found | {f"ESKER_{name.upper()}" for name in settings})


def headings(path: str) -> set[str]:
    """The anchors of a document's headings, as GitHub makes them."""
    found = re.findall(r"^#+ (.*)$", text(path), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in found}


def is_there(token: str) -> bool:
    """Whether a path, whole or its end, is one of the project's."""
    tail = token.strip("/")
    return any(path == tail or path.endswith(f"/{tail}") for path in (folders() if token.endswith("/") else files()))


def dead_links(path: str, content: str) -> Iterator[str]:
    """Relative links of a document that lead nowhere."""
    for link in re.findall(r"\]\(([^)\s]+)\)", content):
        if re.match(r"\w+:", link):
            continue
        target, _, anchor = link.partition("#")
        to = (ROOT / path).parent / target if target else ROOT / path
        if not to.exists() or (anchor and anchor not in headings(str(to.resolve().relative_to(ROOT)))):
            yield link


def unknown(content: str, *, names: bool) -> Iterator[str]:
    """What a document names in backquotes that is not there: files, folders and, where asked for, ``names`` in code."""
    for token in re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", content, flags=re.DOTALL)):
        if token in ELSEWHERE or "//" in token:
            continue
        if FILE.fullmatch(token) or re.fullmatch(r"[\w.-]+(?:/[\w.-]+)*/", token):
            if not is_there(token):
                yield token
        elif names and NAME.fullmatch(token) and not words().issuperset(token.rstrip("()").split(".")):
            yield token


DOCUMENTS = [path for path in files() if path.endswith(".md")]


@pytest.mark.parametrize("path", DOCUMENTS)
def test_documents_name_what_is_there(path: str) -> None:
    content = text(path)
    past = "docs/decisions/" in path or path == "CHANGELOG.md"  # they tell of names that are gone, too
    assert list(dead_links(path, content)) == []
    assert past or list(unknown(content, names=True)) == []


def test_every_decision_is_in_the_list() -> None:
    listed = re.findall(r"^\d+\. \[[^]]+\]\((\d{4}-[\w-]+\.md)\)$", text("docs/decisions/README.md"), re.M)
    there = [Path(path).name for path in files() if path.startswith("docs/decisions/0")]
    assert listed == sorted(there)


def test_the_check_of_documents_can_fail() -> None:
    bad = "[a](../gone.md) [b](user-guide.md#gone) [c](https://x.org) `solve/gone.py` `gone/` `Terrain.zz" + "yx()`"
    assert list(dead_links("docs/tiles.md", bad)) == ["../gone.md", "user-guide.md#gone"]
    assert list(unknown(bad, names=True)) == ["solve/gone.py", "gone/", "Terrain.zz" + "yx()"]


def files_in_comments(path: str) -> Iterator[str]:
    for comment in re.findall(r'""".*?"""|#[^\n]*|//[^\n]*|/\*.*?\*/', text(path), re.DOTALL):
        yield from re.findall(r"(?<![\w./-])[\w/-]+\.(?:py|ts|wgsl|cl|md)\b", comment)


def test_comments_name_files_that_are_there() -> None:
    """``solve/refine.py`` and its like, in the comments of all languages."""
    code = [path for path in files() if path.endswith((".py", ".ts", ".wgsl", ".cl")) and "/generated/" not in path]
    named = [(path, token) for path in code if path != "tests/unit/test_docs.py" for token in files_in_comments(path)]
    assert len(named) > 100
    assert [pair for pair in named if not is_there(pair[1])] == []


def test_rules_that_tests_cite_are_written_down() -> None:
    rules = {rule for path in DOCUMENTS if "/spec/" in path or path.endswith("SPEC.md")
             for rule in re.findall(r"^(?:-|\d+\.) \*\*([A-Z]+\d+)\*\*", text(path), re.M)}  # fmt: skip
    cited = {(rule, path) for path in files() if path.endswith((".py", ".ts")) and "test" in path
             for line in re.findall(r"\(?SPEC ([^\n]*)", text(path)) for rule in RULE.findall(line)}  # fmt: skip
    assert len(cited) > 300
    assert sorted((rule, path) for rule, path in cited if rule not in rules) == []
