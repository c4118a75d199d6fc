"""One import: what is known of it from its first byte to its end, and what does the work on its file."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from esker import contract as c
from esker.contract import ImportStage, ImportStatus
from esker.fairness.shares import Place
from esker.session.room.entry import Caller
from esker.store.access import Link


class Importer(Protocol):
    """What examines and converts files: the module ``esker.importing.run``, whose functions are told of there."""

    def inspect(
        self,
        path: Path,
        name: str,
        *,
        answers: c.ImportAnswers | None = None,
        place: c.Place | None = None,
        size_m: float | None = None,
        on_progress: Callable[[ImportStage, float], None] | None = None,
        folder: Path | None = None,
    ) -> Coroutine[Any, Any, c.ImportReport]: ...

    def convert(
        self,
        path: Path,
        answers: c.ImportAnswers,
        place: c.Place | None,
        size_m: float,
        out_dir: Path,
        on_progress: Callable[[ImportStage, float], None] | None = None,
        *,
        name: str | None = None,
    ) -> Coroutine[Any, Any, c.Layer]: ...

    def suggest_place(self, report: c.ImportReport) -> c.Place | None: ...

    def suggest_size(self, report: c.ImportReport) -> float: ...


@dataclass(eq=False)
class Job:
    """One import from its first byte to its end."""

    id: str
    file: str
    person: str
    """The person, of whom one import at a time is taken."""
    link: Link | None
    """The link by which the file is brought in; None until there is a terrain."""
    client: str
    """The client in whose name the layer is added."""
    work: Path
    place: Place
    """A place among those that the server has; it knows who brings the file in."""
    terrain: str = ""
    caller: Caller | None = None
    """Who brings it in, as a lesson knows them; None: a lesson has no say."""
    hold: bool = False
    """Whether it waits for answers even where it asks nothing."""
    stage: ImportStage = "upload"
    share: float = 0.0
    text: str = ""
    report: c.ImportReport | None = None
    layer: str | None = None
    answers: c.ImportAnswers = field(default_factory=c.ImportAnswers)
    answered: asyncio.Event = field(default_factory=asyncio.Event)
    task: asyncio.Task[None] | None = None
    last_sent: tuple[str, float] = ("", 0.0)
    """Stage and time of the last broadcast."""
    ended: float = 0.0

    @property
    def path(self) -> Path:
        """The file as it came."""
        return self.work / "upload"

    @property
    def link_id(self) -> str:
        """The id of ``link``; empty without one."""
        return "" if self.link is None else self.link.id

    def status(self) -> ImportStatus:
        """Where it stands."""
        share = min(1.0, max(0.0, self.share))
        return ImportStatus(
            id=self.id, stage=self.stage, share=share, text=self.text[:240], report=self.report, layer=self.layer
        )


def clean_name(name: str) -> str:
    """A file's own name, without folders and control characters, at most 80 characters."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    return "".join(ch for ch in last if ch.isprintable()).strip()[: c.MAX_NAME_LENGTH] or "grid"
