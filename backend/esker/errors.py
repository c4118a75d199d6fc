"""What Esker refuses: one base for all refusals, with a code for programs and a sentence for people.

It knows no other room.
"""

from __future__ import annotations


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

    def __init__(self, status: int, code: str, message: str) -> None:
        super().__init__(code, message, status)
