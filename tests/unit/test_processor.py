"""What tests cost is counted with their children (``tests/processor.py``)."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.processor import tree_seconds

BUSY = "import time\nwhile time.process_time() < 0.4: pass\nprint('done', flush=True)\ninput()"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system does not tell what processes take")
def test_processor_time_is_that_of_living_and_of_ended_children() -> None:
    before, own = tree_seconds(os.getpid()), time.process_time()
    command = [sys.executable, "-c", BUSY]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "done\n"
        living = tree_seconds(os.getpid()) - before
        child.communicate("\n")
    ended = tree_seconds(os.getpid()) - before
    assert 0.35 < living <= ended
    assert ended < 2 + time.process_time() - own
