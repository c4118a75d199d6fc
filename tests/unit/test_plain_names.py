"""Names show all that is in them, in the order in which it is (SPEC P302)."""

from __future__ import annotations

import unicodedata

import pytest

from esker import contract as c
from esker.contract.values import plain
from esker.document.ops import StrokeSet
from esker.store.journal import Row, replay


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("Äskulap — 山 مرحبا שלום", "Äskulap — 山 مرحبا שלום"),
        ("می\u200cخواهم", "می\u200cخواهم"),
        ("👩\u200d🌾", "👩\u200d🌾"),
        ("a\u202eb\u2067c\u2069", "abc"),
        ("one\r\ntwo\tthree", "one  two three"),
        ("\x00\x07\x1b[31mred\x7f\x9b", "[31mred"),
        ("\u200b\ufeff\u2060\u2028", ""),
    ],
)
def test_names_lose_what_nobody_sees(text: str, kept: str) -> None:
    """SPEC P302."""
    assert plain(text) == kept
    assert plain(kept) == kept
    assert c.Rename(name=text).name == kept
    assert c.TerrainFields(title=text).title == kept


def test_no_control_and_no_mark_of_direction_is_left() -> None:
    """SPEC P302: of all that Unicode has."""
    for code in range(0x110000):
        if 0xD800 <= code < 0xE000:
            continue
        character = chr(code)
        left = plain(character)
        if unicodedata.category(character) == "Cc" or unicodedata.bidirectional(character) in {
            "LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI",
        }:  # fmt: skip
            assert left in ("", " "), hex(code)
        elif unicodedata.category(character)[0] in "LNPSM":
            assert left == character, hex(code)


def test_a_journal_of_before_opens() -> None:
    """SPEC P302: what was let in then is shown without it now."""
    op = '{"type":"terrain.set","fields":{"title":"T\\u202eor"}}'
    document = replay(StrokeSet.from_document(c.Document(id="t")), [Row(1, "a", 1, "a", op)])
    assert document.settings.title == "Tor"
