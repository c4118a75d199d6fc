"""Threads of the server take memory from few heaps (SPEC S589)."""

from __future__ import annotations

import subprocess
import sys

import pytest

CHILD = """
import ctypes, sys, threading
from esker.process import system
libc = ctypes.CDLL(None)
if not hasattr(libc, "malloc_info"):
    sys.exit(3)
if sys.argv[1] == "shared":
    assert system.share_heaps()
gate = threading.Barrier(9)
def work():
    held = libc.malloc(100_000)
    gate.wait()
    gate.wait()
threads = [threading.Thread(target=work) for _ in range(8)]
for each in threads:
    each.start()
gate.wait()
libc.fdopen.restype = ctypes.c_void_p
out = libc.fdopen(1, b"w")
libc.malloc_info(0, ctypes.c_void_p(out))
libc.fflush(ctypes.c_void_p(out))
gate.wait()
"""


def test_threads_share_two_heaps() -> None:
    """SPEC S589: what one frees serves the others; by itself each thread has one."""
    heaps = {}
    for how in ("own", "shared"):
        done = subprocess.run([sys.executable, "-c", CHILD, how], capture_output=True, timeout=60, check=False)
        if done.returncode == 3:
            pytest.skip("not the GNU C library")
        assert done.returncode == 0, done.stderr.decode()
        heaps[how] = done.stdout.count(b"<heap nr=")
    assert heaps["shared"] <= 2 < heaps["own"]
