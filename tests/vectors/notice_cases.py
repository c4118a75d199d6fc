"""Notices of a lesson as the server sends them: the page says them in its own language."""

from __future__ import annotations

from typing import Any

from esker.session.lesson.notices import SENTENCES, notice


def notice_vectors() -> list[dict[str, Any]]:
    """Each notice, those about people of nobody, of one and of three."""
    some: tuple[tuple[str, ...], ...] = ((), ("Ben",), ("Cho", "Ada", "Ben"))
    return [
        notice(code, names).model_dump(mode="json")
        for code, sentence in SENTENCES.items()
        for names in (some if "{who}" in sentence else some[:1])
    ]
