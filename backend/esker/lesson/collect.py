"""Collecting a class: one zip with a terrain file and a picture of each copy, and a table of names and times.

One class is collected at a time, copy after copy, in the threads that make files; what was made is kept for a while, as
exports are. Only one copy is in memory at a time.
"""

from __future__ import annotations

import asyncio
import csv
import io
import logging
import re
import secrets
import shutil
import time
import zipfile
from collections.abc import Collection
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from esker.document.archive import ArchiveError
from esker.errors import Cannot, EskerError
from esker.fairness.shares import Full, Place, Places, Share, Who
from esker.fairness.turns import Turns
from esker.lesson import relief
from esker.lesson.classes import Classes
from esker.patchwork.raster.rasters import RasterError
from esker.store.access import Link
from esker.store.classes import Class, Copy, changed_at

log = logging.getLogger("esker.lesson")

KEPT_SECONDS: Final = 10 * 60.0
KEPT: Final = Share(8, address=3, network=4, link=2)
"""Collections of the whole server that are made or kept, of one address, one /48 and one link."""
MOST_BYTES: Final = 2 << 30
"""Bytes of one collection; the terrain files of copies hold their elevation grids."""
SPARE_BYTES: Final = 64 << 20
PICTURE_LEVEL: Final = 3
SETTLE_SECONDS: Final = 20.0
"""A copy that has not settled by then gets the picture of what there is."""
LOOK_SECONDS: Final = 0.02
STEM: Final = 40
COLUMNS: Final = ("copy", "names", "joined", "last_changed", "strokes", "score", "score_text", "file")
BUSY: Final = "Several classes are being collected just now. Try again in a few minutes."
YOURS: Final = (
    "Several classes are being collected, or were just now, for your address or link. Try again in ten minutes."
)
TOO_LARGE: Final = f"Together the copies are more than {MOST_BYTES >> 30} GiB. Download them one by one."
FAILED: Final = "The class could not be collected. It is in the server's log."


@dataclass(eq=False)
class _Job:
    id: str
    lesson: Class
    link: Link
    who: Who
    folder: Path
    place: Place
    stage: str = "waiting"
    share: float = 0.0
    text: str = ""
    bytes: int = 0
    task: asyncio.Task[None] | None = None
    ended: float = 0.0

    @property
    def over(self) -> bool:
        return self.stage in ("done", "failed", "cancelled")

    @property
    def path(self) -> Path:
        return self.folder / "class.zip"

    def status(self) -> dict[str, Any]:
        """What a page is told."""
        return {"id": self.id, "stage": self.stage, "share": self.share, "text": self.text, "bytes": self.bytes}


class Collections:
    """All collections of one server. Lives in the event loop."""

    def __init__(self, classes: Classes, folder: Path) -> None:
        """``folder``: for what is made; what an earlier server left there is removed."""
        self._classes, self._hub, self._folder = classes, classes.hub, folder
        self._jobs: dict[str, _Job] = {}
        self._turn = Turns(1)
        self._places = Places(KEPT)
        shutil.rmtree(folder, ignore_errors=True)
        self._hub.hear_of_ended.append(self._end)
        classes.hear.append(self._drop_deleted)

    def begin(self, lesson: Class, link: Link, who: Who) -> dict[str, Any]:
        """Begins to collect a class; one collection of a class at a time. Raises Cannot, OSError."""
        self._forget_old()
        if any(job.lesson.id == lesson.id and not job.over for job in self._jobs.values()):
            raise Cannot(409, "busy", "This class is being collected already. Wait for it.")
        for job in list(self._jobs.values()):
            if job.lesson.id == lesson.id and job.link.id == link.id:
                self._forget(job)  # the newer one takes its place
        try:
            place = self._places.take(who)
        except Full as full:
            raise Cannot(503, "busy", YOURS if full.yours else BUSY) from None
        job_id = secrets.token_urlsafe(9)
        job = self._jobs[job_id] = _Job(job_id, lesson, link, who, self._folder / job_id, place)
        try:
            job.folder.mkdir(parents=True)
        except OSError:
            self._forget(job)
            raise
        job.task = asyncio.create_task(self._run(job))
        return job.status()

    def status(self, lesson: Class, job_id: str) -> dict[str, Any]:
        """Where a collection stands. Raises Cannot."""
        return self._own(lesson, job_id).status()

    def file(self, lesson: Class, job_id: str) -> tuple[Path, str]:
        """What was made, and its name. Raises Cannot: there is none (yet)."""
        job = self._own(lesson, job_id)
        if job.stage != "done":
            raise Cannot(409, "not_done", "The class is not collected yet.")
        return job.path, f"{_stem(lesson.title) or 'class'}.zip"

    async def close(self) -> None:
        """Stops all and removes what was made."""
        tasks = [job.task for job in self._jobs.values() if job.task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        shutil.rmtree(self._folder, ignore_errors=True)

    # --- the work -----------------------------------------------------------------------------------------------

    async def _run(self, job: _Job) -> None:
        try:
            await self._collect(job)
            job.stage, job.share, job.bytes = "done", 1.0, job.path.stat().st_size
        except asyncio.CancelledError:
            job.stage = "cancelled"
        except (EskerError, OSError, ArchiveError, RasterError) as error:
            job.stage, job.text = "failed", str(error)[:240]
        except Exception:
            log.exception("a class could not be collected")
            job.stage, job.text = "failed", FAILED
        job.ended = time.monotonic()
        if job.stage != "done":
            shutil.rmtree(job.folder, ignore_errors=True)
        asyncio.get_running_loop().call_later(KEPT_SECONDS + 1.0, self._forget_old)

    async def _collect(self, job: _Job) -> None:
        copies = self._classes.store.copies(job.lesson.id)
        rows: list[dict[str, object]] = []
        with zipfile.ZipFile(job.path, "w", zipfile.ZIP_STORED) as archive:
            for n, copy in enumerate(copies):
                if self._hub.deletion.deleted(copy.terrain) is None:
                    async with self._turn.turn(job.who):  # after each copy others have theirs
                        job.stage = "collecting"
                        rows.append(await self._add(job, archive, copy))
                job.share = (n + 1) / len(copies)
            archive.writestr("class.csv", "\ufeff" + _table(rows))

    async def _add(self, job: _Job, archive: zipfile.ZipFile, copy: Copy) -> dict[str, object]:
        pupils = [p for p in self._classes.store.pupils(job.lesson.id) if p.number == copy.number]
        names = ", ".join(p.name for p in pupils if p.name)
        stem = "-".join(filter(None, (f"{copy.number:02}", _stem(names))))
        room = await self._hub.room(copy.terrain, Who(job.who.address))
        try:
            deadline = time.monotonic() + SETTLE_SECONDS
            while not (room.settled and not room.scoring.busy) and not room.closed and time.monotonic() < deadline:
                await asyncio.sleep(LOOK_SECONDS)
            heights = await room.heights(min(PICTURE_LEVEL, room.info.levels))
            document, points = room.core.document.to_document(), room.scoring.newest
        finally:
            self._hub.sleep(copy.terrain)
        packed = await self._hub.packing.run(job.who, self._classes.grids.pack, document)
        try:
            size = packed.stat().st_size
            if job.path.stat().st_size + size > MOST_BYTES:
                raise Cannot(409, "too_large", TOO_LARGE)
            self._hub.journal.space.need(size + SPARE_BYTES)
            await self._hub.packing.run(job.who, archive.write, packed, f"{stem}.esker")
        finally:
            packed.unlink(missing_ok=True)
        if heights is not None:
            made = job.folder / "picture.png"
            await self._hub.packing.run(job.who, relief.write, made, np.asarray(heights), document.settings)
            await self._hub.packing.run(job.who, archive.write, made, f"{stem}.png")
        return {
            "copy": copy.number,
            "names": names,
            "joined": _date(min((p.joined for p in pupils), default=None)),
            "last_changed": _date(changed_at(self._hub.journal, copy.terrain) if document.clock else None),
            "strokes": len(document.strokes),
            "score": "" if points is None or points.points is None else points.points,
            "score_text": "" if points is None else points.text,
            "file": f"{stem}.esker",
        }

    # --- what is kept -------------------------------------------------------------------------------------------

    def _own(self, lesson: Class, job_id: str) -> _Job:
        job = self._jobs.get(job_id)
        if job is None or job.lesson.id != lesson.id:
            raise Cannot(404, "no_collection", "This collection is not on the server any more. Collect again.")
        return job

    def _forget_old(self) -> None:
        late = time.monotonic() - KEPT_SECONDS
        for job in list(self._jobs.values()):
            if job.over and job.ended < late:
                self._forget(job)

    def has(self, terrain: str) -> bool:
        """Returns whether something of a terrain is under way, or can still be asked about."""
        self._forget_old()
        return any(job.lesson.terrain == terrain for job in self._jobs.values())

    def _forget(self, job: _Job) -> None:
        if job.task is not None and not job.over:
            job.task.cancel()
        self._jobs.pop(job.id, None)
        job.place.release()
        shutil.rmtree(job.folder, ignore_errors=True)

    def _end(self, terrain: str, links: Collection[str]) -> None:
        """Links were revoked: what was begun by them ends."""
        for job in list(self._jobs.values()):
            if job.lesson.terrain == terrain and job.link.id in links:
                self._forget(job)

    def _drop_deleted(self, lesson: str) -> None:
        """Drops what is kept here of a class that was deleted."""
        found = self._classes.store.find(lesson)
        for job in list(self._jobs.values()):
            if job.lesson.id == lesson and (found is None or found.ended is not None):
                self._forget(job)


def _table(rows: list[dict[str, object]]) -> str:
    out = io.StringIO()
    writer = csv.DictWriter(out, COLUMNS)
    writer.writeheader()
    writer.writerows({key: _plain(value) for key, value in row.items()} for row in rows)
    return out.getvalue()


def _plain(value: object) -> object:
    """A cell that a spreadsheet takes for text: a name may begin like a formula."""
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@") else value


def _date(seconds: float | None) -> str:
    return "" if seconds is None else datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S")


def _stem(text: str) -> str:
    return re.sub(r"[\W_]+", "-", text)[:STEM].strip("-").lower()
