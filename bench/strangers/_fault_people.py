"""People who draw while servers are killed under them, and what of it they were told is saved."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Iterator
from typing import Any, Final

from esker import contract as c
from esker.api.live import connection as live
from esker.api.live.client import LiveTerrain, Refused

PEOPLE: Final = 3
PERIOD: Final = 0.04
"""Seconds between two operations of a person."""
MOST_PENDING: Final = 150
"""With so many unsaved a person waits for the server."""
PATIENCE: Final = 120.0


class Person:
    """Draws, drags and deletes in a thread of its own, and comes back after every cut."""

    def __init__(self, link: str, name: str, seed: int) -> None:
        self.acked: dict[str, int] = {}
        """Clocks by the ids that were acknowledged."""
        self._rng = random.Random(seed)
        self._name, self._count = name, 0
        self._stop = threading.Event()
        self.live = LiveTerrain(link, name, timeout=PATIENCE)
        sync: Any = self.live._sync
        taken = sync.ack

        def ack(message: c.Ack) -> None:
            self.acked |= dict(zip(message.ids, message.clocks, strict=True))
            taken(message)

        sync.ack = ack
        self.refused: list[str] = []
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def pending(self) -> int:
        """Operations that are not saved yet."""
        return len(self.live._sync.pending)

    def rest(self) -> None:
        """Draws no more."""
        self._stop.set()
        self._thread.join()

    def settle(self) -> c.Document:
        """Waits until all is saved; what the terrain is from here. Raises TimeoutError."""
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                self.live.wait(max(0.1, deadline - time.monotonic()))
                return self.live.document
            except Refused as refused:
                self.refused.append(str(refused))

    def _run(self) -> None:
        gesture: Iterator[c.Op] = iter(())
        while not self._stop.is_set():
            op = next(gesture, None)
            if op is None:
                self._count += 1
                gesture = self._gesture(f"{self._name}-{self._count}")
                continue
            try:
                self.live.apply(op)
            except Refused:  # somebody else deleted what this is about
                gesture = iter(())
            self._stop.wait(PERIOD if self.pending < MOST_PENDING else 10 * PERIOD)

    def _gesture(self, name: str) -> Iterator[c.Op]:
        rng, strokes = self._rng, [stroke.id for stroke in self.live.strokes]
        if len(strokes) > 60:
            yield c.DeleteStroke(stroke=strokes[0])
        elif strokes and rng.random() < 0.4:
            stroke = rng.choice(strokes)
            for _ in range(rng.randint(3, 15)):
                yield c.MoveAnchor(stroke=stroke, which="last", to=(round(rng.uniform(0, 4000), 2), 900.0, 5.0))
        else:
            ends: dict[str, Any] = {"first": (100.0, 200.0, 0.0), "last": (300.0, 200.0, 0.0)}
            yield c.BeginStroke(stroke=c.Stroke(id=name, kind="profile", curve=(), **ends))
            curve: tuple[c.CurvePoint, ...] = ()
            for k in range(rng.randint(3, 20)):
                curve += ((k / 20, round(rng.uniform(0, 90), 2)),)
                yield c.AppendPoints(stroke=name, start=0, points=curve, last=(300.0 + 10 * k, 200.0, 0.0))
            yield c.FinishStroke(stroke=name)


def come_back_soon() -> None:
    """Clients try again at once: a life of a server is short here."""
    places: Any = live
    places.BACKOFF_SECONDS = (0.05, 0.1)
