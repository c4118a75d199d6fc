"""One connection as a state machine with no I/O in it (DESIGN 6, 8): bytes and times in, events out.

Everything a client sends is validated here once: size, shape, rates, order. What comes out is safe to hand to the
room. The answers to bad input are numbered in ``tests/spec/protocol.md``.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from esker import contract as c
from esker.contract import CloseCode, RejectCode
from esker.fairness.buckets import TokenBucket

HELLO_SECONDS: Final = 10.0
MAX_MESSAGES_PER_SECOND: Final = 600
"""Messages of all kinds together: a client above this rate is out of control, and its connection is closed."""
MESSAGES_BURST: Final = 1_200
CONDUCTS_PER_SECOND, CONDUCTS_BURST = 5, 30
"""Switches of a lesson, and what is done about people: each may be a commit."""
RENAMES_PER_SECOND, RENAMES_BURST = 2, 10
"""New names: each is written down, and told to all."""
MAX_REFUSED_OPS: Final = 4 * c.OPS_BURST
"""The connection is closed after so many ops in a row were refused for their rate."""
FITS_CHARACTERS: Final = c.MAX_MESSAGE_BYTES // 4
"""A text with no more characters than this need not be counted in bytes, since a character has four bytes at most."""
MAX_NAME: Final = 120
"""Characters that a sentence shows of the name of a field."""


@dataclass(frozen=True)
class Hi:
    """The handshake is complete as far as the protocol goes; the room has yet to check the secret."""

    hello: c.Hello


@dataclass(frozen=True)
class Accepted:
    """Well-formed ops within the rate, in the order sent."""

    ops: tuple[c.OpEnvelope, ...]


@dataclass(frozen=True)
class Refused:
    """One op that is refused before it reaches the document."""

    id: str
    code: RejectCode
    message: str


@dataclass(frozen=True)
class Message:
    """A well-formed view, presence, credit, rename, seek, or what a conductor says."""

    body: c.View | c.Presence | c.Credit | c.Rename | c.Seek | c.Conduct | c.People | c.Grouping


@dataclass(frozen=True)
class Reply:
    """A message that is to be sent back as it is."""

    message: c.Pong | c.ErrorMessage


@dataclass(frozen=True)
class Close:
    """Say why and close. Nothing that follows on this connection is read."""

    code: CloseCode
    message: str


Event = Hi | Accepted | Refused | Message | Reply | Close


class Connection:
    """The server's side of one socket."""

    def __init__(self, opened: float, subprotocol: str | None) -> None:
        """``opened``: the time now, seconds; ``subprotocol``: what the handshake agreed on (None: nothing)."""
        self._opened = opened
        self._subprotocol = subprotocol
        self._greeted = False
        self._is_history = False
        self._closed = False
        self._ops = TokenBucket(c.MAX_OPS_PER_SECOND, c.OPS_BURST)
        self._presences = TokenBucket(c.MAX_PRESENCE_PER_SECOND, c.MAX_PRESENCE_PER_SECOND)
        self._seeks = TokenBucket(c.MAX_SEEKS_PER_SECOND, c.MAX_SEEKS_PER_SECOND)
        self._views = TokenBucket(c.MAX_VIEWS_PER_SECOND, c.MAX_VIEWS_PER_SECOND)
        self._renames = TokenBucket(RENAMES_PER_SECOND, RENAMES_BURST)
        self._conducts = TokenBucket(CONDUCTS_PER_SECOND, CONDUCTS_BURST)
        self._messages = TokenBucket(MAX_MESSAGES_PER_SECOND, MESSAGES_BURST)
        self._notices = TokenBucket(1.0, 1.0)
        self._refused_in_a_row = 0

    def opened(self) -> list[Event]:
        """Returns the first events: a client that does not speak this protocol is refused."""
        if self._subprotocol == c.SUBPROTOCOL:
            return []
        return self._close(
            "bad_protocol",
            f"This server speaks {c.SUBPROTOCOL}. Reload the page to get the version that fits.",
        )

    def tick(self, now: float) -> list[Event]:
        """Ends a connection that does not say hello. The caller asks now and then."""
        if not self._greeted and not self._closed and now - self._opened > HELLO_SECONDS:
            return self._close("bad_hello", f"No hello came within {HELLO_SECONDS:.0f} seconds.")
        return []

    def binary(self, data: bytes) -> list[Event]:
        """Refuses a binary message: clients have none."""
        if self._closed:
            return []
        return self._close("malformed", f"A client sends no binary messages ({len(data)} bytes came).")

    def text(self, text: str, now: float) -> list[Event]:
        """Takes one text message."""
        if self._closed:
            return []
        if len(text) > FITS_CHARACTERS and len(text.encode("utf-8", "replace")) > c.MAX_MESSAGE_BYTES:
            return self._close("too_large", f"A message may have {c.MAX_MESSAGE_BYTES} bytes at most.")
        if not self._messages.take(now):
            return self._close("rate_limited", f"More than {MAX_MESSAGES_PER_SECOND} messages came in a second.")
        try:
            message = c.CLIENT_MESSAGE.validate_json(text)
        except ValidationError as error:
            return self._broken(text, error, now)
        return self._understood(message, now)

    def _understood(self, message: Any, now: float) -> list[Event]:
        if isinstance(message, c.Ops) and self._greeted:  # most messages are ops, so they are looked for first
            return self._rated(message.ops, [], now)
        if isinstance(message, c.Hello):
            return self._hello(message)
        if not self._greeted:
            return self._close("bad_hello", "The first message must be hello.")
        match message:
            case c.Presence():
                if not self._presences.take(now):
                    return self._notice(f"More than {c.MAX_PRESENCE_PER_SECOND} cursor messages a second.", now)
            case c.View():
                if not self._views.take(now):
                    return self._notice(f"More than {c.MAX_VIEWS_PER_SECOND} views a second.", now)
            case c.Seek():
                if not self._is_history:
                    return self._close("malformed", "Only who looks at the past goes to another clock.")
                if not self._seeks.take(now):
                    return self._notice(f"More than {c.MAX_SEEKS_PER_SECOND} clocks a second.", now)
            case c.Rename():
                if not self._renames.take(now):
                    return self._notice(f"More than {RENAMES_PER_SECOND} new names a second.", now)
            case c.Conduct() | c.People() | c.Grouping():
                if not self._conducts.take(now):
                    return self._notice(f"More than {CONDUCTS_PER_SECOND} switches of a lesson a second.", now)
            case c.Ping():
                return [Reply(c.Pong(t=message.t))]
        return [Message(message)]

    def _hello(self, hello: c.Hello) -> list[Event]:
        if self._greeted:
            return self._close("bad_hello", "Hello was said already.")
        if hello.protocol != c.PROTOCOL_VERSION:
            return self._close(
                "bad_protocol",
                f"This server speaks protocol {c.PROTOCOL_VERSION}, not {hello.protocol}. Reload the page.",
            )
        self._greeted, self._is_history = True, hello.at is not None
        return [Hi(hello)]

    def _rated(self, ops: tuple[c.OpEnvelope, ...], events: list[Event], now: float) -> list[Event]:
        for i, envelope in enumerate(ops):
            size = len(envelope.op.ops) if isinstance(envelope.op, c.Group) else 1
            if not self._ops.take(now, size):
                # Later ops may build on the one that is refused: refuse the rest of the message with it.
                events += [Accepted(ops[:i])] if i else []
                if self._refuses(len(ops) - i):
                    return events + self._close("rate_limited", "Far too many changes a second.")
                sentence = f"More than {c.MAX_OPS_PER_SECOND} changes a second. Slow down and send it again."
                return events + [Refused(e.id, "rate_limited", sentence) for e in ops[i:]]
        if not ops:
            return events
        self._refused_in_a_row = 0
        return [*events, Accepted(ops)]

    def _refuses(self, count: int) -> bool:
        """Notes ops that are refused for their rate. Returns True when they are too many to go on."""
        self._refused_in_a_row += count
        return self._refused_in_a_row > MAX_REFUSED_OPS

    def _notice(self, sentence: str, now: float) -> list[Event]:
        if not self._notices.take(now):
            return []
        text = f"{sentence} The surplus is dropped."
        return [Reply(c.ErrorMessage(code="rate_limited", message=text, fatal=False))]

    def _broken(self, text: str, error: ValidationError, now: float) -> list[Event]:
        """Refuses bad ops inside a well-formed envelope one by one. Anything else ends the connection."""
        events = self._salvage(text, now) if self._greeted else None
        if events is not None:
            return events
        if not self._greeted:
            return self._close("bad_hello", f"The hello cannot be read: {_sentence(error.errors()[0])}")
        return self._close("malformed", f"The message cannot be read: {_sentence(error.errors()[0])}")

    def _salvage(self, text: str, now: float) -> list[Event] | None:
        try:
            raw = json.loads(text)
        except (ValueError, RecursionError):
            return None
        if not isinstance(raw, dict) or raw.get("type") != "ops" or set(raw) != {"type", "ops"}:
            return None
        items = raw["ops"]
        if not isinstance(items, list) or not 1 <= len(items) <= c.MAX_OPS_PER_MESSAGE:
            return None
        good: list[c.OpEnvelope] = []
        events: list[Event] = []
        for item in items:
            try:
                good.append(c.OpEnvelope.model_validate_json(json.dumps(item)))
            except ValidationError as error:
                details = error.errors(include_url=False, include_context=False, include_input=False)
                if any(e["loc"][:1] != ("op",) for e in details) or not isinstance(item, dict):
                    return None
                if not self._ops.take(now) and self._refuses(1):
                    return events + self._close("rate_limited", "Far too many changes a second that cannot be read.")
                events.append(Refused(item["id"], _reject_code(details[0]), _sentence(details[0])))
        return self._rated(tuple(good), events, now)

    def _close(self, code: CloseCode, message: str) -> list[Event]:
        self._closed = True
        return [Close(code, message)]


def _reject_code(first: ErrorDetails) -> RejectCode:
    where = first["loc"][-1] if first["loc"] else ""
    if first["type"] == "too_long" and where in ("points", "curve"):
        return "too_many_points"
    if first["type"] in ("less_than_equal", "greater_than_equal", "finite_number") and isinstance(where, int):
        return "out_of_domain"
    return "malformed"


def _sentence(first: ErrorDetails) -> str:
    # The name of a field that does not exist comes from the client, and this sentence goes into the log.
    where = ascii(".".join(str(part) for part in first["loc"])[:MAX_NAME])[1:-1]
    return f"{where}: {first['msg']}." if where else f"{first['msg']}."
