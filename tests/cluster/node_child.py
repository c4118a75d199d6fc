"""One node in a process of its own: ``python -m tests.cluster.node_child DATA PORT NAME URL [HOURS]``.

The real server with a solver that is arithmetic. HOURS: by how many this machine's clock is wrong.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from esker.process import system
from esker.server.run import Assembly
from esker.server.settings import from_environment
from tests.cluster.processes import LINE
from tests.sync.harness import PlainSolver


def main() -> None:
    data, port, name, url, *hours = sys.argv[1:]
    if hours:
        real, wrong = time.time, 3600.0 * float(hours[0])
        time.time = lambda: real() + wrong
    folder = Path(data)
    line = f"http://127.0.0.1:{os.environ.get(LINE, port)}"
    settings = from_environment(
        data=folder, port=int(port), node=name, advertise=line, page=folder / "none", level=1,
        database=url, log_level="info", metrics="127.0.0.1",
    )  # fmt: skip
    import logging

    logging.basicConfig(level="INFO", format="%(asctime)s %(name)s: %(message)s", stream=sys.stderr)
    assembly = Assembly(settings, lambda _: PlainSolver())
    server = assembly.server(announce=False)
    system.on_stop(lambda *_: setattr(server, "should_exit", True))
    try:
        assembly.run(server)
    finally:
        assembly.close()
    os._exit(0)


if __name__ == "__main__":
    main()
