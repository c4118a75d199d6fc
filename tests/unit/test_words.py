"""The backend and the benchmarks say each thing in one word, the glossary's (SPEC H512, docs/glossary.md)."""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

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
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        said = parts(re.sub(r"\b[Tt]ime lapse", "", token.string))
        found |= {word for word in said if word in (forbidden if token.type == tokenize.NAME else WORDS)}
    yield from (f"{name}: {word}, say {forbidden[word]}" for word in sorted(found - allowed))


def sources() -> list[Path]:
    return sorted(path for folder in ("backend", "bench") for path in (ROOT / folder).rglob("*.py"))


def test_words_are_the_glossarys() -> None:
    """SPEC H512."""
    files = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in sources()}
    assert [found for name, text in files.items() for found in old_words(name, text)] == []


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
