"""What people did to a live terrain, and how they are led, from Python: history, copies, the lesson (docs/protocol.md,
docs/teaching.md)."""

from __future__ import annotations

import json
import ssl
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

from esker import contract as c
from esker.api import arguments
from esker.api.http import Api
from esker.api.live.connection import LiveConnection
from esker.api.live.layers import Grids
from esker.api.terrain import Terrain


@dataclass(frozen=True)
class Event:
    """One thing that somebody did, from clock ``first`` to ``last``. ``text`` says what, as "drew a mountain"; ``who``
    its author, "" where the name is not known; ``at``: when, seconds since 1970, None where that is not known."""

    first: int
    last: int
    at: float | None
    client: str
    who: str
    text: str

    def __str__(self) -> str:
        return f"{self.who or 'Somebody'} {self.text}"


class HistoryReader:
    """The history of the terrain behind a link."""

    def __init__(self, link: str, tls: ssl.SSLContext | None = None) -> None:
        """Raises ValueError for what is no link."""
        self._api = Api(link, tls)

    def events(self, before: int | None = None) -> Iterator[Event]:
        """Yields what people did, newest first, read page by page. Raises Refused, OSError."""
        while True:
            query = {"limit": c.MAX_HISTORY_PAGE} | ({} if before is None else {"before": before})
            page = self._ask("GET", f"history?{urlencode(query)}")
            for entry in page["entries"]:
                who = page["people"].get(entry["author"], {}).get("name", "")
                yield Event(entry["first"], entry["last"], entry["at"], entry["author"], who, entry["text"])
            if not page["more"]:
                return
            before = page["entries"][-1]["last"]

    def document(self, clock: int) -> c.Document:
        """The document as it was. Raises Refused, OSError."""
        return c.Document.model_validate_json(json.dumps(self._ask("GET", f"document?at={clock}")))

    def fork(self, clock: int | None, title: str | None) -> str:
        """The owner link of a new terrain. Raises Refused, OSError."""
        made = self._ask("POST", "fork", {"at": clock} | ({} if title is None else {"title": title}))
        return f"{self._api.origin}/t/{made['id']}#{made['secret']}"

    def _ask(self, method: str, path: str, body: Mapping[str, Any] | None = None) -> Any:
        data = None if body is None else json.dumps(body).encode()
        return json.loads(self._api.request(method, path, data))


class LiveHistory:
    """The methods of ``LiveTerrain`` for what was."""

    _address: str
    _tls: ssl.SSLContext | None
    _grids: Grids
    _solver: Any

    def history(self, before: int | None = None) -> Iterator[Event]:
        """Yields what people did here, newest first; ``before``: only what had ended before this clock.

        Raises Refused, OSError while it is read.
        """
        if before is not None:
            before = arguments.clock("before", before)
        return HistoryReader(self._address, self._tls).events(before)

    def at(self, clock: int) -> Terrain:
        """The terrain as it was at a clock (now, where that is earlier), solved here. Raises Refused, OSError."""
        clock = arguments.clock("clock", clock)
        document = HistoryReader(self._address, self._tls).document(clock)
        return Terrain.from_document(document, self._grids.of(document.layers), solver=self._solver, trusted=True)

    def fork(self, clock: int | None = None, title: str | None = None) -> str:
        """A new terrain on the same server, as this one was at a clock (default: now); returns its owner link.

        Raises Refused (also where the link only allows to look), OSError.
        """
        if clock is not None:
            clock = arguments.clock("clock", clock)
        if title is not None:
            title = arguments.text("title", title, c.MAX_NAME_LENGTH)
        return HistoryReader(self._address, self._tls).fork(clock, title)


class LiveLesson:
    """The part of ``LiveTerrain`` that knows how the lesson stands."""

    _connection: LiveConnection

    @property
    def lesson(self) -> c.Lesson:
        """How the lesson stands: whether hands are off, whether we draw, who was sent out."""
        with self._connection.changed:
            return self._connection.lesson

    @property
    def notices(self) -> tuple[str, ...]:
        """What the server said to us about the lesson, the last thing last."""
        with self._connection.changed:
            return tuple(self._connection.notices)

    def conduct(self, **switches: object) -> None:
        """Switches ``hands_off``, ``protect``, ``hide``, ``animals``, ``look`` or ``held``. The others stay.

        Whoever does not lead gets a notice. Raises ValueError for what is no switch, RuntimeError while nobody is
        connected.
        """
        self._connection.say(arguments.model(c.Conduct, switches))

    def about(self, action: c.PersonAction, *people: str) -> None:
        """Does something about people, by their ids (``members`` has them as ``person``): ``pen``, ``no_pen``,
        ``conductor``, ``no_conductor``, ``remove``, ``let_in`` or ``undo``.

        Raises ValueError, and RuntimeError while nobody is connected.
        """
        self._connection.say(arguments.model(c.People, {"action": action, "people": tuple(people)}))

    def group(self, group: str | None, **changes: object) -> None:
        """Changes a group of people (``lesson.groups``) by its id, or with None every group: ``name`` (which makes a
        group of a new id), ``pen``, ``put`` and ``out`` (people by their ids), ``forget``. What is not named stays.

        Raises ValueError, and RuntimeError while nobody is connected.
        """
        people = {name: tuple(value) for name, value in changes.items() if isinstance(value, list | tuple)}
        self._connection.say(arguments.model(c.Grouping, {"group": group, **changes, **people}))
