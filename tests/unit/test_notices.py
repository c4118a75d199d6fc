"""What conductors are told of what they asked for (SPEC L165)."""

from __future__ import annotations

from typing import get_args

import pytest

from esker import contract as c
from esker.session.lesson.notices import SENTENCES, notice

LONGEST = "\u00e9" * c.MAX_NAME_LENGTH


def test_each_code_has_a_sentence_of_its_own() -> None:
    assert SENTENCES.keys() == set(get_args(c.NoticeCode))
    assert len(set(SENTENCES.values())) == len(SENTENCES)


@pytest.mark.parametrize("code", SENTENCES)
def test_the_longest_names_fit(code: c.NoticeCode) -> None:
    said = notice(code, [f"{k}{LONGEST}"[: c.MAX_NAME_LENGTH] for k in range(9)])
    assert c.Notice.model_validate_json(said.model_dump_json()) == said
    assert len(said.names) == c.MAX_NAMED


def test_names_come_by_the_alphabet_and_nobody_is_they() -> None:
    assert notice("taken_back", ["Ben", "", "Ada", "Ben"]).text == "Everything that Ada and Ben did was taken back."
    assert notice("nothing_stands").text == "Nothing that they did still stands."


def test_a_name_is_no_template() -> None:
    assert notice("taken_back", ["{who} {0}"]).text == "Everything that {who} {0} did was taken back."
