"""A pytest plugin that tells which tests cost the most processor time: their own, their servers' and their browsers'.

How long a test lasts says little beside other parts of the tests: what the whole takes is the sum of what all compute.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

TOLD = 12
"""The summary at the end of a run names so many tests."""
RARELY_SECONDS = 0.3
"""Looking through the processes takes milliseconds: what several short tests took is told of the last one."""


def tree_seconds(root: int) -> float:
    """Processor time of a process, of its living descendants and of those that ended and were waited for, seconds."""
    parents: dict[int, int] = {}
    ticks: dict[int, int] = {}
    for name in os.listdir("/proc"):
        if name.isdigit():
            try:
                fields = Path("/proc", name, "stat").read_text().rpartition(")")[2].split()
            except OSError:  # it ended meanwhile
                continue
            parents[int(name)] = int(fields[1])
            ticks[int(name)] = sum(map(int, fields[11:15]))
    ours = {root}
    grown = True
    while grown:
        more = {each for each, parent in parents.items() if parent in ours} - ours
        grown = bool(more)
        ours |= more
    return sum(ticks.get(each, 0) for each in ours) / os.sysconf("SC_CLK_TCK")


class Processor:
    """Adds up what each test took. What ended without being waited for is missing."""

    def __init__(self) -> None:
        self.looked = time.monotonic()
        self.before = tree_seconds(os.getpid())
        self.took: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Iterator[None]:
        now = time.monotonic()
        if now - self.looked > RARELY_SECONDS:
            after = tree_seconds(os.getpid())
            self.took[item.nodeid] = self.took.get(item.nodeid, 0.0) + max(0.0, after - self.before)
            self.looked, self.before = now, after
        return (yield)  # after the last test of a browser or a server they end, and what they took is not seen any more

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if path := os.environ.get("ESKER_TEST_PROCESSOR"):
            Path(f"{path}.{os.getpid()}.json").write_text(json.dumps(self.took, indent=1))
        if sum(self.took.values()) > TOLD:
            terminalreporter.section(f"most processor time, of {sum(self.took.values()):.0f} s")
            for name, seconds in sorted(self.took.items(), key=lambda each: -each[1])[:TOLD]:
                terminalreporter.write_line(f"{seconds:7.1f} s  {name}")


def pytest_configure(config: pytest.Config) -> None:
    """Join where the system tells what processes take."""
    if os.path.exists("/proc/self/stat"):
        config.pluginmanager.register(Processor(), "processor")
