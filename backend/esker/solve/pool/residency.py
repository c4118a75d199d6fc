"""Which workspaces of a solver have device memory: those that solve now, and as many others as fit (decision 57).

Device memory goes by arenas, each with all that one workspace needs while it solves. A workspace that is to solve and
has none gets that of the one that has not solved for longest, which is parked (``parking.py``).
"""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any, Final

from esker import grid
from esker.solve.opencl.device import Device
from esker.solve.opencl.parking import Spares
from esker.solve.opencl.workspaces import on_device, with_arena

if TYPE_CHECKING:
    from esker.solve.opencl.device_workspace import Arena, DeviceWorkspace
    from esker.solve.opencl.workspaces import OnDevice

SHARE: Final = 8
"""Arenas of all kinds take up to this part of the bound of a solver's workspaces, but there is one of each kind."""

Kind = tuple[int, bool]
"""Finest level, and whether over a base."""


class Residency:
    """Gives arenas to workspaces. Use it from the solver's thread. bound: bytes for arenas."""

    def __init__(self, bound: int) -> None:
        self.bound = bound
        self.spares = Spares()
        self._turns: weakref.WeakKeyDictionary[DeviceWorkspace[Any], int] = weakref.WeakKeyDictionary()
        """The workspaces that have an arena, each with the number of its last turn."""
        self._turn = 0
        self._free: list[tuple[Kind, Arena]] = []

    @property
    def bytes(self) -> int:
        """Bytes of arenas that no workspace has, and of host memory that is kept for the next parking."""
        return self.spares.bytes + sum(grid.arena_bytes(*kind) for kind, _ in self._free)

    def new(self, device: Device, top: int, based: bool) -> OnDevice:
        """A workspace that is empty and has an arena. Raises OutOfDeviceMemoryError and other DeviceErrors."""
        arena = self._arena((top, based))
        made = on_device(device, top, based) if arena is None else with_arena(device, top, based, arena)
        made.home = self
        self._admitted(made)
        return made

    def admit(self, workspace: DeviceWorkspace[Any]) -> None:
        """Sees to it that a workspace has an arena; it is its turn. Raises DeviceErrors."""
        if workspace.is_parked:
            kind = workspace.top, workspace.based
            arena = self._arena(kind)
            if arena is None:
                arena = on_device(workspace.device, *kind).park(self.spares, empty=True)
            workspace.resume(arena, self.spares)
        self._admitted(workspace)

    def drop(self, workspace: DeviceWorkspace[Any]) -> None:
        """A workspace goes; its arena stays for the next one."""
        if not workspace.is_parked:
            self._turns.pop(workspace, None)
            self._free.append(((workspace.top, workspace.based), workspace.park(self.spares, empty=True)))

    def clear(self) -> None:
        """Lets go what no workspace has."""
        self._free.clear()
        self.spares.clear()

    def cost(self, top: int, based: bool) -> int:
        """Bytes that one workspace more would take: an arena, or what the one keeps that gives its arena to it."""
        if any(kind == (top, based) for kind, _ in self._free):
            return 0
        return (grid.arena_bytes if self._may_grow((top, based)) else grid.parked_bytes)(top, based)

    def _may_grow(self, kind: Kind) -> bool:
        held = [(w.top, w.based) for w in self._turns] + [other for other, _ in self._free]
        return kind not in held or sum(grid.arena_bytes(*other) for other in [*held, kind]) <= self.bound

    def _admitted(self, workspace: DeviceWorkspace[Any]) -> None:
        self._turn += 1
        self._turns[workspace] = self._turn

    def _arena(self, kind: Kind) -> Arena | None:
        """An arena that nobody has, or that of another workspace where there are as many as may be; None: make one."""
        free = next((k for k, (other, _) in enumerate(self._free) if other == kind), None)
        if free is not None:
            return self._free.pop(free)[1]
        return None if self._may_grow(kind) else self._taken(kind)

    def _taken(self, kind: Kind) -> Arena | None:
        """The arena of the workspace of a kind that has had no turn for longest, one that rests before one that is in
        the middle of a solve; None where no workspace has one."""
        found = [w for w in self._turns if (w.top, w.based) == kind]
        if not found:
            return None
        last = min(found, key=lambda w: (w.in_progress, self._turns[w]))
        del self._turns[last]
        return last.park(self.spares)
