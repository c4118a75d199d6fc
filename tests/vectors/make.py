"""Writes the vectors that pytest and vitest both read, each a .json.

``python tests/vectors/make.py`` rewrites them; ``tests/unit/test_vectors.py`` checks that doing so changes nothing.
The expected outcome of every case is named here by hand (refusal code, or that it applies); the resulting documents
come from the Python implementation and are reviewed as a diff.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent.parent))

from tests.vectors.flow_cases import flow_vectors  # noqa: E402
from tests.vectors.lake_cases import lake_vectors  # noqa: E402
from tests.vectors.message_cases import message_vectors  # noqa: E402
from tests.vectors.notice_cases import notice_vectors  # noqa: E402
from tests.vectors.op_cases import op_vectors  # noqa: E402
from tests.vectors.pour_cases import pour_vectors  # noqa: E402
from tests.vectors.question_cases import question_vectors  # noqa: E402
from tests.vectors.river_cases import river_vectors  # noqa: E402
from tests.vectors.rivermap_cases import rivermap_vectors  # noqa: E402
from tests.vectors.target_cases import target_vectors  # noqa: E402
from tests.vectors.undo_cases import undo_vectors  # noqa: E402


def text(about: str, cases: list[dict[str, Any]]) -> str:
    """One case a line, so that a change reads as a change of lines."""
    lines = ",\n".join(json.dumps(case, ensure_ascii=False, allow_nan=False, separators=(",", ":")) for case in cases)
    return f'{{"about":{json.dumps(about)},\n"cases":[\n{lines}\n]}}\n'


def build() -> dict[str, str]:
    """File name to content."""
    return {
        "ops.json": text("document + op -> result document, or a refusal code", op_vectors()),
        "undo.json": text("scripts of mine / theirs / undo / redo with the ops and sentences expected", undo_vectors()),
        "lakes.json": text("ground in sixteenths of a metre, row 0 south -> levels of lakes, waves", lake_vectors()),
        "flow.json": text("ground in whole steps, row 0 south -> receivers, water, areas, rivers", flow_vectors()),
        "pour.json": text("ground in whole steps, water poured out -> pools and what runs off", pour_vectors()),
        "notices.json": text("notices of a lesson, which the page has in its language", notice_vectors()),
        "questions.json": text("questions of imports, which the page has in its language", question_vectors()),
        "rivermap.json": text(
            "rivers in cells of a level -> the pieces that shaders read, by cell", rivermap_vectors()
        ),
        "rivers.json": text("frames of rivers and what is in them, or a part of the sentence", river_vectors()),
        "targets.json": text("texts of targets with some of their heights, or null", target_vectors()),
        "messages.json": text("texts a client may send: accepted, or refused (accept false)", message_vectors()),
    }


def main() -> None:
    """Writes all files."""
    for name, content in build().items():
        (HERE / name).write_text(content, encoding="utf-8")


if __name__ == "__main__":
    main()
