"""What documents and comments name is there (SPEC H7, H420 to H426)."""

from __future__ import annotations

import re
import subprocess
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from docs import rooms
from tests.unit import test_house as house

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
    settings = re.findall(r"^    (\w+): ", text("backend/esker/server/settings.py"), re.M)
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
    """``solve/refine/refinement.py`` and its like, in the comments of all languages."""
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


SAID = re.compile(
    r'"""(.*?)"""|#([^\n]*)|//([^\n]*)|/\*(.*?)\*/|\b(?:it|describe|test)(?:\.\w+\(.*?\))?\(\s*["`]([^"`]*)', re.DOTALL
)
"""Docstrings, comments and titles of tests: what else looks like a rule is a name of something."""


def rules_in(words: str) -> set[str]:
    """All rules that a text names: one by one, or from the first to the last of several."""
    named = set(RULE.findall(words))
    for letters, first, last in re.findall(r"\b([A-Z]{1,2})(\d+)(?: to |\.\.|-|–)(?:\1)?(\d+)\b", words):
        named |= {f"{letters}{number}" for number in range(int(first), min(int(last), int(first) + 60) + 1)}
    return named


def test_every_rule_is_cited_by_a_test_and_stands_once() -> None:
    """SPEC H571."""
    written = [rule for path in DOCUMENTS if "/spec/" in path or path.endswith("SPEC.md")
               for rule in re.findall(r"^- \*\*([A-Z]+\d+)\*\*", text(path), re.M)]  # fmt: skip
    assert [rule for rule, times in Counter(written).items() if times > 1] == []
    tests = [path for path in files() if path.endswith((".py", ".ts")) and re.match(r"tests/|frontend/test/", path)]
    said = [" ".join(filter(None, found.groups())) for path in tests for found in SAID.finditer(text(path))]
    named = set.union(*map(rules_in, said))
    assert [rule for rule in written if rule not in named] == []


def test_ranges_of_rules_are_read() -> None:
    said = "SPEC E1..E3, D27 to D29, H1"
    assert rules_in(said) == {"E1", "E2", "E3", "D27", "D28", "D29", "H1"}


def paragraphs_with(pattern: str) -> Iterator[tuple[str, str]]:
    """Every file in which a pattern is found, and the text of its first group on one line."""
    own = {"tests/unit/test_docs.py", "docs/design.md", "docs/bibliography.md"}
    for path in files():
        if path.endswith((*SOURCES, ".md", "Makefile")) and path not in own and "/generated/" not in path:
            for found in re.finditer(pattern, text(path), re.I):
                yield path, re.sub(r"\s*\n[\s/*#]*", " ", found.group(1))


SECTION = re.compile(r"\d+(?:\.\d+)?")
DESIGN = r"\bDESIGN\s+((?:\d+(?:\.\d+)?(?!\w)(?:,? \"[^\"]*\")?(?:[,;]\s+|\s+(?:to|and)\s+)?(?:\n[\s/*#]*)?)+)"


def sections_cited() -> set[tuple[str, str]]:
    """(file, section) of every "DESIGN n", lists and ranges of whole sections included."""
    found = set()
    for path, tail in paragraphs_with(DESIGN):
        for first, last in re.findall(r"(\d+) to (\d+)", tail):
            found |= {(path, str(n)) for n in range(int(first), int(last) + 1)}
        found |= {(path, number) for number in SECTION.findall(re.sub(r'"[^"]*"', "", tail))}
    return found


def design_sections() -> set[str]:
    return set(re.findall(r"^#+ (\d+(?:\.\d+)?)\.? ", text("docs/design.md"), re.M))


def test_every_section_of_the_design_that_is_cited_is_there() -> None:
    """SPEC H420."""
    cited = sections_cited()
    assert len(cited) > 200
    assert {number for _, number in cited} >= {"2", "5.6", "13", "17", "18"}
    assert sorted((path, number) for path, number in cited if number not in design_sections()) == []


def papers_cited() -> set[tuple[str, str, str]]:
    """(file, paper, place in it) of every "paper k, section n": an empty place where a paper is cited as a whole."""
    found = set()
    for path, tail in paragraphs_with(r"\bpaper\s+([012]\b(?:[, (]*(?:sections? |figure )?(?:III-[AB]|\d(?:\.\d)?\b)"
                                      r"(?: and \d\.\d|, figure \d| [a-z]\b)?)?)"):  # fmt: skip
        places = re.findall(r"III-[AB]|figure \d|\d\.\d|section \d(?!\.)", tail[1:])
        found |= {(path, tail[0], place.removeprefix("section ")) for place in places or [""]}
    return found


def bibliography() -> dict[str, set[str]]:
    """Places by paper, as the tables of the bibliography name them."""
    parts = re.split(r"^## ", text("docs/bibliography.md"), flags=re.M)
    papers = {part[6]: part for part in parts if part.startswith("Paper ")}
    cells = {k: ", ".join(re.findall(r"^\| ([^|]+?)(?:, equation \d)? \|", part, re.M)) for k, part in papers.items()}
    return {k: {"", *re.findall(r"III-[AB]|figure \d|\d\.\d|\b\d\b", cell)} for k, cell in cells.items()}


def test_every_paper_and_section_that_is_cited_is_in_the_bibliography() -> None:
    """SPEC H421."""
    cited, known = papers_cited(), bibliography()
    assert len(cited) > 40
    assert {(paper, place) for _, paper, place in cited} >= {("0", "III-B"), ("1", "4"), ("2", "3.1"), ("2", "4.1")}
    assert sorted(entry for entry in cited if entry[2] not in known.get(entry[1], set())) == []


def rows(path: str) -> Iterator[list[str]]:
    """The cells of a document's tables, row by row, without their heads."""
    for line in text(path).splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| ") and cells[0] not in {"term", "rule", "question", "cited"}:
            yield cells


def test_twins_are_where_the_list_says_and_what_pins_them_reads_the_vectors() -> None:
    """SPEC H422."""
    table = list(rows("docs/twins.md"))
    paths = {path for row in table for path in re.findall(r"`([^`]+)`", " ".join(row[1:]))}
    assert sorted(path for path in paths if path not in files() and path.rstrip("/") not in folders()) == []
    for rule, homes, pins in table:
        assert len(re.findall(r"`[^`]+`", homes)) > 1, rule
        named = re.findall(r"`([^`]+)`", pins)
        assert any("test" in path for path in named), rule
        vectors = [Path(path).stem for path in named if path.endswith(".json")]
        readers = re.findall(r"`([^`]+)`", pins.partition("read by")[2].partition(";")[0])
        assert all(any(word in text(path) for word in (*vectors, "make.build")) for path in readers), rule
    made = {path for path in files() if re.fullmatch(r"tests/vectors/\w+\.json", path)}
    assert made
    assert sorted(made - paths) == []


def test_each_term_is_defined_once() -> None:
    """SPEC H423."""
    table = list(rows("docs/glossary.md"))
    terms = [term.strip() for row in table for term in row[0].split(",")]
    old = [word for row in table for word in re.findall(r"`[^`]+`(?: of [^,]*)?", row[1])]
    for words_ in (terms, old):
        assert sorted({word for word in words_ if words_.count(word) > 1}) == []
    assert len(terms) > 60
    assert not set(terms) & {word.strip("`") for word in old}


def diagrams(path: str) -> list[str]:
    """The sequence diagrams of a document."""
    return re.findall(r"```mermaid\n(.*?)```", text(path), re.DOTALL)


def test_walks_name_two_files_at_most_and_what_is_in_them() -> None:
    """SPEC H424."""
    questions = [row for row in rows("docs/walks.md") if len(row) == 3]
    assert len(questions) == 4
    for question, read, answer in questions:
        named = re.findall(r"`([^`]+)`", read)
        assert 1 <= len(named) <= 2, question
        both = "\n".join(text(path) for path in named)
        for token in re.findall(r"`([\w.]+)`", answer):
            assert all(defined(part, both) for part in token.split(".")), (question, token)


def defined(name: str, source: str) -> bool:
    """Whether Python or TypeScript code makes something of that name, rather than only uses it."""
    made = rf"\b(?:def|class|interface|function|const) {name}\b|^ *(?:self\.)?{name}\b *[:=]|self\.{name}\b[^=\n]*=[^=]"
    return bool(re.search(rf"{made}|^ +(?:async )?#?{name}(?:<.*>)?\(.*\{{$", source, re.M))


def test_diagrams_name_what_is_there() -> None:
    """SPEC H424: each place is a file, each call a name that it, or who calls it, has."""
    made = diagrams("docs/walks.md")
    assert len(made) == 5
    for diagram in made:
        places = dict(re.findall(r"participant (\w+) as [^<\n]*<br/>(\S+)", diagram))
        assert sorted(path for path in places.values() if path not in files()) == []
        assert diagram.count("participant") == len(places)
        for sender, receiver, words_ in re.findall(r"(\w+)-{1,2}>>(\w+): (.*)", diagram):
            both = text(places[sender]) + text(places[receiver])
            for call in re.findall(r"(\w+)\(\)", words_):
                assert defined(call, both), (call, places[sender], places[receiver])


def test_the_table_of_rooms_is_what_the_rooms_say() -> None:
    """SPEC H425."""
    page = text("CONTRIBUTING.md")
    assert rooms.contributing(page) == page, "run `make generate`"
    assert rooms.first_sentence("One (DESIGN 3) of ``two``.\nThree.\n\nFour.") == "One of `two`."


BELOW = "It may know every room that ranks below it."
ALONE = "no other room"


def knows(said: str) -> set[str] | None:
    """The rooms that a room says it may know; None for all that rank below it."""
    flat = re.sub(r"\s+", " ", said)
    if BELOW in flat:
        return None
    if ALONE in flat:
        return set()
    found = re.search(r"It may know ((?:`+\w+`+(?:, | and )?)+)\.", flat)
    assert found, f"it does not say whom it may know: {flat[:80]}"
    return set(re.findall(r"\w+", found.group(1))) - {"and"}


def strangers(said: str, imported: set[str], there: set[str]) -> set[str]:
    """What a room imports and does not say, and what it says that is not there."""
    named = knows(said)
    return set() if named is None else (imported - named) | (named - there)


def test_rooms_know_whom_they_say() -> None:
    """SPEC H426: packages of the backend, folders of the page."""
    for init in sorted(house.PACKAGE.glob("*/__init__.py")):
        imported = {name.split(".")[1] for path in init.parent.rglob("*.py")
                    for name in house.imports(path) if name.startswith("esker.")}  # fmt: skip
        room = init.parent.name
        assert strangers(rooms.about(init), (imported & house.RANK.keys()) - {room}, set(house.RANK)) == set(), room
    folders_ = {path.name: path for path in (ROOT / "frontend/src").iterdir() if path.is_dir()}
    for room, folder in folders_.items():
        if room != rooms.GENERATED:
            seen = {word for path in folder.rglob("*.ts")
                    for word in re.findall(r"from \"(?:\.\./)+(\w+)/", path.read_text("utf-8"))}  # fmt: skip
            said = rooms.about(folder / "README.md")
            assert strangers(said, (seen & folders_.keys()) - {room}, set(folders_)) == set(), room


def test_the_check_of_what_rooms_know_can_fail() -> None:
    assert strangers("It may know ``a`` and ``b``.", {"a", "c"}, {"a", "b", "c"}) == {"c"}
    assert strangers("It may know ``gone``.", set(), {"a"}) == {"gone"}
    assert strangers("It knows no other room.", {"a"}, {"a"}) == {"a"}
    assert strangers(BELOW, {"a"}, set()) == set()


def tree_of(page: str) -> set[str]:
    """Folders of the tree that a page draws, from the repository's root."""
    drawn = page.partition("<!-- the tree -->")[2].split("```")[1]
    found: set[str] = set()
    above: list[str] = []
    for line in drawn.strip("\n").split("\n"):
        depth, name = (len(line) - len(line.lstrip())) // 2, line.split()[0].rstrip("/")
        above = [*above[:depth], name]
        found.add("/".join(above))
    return found


def packages() -> set[str]:
    """Folders with Python modules, and the folders above them."""
    inits = [*house.PACKAGE.rglob("__init__.py"), *(ROOT / "bench").rglob("__init__.py")]
    return {path.parent.relative_to(ROOT).as_posix() for path in inits}


def test_the_design_draws_the_tree_that_is_there() -> None:
    """SPEC H492."""
    page = text("docs/design.md")
    assert tree_of(page) == packages()
    assert tree_of(page.replace("  wgsl/ ", "  gone/ ")) != packages()


def proofs(page: str) -> list[tuple[str, str]]:
    """The tests that a page names: their file and their name."""
    return re.findall(r"`((?:tests|frontend/test)/[^`:]+)::([^`]+)`", page)


def test_points_of_the_first_hour_name_tests_that_are_there() -> None:
    """SPEC H516."""
    found = proofs(text("docs/first-hour.md"))
    assert len(found) > 50
    assert [(path, name) for path, name in found if name not in text(path)] == []
    assert all(row[-1].strip() for row in rows("docs/first-hour.md"))
    assert proofs("`tests/unit/test_docs.py::test_nothing` `frontend/test/a.test.ts::says so (SPEC U1)`") == [
        ("tests/unit/test_docs.py", "test_nothing"),
        ("frontend/test/a.test.ts", "says so (SPEC U1)"),
    ]
