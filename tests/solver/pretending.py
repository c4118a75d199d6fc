"""The first build where PoCL passes for a graphics driver: ``python -m tests.solver.pretending`` in its place.

PRETEND says what becomes of it: "works", or it fails as the word says, in the middle of building.
"""

import os
import sys

from esker.server import first_build
from esker.solve.opencl import device

NAME = "Pretend One"


def _pretended() -> list[tuple[str, object]]:
    return [(NAME, found) for _, found in _real()]


def _broken(name: str, device: object) -> device.Device:
    if os.environ["PRETEND"] == "abort":
        os.abort()
    if os.environ["PRETEND"] == "refuse":
        raise RuntimeError("error: no such intrinsic")
    while True:
        pass


_real = device._devices
if __name__ == "__main__":
    device._devices = _pretended
    if os.environ["PRETEND"] != "works":
        device._open = _broken
    sys.exit(first_build.main(sys.argv[1:]))
