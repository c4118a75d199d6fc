"""All imports of one server: who may, how many at once, and the steps from an upload to a layer."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Collection
from pathlib import PurePosixPath
from typing import Final

from esker import contract as c
from esker.contract import ImportStage, ImportStatus
from esker.document.ops import Refusal
from esker.errors import Cannot
from esker.fairness.shares import Full, Places, Share, Who
from esker.fairness.turns import Turns
from esker.importing.refusal import ImportCancelled, ImportRefused
from esker.jobs.import_job import Importer, Job, clean_name
from esker.patchwork.lod.precedence import default_priority
from esker.session.lesson.rules import HANDS_OFF
from esker.session.room.core import Denied
from esker.session.room.entry import Caller
from esker.session.room.hub import Hub
from esker.store.access import Link
from esker.store.grids import GridStore
from esker.store.space import NoSpace

log = logging.getLogger("esker.jobs")

AT_ONCE: Final = 2
"""Files that are worked on at a time, of the whole server. The others wait for their turn."""
OPEN: Final = Share(16, address=8, network=10, link=4)
"""Imports that may be open at a time: uploaded, worked on, or waiting for an answer."""
QUESTION_SECONDS: Final = 15 * 60.0
TELL_SECONDS: Final = 0.2
KEPT_SECONDS: Final = 10 * 60.0
"""How long the end of an import can be asked for."""
UPLOADED: Final = 0.2
EXAMINED: Final = 0.3
CONVERTED: Final = 0.97
"""Shares of the work that are done after each part."""
ROUNDS: Final = 12
"""How often an import asks at most: answers may be wrong, or raise other questions."""
HANDS_SECONDS: Final = 1.0
"""A file that is ready while hands are off is laid when they are on again: that is looked for so often."""
SETTINGS: Final = c.SetTerrain(fields=c.TerrainFields())
ENDED: Final = "The link by which this file came was revoked."
STOP: Final = "stop"
"""The answer that ends an import (``importing.questions``)."""


class Imports:
    """All imports of one server. Lives in the event loop."""

    def __init__(
        self,
        hub: Hub,
        grids: GridStore,
        importer: Importer,
        *,
        quota_bytes: int,
        now: Callable[[], float] = time.monotonic,
        question_seconds: float = QUESTION_SECONDS,
    ) -> None:
        """``quota_bytes``: of the grids that one terrain may keep on disk, deleted layers' too."""
        self._hub, self._grids, self._importer = hub, grids, importer
        self._quota, self._now, self._question_seconds = quota_bytes, now, question_seconds
        self._jobs: dict[str, Job] = {}
        self._slots = Turns(AT_ONCE)
        self._places = Places(OPEN)
        self._closing = False
        hub.hear_of_ended.append(self.end)

    # --- for routes ---------------------------------------------------------------------------------------------

    async def upload(
        self,
        name: str,
        person: str,
        body: AsyncIterator[bytes],
        length: int | None,
        *,
        terrain: str,
        link: Link,
        client: str,
        who: Who,
        hold: bool = False,
        caller: Caller | None = None,
    ) -> ImportStatus:
        """Takes a file for a terrain; the import goes on by itself (``hold``: once it is answered).

        ``caller``: whom a lesson must let change the terrain when it is laid. Raises Cannot."""
        await self._check_terrain(terrain, who)
        self._hub.door.demand(link)
        job = self._begin(name, person, link, client, who)
        job.terrain, job.hold, job.caller = terrain, hold, caller
        await self._receive(job, body, length)
        self._demand(job)
        self._go_on(job)
        return job.status()

    async def upload_new(
        self,
        name: str,
        person: str,
        body: AsyncIterator[bytes],
        length: int | None,
        client: str,
        who: Who,
        gone: Callable[[], Awaitable[bool]] | None = None,
    ) -> tuple[c.Document, str, ImportStatus]:
        """Takes a file, makes a terrain that it fits, and imports it there: terrain, owner's secret, import.

        ``gone`` says whether nobody waits for the answer any more: then there is no terrain. Raises Cannot, also for a
        file that is refused.
        """
        job = self._begin(name, person, None, client, who)
        await self._receive(job, body, length)
        try:
            report = job.report = await self._inspect(job, None, None)
            if report.verdict == "refused":
                raise Cannot(400, "refused", report.refusal)
            if gone is not None and await gone():
                raise Cannot(409, "cancelled", "The import was cancelled.")
            place, size_m = self._importer.suggest_place(report), self._importer.suggest_size(report)
            settings = c.TerrainSettings(
                size_m=size_m,
                edition=c.CURRENT_EDITION,
                title=PurePosixPath(job.file).stem[: c.MAX_NAME_LENGTH] or "Real ground",
                reach_m=size_m * c.DEFAULT_REACH_FRACTION,
                place=place,
            )
            born, link, secret = await self._hub.create(c.Document(id="new", settings=settings), who)
        except BaseException as error:
            self._end(job, "refused", error.message if isinstance(error, Cannot) else "")
            raise
        job.terrain, job.link = born.id, link
        await self._hub.keep(born.id)
        self._go_on(job)
        return born, secret, job.status()

    def status(self, terrain: str, job_id: str) -> ImportStatus:
        """Raises Cannot (404)."""
        return self._job(terrain, job_id).status()

    def answer(self, terrain: str, job_id: str, link: Link, answers: c.ImportAnswers) -> ImportStatus:
        """Answers what an import asks. Raises Cannot (404, 403, 409)."""
        job = self._own(terrain, job_id, link)
        if job.stage != "question":
            raise Cannot(409, "not_asked", "This import asks nothing at the moment.")
        known = {question.id: question for question in job.report.questions} if job.report is not None else {}
        for key, value in answers.answers.items():
            question = known.get(key)
            if question is None:
                raise Cannot(400, "malformed", f"The import did not ask for “{key}”.")
            if len(value) > 240:
                raise Cannot(400, "malformed", f"The answer to “{key}” is too long.")
        job.answers = answers.model_copy(update={"answers": {**job.answers.answers, **answers.answers}})
        self._at(job, "reading", EXAMINED)
        job.answered.set()
        return job.status()

    async def cancel(self, terrain: str, job_id: str, link: Link) -> None:
        """Stops an import; nothing of it stays. Harmless when it is over. Raises Cannot (404, 403)."""
        job = self._own(terrain, job_id, link)
        if job.task is not None and not job.task.done() and job.stage != "saving":
            job.task.cancel()
            await asyncio.gather(job.task, return_exceptions=True)
        elif job.task is None and job.stage not in c.ENDED_IMPORT:
            self._end(job, "cancelled", "The import was cancelled.")

    def end(self, terrain: str, links: Collection[str]) -> None:
        """Links were revoked: what is being brought in by them ends."""
        for job in self._jobs.values():
            if job.terrain == terrain and job.link_id in links and job.stage not in c.ENDED_IMPORT:
                if job.task is None:  # its upload ends with the next bytes that come
                    self._end(job, "cancelled", ENDED)
                elif job.stage != "saving":  # which asks again itself
                    job.text = ENDED
                    job.task.cancel()

    async def close(self) -> None:
        """Stops all imports."""
        self._closing = True
        tasks = [job.task for job in self._jobs.values() if job.task is not None]
        for job in self._jobs.values():
            if job.task is not None and job.stage != "saving":
                job.task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        for job in list(self._jobs.values()):
            if job.stage not in c.ENDED_IMPORT:
                self._end(job, "cancelled", "The server is stopping.")

    # --- beginning ----------------------------------------------------------------------------------------------

    async def _check_terrain(self, terrain: str, who: Who) -> None:
        document = await self._hub.document(terrain, None, who)
        if len(document.layers) >= c.MAX_LAYERS:
            raise Cannot(409, "too_many_layers", f"A terrain holds at most {c.MAX_LAYERS} elevation layers.")
        await self._check_quota(terrain, 1)

    async def _check_quota(self, terrain: str, more: int) -> None:
        stored = await asyncio.to_thread(lambda: self._grids.size(self._hub.journal.grids(terrain)))
        if stored + more > self._quota:
            raise Cannot(
                409, "quota", f"The elevation data of a terrain may take {self._quota >> 20} MiB on this server."
            )

    def _check_space(self, job: Job) -> None:
        try:
            self._grids.space.need()
        except NoSpace as error:
            log.error("the grid of %s is not kept: %s", job.file, error)
            raise Cannot(507, "storage", "The server has no room for this elevation data.") from error

    def _demand(self, job: Job) -> None:
        """Asks again whether the link opens the terrain. Raises Denied; then the import is over."""
        if job.link is None:
            return
        try:
            self._hub.door.demand(job.link)
        except Denied as denied:
            self._end(job, "cancelled", denied.message)
            raise

    def _begin(self, name: str, person: str, link: Link | None, client: str, who: Who) -> Job:
        self._forget_old()
        if self._closing:
            raise Cannot(503, "shutting_down", "The server is stopping.")
        active = [job for job in self._jobs.values() if job.stage not in c.ENDED_IMPORT]
        if any(job.person == person for job in active):
            raise Cannot(409, "busy", "Another file of yours is still being brought in. Wait for it, or cancel it.")
        try:
            place = self._places.take(who)
        except Full as full:
            sentence = "Many files are being brought in just now. Try again in a few minutes."
            if full.yours:
                sentence = "Several files from your address or by your link are being brought in. Wait for them."
            raise Cannot(503, "busy", sentence) from None
        job_id = secrets.token_urlsafe(9)
        try:
            job = Job(job_id, clean_name(name), person, link, client, self._grids.work(), place)
        except BaseException:
            place.release()
            raise
        self._jobs[job_id] = job
        return job

    async def _receive(self, job: Job, body: AsyncIterator[bytes], length: int | None) -> None:
        """The body of a request, to the disk. Raises Cannot."""
        size = 0
        try:
            with job.path.open("wb") as file:
                async for part in body:
                    size += len(part)
                    if size > c.MAX_GRID_BYTES or (length or 0) > c.MAX_GRID_BYTES:
                        raise Cannot(413, "too_large", f"A file may have {c.MAX_GRID_BYTES >> 20} MiB at most.")
                    if job.stage in c.ENDED_IMPORT:
                        raise Cannot(409, "cancelled", "The import was cancelled.")
                    self._grids.space.need(len(part))
                    file.write(part)
                    self._at(job, "upload", UPLOADED * (size / length if length else 0.0))
            if size == 0:
                raise Cannot(400, "empty", "The file is empty.")
        except OSError as error:
            log.error("an upload could not be stored: %s", error)
            self._end(job, "refused", "The server cannot store this file (is its disk full?).")
            raise Cannot(507, "storage", "The server cannot store this file (is its disk full?).") from error
        except BaseException as error:
            self._end(job, "cancelled", error.message if isinstance(error, Cannot) else "The upload was cut off.")
            raise
        self._at(job, "reading", UPLOADED)

    def _go_on(self, job: Job) -> None:
        job.task = asyncio.create_task(self._run(job))
        job.task.add_done_callback(lambda _: job.place.release())  # also where it was cancelled before it began

    # --- the work -----------------------------------------------------------------------------------------------

    async def _run(self, job: Job) -> None:
        try:
            await self._import(job)
        except asyncio.CancelledError:
            self._end(job, "cancelled", ENDED if job.text == ENDED else "The import was cancelled.")
        except (ImportRefused, Refusal, Cannot, Denied, ImportCancelled) as error:
            self._end(job, "refused", str(error))
        except Exception:
            log.exception("the import of %s failed", job.file)
            self._end(job, "refused", "The server failed to bring in this file. It is in its log.")

    async def _import(self, job: Job) -> None:
        settings = (await self._hub.document(job.terrain)).settings
        report = job.report = await self._inspect(job, settings.place, settings.size_m)
        if report.verdict == "refused":
            raise ImportRefused(report.refusal)
        if report.verdict == "ask" or job.hold:
            await self._settle_questions(job, settings)
        layer = await self._convert(job, settings)
        self._demand(job)
        self._at(job, "saving", CONVERTED)
        # From here on it is not left half done: what is stored without an op is swept at the next start.
        await asyncio.shield(asyncio.ensure_future(self._lay(job, layer)))

    async def _settle_questions(self, job: Job, settings: c.TerrainSettings) -> None:
        """Asks until the answers make a grid of the file. A wrong answer is told and asked for again."""
        asked: set[str] = set()
        text = ""
        for _ in range(ROUNDS):
            asked |= {question.id for question in (job.report.questions if job.report is not None else ())}
            await self._ask(job, text)
            if not job.answers.answers:
                return
            found = await self._inspect(job, settings.place, settings.size_m, job.answers)
            if found.verdict == "refused":
                if STOP in job.answers.answers.values():
                    break
                text = found.refusal
                continue
            job.report, text = found, ""
            if asked.issuperset(question.id for question in found.questions):
                return
        raise ImportRefused(text or found.refusal)

    async def _inspect(
        self, job: Job, place: c.Place | None, size_m: float | None, answers: c.ImportAnswers | None = None
    ) -> c.ImportReport:
        def progress(stage: ImportStage, share: float) -> None:
            self._at(job, stage, max(job.share, UPLOADED + (EXAMINED - UPLOADED) * share))

        if self._slots.locked():
            self._at(job, "reading", UPLOADED, "Waiting for its turn.")
        async with self._slots.turn(job.place.who):
            self._at(job, "reading", max(job.share, UPLOADED))
            report = await self._importer.inspect(
                job.path, job.file, answers=answers, place=place, size_m=size_m, on_progress=progress, folder=job.work
            )
        job.share = EXAMINED
        return report

    async def _ask(self, job: Job, text: str) -> None:
        job.answered.clear()
        self._at(job, "question", EXAMINED, text)
        try:
            await asyncio.wait_for(job.answered.wait(), self._question_seconds)
        except TimeoutError:
            raise ImportRefused("Nobody answered its questions in time. Bring the file in again.") from None

    async def _convert(self, job: Job, settings: c.TerrainSettings) -> c.Layer:
        def progress(stage: ImportStage, share: float) -> None:
            self._at(job, stage, EXAMINED + (CONVERTED - EXAMINED) * share)

        async with self._slots.turn(job.place.who):
            layer = await self._importer.convert(
                job.path,
                job.answers,
                settings.place,
                settings.size_m,
                job.work / "raster",
                progress,
                name=job.file,
            )
        size = sum(file.stat().st_size for file in (job.work / "raster").iterdir())
        if not await asyncio.to_thread(self._grids.has, layer.content):
            await self._check_quota(job.terrain, size)
            self._check_space(job)
        return layer

    async def _lay(self, job: Job, layer: c.Layer) -> None:
        """Stores the raster, then has the room add the layer."""
        await asyncio.to_thread(self._grids.keep, job.work / "raster", layer.content)
        room = await self._hub.room(job.terrain)
        while job.caller is not None and not room.core.lesson.draws(job.caller):
            self._demand(job)
            self._at(job, "saving", CONVERTED, HANDS_OFF)
            await asyncio.sleep(HANDS_SECONDS)
            room = await self._hub.room(job.terrain)
        head = room.core.head
        others = (*head.layers.values(), *head.deleted_layers.values())
        named = layer.model_copy(
            update={
                "id": f"g-{secrets.token_hex(6)}",
                "author": self._author(job),
                "priority": default_priority(layer, others),
            }
        )
        op: c.Op = c.AddLayer(layer=named)
        place = self._importer.suggest_place(job.report) if job.report is not None else None
        settings = job.caller is None or room.core.lesson.refusal(job.caller, SETTINGS) is None
        if settings and named.facts.geo and head.settings.place is None and place is not None:
            op = c.Group(ops=(c.SetTerrain(fields=c.TerrainFields(place=place)), c.AddLayer(layer=named)))
        self._demand(job)  # nothing is waited for between this and the op
        mine = job.client and room.core.belongs(job.client, job.link_id)
        await room.perform(op, f"import-{job.id}", job.client if mine else f"import-{job.id}")
        job.layer = named.id
        self._end(job, "done", "")

    # --- telling ------------------------------------------------------------------------------------------------

    def _author(self, job: Job) -> str:
        room = self._hub.open_room(job.terrain)
        member = room.core.members.by_client.get(job.client) if room is not None else None
        return member.name if member is not None and member.link == job.link_id else ""

    def _at(self, job: Job, stage: ImportStage, share: float, text: str = "") -> None:
        """Where the import stands now; everybody is told, of the same stage at most five times a second."""
        if job.stage in c.ENDED_IMPORT:
            return
        job.stage, job.share, job.text = stage, share, text
        now = self._now()
        if job.last_sent[0] == stage and now - job.last_sent[1] < TELL_SECONDS:
            return
        job.last_sent = (stage, now)
        room = self._hub.open_room(job.terrain) if job.terrain else None
        if room is not None:
            # The report is for who brings the file in, and comes with the answers of HTTP.
            status = job.status().model_copy(update={"report": None})
            room.importing(c.Importing(author=self._author(job), file=job.file, status=status))

    def _end(self, job: Job, stage: ImportStage, text: str) -> None:
        # In a thread: what was unpacked is hundreds of megabytes at worst.
        asyncio.get_running_loop().run_in_executor(None, self._grids.drop, job.work)
        job.place.release()
        self._at(job, stage, 1.0 if stage == "done" else job.share, text)
        job.ended = self._now()

    def _forget_old(self) -> None:
        now = self._now()
        self._jobs = {
            key: job
            for key, job in self._jobs.items()
            if job.stage not in c.ENDED_IMPORT or now - job.ended < KEPT_SECONDS
        }

    def has(self, terrain: str) -> bool:
        """Returns whether something of a terrain is under way, or can still be asked about."""
        self._forget_old()
        return any(job.terrain == terrain for job in self._jobs.values())

    def _job(self, terrain: str, job_id: str) -> Job:
        job = self._jobs.get(job_id)
        if job is None or job.terrain != terrain:
            raise Cannot(404, "no_import", "There is no such import, or it ended long ago.")
        return job

    def _own(self, terrain: str, job_id: str, link: Link) -> Job:
        job = self._job(terrain, job_id)
        if job.link_id != link.id and link.role != "owner":
            raise Cannot(403, "not_allowed", "Only who brings the file in, or an owner of the terrain, may do this.")
        return job
