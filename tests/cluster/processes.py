"""Nodes as processes over one real PostgreSQL, and clients that come back by themselves, as the page does."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

from esker.api.live.client import LiveTerrain
from tests import zygote
from tests.browser import free_port

ROOT = Path(__file__).resolve().parents[2]
KEY = "the key that the nodes of these tests have together"
LINE = "ESKER_TEST_LINE"
PATIENCE = 90.0


class NodeProcess:
    """One node, which can be frozen, killed, stopped and started again."""

    def __init__(self, name: str, url: str, folder: Path, hours: float = 0.0) -> None:
        """``hours``: by how many the clock of its machine is wrong."""
        self.name, self.url, self.folder, self.hours = name, url, folder, hours
        self.port = free_port()
        self.line = self.port
        """The port at which the other nodes reach it."""
        self.process: zygote.Process | None = None
        folder.mkdir(parents=True, exist_ok=True)

    @property
    def base(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        arguments = [str(self.folder), str(self.port), self.name, self.url, *([str(self.hours)] if self.hours else [])]
        environment = {"ESKER_CLUSTER_KEY": KEY, LINE: str(self.line)}
        self.process = zygote.start("tests.cluster.node_child", arguments, environment, self.folder / "log")

    def ready(self) -> None:
        """Waits until the node takes people."""
        assert self.process is not None
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and self.process.poll() is None:
            try:
                with urllib.request.urlopen(f"{self.base}/readyz", timeout=2) as answer:
                    if answer.status == 200:
                        return
            except (urllib.error.URLError, OSError):
                time.sleep(0.05)
        raise AssertionError(self.log()[-6000:])

    def log(self) -> str:
        return (self.folder / "log").read_text(errors="replace")

    def tell(self, number: int) -> None:
        assert self.process is not None
        os.kill(self.process.pid, number)

    def end(self, number: int = signal.SIGKILL) -> None:
        """Ends the process by a signal, and waits until it is gone."""
        if self.process is not None and self.process.poll() is None:
            self.tell(signal.SIGCONT)
            self.tell(number)
            self.process.wait(PATIENCE)

    def request(self, method: str, path: str, body: bytes | None = None, secret: str = "") -> bytes:
        headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {secret}"} if secret else {})
        request = urllib.request.Request(self.base + path, data=body, headers=headers, method=method)
        with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
            found: bytes = answer.read()
            return found

    def refused(self, method: str, path: str, body: Any = None, secret: str = "") -> int:
        """The status of a request that is refused."""
        try:
            self.request(method, path, None if body is None else json.dumps(body).encode(), secret)
        except urllib.error.HTTPError as error:
            return error.code
        raise AssertionError(f"{method} {path} was not refused")

    def figures(self) -> dict[str, float]:
        """What ``/metrics`` says, figures without labels."""
        lines = self.request("GET", "/metrics").decode().splitlines()
        return {name: float(value) for name, _, value in (line.partition(" ") for line in lines) if name[0] != "#"}


@contextmanager
def running(made: list[NodeProcess]) -> Iterator[list[NodeProcess]]:
    """Nodes that take people, until the block ends."""
    try:
        for each in made:
            each.start()
        for each in made:
            each.ready()
        yield made
    finally:
        for each in made:
            each.end(signal.SIGKILL)


@contextmanager
def nodes(url: str, folder: Path, *names: str, hours: dict[str, float] | None = None) -> Iterator[list[NodeProcess]]:
    """Some nodes that take people."""
    with running([NodeProcess(name, url, folder / name, (hours or {}).get(name, 0.0)) for name in names]) as made:
        yield made


def until(holds: Callable[[], Any], what: str = "it did not come") -> Any:
    """Waits until something is true, and returns it."""
    end = time.monotonic() + PATIENCE
    while not (found := holds()):
        if time.monotonic() > end:
            raise AssertionError(what)
        time.sleep(0.02)
    return found


class Artist:
    """Somebody who draws without a pause, and comes back wherever a balancer would bring them."""

    everybody: ClassVar[list[Artist]] = []
    """Those of the test that runs. Whoever draws on after it failed would make the next ones fail."""

    def __init__(self, door: str, terrain: str, secret: str, name: str) -> None:
        """``door``: the base of a node."""
        self._name, self.path = name, f"/t/{terrain}#{secret}"
        self.live = LiveTerrain(door + self.path, name=name, timeout=PATIENCE)
        self._stop = threading.Event()
        self.drawn = 0
        self.pause = 0.02
        """Seconds between two operations."""
        self.waited = 0.0
        """The longest time without an acknowledgement while it drew."""
        self._thread = threading.Thread(target=self._draw, daemon=True)
        self.everybody.append(self)

    @property
    def saved(self) -> int:
        """How much of it is acknowledged."""
        connection = self.live._connection
        with connection.changed:
            return self.drawn - len(connection.sync.pending)

    def turn_to(self, door: str) -> None:
        """From now on the connection is made there, as a balancer makes it when a node is gone."""
        self.live._link.url = f"ws{door.removeprefix('http')}/ws"

    def cut(self) -> None:
        """Ends the connection, as a balancer does that no longer reaches a node."""
        connection = self.live._connection
        socket = connection._socket
        if socket is not None:
            connection._loop.call_soon_threadsafe(socket.transport.abort)

    def begin(self) -> None:
        self._thread.start()

    def _draw(self) -> None:
        last, since = 0, time.monotonic()
        while not self._stop.wait(self.pause):
            with self.live._connection.changed:  # else one would seem to be unsaved that is not counted yet
                self.live.set_terrain(title=f"{self._name} {self.drawn}")
                self.drawn += 1
            if (saved := self.saved) > last:
                last, since = saved, time.monotonic()
            self.waited = max(self.waited, time.monotonic() - since)

    def rest(self) -> None:
        """Draws no more, and waits until all is saved."""
        self._stop.set()
        self._thread.join()
        self.live.wait(PATIENCE)

    def close(self) -> None:
        self._stop.set()
        self.live.close()


def made(node: NodeProcess) -> tuple[str, str]:
    """A new terrain: its id and the secret of its owner's link."""
    found = json.loads(node.request("POST", "/api/terrains", b"{}"))
    return found["id"], found["secret"]


def drawing(*doors: Sequence[NodeProcess]) -> tuple[list[Artist], str, str]:
    """A terrain on which somebody draws through each of these doors; what else they say stands for later."""
    terrain, secret = made(doors[0][0])
    artists = [Artist(door[0].base, terrain, secret, f"p{n}") for n, door in enumerate(doors)]
    for each in artists:
        each.begin()
    gone_on(artists)
    return artists, terrain, secret


def gone_on(artists: Sequence[Artist], count: int = 25) -> None:
    """Waits until everybody has had so much more acknowledged."""
    before = [each.saved for each in artists]
    until(lambda: all(each.saved >= had + count for each, had in zip(artists, before, strict=True)))


def all_is_there(artists: Sequence[Artist]) -> None:
    """Everybody rests: each of their operations is in the journal once, and all see the same."""
    for each in artists:
        each.rest()
    total = sum(each.drawn for each in artists)
    until(lambda: all(each.live.clock >= total for each in artists))
    assert {each.live.clock for each in artists} == {total}
    assert len({each.live.document.model_dump_json() for each in artists}) == 1
    for each in artists:
        each.close()
