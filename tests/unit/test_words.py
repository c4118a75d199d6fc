"""The backend and the benchmarks say each thing in one word, the glossary's (SPEC H512, H513, docs/glossary.md)."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.unit.sources import statements

ROOT = Path(__file__).resolve().parents[2]
NAMES = {
    "past": "history view, earlier",
    "pasts": "history rooms",
    "told": "notified; or what the value is",
    "laying": "base builder, placement",
    "spoken": "contributors",
    "steady": "stabiliser, stable",
}
"""Old words that English needs in sentences: no name has them. What is said instead."""
WORDS = {
    "wish": "request, target",
    "wishes": "requests, targets",
    "wished": "requested",
    "owing": "frames pending",
    "lull": "yield",
    "sheet": "layer patches, lake texture, print map, page: what it is",
    "sheets": "layer patches, lake texture, print map, page: what it is",
    "glimpse": "early preview",
    "glimpses": "early previews",
    "scout": "preview workspace",
    "sayings": "channel targets",
    "speakers": "contributors",
    "kinship": "shared ids",
    "likeness": "unchanged count",
    "melt": "seam blend",
    "melts": "is blended",
    "chronicle": "activity log",
    "lapse": "time lapse",
    "grip": "handle",
    "grips": "handles",
    "presses": "pointer actions",
    "pointing": "hit test",
}
"""Old words that nothing says, in names, comments or strings. What is said instead."""
ALLOWED = {
    # how far a sample lies past the end of a crest; the kernels say so too
    "section_reference.py": {"past"},
    "raster_reference.py": {"past"},
    "messages.py": {"laying"},  # a field on the wire keeps its name
}


def parts(text: str) -> list[str]:
    """The words of prose and identifiers: ``PAST_ROOM``, ``past_room`` and ``PastRoom`` have the same two."""
    apart = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", text)
    return [word.lower() for word in re.findall(r"[A-Za-z]+", apart)]


def old_words(name: str, source: str) -> Iterator[str]:
    """What a file says in old words; its name counts too."""
    allowed = ALLOWED.get(Path(name).name, set())
    forbidden = {**NAMES, **WORDS}
    found = {word for word in parts(name) if word in forbidden}
    # Tokens are parts of the source: where it has no such word, none of them has.
    tokens = tokenize.generate_tokens(io.StringIO(source).readline) if forbidden.keys() & parts(source) else ()
    for token in tokens:
        said = parts(re.sub(r"\b[Tt]ime lapse", "", token.string))
        found |= {word for word in said if word in (forbidden if token.type == tokenize.NAME else WORDS)}
    yield from (f"{name}: {word}, say {forbidden[word]}" for word in sorted(found - allowed))


def sources() -> list[Path]:
    return sorted(path for folder in ("backend", "bench") for path in (ROOT / folder).rglob("*.py"))


def test_words_are_the_glossarys() -> None:
    """SPEC H512."""
    files = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in sources()}
    assert [found for name, text in files.items() for found in old_words(name, text)] == []


OPENINGS = re.compile(r"(That|Of|As of|So many|So much|The same|Whose|Theirs|Its own|And)\b")
"""Beginnings of sentences whose noun stands somewhere else."""
SUSPECT = re.compile(rf"#[# ]*{OPENINGS.pattern}")
"""What a source has where one of its comments begins in this way, and what few others have."""


def remarks(source: str) -> Iterator[str]:
    """Docstrings, of attributes too, and comments where one of them may be a riddle. Lines of comments that follow each
    other are one."""
    for node in statements(ast.parse(source)):
        body = getattr(node, "body", None)
        for each in body if isinstance(body, list) else ():
            if (
                isinstance(each, ast.Expr)
                and isinstance(each.value, ast.Constant)
                and isinstance(each.value.value, str)
            ):
                yield each.value.value
    before = -1
    for token in tokenize.generate_tokens(io.StringIO(source).readline) if SUSPECT.search(source) else ():
        if token.type == tokenize.COMMENT:
            if token.start[0] != before + 1:
                yield token.string.lstrip("# ")
            before = token.start[0]


def riddles(source: str) -> list[str]:
    """Comments and docstrings that begin without their noun."""
    return [said.split("\n")[0] for said in remarks(source) if OPENINGS.match(said)]


def test_sentences_have_their_noun() -> None:
    """SPEC H513."""
    found = {path.relative_to(ROOT).as_posix(): riddles(path.read_text(encoding="utf-8")) for path in sources()}
    assert {name: said for name, said in found.items() if said} == {}


def test_a_riddle_is_noticed() -> None:
    assert riddles('x = 1\n"""Of the relief."""\n# And from which on it is not.\ny = 2  # That is over.\n') != []
    assert len(riddles('"""The same as above."""\n# Whose turn it is,\n# of all rooms.\n')) == 2
    assert riddles('"""Offsets that have theirs."""\n# A line that goes on\n# of itself.\n') == []


def test_exceptions_are_needed() -> None:
    texts = {path.name: path.read_text(encoding="utf-8") for path in sources()}
    assert [name for name, words in ALLOWED.items() if not words <= set(parts(texts.get(name, "")))] == []


def test_the_glossary_has_no_old_words_left() -> None:
    """SPEC H512: its second column is empty."""
    rows = re.findall(r"^\|([^|]*)\|([^|]*)\|[^|]*\|$", (ROOT / "docs" / "glossary.md").read_text("utf-8"), re.M)
    assert len(rows) > 50
    assert {term.strip(): old.strip() for term, old in rows if old.strip(" -") and "code still" not in old} == {}


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("past.py", ""),
        ("a.py", "MAX_PAST_ROOMS = 8\n"),
        ("a.py", "class PastRoom: ...\n"),
        ("a.py", "x.told = 1\n"),
        ("a.py", "# What clients wish.\n"),
        ("a.py", '"""A glimpse of newer strokes."""\n'),
    ],
)
def test_an_old_word_is_noticed(name: str, source: str) -> None:
    assert list(old_words(name, source)) != []


@pytest.mark.parametrize("source", ["# half past nine, as was told\n", '"""A time lapse."""\n', "laid = pasted\n"])
def test_words_of_english_are_left_alone(source: str) -> None:
    assert list(old_words("a.py", source)) == []
