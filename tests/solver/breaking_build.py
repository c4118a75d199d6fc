"""A first build that goes wrong in one way: ``python -m tests.solver.breaking_build`` in place of the real one."""

import os
import subprocess
import sys
import time

how = os.environ["BREAK"]
if how == "abort":
    os.abort()
if how == "memory":
    kept = bytearray(80 << 20)
    kept[::4096] = b"x" * len(kept[::4096])
if how == "words":
    sys.stdout.write("no JSON\n")
if how == "turns":
    while True:
        pass
if how in ("memory", "waits"):
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"]) as linker:
        sys.stderr.write(f"{linker.pid}\n")
        time.sleep(600)
