"""Compiles what each server, node and reader of files would compile at its first start: ``python -m tests.warm``.

Parts of the tests that begin side by side in an empty checkout would each compile all of it. Here it is done once,
while packages still come over the network; tests of first starts have empty folders of their own.
"""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from threading import Event

from esker.importing import warm
from esker.server import first_build
from esker.solve.solver import Solver


def main() -> None:
    """Kernels of the solver, loops of tiles and rivers; beside them those of layers and of readers of files."""
    with ThreadPoolExecutor(1) as beside:
        layers = beside.submit(first_build.have_layer_loops, Event())
        Solver()
        first_build.have_loops(Event(), Event())
        first_build.have_river_loops(Event())
        layers.result()
    # After those of layers, of which readers run some: none is compiled twice.
    asyncio.run(warm.loops())


if __name__ == "__main__":
    main()
