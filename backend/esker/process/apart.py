"""Runs a module as ``python -m`` does, in a process group of its own: ``python -m esker.process.apart MODULE …``.

A terminal's Ctrl-C reaches one group, and whoever started a child ends it. The child makes the group itself: an event
loop that is written in C starts children in a session of their own or in none. In one of its own a child would have as
much of the processors as the whole server, however far it stepped back: Linux shares them by session first, where it
groups processes so (autogroups).
"""

from __future__ import annotations

import os
import runpy
import sys
from contextlib import suppress


def main() -> None:
    """Runs the module that the first argument names, with the others."""
    if hasattr(os, "setpgid"):
        with suppress(OSError):  # it leads a session
            os.setpgid(0, 0)
    module = sys.argv[1]
    del sys.argv[0]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
