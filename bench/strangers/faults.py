"""Faults: servers killed by ``kill -9`` at random moments while people draw, and a disk that is full.

Three people draw on one terrain through ``esker.connect``; the server under them is killed again and again, and started
anew on the same data: while they draw, and in the middle of an import, a backup, a restore, the removal of a deleted
terrain, a migration, and folding, while classes are made, entered and deleted, and while a lesson is switched.
Afterwards every operation that was acknowledged must be there at its clock, every file must open, all people must see
the same terrain, which is that of the journal, and classes, seats and switches must be as they were told. ``inside``:
kills that struck between the beginning and the end of what they were meant for. A disk is filled beside a running
server in the same way. Not a timing: it says the same on a busy machine.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from bench.room import _serving
from bench.strangers import _fault_disk
from bench.strangers._fault_checks import Checks, final, old_database, opens
from bench.strangers._fault_lessons import Teacher
from bench.strangers._fault_people import PEOPLE, Person, come_back_soon
from bench.strangers._fault_run import PATIENCE, Life, Lives, bring_in, request
from esker import contract as c
from esker.document.birth import new_document
from esker.document.wire import op_json
from esker.store.access import Access
from esker.store.journal import Journal, Row
from esker.store.upkeep.backup import write_backup
from esker.store.upkeep.inspection import DATABASE_NAME
from esker.version import VERSION

KINDS: Final = ("drawing", "import", "backup", "restore", "delete", "migration", "compaction", "class", "lesson")
WITHIN: Final = {
    "backup": 0.015,
    "restore": 0.03,
    "delete": 0.015,
    "migration": 0.03,
    "compaction": 0.015,
    "import": 0.15,
}
"""Seconds after the beginning in which a kill strikes, about as long as it takes."""
DELETED_OPS: Final = 4_000


@dataclass
class Count:
    """Kills of one kind."""

    kills: int = 0
    inside: int = 0
    missed: list[str] = field(default_factory=list)
    """What a life said that ended by itself, or never came to what it was to be killed in."""


class Siege:
    """A data folder whose servers are killed."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.data = folder, folder / "data"
        self.rng = random.Random(seed)
        self.log = folder / "server.log"
        self.lives = Lives(self.log)
        self.port = _serving.free_port()
        self.base = f"http://127.0.0.1:{self.port}"
        self.counts = {kind: Count() for kind in KINDS}
        self.people: list[Person] = []
        self.checks = Checks(self.data)
        self.doomed: list[str] = []
        journal = Journal(self.data)
        born = new_document().model_copy(update={"id": "t"})
        journal.create(born).result()
        self.secret = Access(journal).add("t", "owner", "o").result()[1]
        self.teacher = Teacher(self.base, self.secret, seed)
        journal.close()
        self.old = folder / "old"
        old_database(self.old)

    def begin(self) -> Life:
        """A server that is ready. Raises RuntimeError when it does not become so."""
        life = self.lives.begin("serve", self.data, self.port)
        if life.until("ready") != "ready":
            raise RuntimeError(f"a server did not start: {life.said}")
        return life

    def kill(self, kind: str) -> None:
        """One life and its end."""
        count = self.counts[kind]
        count.kills += 1
        ways: dict[str, Callable[[], bool]] = {
            "drawing": self._drawing, "import": self._import, "restore": self._restore, "delete": self._delete,
            "migration": self._migration, "class": lambda: self._taught(self.teacher.teach, "class"),
            "lesson": lambda: self._taught(self.teacher.switch, "lesson"),
        }  # fmt: skip
        count.inside += ways[kind]() if kind in ways else self._marked(kind)

    def _serving(self) -> Life:
        """A server, with everybody back and what was acknowledged before looked for."""
        life = self.begin()
        self.checks.look([person.acked for person in self.people])
        return life

    def _drawing(self) -> bool:
        life = self._serving()
        time.sleep(self.rng.uniform(0.02, 0.6))
        life.end()
        return True

    def _marked(self, kind: str, life: Life | None = None) -> bool:
        life = life or self._serving()
        for _ in range(self.rng.randint(1, 3) if kind == "compaction" else 1):
            if life.until(f"begin {kind}", timeout=30.0) != f"begin {kind}":
                self.counts[kind].missed.append(str(life.said[-3:]))
                life.end()
                return False
        return self._strike(kind, life)

    def _strike(self, kind: str, life: Life) -> bool:
        heard = len(life.said)
        time.sleep(self.rng.uniform(0, WITHIN[kind]))
        life.end()
        return f"end {kind}" not in life.said[heard:]

    def _import(self) -> bool:
        life = self._serving()
        anywhere = self.rng.random() < 0.3
        try:
            bring_in(self.base, self.secret, self.rng.randrange(10**6), answer=not anywhere)
        except OSError as error:
            self.counts["import"].missed.append(str(error))
            life.end()
            return False
        if anywhere:
            time.sleep(self.rng.uniform(0, 2.0))
            life.end()
            return True
        return self._marked("import", life)

    def _restore(self) -> bool:
        write_backup(self.data / DATABASE_NAME, self.data, time.time())
        inside = self._marked("restore", self.lives.begin("restore", self.data))
        if not (self.data / DATABASE_NAME).exists():  # as the server's own sentence says
            again = self.lives.begin("restore", self.data)
            again.until("gone")
            if "done" not in again.said:
                self.counts["restore"].missed.append(str(again.said))
        self._drawing()
        return inside

    def _delete(self) -> bool:
        doomed = f"doomed-{len(self.doomed)}"
        self.doomed.append(doomed)
        journal = Journal(self.data)
        journal.create(c.Document(id=doomed)).result()
        op = op_json(c.SetTerrain(fields=c.TerrainFields(title="doomed")))
        journal.append(doomed, [Row(k, "c", k, "c", op) for k in range(1, DELETED_OPS)]).result()
        secret = Access(journal).add(doomed, "owner", "o").result()[1]
        journal.close()
        life = self._serving()
        with suppress(OSError):
            request(f"{self.base}/api/terrains/{doomed}", "DELETE", None, secret)
        return self._marked("delete", life)

    def _migration(self) -> bool:
        data = self.folder / "migrated"
        shutil.rmtree(data, ignore_errors=True)
        shutil.copytree(self.old, data)
        inside = self._marked("migration", self.lives.begin("open", data))
        self.checks.problems += opens(data)
        return inside

    def _taught(self, work: Callable[[], None], kind: str) -> bool:
        """A server that is killed while a teacher does this. What was told before must be there when it begins."""
        life = self._serving()
        self.checks.problems += self.teacher.problems(self.data)
        before = self.teacher.count + self.teacher.notified
        thread = self.teacher.begin(work)
        time.sleep(self.rng.uniform(0.1, 1.5))
        inside = thread.is_alive()
        life.end()
        thread.join(PATIENCE)
        if thread.is_alive():
            self.counts[kind].missed.append("it never ended")
        return inside and self.teacher.count + self.teacher.notified >= before

    def settle(self) -> dict[str, Any]:
        """Everybody rests and sees the same; then the files are looked at."""
        for person in self.people:
            person.rest()
        life = self.begin()
        documents = [person.settle() for person in self.people]
        clock = max(document.clock for document in documents)
        for person in self.people:
            person.live.wait_clock(clock, PATIENCE)
        documents = [person.live.document for person in self.people]
        time.sleep(2.0)  # the care of the last server removes what was deleted
        self.checks.look([person.acked for person in self.people], everything=True)
        refused = sum(len(person.refused) for person in self.people)
        for person in self.people:
            person.live.close()
        life.end(signal.SIGTERM)
        stopped = "done" in life.said
        found = final(self.data, "t", self.doomed)
        found["problems"] += self.teacher.problems(self.data, at_rest=True)
        return {
            "classes": len(self.teacher.classes) + len(self.teacher.ended),
            "seats": len(self.teacher.seats),
            "switches": self.teacher.notified,
            "operations": found.pop("clock"),
            "acknowledged": sum(len(person.acked) for person in self.people),
            "lost": len(self.checks.lost),
            "converged": all(document == found["document"] for document in documents),
            "refused": refused,
            "stopped_well": stopped,
            "problems": self.checks.problems + found["problems"],
            "folded_ops": found["folded"],
            "layers": found["layers"],
        }


def killed(
    kills: int, seed: int, tell: Callable[[str], object] = lambda _: None, kinds: Sequence[str] = KINDS
) -> dict[str, Any]:
    """Kills servers ``kills`` times, each kind in turn. Returns what was found."""
    come_back_soon()
    with tempfile.TemporaryDirectory(prefix="esker-faults-") as folder:
        siege = Siege(Path(folder), seed)
        first = siege.begin()
        link = f"{siege.base}/t/t#{siege.secret}"
        siege.people = [Person(link, f"p{k}", seed + k) for k in range(PEOPLE)]
        time.sleep(1.0)
        first.end()
        order = [kinds[k % len(kinds)] for k in range(kills)]
        siege.rng.shuffle(order)
        for number, kind in enumerate(order):
            siege.kill(kind)
            tell(f"{number + 1} {kind} {siege.counts[kind]}")
        found = siege.settle()
        siege.lives.close()
        text = siege.log.read_text(encoding="utf-8", errors="replace") if siege.log.exists() else ""
    counts = {
        kind: {"kills": count.kills, "inside": count.inside, "missed": count.missed}
        for kind, count in siege.counts.items()
        if kind in kinds
    }
    return {
        "kills": kills,
        "seed": seed,
        "kinds": counts,
        **found,
        "tracebacks": text.count("Traceback"),
        "log": text[-2000:],
    }


def main(argv: list[str]) -> int:
    """``esker bench faults [--json] [--kills N] [--kind NAME ...] [--seed N] [--note TEXT]``."""
    parser = argparse.ArgumentParser(prog="esker bench faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--kind", action="append", choices=KINDS, help="only these kinds of kills, and no full disk")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--note", default="", help="a sentence about the circumstances, kept in the result")
    arguments = parser.parse_args(argv)
    if not hasattr(os, "fork"):
        sys.stderr.write("esker: this needs fork and kill -9, which this system does not have.\n")
        return 1
    began = time.monotonic()
    result = {
        "bench": "faults", "version": VERSION, "machine": _serving.machine("numpy"), "note": arguments.note,
        "killed": killed(
            arguments.kills, arguments.seed, lambda line: sys.stderr.write(line + "\n"), arguments.kind or KINDS
        ),
        "disk": {} if arguments.kind else _fault_disk.filled(),
        "seconds": round(time.monotonic() - began),
    }  # fmt: skip
    sys.stdout.write(json.dumps(result, indent=1 if arguments.json else None) + "\n")
    return 0 if not result["killed"]["lost"] and result["killed"]["converged"] else 1
