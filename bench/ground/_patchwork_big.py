"""Builds one large raster out of core: ``python -m bench.ground._patchwork_big HEIGHTS.npy FOLDER``.

A process of its own, so that its memory is its own, with a limit on what it may allocate (RLIMIT_DATA): beyond
``LIMIT_MIB`` it fails. Three figures of it: ``anonymous``, what the process itself allocated, ``resident``, which
counts the pages of mapped files too, both looked at every ``EVERY_S``, and ``peak_resident``, the kernel's own record
of the latter, which misses no moment. What the system keeps of files in its cache is no process's and is not counted.
"""

from __future__ import annotations

import contextlib
import json
import resource
import sys
import threading
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.ground import patchwork
from esker.patchwork.raster import rasters

EVERY_S: Final = 0.02
LIMIT_MIB: Final = 1024


class Watch(threading.Thread):
    """Greatest memory of this process while it runs, MiB."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.most = {"RssAnon": 0.0, "VmRSS": 0.0, "VmHWM": 0.0}
        with contextlib.suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5")  # the record begins anew
        self._over = threading.Event()

    def run(self) -> None:
        """Looks every ``EVERY_S``."""
        while not self._over.wait(EVERY_S):
            self._look()

    def _look(self) -> None:
        for line in Path("/proc/self/status").read_text().splitlines():
            name, _, value = line.partition(":")
            if name in self.most:
                self.most[name] = max(self.most[name], int(value.split()[0]) / 1024)

    def stop(self) -> dict[str, float | None]:
        """Ends it."""
        self._over.set()
        self.join()
        self._look()
        limit = resource.getrlimit(resource.RLIMIT_DATA)[0]
        return {
            "anonymous_mib": self.most["RssAnon"],
            "resident_mib": self.most["VmRSS"],
            "peak_resident_mib": self.most["VmHWM"],
            "data_limit_mib": None if limit == resource.RLIM_INFINITY else limit / 2**20,
        }


def main(heights: Path, folder: Path) -> dict[str, Any]:
    """Stages, bytes and memory."""
    patchwork.built(lambda stages: rasters.build(np.zeros((200, 200)), progress=stages))  # compiled loops, ready
    mapped = np.load(heights, mmap_mode="r")
    watch = Watch()
    watch.start()
    figures, raster, model, index = patchwork.built(
        lambda stages: rasters.build_out_of_core(mapped, folder, progress=stages)
    )
    memory = watch.stop()
    return figures | {
        "patches": model.count, "bytes_over": patchwork.bytes_over(raster, model, index), "memory": memory,
    }  # fmt: skip


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_DATA, (LIMIT_MIB << 20, LIMIT_MIB << 20))
    sys.stdout.write(json.dumps(main(Path(sys.argv[1]), Path(sys.argv[2]))) + "\n")
