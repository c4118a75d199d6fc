"""Protocols of all that the ground of a room needs from other rooms of the house. Tests stand in for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.contract import CloseCode
from esker.events import BaseLevel, SolveEvent
from esker.grid import TileKey
from esker.session.ground.frames.tilethread import Lane
from esker.tiles.delivery import RefinedTile


class FrameOutlet(Protocol):
    """The connection of one client, as far as frames need it (``room.outbox.Outbox``)."""

    @property
    def closing(self) -> object:
        """None while frames may be sent; else the reason why not."""
        ...

    @property
    def home(self) -> str:
        """What the client's address counts as (``fairness.shares.homes``); empty where it has none."""
        ...

    def notify(self) -> None:
        """Says that a frame waits."""
        ...

    def close(self, code: CloseCode, reason: str) -> None:
        """Ends the connection with a sentence."""
        ...


class FramePlan(Protocol):
    """A binary frame decided but not yet encoded. ``encode`` is pure and may run in any thread."""

    def encode(self) -> bytes: ...


class ClientTiles(Protocol):
    """The tiles that one client holds, and its view (``tiles/delivery.py``)."""

    def set_view(self, view: c.View) -> None: ...

    def plan(self, hurry: bool = False) -> Any: ...

    def commit(self, plan: Any) -> None: ...


class TileServer(Protocol):
    """The tiles of one terrain (``tiles/delivery.py``)."""

    def put_level(
        self,
        clock: int,
        level: int,
        heights: NDArray[np.float32],
        settled: bool,
        channel: c.Channel = ...,
    ) -> int: ...

    def note(self, clock: int, level: int, heights: NDArray[np.float32]) -> None: ...

    def settled(self) -> bool: ...

    def heights(self, level: int) -> NDArray[np.float32] | None: ...

    def put_tile(self, clock: int, tile: RefinedTile) -> bool: ...

    def limit(self, top: int) -> None: ...

    def requests(self, clients: Sequence[Any]) -> tuple[tuple[TileKey, ...], int]: ...

    def forget_earlier(self, clients: Sequence[Any]) -> int: ...


class Tiles(Protocol):
    """Makes the two above. ``watcher``: a client that is sent all levels up to ``top`` and nothing else."""

    def server(self, size_m: float, levels: int, finest: int) -> TileServer: ...

    def client(self, server: TileServer) -> ClientTiles: ...

    def watcher(self, server: TileServer, top: int) -> ClientTiles: ...


class Hydrology(Protocol):
    """Finds rivers, in a thread of its own (``server.hydrology``). pace: see ``session.rivers.Pace``."""

    @property
    def pace(self) -> Any: ...

    def lane(self) -> Lane:
        """Returns a place for the searches of one room; homes have turns."""
        ...

    def find(
        self,
        lane: Lane,
        ground: Any,
        settings: c.TerrainSettings,
        span_m: tuple[float, float] | None,
        settled: bool,
        is_wanted: Callable[[], bool],
    ) -> Future[bytes | None]:
        """Begins to look; the outcome is a frame of all rivers of a ground, or None where it was wanted no more.

        Raises RuntimeError once it is closed.
        """
        ...


@runtime_checkable
class WateredTiles(Protocol):
    """Tiles on whose ground rivers are found."""

    @property
    def hydrology(self) -> Hydrology: ...

    def snapshot(self, server: TileServer, level: int) -> Any:
        """Returns the ground of a level at this moment, for ``Hydrology.find``; None before there is any."""
        ...


@runtime_checkable
class ScoredTiles(Protocol):
    """Tiles on whose ground tasks are scored."""

    @property
    def scorer(self) -> Any:
        """What scores tasks (``session.scoring.Scorer``)."""
        ...


class Refiner(Protocol):
    """Refines one settled solve, in the worker's thread (``solve/refine/refinement.py``)."""

    def tiles(
        self, keys: Sequence[TileKey], urgent: Callable[[], bool] | None = None
    ) -> Iterator[RefinedTile | None]: ...


class Refinement(Protocol):
    """The requests of a room for tiles above the global levels, and the place to bring them (``feed.TileFeed``)."""

    def wanted(self) -> Sequence[TileKey]:
        """Returns the next tiles to refine, most urgent first; none while the ground moves.

        It may be called from any thread.
        """
        ...

    def deliver_tile(self, clock: int, tile: RefinedTile) -> None:
        """Takes a tile of the settled solve at ``clock``. Called in the worker's thread; never waits."""
        ...


class Base(Protocol):
    """The ground of the elevation layers (``patchwork/base.py``): immutable, so the same object is the same ground."""

    @property
    def digest(self) -> bytes: ...


class Elevation(Protocol):
    """Makes the base of a terrain's layers (``server.elevation``). May block for seconds: not for the event loop."""

    def base(
        self,
        layers: tuple[c.Layer, ...],
        size_m: float,
        before: Base | None,
        tell: Callable[[str], None] = ...,
        edition: int = 1,
    ) -> Base | None:
        """The base of these layers, hidden ones left out; None when nothing is visible.

        ``before``: an earlier base of the same terrain, whose parts that no changed layer reaches are used again.
        ``tell`` is called with a sentence for each layer that had to be left out. ``edition``: of the terrain's rules.
        """
        ...


class Solver(Protocol):
    """The solver as the worker uses it (``solve/solver.py``)."""

    @property
    def device_name(self) -> str: ...

    def steps(
        self,
        strokes: Sequence[c.Stroke],
        settings: c.TerrainSettings,
        levels: int | None = None,
        *,
        basis: bool = False,
        base: Any = None,
    ) -> Iterator[SolveEvent]:
        """The last event is Done, with a basis where it was asked for. Solvers whose solves are
        ``work.PreviewingEarly`` also take ``coarsest=False``, which leaves out level 0: it was shown."""
        ...

    def base_levels(self, base: Any, levels: int) -> Iterator[BaseLevel]:
        """Yields the base up to a level, coarse to fine, then its data level.

        All of it is shown before strokes solved on it.
        """
        ...

    def channels(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, *, base: Any = None
    ) -> Iterator[SolveEvent]:
        """Yields the channels alone; the last event is Done."""
        ...

    def refiner(self, basis: Any) -> Refiner: ...


@runtime_checkable
class Tidying(Protocol):
    """A solver that keeps memory for rooms that may come back."""

    def tidy(self) -> int:
        """Gives back memory that nobody has used for long, and returns the number of pieces.

        Called while there is nothing to do.
        """
        ...


@runtime_checkable
class Proving(Protocol):
    """A solver that can tell whether its device works."""

    def prove(self) -> None:
        """Solves a small scene that is known to work. Raises when the device does not."""
        ...


SolverFactory = Callable[[str | None], Solver]
"""Makes a solver for a device name (None: the default device). Called in the worker's thread."""
