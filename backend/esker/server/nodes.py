"""What makes this server one of several over one database (DESIGN 18). Without ``--node`` nothing here runs."""

from __future__ import annotations

import asyncio
import base64
import json
import logging
import os
import re
import time
from collections.abc import Callable
from typing import Any, Final, Protocol
from urllib.parse import urlsplit

from esker.cluster import signing
from esker.cluster.codes import StoredCodes
from esker.cluster.node import Cluster
from esker.cluster.peers import Message
from esker.cluster.places import About
from esker.keeper.private import KEY_CHARACTERS
from esker.server.settings import Settings
from esker.server.starting import CannotServe
from esker.session.ground.worker import Worker
from esker.session.room.hub import Hub
from esker.store.classes import ClassStore
from esker.store.engine.leases import Unreachable
from esker.store.engine.ports import BadDatabase, Database
from esker.store.journal import Journal
from esker.store.previews import PreviewTokens

log = logging.getLogger("esker.cluster")

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,39}")
NEEDS_DATABASE: Final = (
    "--node needs a database that several servers share: set ESKER_DATABASE=postgresql://user@host/name. "
    "Without --node this server keeps its terrains in its data folder, as ever."
)
LOOK_SECONDS: Final = 10.0
"""The solver's load is that of so long."""
LEAST_FREE: Final = 0.05


class Jobs(Protocol):
    """What a terrain may have under way: imports, exports, collections."""

    def has(self, terrain: str) -> bool:
        """Returns whether something of a terrain is under way, or can still be asked about."""


def check(settings: Settings) -> None:
    """Raises CannotServe where the settings of a node are not whole, before anything is opened."""
    if not settings.database:
        raise CannotServe(NEEDS_DATABASE)
    if not NAME.fullmatch(settings.node):
        raise CannotServe("--node: a name of letters, digits, '.', '_' and '-', 40 characters at most.")
    parts = urlsplit(settings.advertise)
    if parts.scheme not in ("http", "https") or not parts.hostname or parts.path.strip("/"):
        raise CannotServe("--advertise: where the other nodes reach this one, as http://10.0.0.5:8000.")
    try:
        signing.made_key(settings.cluster_key)
    except ValueError as error:
        raise CannotServe(str(error)) from None


class Load:
    """How much of the solver's time is free, by the processors that it has."""

    def __init__(self, worker: Worker, now: Callable[[], float] = time.monotonic) -> None:
        self._worker, self._now = worker, now
        self._cores = float(os.cpu_count() or 1)
        self._since, self._spent, self._share = now(), worker.spent, 0.0

    def free(self) -> float:
        """Processors that do nothing for the solver, about: of the last ten seconds."""
        now = self._now()
        if now - self._since >= LOOK_SECONDS:
            self._share = min(1.0, (self._worker.spent - self._spent) / (now - self._since))
            self._since, self._spent = now, self._worker.spent
        return self._cores * max(LEAST_FREE, 1.0 - self._share)


class Rooms:
    """The rooms of this process, as its node needs them (``cluster.rooms.Rooms``)."""

    def __init__(self, hub: Hub) -> None:
        self._hub, self._journal = hub, hub.journal
        self._classes, self._tokens = ClassStore(hub.journal), PreviewTokens(hub.journal)
        self.jobs: list[Jobs] = []

    def in_use(self, terrain: str) -> bool:
        """Whether something of a terrain is open or under way here."""
        return self._hub.in_use(terrain) or any(jobs.has(terrain) for jobs in self.jobs)

    def lose(self, terrain: str) -> None:
        """Shuts what is open of a terrain without writing."""
        self._hub.lose(terrain)

    async def hand_over(self, terrain: str) -> None:
        """Commits what was ordered, and sends everybody on."""
        await self._hub.hand_over(terrain)

    def taken(self, terrain: str) -> None:
        """Forgets what was counted of a terrain."""
        self._journal.forget(terrain)

    def home(self, terrain: str) -> str:
        """Returns the terrain of the class whose copy this one is, else itself."""
        found = self._classes.copy_of(terrain)
        home = None if found is None else self._classes.home(found[0])
        return home or terrain

    async def terrain_of(self, about: About, scope: Message, body: bytes) -> str:
        """Returns the terrain that a request is about which names none: by its class, picture, seat or join code."""
        return await asyncio.to_thread(self._terrain_of, about, dict(scope["headers"]), body)

    def _terrain_of(self, about: About, fields: dict[bytes, bytes], body: bytes) -> str:
        if about.lesson:
            return self._classes.home(about.lesson) or ""
        if about.picture:
            return self._tokens.terrain(about.picture) or ""
        if about.is_seat:
            secret = fields.get(b"authorization", b"").decode("latin-1").partition(" ")[2].strip()
            pupil = self._classes.seated(secret) if 0 < len(secret) <= 128 else None
            return "" if pupil is None else self._classes.home(pupil.lesson) or ""
        code = _code_in(body)
        opened = self._hub.access.open_code(code) if code else None
        if opened is not None:
            return opened.terrain
        lesson = self._classes.by_code(code) if code else None
        return "" if lesson is None else lesson.terrain


def _code_in(body: bytes) -> str:
    try:
        said: Any = json.loads(body)
    except ValueError:
        return ""
    code = said.get("code") if isinstance(said, dict) else None
    return code if isinstance(code, str) and len(code) <= 20 else ""


class Member:
    """This server as a node: the database that it shares, its leases, and what it tells the others."""

    def __init__(self, settings: Settings) -> None:
        """Opens the database. Raises CannotServe."""
        check(settings)
        try:  # a server that is alone needs none of these packages
            from esker.store.engine.postgres.engine import Postgres
            from esker.store.engine.postgres.leases import PostgresLeases
        except ModuleNotFoundError as error:
            raise CannotServe(
                f"--node needs a package that is not here ({error.name}): install esker[cluster]."
            ) from None
        key = signing.made_key(settings.cluster_key)
        try:
            self._leases = PostgresLeases(settings.database)
            self.cluster = Cluster(settings.node, settings.advertise.rstrip("/"), self._leases, key)
            self.engine = Postgres(settings.database, self.cluster)
            self.date = date_of(self.engine)
        except (BadDatabase, Unreachable) as error:
            raise CannotServe(str(error)) from None
        self.claims = signing.derived(key, "claims")
        self.keeper = base64.urlsafe_b64encode(signing.derived(key, "keeper")).decode()[:KEY_CHARACTERS]
        """What the owner of the machines shows: one key for all of them, which each keeps in its private file."""
        self.rooms: Rooms | None = None

    def codes(self, journal: Journal) -> StoredCodes:
        """Where join codes are kept."""
        return StoredCodes(journal, self.date)

    def join(self, hub: Hub, worker: Worker) -> None:
        """The rooms that are this node's, and the solver by whose load terrains are shared out."""
        self.rooms, self.cluster.free = Rooms(hub), Load(worker).free

    async def begin(self) -> None:
        """Registers the node. Raises CannotServe."""
        assert self.rooms is not None
        try:
            await self.cluster.start(self.rooms)
        except Unreachable as error:
            raise CannotServe(f"The node cannot be registered: {error}") from None
        log.info("node %s is reached at %s", self.cluster.name, self.cluster.address)

    async def leave(self) -> None:
        """Gives all terrains away."""
        await self.cluster.drain()
        await self.cluster.close()

    def knows(self, address: str) -> bool:
        """Returns whether a connection from an address may be another node's."""
        return self.cluster.knows(address)

    def close(self) -> None:
        """Closes the connections for leases. The journal closes its own."""
        self._leases.close()


def date_of(engine: Database) -> Callable[[], float]:
    """Returns the date of the database, seconds since 1970, which all nodes have together: clocks of machines may be
    hours off. Raises Unreachable."""
    asked = time.monotonic()
    row = engine.reader().execute("SELECT extract(epoch from clock_timestamp())::float8").fetchone()
    offset = float(row[0]) - asked
    return lambda: time.monotonic() + offset
