"""All exports of one server: who may, how many at once, how long what was made is kept."""

from __future__ import annotations

import asyncio
import logging
import re
import secrets
import shutil
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Collection
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from esker import contract as c
from esker.contract import ExportEstimate, ExportRequest, ExportStage, ExportStatus
from esker.errors import Cannot
from esker.exporting import formats, wire
from esker.exporting.run import FAILED, ExportFailed, Progress
from esker.fairness.shares import RANK, Place, Places, Share, Who
from esker.fairness.turns import Turns
from esker.jobs.kept import KeptExports
from esker.session.room.hub import Hub
from esker.session.room.replicas.viewing import shown
from esker.store.access import Link
from esker.store.engine.made import Made

log = logging.getLogger("esker.exporting")

OPEN: Final = Share(12, address=8, network=10, link=4)
"""Exports that wait or are made at a time, of the whole server; one is made, the others wait for their turn."""
OPEN_IN_ROOM: Final = Share(4, address=2, network=2, link=2, reserve=(2, 1))
"""Exports of one terrain among these: links to look have two at most, people who draw have three, and the last is an
owner's."""
KEPT_SECONDS: Final = 10 * 60.0
"""How long a file, or why there is none, can be asked for."""
KEPT_BYTES: Final = 1 << 30
"""Bytes of all files together; the oldest go."""
SPARE_BYTES: Final = 64 << 20
"""Bytes of the disk that an export leaves free."""
STEM: Final = 48
OVER: Final = frozenset({"done", "failed", "cancelled"})
WAITING: Final = "Waiting for its turn."
GONE: Final = "This export is not on the server any more. Export again."
BUSY: Final = "Many exports are being made just now. Try again in a few minutes."
BUSY_SHARE: Final = "Several exports for your address or link are being made. Wait for them."
PACE: Final = (0.3, 30.0)
"""Bounds of how much slower than ``formats.estimate`` this server is taken to be."""

Maker = Callable[[wire.Task, Progress], Awaitable[wire.Made]]


class Plant(NamedTuple):
    """How this server solves: device and threads for ``Solver``, its global and its finest refined level."""

    device: str | None = None
    threads: int | None = None
    level: int = c.DEFAULT_LEVEL
    refine: int = c.DEFAULT_REFINED_LEVEL


class Finished(NamedTuple):
    """A file to be sent."""

    path: Path
    name: str
    media: str


@dataclass(eq=False)
class Job:
    """One export from its beginning until it is forgotten."""

    id: str
    terrain: str
    link: str
    """The id of the link by which it was asked for."""
    person: str
    """The person, of whom one export at a time is taken."""
    media: str
    folder: Path
    status: ExportStatus
    place: Place
    """A place among those that the server has; it knows who asked for it."""
    seat: Place
    """A place among those that the terrain has."""
    task: asyncio.Task[None] | None = None
    ended: float | None = None
    """When its file may begin to grow old: what is being given to other servers is done, and has not ended."""
    is_shared: bool = False
    """Whether other servers have what was made, too."""

    @property
    def over(self) -> bool:
        """Whether nothing will change any more."""
        return self.status.stage in OVER

    def release(self) -> None:
        """Gives its places back."""
        self.place.release()
        self.seat.release()

    def at(self, stage: ExportStage, **fields: object) -> None:
        """Where it stands now; the end is the end."""
        if not self.over:
            self.status = self.status.model_copy(update={"stage": stage, **fields})


class Exports:
    """All exports of one server. Lives in the event loop."""

    def __init__(
        self,
        hub: Hub,
        folder: Path,
        grids: Path,
        maker: Maker,
        plant: Plant = Plant(),  # noqa: B008  (immutable)
        *,
        fetch: Callable[[c.Document], object] = lambda _: None,
        made: Made | None = None,
        now: Callable[[], float] = time.monotonic,
        kept_seconds: float = KEPT_SECONDS,
        kept_bytes: int = KEPT_BYTES,
    ) -> None:
        """``folder``: for what is made; what an earlier server left there is removed. ``grids``: where the rasters of
        layers lie, by digest; ``fetch`` brings those of a document there. ``made``: where several servers have what
        they made. ``maker``: ``run.make``, or another for tests. Raises OSError."""
        self._fetch, self._kept = fetch, KeptExports(Made() if made is None else made, hub.journal.now)
        self._hub, self._folder, self._grids, self._maker, self._plant = hub, folder, grids, maker, plant
        self._now, self._kept_seconds, self._kept_bytes = now, kept_seconds, kept_bytes
        self._jobs: dict[str, Job] = {}
        self._turn = Turns(1)
        self._places = Places(OPEN)
        self._in_room: dict[str, Places] = {}
        """Places of the terrains of which something is being exported."""
        self._closing = False
        self._pace = 1.0
        shutil.rmtree(folder, ignore_errors=True)
        hub.hear_of_ended.append(self.end)

    # --- for routes ---------------------------------------------------------------------------------------------

    async def begin(self, terrain: str, link: Link, person: str, wanted: ExportRequest, who: Who) -> ExportStatus:
        """Begins an export, or has it wait for its turn; it goes on by itself. Raises Cannot, OSError, and Denied where
        there is no such terrain."""
        if sentence := formats.refusal(wanted):
            raise Cannot(400, "malformed", sentence)
        self._check(terrain, person, who, link)
        document = await self._hub.document(terrain, wanted.at, who)
        await asyncio.to_thread(self._fetch, document)
        if link.role == "view":
            document = shown(document)
        self._hub.door.demand(link)
        self._check(terrain, person, who, link)  # others may have come meanwhile
        job_id = secrets.token_urlsafe(9)
        folder = self._folder / job_id
        folder.mkdir(parents=True)
        try:
            room = formats.free_bytes(self._folder) - SPARE_BYTES - 2 * formats.estimate(wanted).bytes
            if room < 0:
                raise Cannot(507, "storage", "The server has no room for this file (is its disk full?).")
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        status = ExportStatus(id=job_id, stage="waiting", text=WAITING if self._turn.locked() else "")
        place, seat = self._places.take(who), self._in(terrain).take(_in_terrain(who, link))
        media = formats.FORMATS[wanted.format].media
        job = self._jobs[job_id] = Job(job_id, terrain, link.id, person, media, folder, status, place, seat)
        job.task = asyncio.create_task(self._run(job, self._task(job, document, wanted), formats.estimate(wanted)))
        job.task.add_done_callback(lambda _: job.release())  # also where it was cancelled before it began
        return job.status

    def estimate(self, wanted: ExportRequest) -> ExportEstimate:
        """About what an export costs, at the pace of the last ones here. Raises Cannot."""
        if sentence := formats.refusal(wanted):
            raise Cannot(400, "malformed", sentence)
        plain = formats.estimate(wanted)
        return plain.model_copy(update={"seconds": round(plain.seconds * self._pace, 1)})

    async def status(self, terrain: str, job_id: str, link: Link) -> ExportStatus:
        """Where an export stands. Raises Cannot."""
        return (await self._own(terrain, job_id, link)).status

    async def cancel(self, terrain: str, job_id: str, link: Link) -> None:
        """Stops an export, or removes its file. Harmless when it is over. Raises Cannot."""
        job = await self._own(terrain, job_id, link)
        if job.task is not None and not job.task.done():
            job.task.cancel()
            await asyncio.gather(job.task, return_exceptions=True)
        self._forget(job)

    async def file(self, terrain: str, job_id: str, link: Link) -> Finished:
        """What an export made. Raises Cannot: there is none (yet)."""
        job = await self._own(terrain, job_id, link)
        if job.status.stage != "done":
            raise Cannot(409, "not_done", "This export is not done.")
        path = job.folder / job.status.file
        if not path.exists():  # another server made it
            job.folder.mkdir(parents=True, exist_ok=True)
            if not await self._kept.fetch(terrain, job_id, path):
                self._forget(job)
                raise Cannot(404, "no_export", GONE)
        return Finished(path, job.status.file, job.media)

    def end(self, terrain: str, links: Collection[str]) -> None:
        """Links were revoked: what is being made for them ends, and what was made is removed."""
        for job in list(self._jobs.values()):
            if job.terrain == terrain and job.link in links:
                if job.task is not None and not job.task.done():
                    job.task.cancel()
                    job.task.add_done_callback(partial(self._forget_late, job))
                else:
                    self._forget(job)

    async def close(self) -> None:
        """Stops all exports and removes what was made."""
        self._closing = True
        tasks = [job.task for job in self._jobs.values() if job.task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        self._jobs.clear()  # what other servers have too is there for them
        shutil.rmtree(self._folder, ignore_errors=True)

    # --- the work -----------------------------------------------------------------------------------------------

    def _check(self, terrain: str, person: str, who: Who, link: Link) -> None:
        self._forget_old()
        if self._closing:
            raise Cannot(503, "shutting_down", "The server is stopping.")
        if any(job.person == person and not job.over for job in self._jobs.values()):
            raise Cannot(409, "busy", "Another export of yours is still being made. Wait for it, or cancel it.")
        for against in (self._places.refusal(who), self._in(terrain).refusal(_in_terrain(who, link))):
            if against is not None:
                raise Cannot(503, "busy", BUSY if against == "total" else BUSY_SHARE)

    def _in(self, terrain: str) -> Places:
        """Returns the places of a terrain; those of terrains that have none taken are forgotten."""
        for other in [key for key, places in self._in_room.items() if not len(places) and key != terrain]:
            del self._in_room[other]
        return self._in_room.setdefault(terrain, Places(OPEN_IN_ROOM))

    def _task(self, job: Job, document: c.Document, wanted: ExportRequest) -> wire.Task:
        plant = self._plant
        stem = re.sub(r"[\W_]+", "-", document.settings.title)[:STEM].strip("-").lower() or "terrain"
        return wire.Task(
            document=document.model_copy(update={"deleted": (), "deleted_layers": ()}),
            wanted=wanted,
            grids=str(self._grids.resolve()),
            folder=str(job.folder.resolve()),
            name=f"{stem}-{wanted.samples}",
            device=plant.device,
            threads=plant.threads,
            global_level=plant.level,
            refined_level=plant.refine,
        )

    async def _run(self, job: Job, task: wire.Task, plain: ExportEstimate) -> None:
        try:
            async with self._turn.turn(job.place.who):
                started = self._now()
                job.at("solving", text="")
                made = await self._maker(task, lambda stage, share: job.at(stage, share=share))
            fields = made.model_dump(exclude={"type"})
            job.at("done", share=1.0, **fields)
            job.is_shared = await self._kept.keep(
                job.terrain, job.folder / job.status.file, job.status, job.link, job.media, self._kept_seconds
            )
            took = self._now() - started
            low, high = PACE
            pace = min(max(took / plain.seconds, low), high)
            self._pace = 0.5 * (self._pace + pace)
            log.info("export %s of %s in %.1f s", made.file, job.terrain, took)
        except asyncio.CancelledError:
            job.at("cancelled", text="The export was cancelled.")
        except ExportFailed as error:
            job.at("failed", text=str(error)[:240])
        except Exception:
            log.exception("the export of %s failed", job.terrain)
            job.at("failed", text=FAILED)
        job.ended = self._now()
        job.release()
        if job.status.stage != "done":
            shutil.rmtree(job.folder, ignore_errors=True)
        self._forget_old()
        if not self._closing:
            asyncio.get_running_loop().call_later(self._kept_seconds + 1.0, self._forget_old)

    def _forget_old(self) -> None:
        """Removes what was kept long enough and, beyond ``kept_bytes``, the oldest files of whichever address has the
        most; never the newest of all."""
        late = self._now() - self._kept_seconds
        ends = sorted(
            ((job.ended, job) for job in self._jobs.values() if job.ended is not None), key=lambda end: end[0]
        )
        for ended, job in ends:
            if ended < late:
                self._forget(job)
        newest = [job for _, job in ends[-1:]]
        over = [job for ended, job in ends if ended >= late]
        while over and sum(job.status.bytes for job in over) > self._kept_bytes:
            kept: Counter[str] = Counter()
            for job in over:
                kept[job.place.who.site] += job.status.bytes
            most = kept.most_common(1)[0][0]
            going = next((job for job in over if job.place.who.site == most and job not in newest), None)
            if going is None:
                break
            over.remove(going)
            self._forget(going)

    def has(self, terrain: str) -> bool:
        """Returns whether something of a terrain is under way, or can still be asked about here alone."""
        self._forget_old()
        return any(job.terrain == terrain and not job.is_shared for job in self._jobs.values())

    def _forget_late(self, job: Job, _: object) -> None:
        self._forget(job)

    def _forget(self, job: Job) -> None:
        self._jobs.pop(job.id, None)
        shutil.rmtree(job.folder, ignore_errors=True)
        if job.is_shared:
            self._kept.drop(job.terrain, job.id)

    async def _own(self, terrain: str, job_id: str, link: Link) -> Job:
        job = self._jobs.get(job_id) or await self._made_elsewhere(terrain, job_id)
        if job is None or job.terrain != terrain:
            raise Cannot(404, "no_export", GONE)
        if job.link != link.id and link.role != "owner":
            raise Cannot(403, "not_allowed", "Only who began an export, or an owner of the terrain, may do this.")
        return job

    async def _made_elsewhere(self, terrain: str, job_id: str) -> Job | None:
        """Takes an export over that another server made, while the link by which it was asked for lives."""
        found = await self._kept.find(terrain, job_id)
        if found is None or self._closing:
            return None
        export, left = found
        if not any(each.id == export.link and each.revoked is None for each in self._hub.access.links(terrain)):
            self._kept.drop(terrain, job_id)
            return None
        place, seat = (Places(Share(1)).take(Who("")) for _ in range(2))  # it takes nobody's place
        job = Job(job_id, terrain, export.link, "", export.media, self._folder / job_id, export.status, place, seat)
        job.is_shared, job.ended = True, self._now() - self._kept_seconds + left
        return self._jobs.setdefault(job_id, job)


def _in_terrain(who: Who, link: Link) -> Who:
    """Returns who asks, with what the link allows in the terrain."""
    return Who(who.address, link.id, RANK[link.role])
