"""Questions of imports as the server asks them: the page knows the sentences, to ask them in its own language."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from esker.contract import ImportQuestion
from esker.importing import questions
from esker.importing.scan import Scan
from esker.importing.source import Source


def question_vectors() -> list[dict[str, Any]]:
    """Each kind of question, with figures where it has some."""
    scan = cast(
        Scan,
        SimpleNamespace(low=0.0, high=65535.0, lows=[(-9999.0, 25), (12.0, 1)], highs=[(900.0, 1)], rows=100, cols=100),
    )
    source = cast(Source, SimpleNamespace(eight_bit=False))
    nameless = "It does not name its coordinate system."
    asked: list[ImportQuestion] = [
        questions.type_question(("int16", "float32")),
        questions.shape_question(("512 x 512", "1024 x 256")),
        questions.band_question(4),
        questions.ROWS,
        questions.encoding_question(("terrarium", "mapbox"), "terrarium"),
        questions.UNIT,
        questions.IMAGERY,
        questions.SIZE,
        questions.nodata_question((-9999.0,), scan),
        questions.nodata_question((-9999.0, 0.0), scan),
        questions.range_question(scan, source),
        questions.height_question(5200, 8848, 4096)[0],
        questions.height_question(-9000, -6000, 4096)[0],
        questions.far_question(1_234_567),
        questions.system_question(True, nameless, False),
        questions.system_question(False, nameless, False),
    ]
    return [question.model_dump(mode="json") for question in asked]
