"""New terrains under attack: how many of an address come, and how they are written (SPEC P531)."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from esker import contract as c
from esker.errors import Cannot
from esker.fairness.shares import Full, Rate, Rates, Who
from esker.fairness.turns import FairThreads
from esker.session import births
from esker.store.journal import Journal

HERE, THERE = Who("192.0.2.1"), Who("192.0.2.2")


def document_of(name: str, strokes: int = 0) -> c.Document:
    made = (c.Stroke(id=f"s{k}", kind="profile", first=(0, 0, 0), last=(9, 0, 0), curve=()) for k in range(strokes))
    return c.Document(id=name, strokes=tuple(made))


@pytest.fixture(name="journal")
def _journal(tmp_path: Path) -> Iterator[Journal]:
    journal = Journal(tmp_path)
    yield journal
    journal.close()


def test_new_terrains_of_one_address_have_a_rate_in_bytes(journal: Journal) -> None:
    """SPEC P531: what is refused is not written; another address is not refused for it."""

    async def run() -> None:
        born = births.Births(journal, FairThreads(1, "reading"), now=lambda: 0.0)
        born.rates = Rates(Rate(1.0, 2_000.0))
        await born.write(document_of("a"), who=HERE)
        with pytest.raises(Cannot) as refused:
            await born.write(document_of("b", 100), who=HERE)
        assert (refused.value.status, refused.value.code) == (429, "rate_limited")
        await born.write(document_of("c"), who=THERE)

    asyncio.run(run())
    assert [journal.exists(name) for name in "abc"] == [True, False, True]


def test_new_terrains_are_written_one_after_another(journal: Journal) -> None:
    """SPEC P531: one heavy birth at a time lies before the changes of those who draw, each address in its turn."""
    written: list[str] = []
    more, waiting = threading.Event(), []
    create = journal.create

    def noted(document: c.Document, also: Any = None, by: str | None = None, kept: Any = None) -> Any:
        assert kept is not None, "it was compressed before"
        written.append(document.id)
        waiting.append(journal.waiting)
        return create(document, lambda _: more.wait(30), by, kept)

    journal.create = noted  # type: ignore[method-assign]

    async def run() -> None:
        born = births.Births(journal, FairThreads(4, "reading"))
        tasks = [asyncio.create_task(born.write(document_of(f"h{k}"), who=HERE)) for k in range(3)]
        while len(written) < 1:
            await asyncio.sleep(0)
        tasks.append(asyncio.create_task(born.write(document_of("t"), who=THERE)))
        for _ in range(200):
            await asyncio.sleep(0)
        assert len(written) == 1
        more.set()
        await asyncio.gather(*tasks)

    asyncio.run(run())
    assert len(written) == 4
    assert max(waiting) == 0


def test_an_address_waits_with_so_many_new_terrains(journal: Journal) -> None:
    """SPEC P531."""

    async def run() -> None:
        born = births.Births(journal, FairThreads(1, "reading"))
        async with born._turns.turn(THERE):
            tasks = [asyncio.create_task(born.write(document_of(f"h{k}"), who=HERE)) for k in range(births.WAITING)]
            while len(born._turns._line) < births.WAITING:
                await asyncio.sleep(0)
            with pytest.raises(Full):
                await born.write(document_of("more"), who=HERE)
        await asyncio.gather(*tasks)

    asyncio.run(run())
