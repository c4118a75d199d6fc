"""The terrain that a start prints, and the words for it (DESIGN 13)."""

from __future__ import annotations

import asyncio
import io
import time
from pathlib import Path
from typing import Final

import segno

from esker import contract as c
from esker.document.birth import new_document
from esker.keeper.private import Content, Lesson, Private
from esker.session.room.hub import Hub
from esker.store.access import CODE_LIFE_SECONDS
from esker.store.kept import Kept, kept_one

EDIT_NAME: Final = "Shown at the server's start"
OWNER_NAME: Final = "Owner at the server's computer"


async def open_lesson(hub: Hub, private: Private, base: str, new: bool) -> tuple[Content, Kept]:
    """The terrain of the last start, or a new one, with links that work; the private file then holds them.

    ``new``: a new terrain in any case. A link that was revoked or replaced since is made anew: whoever may read the
    private file may open every terrain of this server. Raises store.journal.Unwritable, store.access.TooManyLinks,
    OSError.
    """
    content = private.open()
    lesson = content.lesson
    if new or lesson is None or not hub.journal.exists(lesson.terrain):
        born, _, owner = await hub.create(new_document())
        lesson = Lesson(terrain=born.id, owner=owner, edit="")
    lesson = Lesson(
        terrain=lesson.terrain,
        owner=await _living(hub, lesson.terrain, lesson.owner, "owner", OWNER_NAME),
        edit=await _living(hub, lesson.terrain, lesson.edit, "edit", EDIT_NAME),
    )
    content = content.model_copy(update={"lesson": lesson, "base": base})
    await asyncio.to_thread(private.write, content)
    kept = kept_one(hub.journal, lesson.terrain)
    assert kept is not None, "it was made, or it exists"
    return content, kept


async def _living(hub: Hub, terrain: str, secret: str, role: c.Role, name: str) -> str:
    """Returns the secret where its link still has the role, else the secret of a new link. Raises TooManyLinks."""
    link = hub.access.check(terrain, secret) if secret else None
    if link is not None and link.revoked is None and link.role == role:
        return secret
    _, made = await asyncio.wrap_future(hub.access.add(terrain, role, name))
    return made


def first_code(hub: Hub, content: Content) -> str | None:
    """A join code of the lesson's link to draw, for the projector: it lives for a day at school, and ends with the
    link."""
    assert content.lesson is not None, "a lesson was opened"
    link = hub.access.check(content.lesson.terrain, content.lesson.edit)
    return None if link is None else hub.access.make_code(link.terrain, "edit", link.id, CODE_LIFE_SECONDS)


def greeting(
    content: Content, kept: Kept, data: Path, *, private: bool, lan: str | None = None, code: str | None = None
) -> str:
    """Returns what a start prints.

    ``private``: only whoever sits at this computer reads it (a terminal), so secrets may stand in it. ``lan``: where
    the certificate can be fetched, when others on the network come in too. ``code``: a join code for the projector.
    """
    assert content.lesson is not None, "a lesson was opened"
    base, lesson = content.base, content.lesson
    lines = ["", f"  Esker is ready: {base}", f"  Terrain:        {_words(kept)}"]
    if lan:
        lines.append(f"  To have no warning, trust this certificate once on each device: {lan}")
        lines.append(f"  What the warning means: {base}/help/warning   School devices: {base}/help/devices")
    if not private:
        lines += ["  Its links are secrets and stand in no log: `esker link` prints them on this computer."]
        lines += [f"  (They are kept in {data / 'private.json'}.)", "", ""]
        return "\n".join(lines)
    own = f"{base}/t/{lesson.terrain}#{lesson.owner}"
    everybody = f"{base}/t/{lesson.terrain}#{lesson.edit}"
    lines += ["  A new terrain:  esker serve --new, or “New terrain” on the start page. All terrains: esker list", ""]
    lines += ["  PRIVATE, for you alone (not for the projector):", f"    you own it:      {own}"]
    lines += [f"    all terrains:    {base}/server#{content.key}", ""]
    if code:
        lines += [f"  For the projector (the code {code}, and how many are in):", f"    {base}/room#{code}", ""]
    lines += ["  For everybody (can draw):", f"    {everybody}", ""]
    return "\n".join(lines) + (f"\n{_qr(everybody)}\n" if lan else "\n")


def _words(kept: Kept) -> str:
    title = f"“{kept.title}”" if kept.title else "untitled"
    if kept.clock == 0:
        return f"{title}, nothing drawn yet"
    return f"{title}, as it was left on {time.strftime('%Y-%m-%d at %H:%M', time.localtime(kept.changed))}"


def _qr(link: str) -> str:
    out = io.StringIO()
    segno.make(link, error="l").terminal(out=out, compact=True)
    return out.getvalue()
