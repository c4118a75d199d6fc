"""What the room needs from other rooms of the house, as protocols: so it can be tested without any of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from esker import contract as c
from esker.grid import TileKey
from esker.store.journal import Loaded, Row
from esker.store.moments import Person
from esker.tiles.delivery import RefinedTile


class FramePlan(Protocol):
    """A binary frame decided but not yet encoded. ``encode`` is pure and may run in any thread."""

    def encode(self) -> bytes: ...


class ClientTiles(Protocol):
    """What one client holds and looks at (``tiles/delivery.py``)."""

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
        show: bool = True,
    ) -> int: ...

    def settled(self) -> bool: ...

    def put_tile(self, clock: int, tile: RefinedTile) -> bool: ...

    def limit(self, top: int) -> None: ...

    def wishes(self, clients: Sequence[Any]) -> tuple[tuple[TileKey, ...], int]: ...


class Tiles(Protocol):
    """Makes the two above."""

    def server(self, size_m: float, levels: int, finest: int) -> TileServer: ...

    def client(self, server: TileServer) -> ClientTiles: ...


class LevelResult(Protocol):
    """One solved level (``solve/solver.py``)."""

    @property
    def level(self) -> int: ...

    @property
    def heights(self) -> NDArray[np.float32]: ...

    @property
    def settled(self) -> bool: ...

    @property
    def channel(self) -> c.Channel: ...

    @property
    def basis(self) -> Any:
        """With the last result of a settled solve, if it was asked for: what ``Solver.refiner`` takes."""
        ...


class Refiner(Protocol):
    """Refines one settled solve, in the worker's thread (``solve/refine.py``)."""

    def tiles(
        self, keys: Sequence[TileKey], urgent: Callable[[], bool] | None = None
    ) -> Iterator[RefinedTile | None]: ...


class Refinement(Protocol):
    """Which tiles above the global levels a room wants, and where they go (``feed.TileFeed``)."""

    def wanted(self) -> Sequence[TileKey]:
        """The next tiles to refine, most urgent first; none while the ground moves. From any thread."""
        ...

    def deliver_tile(self, clock: int, tile: RefinedTile) -> None:
        """Takes a tile of the settled solve at ``clock``. In the worker's thread; never waits."""
        ...


class Base(Protocol):
    """The ground of the elevation layers (``patchwork/base.py``): immutable, so the same object is the same ground."""

    @property
    def digest(self) -> bytes: ...


class Elevation(Protocol):
    """Makes the base of a terrain's layers (``esker.elevation``). May block for seconds: not for the event loop."""

    def base(
        self,
        layers: tuple[c.Layer, ...],
        size_m: float,
        before: Base | None,
        tell: Callable[[str], None] = ...,
    ) -> Base | None:
        """The base of these layers, hidden ones left out; None when nothing is visible.

        ``before``: an earlier base of the same terrain, whose parts that no changed layer reaches are used again.
        ``tell`` is called with a sentence for each layer that had to be left out.
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
    ) -> Iterator[LevelResult | None]:
        """Whose solves are ``schedule.Glimpsing`` also take ``coarsest=False``: level 0 is out already."""
        ...

    def base_levels(self, base: Any, levels: int) -> Iterator[LevelResult | None]:
        """The base up to a level, coarse to fine, then the survey channel: to be shown before what is solved on it."""
        ...

    def channels(
        self, strokes: Sequence[c.Stroke], settings: c.TerrainSettings, levels: int | None = None, *, base: Any = None
    ) -> Iterator[LevelResult | None]: ...

    def refiner(self, basis: Any) -> Refiner: ...


@runtime_checkable
class Tidying(Protocol):
    """A solver that keeps memory for rooms that may come back."""

    def tidy(self) -> int:
        """Gives back what nobody has used for long; how many pieces that were. Called while there is nothing to do."""
        ...


SolverFactory = Callable[[str | None], Solver]
"""Makes a solver for a device name (None: the default device). Called in the worker's thread."""


class Journal(Protocol):
    """The part of ``store.journal.Journal`` that a room uses."""

    def append(
        self,
        terrain: str,
        rows: Sequence[Row],
        snapshot: c.Document | None = None,
        people: Sequence[Person] = (),
    ) -> Future[None]: ...

    def find(self, terrain: str, client: str, counter: int) -> int | None: ...

    def load(self, terrain: str, upto: int | None = None) -> Loaded | None: ...

    def rows(self, terrain: str, after: int, upto: int | None = None) -> list[Row]: ...
