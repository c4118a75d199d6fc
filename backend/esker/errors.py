"""What Esker refuses: one base for all refusals, with a code for programs and a sentence for people.

It knows no other room.
"""

from __future__ import annotations

from typing import Literal

AnswerCode = Literal[
    "bad_archive",
    "bad_code",
    "bad_host",
    "bad_origin",
    "bad_secret",
    "busy",
    "cancelled",
    "class_full",
    "cut_off",
    "deleted",
    "empty",
    "error",
    "group_full",
    "hands_off",
    "lost",
    "malformed",
    "moved",
    "no_class",
    "no_collection",
    "no_copy",
    "no_export",
    "no_grid",
    "no_import",
    "no_lesson",
    "no_link",
    "no_page",
    "no_pictures",
    "no_seat",
    "no_template",
    "no_terrain",
    "not_allowed",
    "not_asked",
    "not_deleted",
    "not_done",
    "not_found",
    "not_keeper",
    "not_owner",
    "own_link",
    "quota",
    "rate_limited",
    "refused",
    "revoked",
    "secret_taken",
    "server_error",
    "shutting_down",
    "starting",
    "storage",
    "too_large",
    "too_many_classes",
    "too_many_layers",
    "too_many_links",
    "unavailable",
    "unknown",
    "view_only",
]
"""Codes of what HTTP answers when it refuses, beside those of sockets (``contract.RejectCode``, ``CloseCode``): the
page has a sentence for each (SPEC U651)."""


class EskerError(Exception):
    """Something was refused, or cannot be done. ``str(error)`` is the sentence.

    ``code``: a word for programs; ``message``: the sentence for people; ``status``: what HTTP answers, where a route is
    asked.
    """

    def __init__(self, code: str, message: str, status: int = 400) -> None:
        super().__init__(message)
        self.code, self.message, self.status = code, message, status


class Cannot(EskerError):
    """What a route was asked for cannot be done: HTTP status, code and a sentence."""

    def __init__(self, status: int, code: AnswerCode, message: str) -> None:
        super().__init__(code, message, status)
