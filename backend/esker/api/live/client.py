"""A live terrain from Python (DESIGN 5.7): ``esker.connect(link)`` has the methods of ``Terrain`` and of a session.

    with esker.connect("http://127.0.0.1:8000/t/abc#secret") as t:
        ridge = t.add(Stroke.profile([(500, 2000, 0), (2000, 2200, 900), (3500, 2000, 0)]))
        t.set(ridge, label="Ridge")
        h = t.heights(level=4)

A thread holds the socket. Calls apply at once here and are confirmed by the server; after a cut the thread reconnects
and sends again what was not acknowledged. ``heights`` are solved here from the document; with ``ground=True`` the
client also takes what the server streams:

    with esker.connect(link, ground=True) as t:
        t.ground.look(eye=(2000, 1900, 40), target=(2000, 2000, 30))
        t.ground.wait()
        fine = t.ground.tile(8, 120, 131)   # (65, 65) float32, metres, where one looks
        rough = t.ground.roughness(2)       # (257, 257)
"""

from __future__ import annotations

import secrets
import ssl
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self, get_args

from esker import contract as c
from esker.api import arguments
from esker.api.link import Link, Refused
from esker.api.live.connection import CONNECT_SECONDS, LiveConnection
from esker.api.live.ground import StreamedGround
from esker.api.live.heights import LiveHeights
from esker.api.live.history import LiveHistory, LiveLesson
from esker.api.live.layers import Grids, LiveLayers
from esker.contract import Document, Op, Stroke, TerrainSettings
from esker.document.ops import Refusal
from esker.document.undo import UndoPlan
from esker.document.wire import op_json
from esker.solve.solver import Solver

__all__ = ["Link", "LiveTerrain", "Refused", "connect"]

MESSAGE_BYTES: Final = c.MAX_MESSAGE_BYTES - 1024
MAX_CURVE_POINTS: Final = 1_024
"""A longer curve is sent by appends: one message does not hold it."""


class LiveTerrain(LiveLayers, LiveHistory, LiveHeights, LiveLesson):
    """A terrain that others may be changing too. All methods may be called from any thread."""

    def __init__(
        self,
        link: str,
        name: str = "Python",
        *,
        ca_file: str | Path | None = None,
        timeout: float = CONNECT_SECONDS,
        solver: Solver | None = None,
        ground: bool = False,
    ) -> None:
        """Connects and waits for the document. ``ca_file``: the ``esker-ca.pem`` of a classroom server; ``ground``:
        take the tiles that the server streams.

        Raises ValueError for what is no link, Refused when the server does not let us in, TimeoutError.
        """
        timeout, ground = arguments.wait("timeout", timeout), arguments.flag("ground", ground)
        self._ca_file = None if ca_file is None else arguments.path("ca_file", ca_file)
        self._link, self._name = Link(link), arguments.text("name", name, c.MAX_NAME_LENGTH)
        self._solver, self._address = arguments.kind("solver", solver, Solver), link
        self._tls = ssl.create_default_context(cafile=ca_file) if self._link.secure else None
        self._grids = Grids(link, self._tls)
        self._client = f"py-{secrets.token_hex(8)}"
        self._connection = LiveConnection(self._link, self._name, self._client, self._tls, ground=ground)
        self._sync, self._changed = self._connection.sync, self._connection.changed
        self._local = None
        try:
            self._await(lambda: self._sync.clock is not None, timeout, "no answer from the server")
        except BaseException:
            self.close()
            raise

    # --- reading ------------------------------------------------------------------------------------------------

    @property
    def id(self) -> str:
        """The terrain's id."""
        return self._link.terrain

    @property
    def role(self) -> c.Role:
        """The role that this link gives."""
        return self._connection.role

    @property
    def online(self) -> bool:
        """False while the connection is being made again."""
        return self._connection.is_online

    @property
    def members(self) -> tuple[c.Member, ...]:
        """Who is here, ourselves included."""
        with self._changed:
            return self._connection.members

    @property
    def strokes(self) -> tuple[Stroke, ...]:
        """The strokes as seen from here: confirmed, with our unconfirmed changes on top."""
        with self._changed:
            return tuple(self._sync.document.strokes.values())

    @property
    def settings(self) -> TerrainSettings:
        """The terrain's settings."""
        with self._changed:
            return self._sync.document.settings

    @property
    def clock(self) -> int:
        """Clock of the confirmed document."""
        with self._changed:
            return self._sync.confirmed.clock

    @property
    def document(self) -> Document:
        """The confirmed document."""
        with self._changed:
            return self._sync.confirmed.to_document()

    @property
    def ground(self) -> StreamedGround:
        """The ground that the server streams. Raises RuntimeError unless connected with ``ground=True``."""
        if self._connection.ground is None:
            raise RuntimeError("connect with ground=True to take the ground that the server streams")
        return self._connection.ground

    # --- changing -----------------------------------------------------------------------------------------------

    def add(self, stroke: Stroke) -> str:
        """Adds a stroke, or replaces the one of the same id; returns the id. One undo step.

        Raises Refused, TypeError for what is no stroke, RuntimeError after ``close``.
        """
        if not isinstance(stroke, c.Stroke):
            raise TypeError(f"add takes a stroke, as Stroke.profile(...) makes one, not {type(stroke).__name__}")
        arguments.model(c.Stroke, stroke.model_dump())  # it may be a copy with any fields
        gesture = f"add-{secrets.token_hex(4)}"
        with self._changed:
            exists = stroke.id in self._sync.document.strokes
        long = len(stroke.curve) > MAX_CURVE_POINTS
        if exists:
            fields = {n: getattr(stroke, n) for n in c.StrokeFields.model_fields if not (long and n == "curve")}
            self._submit(c.SetStroke(stroke=stroke.id, fields=c.StrokeFields.model_validate(fields)), gesture)
        else:
            born = stroke.model_copy(update={"curve": (), "finished": False, "locked": False}) if long else stroke
            self._submit(c.BeginStroke(stroke=born), gesture)
        if long:
            step = c.MAX_POINTS_PER_APPEND
            for start in range(0, len(stroke.curve), step):
                points = stroke.curve[start : start + step]
                op = c.AppendPoints(stroke=stroke.id, start=start, points=points, last=stroke.last)
                self._submit(op, gesture)
            if stroke.finished:
                self._submit(c.FinishStroke(stroke=stroke.id), gesture)
            if stroke.locked:
                self._submit(c.SetStroke(stroke=stroke.id, fields=c.StrokeFields(locked=True)), gesture)
        return stroke.id

    def remove(self, stroke_id: str) -> None:
        """Deletes a stroke. Raises Refused, ValueError for what is no id."""
        self._submit(arguments.model(c.DeleteStroke, {"stroke": stroke_id}))

    def restore(self, stroke_id: str) -> None:
        """Brings a deleted stroke back. Raises Refused, ValueError for what is no id."""
        self._submit(arguments.model(c.RestoreStroke, {"stroke": stroke_id}))

    def set(self, stroke_id: str, **fields: Any) -> None:
        """Changes fields of a stroke: ``label``, ``left``, ``hidden`` … Raises Refused, ValueError."""
        changes = arguments.model(c.StrokeFields, fields)
        self._submit(arguments.model(c.SetStroke, {"stroke": stroke_id, "fields": changes}))

    def set_terrain(self, **fields: Any) -> None:
        """Changes settings: ``title``, ``sea_level_m``, ``look`` … Raises Refused, ValueError."""
        self._submit(c.SetTerrain(fields=arguments.model(c.TerrainFields, fields)))

    def apply(self, op: Op) -> None:
        """Any op of the contract. Raises Refused when it does not apply here, TypeError for what is none."""
        if not isinstance(op, get_args(get_args(c.Op)[0])):
            raise TypeError(f"apply takes an op of esker.contract, not {type(op).__name__}")
        self._submit(op)

    def undo(self) -> UndoPlan:
        """Takes back our own last step; never what others did since (``skipped`` says what was left)."""
        return self._travel(self._sync.undo)

    def redo(self) -> UndoPlan:
        """Takes back our own last undo."""
        return self._travel(self._sync.redo)

    def wait(self, timeout: float = CONNECT_SECONDS) -> int:
        """Returns the clock once all our changes are in the server's journal.

        Raises TimeoutError, and Refused when the server refused one of them since the last ``wait``.
        """
        timeout = arguments.wait("timeout", timeout)
        self._await(lambda: not self._sync.pending, timeout, "the server has not saved everything")
        with self._changed:
            refusals, self._connection.refusals = self._connection.refusals, []
            if refusals:
                raise refusals[0]
            return self._sync.confirmed.clock

    def wait_clock(self, clock: int, timeout: float = CONNECT_SECONDS) -> None:
        """Returns once the confirmed document has reached ``clock``. Raises TimeoutError, ValueError."""
        clock, timeout = arguments.clock("clock", clock), arguments.wait("timeout", timeout)
        self._await(lambda: self._sync.confirmed.clock >= clock, timeout, f"clock {clock} did not come")

    def close(self) -> None:
        """Leaves. What is unsent then is lost: call ``wait`` first."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self.wait()
        finally:
            self.close()

    def _submit(self, op: Op, gesture: str | None = None) -> None:
        if len(op_json(op)) > MESSAGE_BYTES:
            raise Refused("too_large", "This change is too large for one message.")
        with self._changed:
            self._connection.raise_failure()
            self._connection.raise_closed()
            try:
                self._sync.submit(op, gesture)
            except Refusal as refusal:
                raise Refused(refusal.code, refusal.message) from None
        self._connection.poke()

    def _travel(self, move: Callable[[], UndoPlan]) -> UndoPlan:
        with self._changed:
            self._connection.raise_failure()
            self._connection.raise_closed()
            plan = move()
        self._connection.poke()
        return plan

    def _await(self, ready: Callable[[], bool], timeout: float, what: str) -> None:
        self._connection.wait_for(ready, timeout, what)


def connect(link: str, name: str = "Python", **options: Any) -> LiveTerrain:
    """Joins a terrain of a running server by its share link.

    Parameters
    ----------
    link: the share link, as a browser opens it; its role says what may be done.
    name: what other people see.
    options: those of ``LiveTerrain``: ``ca_file``, ``timeout``, ``solver``, ``ground``.

    Returns
    -------
    The live terrain. It has the methods of ``Terrain``; ``close`` it, or use it in a ``with`` statement.

    Raises
    ------
    ValueError: the link is none. Refused: the server lets nobody in with it. TimeoutError: no server answers.

    Examples
    --------
    ``link`` is one that may draw, such as "http://127.0.0.1:8000/t/abc#secret".

    >>> from esker import Stroke, connect
    >>> with connect(link, "Ada") as t:
    ...     _ = t.add(Stroke.level([(1000, 1000, 120), (2000, 1200, 120)], id="mesa"))
    ...     t.set("mesa", label="Table hill")
    ...     clock = t.wait()
    ...     t.role, t.strokes[0].label, clock > 0, t.heights(level=0).shape
    ('owner', 'Table hill', True, (65, 65))
    """
    return LiveTerrain(link, name, **options)
