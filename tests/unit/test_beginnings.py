"""What copies of classes begin as, held for a while and within a bound (SPEC L166)."""

from __future__ import annotations

from esker import contract as c
from esker.document.wire import decompressed, document_json
from esker.lesson.beginnings import CHARACTERS, SECONDS, Beginning, Beginnings
from esker.session.births import born_as


def _beginning(characters: int = 100) -> Beginning:
    return Beginning(c.Document(id="class"), characters)


def test_what_nobody_asks_for_is_let_go() -> None:
    now = 1000.0
    held = Beginnings(lambda: now)
    first, second = _beginning(), _beginning()
    held.hold("a", 1, first)
    held.hold("b", 1, second)
    now += SECONDS - 1
    assert held.find("a", 1) is first, "and it is held for as long again"
    now += 2
    assert held.find("b", 1) is None
    assert held.find("a", 1) is first
    now += SECONDS
    held.forget_old()
    assert held._held == {}


def test_all_of_them_have_a_bound_and_a_larger_one_is_read_each_time() -> None:
    held = Beginnings(lambda: 0.0)
    each = CHARACTERS // 3
    for name in "abcd":
        held.hold(name, 1, _beginning(each))
        held.find("a", 1)
    assert [name for name in "abcd" if held.find(name, 1)] == ["a", "c", "d"]
    held.hold("e", 1, _beginning(CHARACTERS + 1))
    assert [name for name in "abcde" if held.find(name, 1)] == ["a", "c", "d"]


def test_a_beginning_of_another_clock_is_another_one() -> None:
    held = Beginnings(lambda: 0.0)
    held.hold("a", 1, _beginning())
    assert held.find("a", 2) is None


def test_a_copy_is_kept_as_its_document_without_compressing_it_anew() -> None:
    """SPEC J568."""
    stroke = c.Stroke(id="s", kind="profile", first=(1, 2, 3), last=(90, 5, 6), curve=((0, 1), (1, 2)))
    document = c.Document(id="class", settings=c.TerrainSettings(title='"id":"x"'), strokes=(stroke,))
    beginning = Beginning(document, 1)
    first, second = born_as(document), born_as(document)
    assert beginning.find(first) is None
    made = beginning.compress(first)
    kept = beginning.find(second)
    assert kept is not None
    for document, each in ((first, made), (second, kept)):
        assert decompressed(each.data) == document_json(document)
        assert (each.characters, each.title) == (len(document_json(document)), '"id":"x"')
    renamed = second.model_copy(update={"settings": c.TerrainSettings(title="Another")})
    assert beginning.find(renamed) is None
