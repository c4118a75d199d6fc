"""Classes, their copies and their pupils, in the journal's database (docs/decisions/0054-a-copy-for-everyone.md).

A class is made from a terrain. It keeps the document that its copies begin as, so nothing that happens to that terrain
later takes a copy away. A pupil is a device with a seat: the secret of the seat, which the device made, is the secret
of its link to the copy, and the store keeps its hash. A code is typed by hand from a wall; it is short-lived, and kept
as it is, so that the teacher's page shows it again after a reload and a restart.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, Final, NamedTuple

from esker import contract as c
from esker.document.former import read_document
from esker.document.wire import Compressed, decompressed
from esker.store.access import CODE_ALPHABET, CODE_LIFE_SECONDS, SecretTaken, code_length, hashed
from esker.store.engine.ports import Connection
from esker.store.journal import Journal


class Class(NamedTuple):
    """A class without its document. Times are seconds since 1970; ``ended``: when it was deleted."""

    id: str
    terrain: str
    title: str
    created: float
    clock: int
    together: int
    places: int
    code: str | None
    code_until: float
    ended: float | None


class Copy(NamedTuple):
    """One copy of a class."""

    number: int
    terrain: str
    frozen: bool


class Pupil(NamedTuple):
    """One device of a class. ``link``: the id of its link to its copy."""

    link: str
    lesson: str
    number: int
    name: str
    joined: float


class NoPlace(Exception):
    """The class, or the copy that was chosen, has no place left. Nothing was done."""


class TooManyClasses(Exception):
    """The terrain has as many classes as it may have. ``deleted``: with those that can still be brought back."""

    def __init__(self, deleted: bool) -> None:
        super().__init__(deleted)
        self.deleted = deleted


_COLUMNS: Final = "id,terrain,title,created,clock,together,places,code,code_until,ended"
_EMPTY: Final = "NOT EXISTS (SELECT 1 FROM copies WHERE copies.class=classes.id)"


class ClassStore:
    """Reads and writes of one journal. Reads may come from any thread; a write's future resolves after its commit."""

    def __init__(self, journal: Journal, now: Callable[[], float] | None = None) -> None:
        """``now``: the date, by default the journal's."""
        self._journal, self.now = journal, journal.now if now is None else now

    # --- classes ------------------------------------------------------------------------------------------------

    def make(self, made: Class, document: Compressed, most: int, kept: int) -> Future[None]:
        """Writes a new class with its document. It fails with TooManyClasses where the terrain has ``most`` classes
        already, or ``kept`` with those that were deleted."""

        def write(db: Connection) -> None:
            count = "SELECT count(*), count(*) - count(ended) FROM classes WHERE terrain=?"
            found, live = db.execute(count, (made.terrain,)).fetchone()
            if live >= most or found >= kept:
                raise TooManyClasses(live < most)
            self._journal.need(len(document.data))
            sql = f"INSERT INTO classes ({_COLUMNS},document) VALUES (?,?,?,?,?,?,?,?,?,?,?)"
            db.execute(sql, (*made, document.data))

        return self._journal.submit(write, made.terrain)

    def find(self, lesson: str) -> Class | None:
        """A class by its id, deleted ones too."""
        return self._one("id=?", lesson)

    def home(self, lesson: str) -> str | None:
        """The terrain from which a class was made: whoever has that one writes for the class and its copies."""
        row = self._db.execute("SELECT terrain FROM classes WHERE id=?", (lesson,)).fetchone()
        return None if row is None else str(row[0])

    def of_terrain(self, terrain: str) -> list[Class]:
        """The classes that were made from a terrain, newest first, deleted ones too."""
        rows = self._db.execute(f"SELECT {_COLUMNS} FROM classes WHERE terrain=? ORDER BY created DESC", (terrain,))
        return [_class(row) for row in rows]

    def by_code(self, code: str) -> Class | None:
        """The class that a code opens, or None where it is wrong or too old."""
        found = self._one("code=? AND ended IS NULL", code.strip().upper().replace(" ", "").replace("-", ""))
        return found if found is not None and found.code_until > self.now() else None

    def document(self, lesson: str) -> tuple[c.Document, int] | None:
        """What a copy begins as, and how many characters it has. Blocks for as long as a document takes to be read."""
        row = self._db.execute("SELECT document FROM classes WHERE id=?", (lesson,)).fetchone()
        if row is None:
            return None
        text = decompressed(row[0])
        return read_document(text), len(text)

    def set_document(self, lesson: str, clock: int, document: Compressed) -> Future[None]:
        """From now on copies begin as this document, of the clock ``clock`` of the class's terrain."""
        return self._write(lesson, "UPDATE classes SET clock=?, document=? WHERE id=?", (clock, document.data, lesson))

    def open_door(self, lesson: str) -> Future[str]:
        """Gives the class a new code; the one before ends."""
        until = self.now() + CODE_LIFE_SECONDS

        def write(db: Connection) -> str:
            db.execute("UPDATE classes SET code=NULL WHERE code_until<=?", (self.now(),))
            live = int(db.execute("SELECT count(*) FROM classes WHERE code IS NOT NULL").fetchone()[0])
            length = code_length(live + 1)
            while True:
                code = "".join(secrets.choice(CODE_ALPHABET) for _ in range(length))
                if db.execute("SELECT 1 FROM classes WHERE code=?", (code,)).fetchone() is None:
                    db.execute("UPDATE classes SET code=?, code_until=? WHERE id=?", (code, until, lesson))
                    return code

        return self._journal.submit(write, self.home(lesson))

    def close_door(self, lesson: str) -> Future[None]:
        """Ends the code of the class."""
        return self._write(lesson, "UPDATE classes SET code=NULL WHERE id=?", (lesson,))

    # --- copies -------------------------------------------------------------------------------------------------

    def copies(self, lesson: str) -> list[Copy]:
        """The copies of a class by number."""
        rows = self._db.execute("SELECT number,terrain,frozen FROM copies WHERE class=? ORDER BY number", (lesson,))
        return [Copy(int(number), str(terrain), bool(frozen)) for number, terrain, frozen in rows]

    def copy_of(self, terrain: str) -> tuple[str, Copy] | None:
        """The id of the class whose copy a terrain is, and the copy; None where it is none."""
        row = self._db.execute("SELECT class,number,terrain,frozen FROM copies WHERE terrain=?", (terrain,)).fetchone()
        return None if row is None else (str(row[0]), Copy(int(row[1]), str(row[2]), bool(row[3])))

    def freeze(self, lesson: str, numbers: Sequence[int], frozen: bool) -> Future[None]:
        """Freezes copies, or lets them be changed again."""
        rows = [(int(frozen), lesson, n) for n in numbers]
        return self._many(lesson, "UPDATE copies SET frozen=? WHERE class=? AND number=?", rows)

    # --- pupils -------------------------------------------------------------------------------------------------

    def pupils(self, lesson: str) -> list[Pupil]:
        """The devices of a class in the order in which they came."""
        rows = self._db.execute(
            "SELECT link,class,number,name,joined FROM pupils WHERE class=? ORDER BY joined, link", (lesson,)
        )
        return [Pupil(*row) for row in rows]

    def seated(self, secret: str) -> Pupil | None:
        """The device whose seat has this secret, where its link still works."""
        row = self._db.execute(
            "SELECT p.link,p.class,p.number,p.name,p.joined FROM pupils p JOIN links l ON l.id=p.link"
            " WHERE l.hash=? AND l.revoked IS NULL",
            (hashed(secret),),
        ).fetchone()
        return None if row is None else Pupil(*row)

    def seating(
        self, insert_link: Callable[[Connection], object], pupil: Pupil, new: str | None = None
    ) -> Callable[[Connection], None]:
        """What writes a device with its link in one commit; ``new``: the terrain of the copy, where that is a new one.

        It raises NoPlace where the class or the copy is full, or the class deleted, and SecretTaken where a link has
        the secret of the seat already.
        """

        def write(db: Connection) -> None:
            places, together, ended = db.execute(
                "SELECT places, together, ended FROM classes WHERE id=?", (pupil.lesson,)
            ).fetchone()
            held = db.execute("SELECT count(*) FROM pupils WHERE class=?", (pupil.lesson,)).fetchone()[0]
            here = db.execute(
                "SELECT count(*) FROM pupils WHERE class=? AND number=?", (pupil.lesson, pupil.number)
            ).fetchone()[0]
            if ended is not None or held >= places or here >= together:
                raise NoPlace
            if new is not None:
                db.execute("INSERT INTO copies VALUES (?,?,?,0)", (pupil.lesson, pupil.number, new))
            try:
                insert_link(db)
            except db.IntegrityError:
                raise SecretTaken from None
            db.execute("INSERT INTO pupils VALUES (?,?,?,?,?)", pupil)

        return write

    def rename(self, link: str, name: str) -> Future[None]:
        """Another name for a device."""
        found = self._db.execute("SELECT class FROM pupils WHERE link=?", (link,)).fetchone()
        lesson = "" if found is None else str(found[0])
        return self._write(lesson, "UPDATE pupils SET name=? WHERE link=?", (name, link))

    # --- the end ------------------------------------------------------------------------------------------------

    def end(self, lesson: str, at_once: bool) -> Future[float]:
        """Deletes a class and all its copies; the future gives when. ``at_once``: nothing of it can be brought back."""
        now = self.now()

        def write(db: Connection) -> float:
            db.execute("UPDATE classes SET ended=coalesce(ended, ?), code=NULL WHERE id=?", (now, lesson))
            db.execute(
                "UPDATE terrains SET deleted=? WHERE (deleted IS NULL OR ?) AND id IN"
                " (SELECT terrain FROM copies WHERE class=?)",
                (0.0 if at_once else now, at_once, lesson),
            )
            if at_once:
                db.execute("DELETE FROM pupils WHERE class=?", (lesson,))
                db.execute(f"DELETE FROM classes WHERE id=? AND {_EMPTY}", (lesson,))
            return now

        return self._journal.submit(write, self.home(lesson))

    def bring_back(self, lesson: str) -> Future[bool]:
        """Takes the deletion of a class back, with those copies that were deleted with it; False where there was
        none."""

        def write(db: Connection) -> bool:
            row = db.execute("SELECT ended FROM classes WHERE id=? AND ended IS NOT NULL", (lesson,)).fetchone()
            if row is None:
                return False
            db.execute("UPDATE classes SET ended=NULL WHERE id=?", (lesson,))
            db.execute(
                "UPDATE terrains SET deleted=NULL WHERE deleted=? AND id IN (SELECT terrain FROM copies WHERE class=?)",
                (row[0], lesson),
            )
            return True

        return self._journal.submit(write, self.home(lesson))

    # --- parts --------------------------------------------------------------------------------------------------

    @property
    def _db(self) -> Connection:
        return self._journal.reader()

    def _one(self, where: str, value: str) -> Class | None:
        row = self._db.execute(f"SELECT {_COLUMNS} FROM classes WHERE {where}", (value,)).fetchone()
        return None if row is None else _class(row)

    def _write(self, lesson: str, sql: str, values: tuple[Any, ...]) -> Future[None]:
        return self._many(lesson, sql, [values])

    def _many(self, lesson: str, sql: str, rows: Sequence[tuple[Any, ...]]) -> Future[None]:
        def write(db: Connection) -> None:
            db.executemany(sql, rows)

        return self._journal.submit(write, self.home(lesson))


def changed_at(journal: Journal, terrain: str) -> float | None:
    """When the last op of a terrain was committed, seconds since 1970; None where none was."""
    row = (
        journal.reader()
        .execute("SELECT at FROM moments WHERE terrain=? ORDER BY clock DESC LIMIT 1", (terrain,))
        .fetchone()
    )
    return None if row is None else float(row[0])


def forget(db: Connection, terrain: str) -> None:
    """A terrain is removed for good: so are its place in a class and the names there, and its class where that was
    deleted and has no other copy. The classes that were made from it are deleted, and their copies with them."""
    copied = db.execute("SELECT class FROM copies WHERE terrain=?", (terrain,)).fetchone()
    db.execute(
        "DELETE FROM pupils WHERE (class, number) IN (SELECT class, number FROM copies WHERE terrain=?)", (terrain,)
    )
    db.execute("DELETE FROM copies WHERE terrain=?", (terrain,))
    now = time.time()
    db.execute("UPDATE classes SET ended=?, code=NULL WHERE terrain=? AND ended IS NULL", (now, terrain))
    db.execute(
        "UPDATE terrains SET deleted=? WHERE deleted IS NULL AND id IN"
        " (SELECT terrain FROM copies WHERE class IN (SELECT id FROM classes WHERE terrain=?))",
        (now, terrain),
    )
    db.execute(
        f"DELETE FROM classes WHERE ended IS NOT NULL AND {_EMPTY} AND (id=? OR terrain=?)",
        ("" if copied is None else copied[0], terrain),
    )


def forget_empty(db: Connection, before: float) -> None:
    """Removes classes without copies that were deleted before a time, seconds since 1970."""
    db.execute(f"DELETE FROM classes WHERE ended<? AND {_EMPTY}", (before,))


def _class(row: Sequence[Any]) -> Class:
    values = list(row)
    values[8] = float(values[8] or 0.0)
    return Class(*values)
