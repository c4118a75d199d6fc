"""A whole server in a process of its own whose solver breaks at every level, to be killed.

``python fault_child.py DATA``: writes its port, a terrain and its secret to stdout as one line of JSON.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from esker.events import Preview, Settled
from esker.solve.opencl.faults import DeviceLostError, OutOfDeviceMemoryError
from tests.sync.harness import LiveServer, PlainSolver


class Breaking(PlainSolver):
    """Fails in another way every time, whatever the device."""

    def __init__(self) -> None:
        self.count = 0

    def steps(self, *job: Any, **_: Any) -> Iterator[Preview | Settled]:
        for level in super().steps(*job):
            self.count += 1
            kinds = (DeviceLostError, OutOfDeviceMemoryError, RuntimeError)
            if self.count % 2:
                raise kinds[self.count // 2 % 3]("The device broke.")
            yield level


if __name__ == "__main__":
    with LiveServer(Path(sys.argv[1]), Breaking(), level=2) as server:
        terrain, secret = server.create()
        sys.stdout.write(json.dumps({"port": server.port, "terrain": terrain, "secret": secret}) + "\n")
        sys.stdout.flush()
        sys.stdin.read()
